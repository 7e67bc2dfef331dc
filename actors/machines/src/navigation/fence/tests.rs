use proptest::prelude::*;

use super::*;

fn place(north_m: f64, east_m: f64) -> Ned {
    Ned::new(north_m, east_m, -20.0)
}

fn polygon(corners: &[(f64, f64)]) -> Polygon {
    let corners = corners
        .iter()
        .map(|(north_m, east_m)| place(*north_m, *east_m));
    Polygon::new(corners).unwrap()
}

fn circle(north_m: f64, east_m: f64, radius_m: f64) -> Area {
    Area::Circle {
        centre: place(north_m, east_m),
        radius_m,
    }
}

const fn inclusion(area: Area) -> Zone {
    Zone {
        area,
        is_inclusion: true,
    }
}

const fn exclusion(area: Area) -> Zone {
    Zone {
        area,
        is_inclusion: false,
    }
}

/// A square of 100 m around home, with a notch from the north, 20 m wide and 60 m deep.
fn notched() -> Polygon {
    polygon(&[
        (-50.0, -50.0),
        (-50.0, 50.0),
        (50.0, 50.0),
        (50.0, 10.0),
        (-10.0, 10.0),
        (-10.0, -10.0),
        (50.0, -10.0),
        (50.0, -50.0),
    ])
}

fn error_of(corners: &[(f64, f64)]) -> PolygonError {
    let corners = corners
        .iter()
        .map(|(north_m, east_m)| place(*north_m, *east_m));
    Polygon::new(corners).unwrap_err()
}

#[track_caller]
fn assert_clearance(found_m: f64, expected_m: f64) {
    let off_m = (found_m - expected_m).abs();
    assert!(off_m < 1e-9, "found {found_m} m, expected {expected_m} m");
}

#[test]
fn cylinder_has_its_radius_and_ceiling() {
    let fence = Fence::cylinder(100.0, 50.0);
    assert_clearance(fence.clearance_m(place(60.0, 80.0)), 0.0);
    assert_clearance(fence.clearance_m(place(0.0, 0.0)), 30.0);
    assert_clearance(fence.clearance_m(Ned::new(0.0, 0.0, -60.0)), -10.0);
    let on_the_way_back = fence.stopping_clearance_m(place(120.0, 0.0), place(90.0, 0.0));
    // The stopping point counts.
    assert_clearance(on_the_way_back, 10.0);
}

#[test]
fn clearance_respects_all_inclusion_and_exclusion_zones() {
    let fence = Fence::new(
        vec![
            inclusion(circle(0.0, 0.0, 50.0)),
            inclusion(circle(30.0, 0.0, 50.0)),
            exclusion(Area::Polygon(polygon(&[
                (10.0, -5.0),
                (10.0, 5.0),
                (20.0, 5.0),
                (20.0, -5.0),
            ]))),
        ],
        f64::INFINITY,
    );
    assert_clearance(fence.clearance_m(place(-15.0, 0.0)), 5.0);
    // In one of the two inclusion zones.
    assert_clearance(fence.clearance_m(place(-25.0, 0.0)), -5.0);
    assert_clearance(fence.clearance_m(place(15.0, 0.0)), -5.0);
    assert_clearance(fence.clearance_m(place(15.0, 8.0)), 3.0);
    assert_clearance(fence.clearance_m(place(15.0, 8.0).at_altitude(1e6)), 3.0);
}

#[test]
fn notch_is_outside_and_blocks_paths() {
    let zone = inclusion(Area::Polygon(notched()));
    assert_clearance(zone.clearance_m(place(30.0, 25.0)), 15.0);
    assert_clearance(zone.clearance_m(place(30.0, 0.0)), -10.0);
    assert_clearance(
        zone.clearance_along_m(place(30.0, -25.0), place(30.0, 25.0)),
        0.0,
    );
    // South of the notch, and past its corner.
    assert_clearance(
        zone.clearance_along_m(place(-25.0, -25.0), place(-25.0, 25.0)),
        15.0,
    );
    let past_the_corner = zone.clearance_along_m(place(-20.0, 0.0), place(-6.0, 20.0));
    assert!(
        (past_the_corner - 2.458).abs() < 0.001,
        "{past_the_corner} m"
    );
}

