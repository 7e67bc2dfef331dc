//! Cost of avoidance and of paths: `cargo bench -p muster-indoor --bench avoidance -- [MAP.yaml]`. Without a map, paths lead
//! over a floor of 75 × 31 m with 78 rooms. Each figure is the fastest of several runs.

#![expect(
    clippy::print_stdout,
    clippy::disallowed_methods,
    reason = "this is a program that measures times and prints a table"
)]

use std::error::Error;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use muster_indoor::avoidance::{
    CELL_M, CertaintyGrid, Limits, Method, SECTORS, SIDE, SectorSet, Situation,
};
use muster_indoor::frames::MapXy;
use muster_indoor::map::{Header, Map, State};
use muster_indoor::path::{Floor, Found, Search};

const REPEATED: usize = 2_000;
const LIMITS: Limits = Limits {
    radius_m: 0.25,
    speed_max_mps: 0.5,
    turn_rate_max_rps: 1.5,
};
/// Edge of a cell that paths are searched on, in metres.
const PATH_CELL_M: f64 = 0.05;

fn main() -> Result<(), Box<dyn Error>> {
    println!("{SIDE} × {SIDE} cells, {SECTORS} sectors: µs a call");
    let grids = [("room", room()), ("every cell", full())];
    for (name, grid) in &grids {
        for method in Method::ALL {
            println!(
                "  {:<18} {name:<11} {:>8.1}",
                method.name(),
                steer_us(method, grid)
            );
        }
    }
    let map = std::env::args().skip(1).find(|it| it.ends_with(".yaml"));
    let map = match map {
        Some(path) => resampled(&read(Path::new(&path))?)?,
        None => rooms()?,
    };
    let map = Arc::new(map);
    println!(
        "paths over {} × {} cells of 5 cm: ms",
        map.columns(),
        map.rows()
    );
    let started = Instant::now();
    let floor = Floor::new(Arc::clone(&map), LIMITS.radius_m);
    println!("  the floor, once      {:>8.1}", ms(started));
    let (from, to) = ends(&floor);
    println!("  from {from:?} to {to:?}");
    paths(&floor, from, to);
    Ok(())
}

fn ms(started: Instant) -> f64 {
    started.elapsed().as_secs_f64() * 1e3
}

fn fastest(runs: usize, mut run: impl FnMut()) -> f64 {
    let times = (0..runs).map(|_| {
        let started = Instant::now();
        run();
        ms(started)
    });
    times.fold(f64::INFINITY, f64::min)
}

fn steer_us(method: Method, grid: &CertaintyGrid) -> f64 {
    let mut avoider = method.avoider(LIMITS);
    let mut goal_rad = 0.0;
    let one = fastest(10, || {
        for _ in 0..REPEATED {
            goal_rad += 0.01;
            std::hint::black_box(avoider.steer(&Situation {
                grid,
                goal_m: 3.0,
                goal_rad,
                course_rad: 0.3,
                speed_mps: 0.4,
                turn_rate_rps: 0.1,
                blind: SectorSet::NONE,
            }));
        }
    });
    one * 1e3 / REPEATED as f64
}

/// Walls around the drone and some posts.
fn room() -> CertaintyGrid {
    let mut grid = CertaintyGrid::new((0.0, 0.0));
    for step in -36..=36 {
        let along = f64::from(step) * CELL_M;
        for wall in [(along, 1.2), (along, -1.5), (1.7, along), (-1.9, along)] {
            grid.mark(wall);
        }
    }
    for post in [(0.6, 0.5), (-0.7, 0.3), (0.9, -0.8)] {
        grid.mark(post);
    }
    grid
}

fn full() -> CertaintyGrid {
    let mut grid = CertaintyGrid::new((0.0, 0.0));
    for x in -40..=40 {
        for y in -40..=40 {
            grid.mark(((f64::from(x) + 0.5) * CELL_M, (f64::from(y) + 0.5) * CELL_M));
        }
    }
    grid
}

fn read(path: &Path) -> Result<Map, Box<dyn Error>> {
    let header = Header::parse(&std::fs::read_to_string(path)?)?;
    let image = match header.image() {
        Some(image) => std::fs::read(path.with_file_name(image))?,
        None => Vec::new(),
    };
    Ok(Map::parse(&header, &image)?)
}

