use std::f64::consts::PI;

use proptest::prelude::*;

use super::*;

const ROOM: &str = "
########
#......#
#..x...#
#......#
########";

fn room() -> Map {
    Map::from_text(ROOM, 0.5).unwrap()
}

fn header(extra: &str) -> Header {
    let text = format!(
        "image: floor.pgm\nresolution: 0.1\norigin: [-1.0, 2.0, 0.5]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.25\n{extra}"
    );
    Header::parse(&text).unwrap()
}

fn states(map: &Map) -> Vec<State> {
    map.cells().map(|cell| map.state(cell)).collect()
}

#[test]
fn first_row_of_an_image_is_the_top_of_the_map() {
    let map = Map::parse(&header(""), b"P2 2 2 255 0 255 255 128").unwrap();
    use State::{Free, Occupied, Unknown};
    assert_eq!(states(&map), [Free, Unknown, Occupied, Free]);
    assert_eq!((map.columns(), map.rows()), (2, 2));
}

#[test]
fn binary_and_text_images_give_the_same_cells() {
    let text = Map::parse(&header(""), b"P2 # a comment\n3 1 15\n0 7 15").unwrap();
    let binary = Map::parse(&header(""), b"P5 3 1 255\n\x00\x77\xff").unwrap();
    let wide = Map::parse(&header(""), b"P5 3 1 65535\n\x00\x00\x77\x77\xff\xff").unwrap();
    assert_eq!(states(&text), states(&binary));
    assert_eq!(states(&wide), states(&binary));
}

#[test]
fn negate_swaps_black_and_white() {
    let image = b"P2 3 1 255 0 128 255";
    let mut negated = header("");
    negated.negate = true;
    let mut swapped = states(&Map::parse(&negated, image).unwrap());
    swapped.reverse();
    assert_eq!(swapped, states(&Map::parse(&header(""), image).unwrap()));
}

#[test]
fn raw_pixels_are_percent() {
    let map = Map::parse(&header("mode: raw"), b"P2 4 1 255 0 50 100 101").unwrap();
    use State::{Free, Occupied, Unknown};
    assert_eq!(states(&map), [Free, Unknown, Occupied, Unknown]);
}

#[test]
fn transparent_pixels_are_unknown_in_scale_mode_only() {
    let mut image = Vec::new();
    let mut encoder = png::Encoder::new(&mut image, 2, 1);
    encoder.set_color(png::ColorType::GrayscaleAlpha);
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(&[255, 255, 255, 0]).unwrap();
    writer.finish().unwrap();
    let scale = Map::parse(&header("mode: scale"), &image).unwrap();
    assert_eq!(states(&scale), [State::Free, State::Unknown]);
    let trinary = Map::parse(&header("mode: trinary"), &image).unwrap();
    assert_eq!(states(&trinary), [State::Free, State::Free]);
}

#[test]
fn cells_and_points_agree_under_a_turned_origin() {
    let map = Map::parse(&header(""), b"P2 3 2 1 1 1 1 1 1 1").unwrap();
    for cell in map.cells() {
        assert_eq!(map.cell(map.centre(cell)), Some(cell));
    }
    // The corner of the first cell is the origin; half a cell along the turned rows lies its centre.
    let centre = map.centre(Cell { column: 0, row: 0 });
    let expected = map.origin().place(crate::frames::BodyXy::new(0.05, 0.05));
    assert!(centre.distance_m(expected) < 1e-12);
}

#[test]
fn distances_are_between_centres() {
    let map = room();
    assert!((map.distance_m(MapXy::new(0.75, 0.75)) - 0.5).abs() < 1e-6);
    assert!((map.distance_m(MapXy::new(2.25, 1.25)) - 1.0).abs() < 1e-6);
    assert!(map.distance_m(MapXy::new(-1.0, 0.0)).is_infinite());
}