#[test]
fn path_through_an_excluded_area_has_no_clearance() {
    let clearance_m =
        |zone: Zone, from, stop| Fence::new(vec![zone], 100.0).stopping_clearance_m(from, stop);
    let (here, there) = (place(30.0, -25.0), place(30.0, 25.0));
    assert!(clearance_m(inclusion(Area::Polygon(notched())), here, there) <= 0.0);
    assert!(clearance_m(exclusion(circle(30.0, 0.0, 3.0)), here, there) <= 0.0);
    assert_clearance(
        clearance_m(exclusion(circle(0.0, 0.0, 3.0)), here, there),
        27.0,
    );
    assert_clearance(
        clearance_m(inclusion(circle(30.0, 0.0, 30.0)), here, there),
        5.0,
    );
}

#[test]
fn polygons_without_area_or_with_meeting_sides_are_rejected() {
    assert_eq!(error_of(&[]), PolygonError::TooFewCorners { corners: 0 });
    let line = [(0.0, 0.0), (1.0, 0.0)];
    assert_eq!(error_of(&line), PolygonError::TooFewCorners { corners: 2 });
    let repeated = [
        (0.0, 0.0),
        (0.0, 0.0),
        (1.0, 0.0),
        (1.0, 0.000_4),
        (0.0, 0.0),
    ];
    let too_few = PolygonError::TooFewCorners { corners: 2 };
    assert_eq!(error_of(&repeated), too_few);
    let bow_tie = [(0.0, 0.0), (10.0, 10.0), (10.0, 0.0), (0.0, 10.0)];
    let sides = |first, second| PolygonError::SidesMeet { first, second };
    assert_eq!(error_of(&bow_tie), sides(0, 2));
    let there_and_back = [(0.0, 0.0), (10.0, 0.0), (5.0, 0.0), (5.0, 5.0)];
    assert_eq!(error_of(&there_and_back), sides(0, 1));
    let flat = [(0.0, 0.0), (10.0, 0.0), (5.0, 0.0)];
    assert_eq!(error_of(&flat), sides(0, 1));
    let touches = [
        (0.0, 0.0),
        (10.0, 0.0),
        (10.0, 10.0),
        (5.0, 0.0),
        (0.0, 10.0),
    ];
    assert_eq!(error_of(&touches), sides(0, 2));
    let closed = [(0.0, 0.0), (0.0, 10.0), (10.0, 0.0), (0.0, 0.0)];
    assert_eq!(
        polygon(&closed).corners().len(),
        3,
        "the first corner is repeated"
    );
}

fn number() -> impl Strategy<Value = f64> {
    // Whole metres, so that places are often on sides and at corners.
    (-30..=30).prop_map(f64::from)
}

fn anywhere() -> impl Strategy<Value = Ned> {
    (number(), number()).prop_map(|(north_m, east_m)| place(north_m, east_m))
}

/// Polygons of random corners with sides that don't meet; usually concave.
fn any_polygon() -> impl Strategy<Value = Polygon> {
    prop::collection::vec(anywhere(), 3..8)
        .prop_filter_map("sides that meet", |corners| Polygon::new(corners).ok())
}

fn any_zone() -> impl Strategy<Value = Zone> {
    let circles = (anywhere(), 1..=20).prop_map(|(centre, radius_m)| Area::Circle {
        centre,
        radius_m: f64::from(radius_m),
    });
    let area = prop_oneof![circles, any_polygon().prop_map(Area::Polygon)];
    (area, any::<bool>()).prop_map(|(area, is_inclusion)| Zone { area, is_inclusion })
}