/// The map in cells of 5 cm: each is what the map has at its centre.
fn resampled(map: &Map) -> Result<Map, Box<dyn Error>> {
    let scale = PATH_CELL_M / map.resolution_m();
    let columns = (map.columns() as f64 / scale) as usize;
    let rows = (map.rows() as f64 / scale) as usize;
    let character = |column: usize, row: usize| {
        let cell = muster_indoor::map::Cell {
            column: ((column as f64 + 0.5) * scale) as usize,
            row: ((row as f64 + 0.5) * scale) as usize,
        };
        match map.state(cell) {
            State::Free => '.',
            State::Occupied => '#',
            State::Unknown => ' ',
        }
    };
    let lines = (0..rows).rev().map(|row| {
        let line: String = (0..columns).map(|column| character(column, row)).collect();
        line
    });
    let text = lines.collect::<Vec<_>>().join("\n");
    Ok(Map::from_text(&text, PATH_CELL_M)?)
}

/// Rooms of 5 × 5 m with doors of 1 m.
fn rooms() -> Result<Map, Box<dyn Error>> {
    let (columns, rows) = (1_500, 620);
    let is_wall = |x: usize, y: usize| {
        let (in_x, in_y) = (x % 100, y % 100);
        (in_x < 2 && !(40..60).contains(&in_y)) || (in_y < 2 && !(40..60).contains(&in_x))
    };
    let line = |y: usize| -> String {
        let cells = (0..columns).map(|x| if is_wall(x, y) { '#' } else { '.' });
        cells.collect()
    };
    let text = (0..rows).map(line).collect::<Vec<_>>().join("\n");
    Ok(Map::from_text(&text, PATH_CELL_M)?)
}

/// The two free cells of the largest part that lie farthest left and right.
fn ends(floor: &Floor) -> (MapXy, MapXy) {
    let map = floor.map();
    let free = map.cells().map(|cell| map.centre(cell));
    let mut free: Vec<_> = free.filter(|point| floor.is_free(*point)).collect();
    free.sort_by(|a, b| a.x_m.total_cmp(&b.x_m));
    let middle = free[free.len() / 2];
    let reached = |it: &&MapXy| floor.path(middle, **it).is_some();
    let left = free.iter().step_by(500).find(reached).unwrap_or(&middle);
    let right = free
        .iter()
        .rev()
        .step_by(500)
        .find(reached)
        .unwrap_or(&middle);
    (*left, *right)
}

fn paths(floor: &Floor, from: MapXy, to: MapXy) {
    let map = floor.map();
    let (Some(start), Some(goal)) = (map.cell(from), map.cell(to)) else {
        return;
    };
    let path = floor.path(from, to).unwrap_or_default();
    let length_m: f64 = path.windows(2).map(|leg| leg[0].distance_m(leg[1])).sum();
    let ours = fastest(20, || {
        std::hint::black_box(floor.path(from, to));
    });
    println!(
        "  A*, straight legs    {ours:>8.1}  {length_m:.1} m in {} legs",
        path.len() - 1
    );
    let mut longest: f64 = 0.0;
    let mut slices = 0;
    let mut search = Search::new(floor, start, goal);
    loop {
        let started = Instant::now();
        let found = search.advance(floor, 2_000);
        longest = longest.max(ms(started));
        slices += 1;
        if found != Found::NotYet {
            break;
        }
    }
    println!("  A*, 2,000 cells      {longest:>8.2}  the longest of {slices} pieces");
    let library = fastest(3, || {
        std::hint::black_box(by_library(
            floor,
            (start.column, start.row),
            (goal.column, goal.row),
        ));
    });
    println!("  pathfinding's astar  {library:>8.1}");
}

fn by_library(floor: &Floor, start: (usize, usize), goal: (usize, usize)) -> Option<u32> {
    let map = floor.map();
    let cost = |(column, row): (usize, usize)| {
        let cell = muster_indoor::map::Cell { column, row };
        map.index(cell)
            .map_or(0, |index| u32::from(floor.costs()[index]))
    };
    let successors = |&(column, row): &(usize, usize)| {
        let mut found = Vec::with_capacity(8);
        for (dx, dy) in [
            (1, 0),
            (0, 1),
            (-1, 0),
            (0, -1),
            (1, 1),
            (-1, 1),
            (-1, -1),
            (1, -1),
        ] {
            let to = (column.wrapping_add_signed(dx), row.wrapping_add_signed(dy));
            let length = if dx == 0 || dy == 0 { 5 } else { 7 };
            match cost(to) {
                0 => {}
                cost => found.push((to, cost * length)),
            }
        }
        found
    };
    let left = |&(column, row): &(usize, usize)| {
        let columns = column.abs_diff(goal.0) as u32;
        let rows = row.abs_diff(goal.1) as u32;
        5 * columns.abs_diff(rows) + 7 * columns.min(rows)
    };
    let path = pathfinding::directed::astar::astar(&start, successors, left, |it| *it == goal);
    path.map(|(_, cost)| cost)
}