#[test]
fn inflated_cells_are_near_walls_zones_and_edges() {
    let row = ".......\n";
    let open = format!("{}...x...\n{}", row.repeat(3), row.repeat(3));
    let open = Map::from_text(&open, 1.0).unwrap();
    let drawn = |radius_m: f64| -> Vec<String> {
        let blocked = open.inflated(radius_m);
        let rows = blocked.chunks(7);
        let row = |row: &[bool]| row.iter().map(|it| if *it { '#' } else { '.' }).collect();
        rows.map(row).collect()
    };
    let near = [
        "#######", "#.....#", "#.###.#", "#.###.#", "#.###.#", "#.....#", "#######",
    ];
    // A cell next to another is 0 m from it, the next one 1 m.
    assert_eq!(drawn(0.1), near);
    assert_eq!(drawn(1.0), near);
    assert!(!drawn(1.1).concat().contains('.'));
    assert_eq!(open.inflated(0.0).iter().filter(|it| **it).count(), 1);
}

#[test]
fn split_map_has_the_same_places_in_smaller_cells() {
    let map = room().split(0.2);
    assert_eq!((map.columns(), map.rows()), (24, 15));
    for cell in map.cells() {
        let (at, whole) = (map.centre(cell), room());
        let of = whole.cell(at).unwrap();
        assert_eq!(map.state(cell), whole.state(of));
        assert_eq!(map.is_kept_out(cell), whole.is_kept_out(of));
    }
    let unsplit_m = room().split(1.0).resolution_m();
    assert!((unsplit_m - room().resolution_m()).abs() < 1e-12);
    let wide = Map::from_text(&".".repeat(CELLS_MAX / 5), 1.0).unwrap();
    assert!((wide.split(0.05).resolution_m() - 0.5).abs() < 1e-12);
}

#[test]
fn zones_cover_the_cells_within_their_corners() {
    let zone = "keep_out: [[[0.0, 0.0], [1.0, 0.0], [1.0, 2.0], [0.0, 2.0]]]";
    let text = format!(
        "resolution: 0.5\n{zone}\nplan: |\n  ......\n  ......\n  ......\n  ......\n  ......\n"
    );
    let map = Map::parse(&Header::parse(&text).unwrap(), &[]).unwrap();
    let kept: Vec<Cell> = map.cells().filter(|cell| map.is_kept_out(*cell)).collect();
    assert_eq!(kept.len(), 8);
    assert!(kept.iter().all(|cell| cell.column < 2 && cell.row < 4));
}

fn zoned(corners: &str) -> Result<Map, MapError> {
    let text = format!(
        "resolution: 0.5\norigin: [1.0, 2.0, 0.3]\nkeep_out: [{corners}]\nplan: |{}\n",
        "\n  ......".repeat(5)
    );
    let header = Header::parse(&text)?;
    Map::parse(&header, &[])
}

/// A zone that covers no centre of a cell was lost without a word.
#[test]
fn small_zones_close_the_cell_that_they_lie_in_and_zones_off_the_map_are_refused() {
    let small = zoned("[[1.2, 2.2], [1.25, 2.2], [1.25, 2.25]]").unwrap();
    let kept: Vec<Cell> = small.cells().filter(|it| small.is_kept_out(*it)).collect();
    assert_eq!(kept, [small.cell(MapXy::new(1.22, 2.21)).unwrap()]);
    let away = "[[-9, -9], [-8, -9], [-8, -8]]";
    for (corners, at_fault, message) in [
        (away, away, "marks no cell"),
        ("[[0, 0], [1e9, 0], [0, 1e9]]", "[1e9, 0]", "no corner"),
    ] {
        let Err(MapError::Text(refusal)) = zoned(corners) else {
            panic!("{corners}");
        };
        assert!(refusal.message.contains(message), "{refusal}");
        let begin = "resolution: 0.5\norigin: [1.0, 2.0, 0.3]\nkeep_out: [".len();
        let at = begin + corners.find(at_fault).unwrap();
        assert_eq!(refusal.span, at..at + at_fault.len());
    }
}

#[test]
fn a_plan_in_the_file_is_the_same_as_one_given_as_text() {
    let text = format!(
        "resolution: 0.25\ncells_per_character: 2\nplan: |{}\n",
        ROOM.replace('\n', "\n  ")
    );
    let map = Map::parse(&Header::parse(&text).unwrap(), &[]).unwrap();
    assert_eq!((map.columns(), map.rows()), (16, 10));
    for cell in room().cells() {
        let centre = room().centre(cell);
        assert_eq!(map.state(map.cell(centre).unwrap()), room().state(cell));
    }
}