/// Points all around an area, at most half a metre apart.
fn boundary(area: &Area) -> Vec<Ned> {
    match area {
        Area::Circle { centre, radius_m } => (0..720)
            .map(|step| Ned::new(*radius_m, 0.0, 0.0).turned(f64::from(step).to_radians() / 2.0))
            .map(|offset| *centre + offset)
            .collect(),
        Area::Polygon(polygon) => {
            let corners: Vec<Ned> = polygon.corners().collect();
            let next = corners.iter().cycle().skip(1);
            let sides = corners.iter().zip(next);
            let along = |(from, to): (&Ned, &Ned)| -> Vec<Ned> {
                let (from, to) = (*from, *to);
                let on = move |step| Ned(from.0.lerp(&to.0, f64::from(step) / 200.0));
                (0..200).map(on).collect()
            };
            sides.flat_map(along).collect()
        }
    }
}

/// Whether the sides wind around a place: by angles, independent of the polygon's method.
fn encloses(area: &Area, place: Ned) -> bool {
    let outline = boundary(area);
    let angle =
        |at: &Ned| libm::atan2(at.east_m() - place.east_m(), at.north_m() - place.north_m());
    let next = outline.iter().cycle().skip(1);
    let turned: f64 = outline
        .iter()
        .zip(next)
        .map(|(from, to)| {
            let turn = angle(to) - angle(from);
            libm::remainder(turn, 2.0 * std::f64::consts::PI)
        })
        .sum();
    turned.abs() > std::f64::consts::PI
}

proptest! {
    #[test]
    fn clearance_is_the_distance_to_the_nearest_boundary_point(zone in any_zone(), here in anywhere()) {
        let clearance_m = zone.clearance_m(here);
        let nearest_m = boundary(&zone.area)
            .into_iter()
            .map(|at| at.horizontal_distance_m(here))
            .fold(f64::INFINITY, f64::min);
        prop_assert!((clearance_m.abs() - nearest_m).abs() < 0.25, "{} and {}", clearance_m, nearest_m);
        if clearance_m.abs() > 0.5 {
            let may_be = encloses(&zone.area, here) == zone.is_inclusion;
            prop_assert_eq!(clearance_m > 0.0, may_be, "{} m", clearance_m);
        }
    }

    #[test]
    fn clearance_along_a_path_is_its_smallest_clearance(
        zone in any_zone(),
        from in anywhere(),
        to in anywhere(),
    ) {
        let on = |step| Ned(from.0.lerp(&to.0, f64::from(step) / 400.0));
        let sampled_m = (0..=400)
            .map(|step| zone.clearance_m(on(step)))
            .fold(f64::INFINITY, f64::min);
        let clearance_m = zone.clearance_along_m(from, to);
        if sampled_m > 0.25 || clearance_m > 1e-9 {
            prop_assert!((clearance_m - sampled_m).abs() < 0.25, "{} and {}", clearance_m, sampled_m);
        } else {
            prop_assert!(clearance_m < 0.25, "{} and {}", clearance_m, sampled_m);
        }
    }

    /// A drone is stopped before it crosses a boundary between two checks: the clearance changes by at most the
    /// movement of the drone and its stopping point.
    #[test]
    fn stopping_clearance_changes_no_faster_than_position_and_stop(
        zones in prop::collection::vec(any_zone(), 1..4),
        from in anywhere(),
        stop in anywhere(),
        moves in prop::array::uniform4(-1.0..1.0_f64),
    ) {
        let fence = Fence::new(zones, 100.0);
        let [a, b, c, d] = moves;
        let before_m = fence.stopping_clearance_m(from, stop);
        let after_m = fence.stopping_clearance_m(from + Ned::new(a, b, 0.0), stop + Ned::new(c, d, 0.0));
        let moved_m = a.hypot(b).max(c.hypot(d));
        if after_m <= 0.0 {
            prop_assert!(before_m <= moved_m + 1e-9, "{} m, after {} m: {}", before_m, moved_m, after_m);
        }
    }
}
