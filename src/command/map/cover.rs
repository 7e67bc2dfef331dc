use std::num::NonZeroUsize;
use std::path::PathBuf;

use clap::Args;
use muster_indoor::coverage::{self, Tour, View};
use muster_indoor::frames::MapXy;
use muster_indoor::path::Floor;
use muster_indoor_world::page;
use muster_indoor_world::world::LIMITS;
use muster_runtime::diagnostic::BadInput;
use muster_runtime::text::{figure, plural};

use super::place::PageFile;
use super::{path, place};
use crate::command::{Failure, Outcome, terminal};

/// Distance that takes as long as looking round once, in metres: 7 s at half a metre a second.
const TURN_M: f64 = 3.5;
/// Most drones.
const DRONES_MAX: usize = 20;

/// Plan tours that bring every reachable place of a map into view, and draw them.
///
/// A drone looks round once at each stop. Several drones get parts that take about equally long.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  muster map cover flat
  muster map cover flat --drones 2 --range 3 --start 5.5,4.2")]
pub(super) struct Arguments {
    /// A map's YAML file, a flat's TOML file, or the name of a shipped flat.
    #[arg(value_name = "MAP")]
    map: PathBuf,
    /// Where the drones start, in metres of the map's frame [default: the free place nearest to the middle]
    #[arg(long, value_name = "X,Y", value_parser = place::place, allow_hyphen_values = true)]
    start: Option<MapXy>,
    /// Number of drones
    #[arg(long, value_name = "N", value_parser = drones, allow_negative_numbers = true, default_value = "1")]
    drones: NonZeroUsize,
    /// How far the camera sees, in metres
    #[arg(long, value_name = "METRES", value_parser = range, allow_negative_numbers = true, default_value_t = 4.0)]
    range: f64,
    /// Distance to keep from walls, in metres
    #[arg(long, value_name = "METRES", value_parser = path::radius, allow_negative_numbers = true, default_value_t = LIMITS.radius_m)]
    radius: f64,
    /// Page to write [default: runs/MAP-cover.html, with -2, -3, … appended if another page has the name]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

fn drones(text: &str) -> Result<NonZeroUsize, String> {
    let drones = text.parse().ok();
    let drones = drones.filter(|it: &NonZeroUsize| it.get() <= DRONES_MAX);
    drones.ok_or_else(|| format!("a whole number from 1 to {DRONES_MAX}"))
}

fn range(text: &str) -> Result<f64, String> {
    place::within(text, 0.5, 20.0)
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let (name, map) = place::map(&arguments.map)?;
    let file = PageFile::new(arguments.out.as_deref(), &name, "cover")?;
    let floor = place::floor(&map, arguments.radius);
    let start = arguments.start.or_else(|| middle(&floor));
    let start = start.ok_or_else(|| {
        let message = "a drone can't be anywhere on this map";
        let help = "a map with free cells, or a smaller --radius";
        BadInput::without_excerpt(&arguments.map, message, help)
    })?;
    let starts = vec![start; arguments.drones.get()];
    let view = View {
        range_m: arguments.range,
        cone_rad: std::f64::consts::TAU,
    };
    let planned = coverage::plan(&floor, view, &starts, TURN_M);
    let (tours, places) = planned.map_err(|error| {
        let help = error.accepted();
        BadInput::without_excerpt(&arguments.map, error, help)
    })?;
    let paths: Vec<Vec<MapXy>> = tours.iter().map(|tour| flown(&floor, tour)).collect();
    let page = page::cover(&name, &map, &tours, &paths, &places);
    let file = file.write(&page)?;
    let (visible, all) = (places.visible().len(), places.targets().len());
    let mut text = format!(
        " {} % of the free floor can be seen from {:.2}, {:.2} on\n",
        figure(100.0 * visible as f64 / all.max(1) as f64, 1),
        start.x_m,
        start.y_m
    );
    for (drone, tour) in tours.iter().enumerate() {
        let stops = plural(tour.stops.len(), "stop");
        text.push_str(&format!(
            "   drone {drone}: {stops}, {} m\n",
            figure(tour.length_m, 1)
        ));
    }
    text.push_str(&idle(&tours));
    text.push_str(&format!("\n wrote {}\n", file.display()));
    terminal::print(&text)?;
    Ok(Outcome::Success)
}

/// A line on drones without a stop, if there are any.
fn idle(tours: &[Tour]) -> String {
    let used = tours.iter().filter(|tour| !tour.stops.is_empty()).count();
    match tours.len() - used {
        0 => String::new(),
        idle => format!(
            " {} nothing to do; --drones {} is enough\n",
            match idle {
                1 => "1 drone has".to_owned(),
                idle => format!("{idle} drones have"),
            },
            used.max(1)
        ),
    }
}

/// The path of a tour.
fn flown(floor: &Floor, tour: &Tour) -> Vec<MapXy> {
    let places: Vec<MapXy> = std::iter::once(tour.start)
        .chain(tour.stops.iter().copied())
        .collect();
    let legs = places
        .windows(2)
        .map(|pair| floor.path(pair[0], pair[1]).unwrap_or_default());
    legs.flatten().collect()
}

/// The free place nearest to the middle of the map.
fn middle(floor: &Floor) -> Option<MapXy> {
    let map = floor.map();
    let size = |cells: usize| cells as f64 * map.resolution_m();
    let middle =
        muster_indoor::frames::BodyXy::new(size(map.columns()) / 2.0, size(map.rows()) / 2.0);
    let reach_m = size(map.columns()) + size(map.rows());
    let cell = floor.nearest_free(map.origin().place(middle), reach_m)?;
    Some(map.centre(cell))
}