#[test]
fn a_plan_with_unknown_cells_at_its_beginning_loses_no_line() {
    let plan = |start: &str, first: &str| {
        Header::parse(&format!(
            "resolution: 0.25\nplan: |{start}\n  {first}\n  ######\n  #....#\n  ######\norigin: [0, 0, 0]\n"
        ))
    };
    let rows = |header: Header| Map::parse(&header, &[]).unwrap().rows();
    let refusal = plan("", "  ####").unwrap_err();
    assert!(refusal.message.contains("ended before"), "{refusal}");
    assert_eq!(refusal.span.len(), "  ######".len());
    assert_eq!(rows(plan("2", "  ####").unwrap()), 4);
    assert_eq!(rows(plan("", "??####").unwrap()), 4);
    let with_comments =
        "resolution: 1 # a comment\nplan: |\n  ###\n  #.#\n# a comment\nnegate: 0 # 1\n";
    assert_eq!(rows(Header::parse(with_comments).unwrap()), 2);
}

#[test]
fn cells_off_the_map_have_no_place() {
    let far = Cell {
        column: usize::MAX,
        row: usize::MAX,
    };
    assert_eq!(room().index(far), None);
    assert_eq!(room().state(far), State::Unknown);
}

#[test]
fn rays_end_at_the_edge_of_the_first_cell_that_is_not_free() {
    let map = room();
    let from = MapXy::new(1.0, 1.25);
    let cast = |angle: f64| map.cast(from, angle, 10.0).unwrap();
    assert!((cast(0.0) - 2.5).abs() < 1e-9);
    assert!((cast(PI) - 0.5).abs() < 1e-9);
    assert!((cast(PI / 2.0) - 0.75).abs() < 1e-9);
    assert!((cast(-PI / 4.0) - 0.75 * 2.0_f64.sqrt()).abs() < 1e-9);
    assert_eq!(map.cast(from, 0.0, 2.4), None);
    assert_eq!(map.cast(MapXy::new(0.2, 0.2), 0.3, 10.0), Some(0.0));
}

proptest! {
    #[test]
    fn rays_agree_with_small_steps(x in 0.6..3.4, y in 0.6..1.9, angle in -3.1..3.1) {
        let map = room();
        let from = MapXy::new(x, y);
        let range_m = map.cast(from, angle, 10.0).unwrap();
        let is_free = |along: f64| {
            map.cell(from.towards(angle, along)).is_some_and(|cell| map.state(cell) == State::Free)
        };
        prop_assert!((0..100).all(|step| is_free(range_m * f64::from(step) / 100.1)));
        // A ray may leave a cell through its corner, where a step beyond is in the wall for less than rounding.
        prop_assert!(!is_free(range_m + 1e-6) || !is_free(range_m + 1e-9));
    }

    #[test]
    fn zone_closes_each_cell_that_it_touches(
        corners in proptest::collection::vec((-0.5..4.0, 1.0..5.5), 3..7),
    ) {
        let corners: Vec<MapXy> = corners.into_iter().map(|(x, y)| MapXy::new(x, y)).collect();
        let text: Vec<String> = corners.iter().map(|it| format!("[{}, {}]", it.x_m, it.y_m)).collect();
        let Ok(map) = zoned(&format!("[{}]", text.join(", "))) else {
            return Ok(());
        };
        let is_inside = |at: MapXy| {
            let sides = (0..corners.len()).map(|it| (corners[it], corners[(it + 1) % corners.len()]));
            let crossed = sides.filter(|(a, b)| {
                let share = (at.y_m - a.y_m) / (b.y_m - a.y_m);
                (a.y_m <= at.y_m) != (b.y_m <= at.y_m) && a.x_m + share * (b.x_m - a.x_m) > at.x_m
            });
            crossed.count() % 2 == 1
        };
        for cell in map.cells() {
            let points = (0..100).map(|it| {
                let off = |it: i32| (f64::from(it) + 0.5) / 10.0 - 0.5;
                let centre = MapPose { at: map.centre(cell), ..map.origin() };
                centre.place(crate::frames::BodyXy::new(0.5 * off(it % 10), 0.5 * off(it / 10)))
            });
            let touched = points.filter(|it| is_inside(*it)).count();
            prop_assert!(touched == 0 || map.is_kept_out(cell), "{cell:?}");
        }
    }
}
