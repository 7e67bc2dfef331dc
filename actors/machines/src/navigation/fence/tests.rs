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

const fn within(area: Area) -> Zone {
    Zone {
        area,
        is_inclusion: true,
    }
}

const fn out_of(area: Area) -> Zone {
    Zone {
        area,
        is_inclusion: false,
    }
}

/// A square of 100 m around home, with a notch from the north that is 20 m wide and reaches 60 m in.
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

fn refused(corners: &[(f64, f64)]) -> PolygonError {
    let corners = corners
        .iter()
        .map(|(north_m, east_m)| place(*north_m, *east_m));
    Polygon::new(corners).unwrap_err()
}

#[track_caller]
fn assert_room(found_m: f64, expected_m: f64) {
    let off_m = (found_m - expected_m).abs();
    assert!(off_m < 1e-9, "{found_m} m in place of {expected_m} m");
}

#[test]
fn a_cylinder_is_as_wide_and_as_high_as_it_says() {
    let fence = Fence::cylinder(100.0, 50.0);
    assert_room(fence.room_m(place(60.0, 80.0)), 0.0);
    assert_room(fence.room_m(place(0.0, 0.0)), 30.0);
    assert_room(fence.room_m(Ned::new(0.0, 0.0, -60.0)), -10.0);
    let on_the_way_back = fence.stopping_room_m(place(120.0, 0.0), place(90.0, 0.0));
    // Where it comes to rest counts.
    assert_room(on_the_way_back, 10.0);
}

#[test]
fn a_drone_stays_within_all_areas_to_stay_within_and_out_of_the_others() {
    let fence = Fence::new(
        vec![
            within(circle(0.0, 0.0, 50.0)),
            within(circle(30.0, 0.0, 50.0)),
            out_of(Area::Polygon(polygon(&[
                (10.0, -5.0),
                (10.0, 5.0),
                (20.0, 5.0),
                (20.0, -5.0),
            ]))),
        ],
        f64::INFINITY,
    );
    assert_room(fence.room_m(place(-15.0, 0.0)), 5.0);
    // In one of the two.
    assert_room(fence.room_m(place(-25.0, 0.0)), -5.0);
    assert_room(fence.room_m(place(15.0, 0.0)), -5.0);
    assert_room(fence.room_m(place(15.0, 8.0)), 3.0);
    assert_room(fence.room_m(place(15.0, 8.0).at_altitude(1e6)), 3.0);
}

#[test]
fn a_notch_is_outside_and_no_way_leads_across_it() {
    let zone = within(Area::Polygon(notched()));
    assert_room(zone.room_m(place(30.0, 25.0)), 15.0);
    assert_room(zone.room_m(place(30.0, 0.0)), -10.0);
    assert_room(
        zone.room_along_m(place(30.0, -25.0), place(30.0, 25.0)),
        0.0,
    );
    // Below the notch, and past its corner.
    assert_room(
        zone.room_along_m(place(-25.0, -25.0), place(-25.0, 25.0)),
        15.0,
    );
    let past_the_corner = zone.room_along_m(place(-20.0, 0.0), place(-6.0, 20.0));
    assert!(
        (past_the_corner - 2.458).abs() < 0.001,
        "{past_the_corner} m"
    );
}

#[test]
fn a_drone_that_would_come_to_rest_behind_what_it_is_to_stay_out_of_has_no_room() {
    let room_m = |zone: Zone, from, stop| Fence::new(vec![zone], 100.0).stopping_room_m(from, stop);
    let (here, there) = (place(30.0, -25.0), place(30.0, 25.0));
    assert!(room_m(within(Area::Polygon(notched())), here, there) <= 0.0);
    assert!(room_m(out_of(circle(30.0, 0.0, 3.0)), here, there) <= 0.0);
    assert_room(room_m(out_of(circle(0.0, 0.0, 3.0)), here, there), 27.0);
    assert_room(room_m(within(circle(30.0, 0.0, 30.0)), here, there), 5.0);
}

#[test]
fn corners_that_enclose_nothing_or_not_one_area_are_refused() {
    assert_eq!(refused(&[]), PolygonError::TooFewCorners { corners: 0 });
    let line = [(0.0, 0.0), (1.0, 0.0)];
    assert_eq!(refused(&line), PolygonError::TooFewCorners { corners: 2 });
    let repeated = [
        (0.0, 0.0),
        (0.0, 0.0),
        (1.0, 0.0),
        (1.0, 0.000_4),
        (0.0, 0.0),
    ];
    let too_few = PolygonError::TooFewCorners { corners: 2 };
    assert_eq!(refused(&repeated), too_few);
    let bow_tie = [(0.0, 0.0), (10.0, 10.0), (10.0, 0.0), (0.0, 10.0)];
    let sides = |first, second| PolygonError::SidesMeet { first, second };
    assert_eq!(refused(&bow_tie), sides(0, 2));
    let there_and_back = [(0.0, 0.0), (10.0, 0.0), (5.0, 0.0), (5.0, 5.0)];
    assert_eq!(refused(&there_and_back), sides(0, 1));
    let flat = [(0.0, 0.0), (10.0, 0.0), (5.0, 0.0)];
    assert_eq!(refused(&flat), sides(0, 1));
    let touches = [
        (0.0, 0.0),
        (10.0, 0.0),
        (10.0, 10.0),
        (5.0, 0.0),
        (0.0, 10.0),
    ];
    assert_eq!(refused(&touches), sides(0, 2));
    let closed = [(0.0, 0.0), (0.0, 10.0), (10.0, 0.0), (0.0, 0.0)];
    assert_eq!(
        polygon(&closed).corners().len(),
        3,
        "the first is said again"
    );
}

fn number() -> impl Strategy<Value = f64> {
    // Whole metres, so that places are on sides and at corners often.
    (-30..=30).prop_map(f64::from)
}

fn anywhere() -> impl Strategy<Value = Ned> {
    (number(), number()).prop_map(|(north_m, east_m)| place(north_m, east_m))
}

/// Of any corners those polygons whose sides don't meet; bent inwards as a rule.
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

/// Places all around an area, each at most half a metre from the next.
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

/// How often the sides go round a place; by angles, and so by other means than the polygon itself.
fn winds_around(area: &Area, place: Ned) -> bool {
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
    fn the_room_is_that_to_the_nearest_place_of_the_boundary(zone in any_zone(), here in anywhere()) {
        let room_m = zone.room_m(here);
        let nearest_m = boundary(&zone.area)
            .into_iter()
            .map(|at| at.horizontal_distance_m(here))
            .fold(f64::INFINITY, f64::min);
        prop_assert!((room_m.abs() - nearest_m).abs() < 0.25, "{} and {}", room_m, nearest_m);
        if room_m.abs() > 0.5 {
            let may_be = winds_around(&zone.area, here) == zone.is_inclusion;
            prop_assert_eq!(room_m > 0.0, may_be, "{} m", room_m);
        }
    }

    #[test]
    fn the_room_along_a_way_is_that_at_its_worst_place(
        zone in any_zone(),
        from in anywhere(),
        to in anywhere(),
    ) {
        let on = |step| Ned(from.0.lerp(&to.0, f64::from(step) / 400.0));
        let sampled_m = (0..=400)
            .map(|step| zone.room_m(on(step)))
            .fold(f64::INFINITY, f64::min);
        let room_m = zone.room_along_m(from, to);
        if sampled_m > 0.25 || room_m > 1e-9 {
            prop_assert!((room_m - sampled_m).abs() < 0.25, "{} and {}", room_m, sampled_m);
        } else {
            prop_assert!(room_m < 0.25, "{} and {}", room_m, sampled_m);
        }
    }

    /// From place to place as far as it moves between two looks, a drone is stopped before it is beyond any boundary:
    /// the room never changes by more than where it is and where it would stop have moved.
    #[test]
    fn the_room_of_one_that_stops_changes_no_faster_than_it_and_its_stop_move(
        zones in prop::collection::vec(any_zone(), 1..4),
        from in anywhere(),
        stop in anywhere(),
        moves in prop::array::uniform4(-1.0..1.0_f64),
    ) {
        let fence = Fence::new(zones, 100.0);
        let [a, b, c, d] = moves;
        let before_m = fence.stopping_room_m(from, stop);
        let after_m = fence.stopping_room_m(from + Ned::new(a, b, 0.0), stop + Ned::new(c, d, 0.0));
        let moved_m = a.hypot(b).max(c.hypot(d));
        if after_m <= 0.0 {
            prop_assert!(before_m <= moved_m + 1e-9, "{} m, after {} m: {}", before_m, moved_m, after_m);
        }
    }
}
