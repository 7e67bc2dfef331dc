use super::*;

const SEPARATION: Separation = Separation {
    horizontal_m: 5.0,
    vertical_m: 5.0,
};

/// Without a fence.
const ANYWHERE: fn(Ned) -> bool = |_| true;

/// A drone is silent after 3 s; an aircraft at 30 m is down 5 s + 10 s + 10 s after that.
const CONFIG: Config = Config {
    separation: SEPARATION,
    time_to_live: Duration::from_secs(2),
    controller_timeout: Duration::from_secs(5),
    descent_mps: 3.0,
    touch_down_margin: Duration::from_secs(10),
    speed_mps: 20.0,
    climb_mps: 3.0,
    has_followers: true,
    landing_places: None,
};

fn at(north_m: f64, east_m: f64, altitude_m: f64) -> Ned {
    Ned::new(north_m, east_m, -altitude_m)
}

fn path(from: Ned, to: Ned) -> Path {
    Path { from, to }
}

fn intent(path: Path) -> Intent {
    Intent::of(path, 0.0, false)
}

fn seconds(seconds: f64) -> Timestamp {
    Timestamp::from_secs_f64(seconds)
}

/// Traffic of drone 5 with these intents.
fn traffic(intents: &[(u32, Path)]) -> Traffic {
    let mut traffic = Traffic::new(NodeId(5), CONFIG);
    for (id, path) in intents {
        assert!(traffic.update(seconds(0.0), NodeId(*id), Some(intent(*path))));
    }
    traffic
}

#[test]
fn intent_encodes_a_path_to_five_centimetres() {
    let flown = path(at(1.04, -2.26, 30.0), at(-1_000.0, 3.0, 12.31));
    let encoded = intent(flown).path();
    assert!(encoded.from.distance_m(flown.from) < 0.09 && encoded.to.distance_m(flown.to) < 0.09);
    let far = at(1e300, f64::NAN, 0.0);
    assert_eq!(intent(path(far, far)).from_dm, [i32::MAX, 0, 0]);
}

#[test]
fn path_through_a_stationary_drone_is_blocked() {
    let there = at(60.0, 0.0, 12.0);
    let mut known = traffic(&[(2, path(there, there))]);
    let leg = path(at(0.0, 0.0, 12.0), at(160.0, 0.0, 12.0));
    assert!(!known.is_clear(seconds(1.0), leg));
    assert!(known.is_clear(seconds(1.0), path(leg.from, at(50.0, 0.0, 12.0))));
    let above = path(at(0.0, 0.0, 18.0), at(160.0, 0.0, 18.0));
    assert!(known.is_clear(seconds(1.0), above));
    // It flies on along a parallel path: drones behind it may follow.
    let ahead = path(there, at(220.0, 0.0, 12.0));
    assert!(known.update(seconds(1.0), NodeId(2), Some(intent(ahead))));
    assert!(
        !known.update(seconds(1.5), NodeId(2), Some(intent(ahead))),
        "unchanged"
    );
    assert!(known.is_clear(seconds(2.0), leg));
    known.update(seconds(3.0), NodeId(2), Some(intent(path(there, there))));
    assert!(!known.is_clear(seconds(3.0), leg));
    assert!(known.update(seconds(4.0), NodeId(2), None) && known.is_clear(seconds(4.0), leg));
}

#[test]
fn rounding_of_intents_keeps_the_separation() {
    // 4.96 m away, announced as 5 m.
    let there = at(50.0, 4.96, 12.0);
    let leg = path(at(0.0, 0.0, 12.0), at(100.0, 0.0, 12.0));
    assert!(!traffic(&[(2, path(there, there))]).is_clear(seconds(1.0), leg));
    let apart = at(50.0, 5.2, 12.0);
    assert!(traffic(&[(2, path(apart, apart))]).is_clear(seconds(1.0), leg));
}

#[test]
fn passing_drone_too_near_only_by_rounding_blocks_a_path() {
    // It passes at 5.06 m, announced as 5 m, so a drone that starts now would be too near.
    let by = traffic(&[(1, path(at(-60.0, 7.56, 30.0), at(60.0, 2.56, 30.0)))]);
    assert!(!by.is_clear(seconds(0.1), path(at(0.0, 0.0, 30.0), at(100.0, 0.0, 30.0))));
    let too_near = traffic(&[(1, path(at(-60.0, 6.5, 30.0), at(60.0, 1.5, 30.0)))]);
    assert!(too_near.is_clear(seconds(0.1), path(at(0.0, 0.0, 30.0), at(100.0, 0.0, 30.0))));
}

#[test]
fn drone_too_near_at_the_start_does_not_block_a_path() {
    let there = at(3.0, 0.0, 12.0);
    let known = traffic(&[(2, path(there, there))]);
    let away = path(at(0.0, 0.0, 12.0), at(-50.0, 0.0, 12.0));
    assert!(known.is_clear(seconds(1.0), away));
}

#[test]
fn drone_below_one_that_lands_does_not_climb_but_may_sidestep() {
    let mut known = traffic(&[]);
    let landing = Intent::of(path(at(2.0, 0.0, 35.0), at(2.0, 0.0, 0.0)), 0.0, true);
    known.update(seconds(0.0), NodeId(2), Some(landing));
    let climb = |altitude_m| path(at(0.0, 0.0, altitude_m), at(0.0, 0.0, 40.0));
    assert!(!known.is_clear(seconds(1.0), climb(12.0)));
    assert!(known.must_give_way(seconds(1.0), climb(15.0), climb(12.0)));
    let sidestep = path(at(0.0, 0.0, 12.0), at(-10.0, 0.0, 12.0));
    assert!(known.is_clear(seconds(1.0), sidestep));
    assert!(
        known
            .room_beside(seconds(1.0), at(0.0, 0.0, 12.0), ANYWHERE)
            .is_some()
    );
    // It has passed.
    let below = Intent::of(path(at(2.0, 0.0, 35.0), at(2.0, 0.0, 0.0)), 0.9, true);
    known.update(seconds(1.0), NodeId(2), Some(below));
    assert!(known.is_clear(seconds(1.0), climb(12.0)));
}

#[test]
fn one_of_two_drones_that_start_at_once_gives_way() {
    let north = path(at(0.0, 0.0, 12.0), at(100.0, 0.0, 12.0));
    let east = path(at(50.0, -50.0, 12.0), at(50.0, 50.0, 12.0));
    let up = path(at(50.0, 0.0, 5.0), at(50.0, 0.0, 30.0));
    let still = path(up.to, up.to);
    let stops = |own: Path, id: u32, other: Path| {
        traffic(&[(id, other)]).must_give_way(seconds(0.1), own, own)
    };
    assert!(stops(north, 4, east) && !stops(north, 6, east));
    assert!(stops(north, 6, up) && !stops(up, 4, north));
    assert!(stops(up, 6, still));
    assert!(!stops(
        path(at(0.0, 0.0, 40.0), at(100.0, 0.0, 40.0)),
        4,
        up
    ));
}

#[test]
fn all_give_way_to_a_drone_that_may_not_hear_them() {
    let own = path(at(0.0, 0.0, 12.0), at(100.0, 0.0, 12.0));
    let crosses = path(at(50.0, -50.0, 12.0), at(50.0, 50.0, 12.0));
    let mut known = traffic(&[(9, crosses)]);
    assert!(!known.must_give_way(seconds(0.1), own, own));
    known.set_deaf(NodeId(9).into());
    assert!(known.must_give_way(seconds(0.1), own, own));
    known.set_deaf(NodeSet::new());
    assert!(!known.must_give_way(seconds(3.0), own, own));
    assert!(known.must_give_way(seconds(3.1), own, own), "it is silent");
    // 100 m take 5 s.
    assert!(
        !known.must_give_way(seconds(10.1), own, own),
        "it has arrived"
    );
}

#[test]
fn space_below_a_drone_that_may_not_hear_this_one_is_blocked() {
    let hovers = at(60.0, 0.0, 30.0);
    let below = path(at(0.0, 0.0, 12.0), at(60.0, 0.0, 12.0));
    let above = path(at(0.0, 0.0, 40.0), at(60.0, 0.0, 40.0));
    let mut known = traffic(&[(9, path(hovers, hovers))]);
    assert!(known.is_clear(seconds(0.1), below));
    known.set_deaf(NodeId(9).into());
    assert!(!known.is_clear(seconds(0.1), below));
    assert!(known.is_clear(seconds(0.1), above));
}

#[test]
fn detour_around_a_stationary_drone_is_clear() {
    let (below, above) = (at(0.0, 0.0, 12.0), at(0.0, 0.0, 24.0));
    let amid = at(0.0, 0.0, 18.0);
    let known = traffic(&[(2, path(amid, amid))]);
    let [side, level] = known
        .detour(seconds(1.0), path(below, above), ANYWHERE)
        .unwrap();
    assert_eq!((side.altitude_m(), level.altitude_m()), (12.0, 24.0));
    assert!((side.horizontal_distance_m(below) - 11.0).abs() < 1e-9);
    let climbs = traffic(&[(2, path(amid, above))]);
    assert_eq!(
        climbs.detour(seconds(1.0), path(below, above), ANYWHERE),
        None,
        "it moves"
    );
    // A drone at the end of the path leaves no detour.
    let there = traffic(&[(2, path(above, above))]);
    assert_eq!(
        there.detour(seconds(1.0), path(below, above), ANYWHERE),
        None
    );
    // With another drone beside the leg: on the other side, or farther out.
    let leg = path(at(0.0, 0.0, 12.0), at(100.0, 0.0, 12.0));
    let (ahead, landing_detour) = (at(60.0, 0.0, 12.0), at(10.0, 10.0, 12.0));
    let known = traffic(&[
        (2, path(ahead, ahead)),
        (3, path(landing_detour, landing_detour)),
    ]);
    let [side, level] = known.detour(seconds(1.0), leg, ANYWHERE).unwrap();
    assert_eq!(side, level);
    assert!(side.east_m() < -9.0, "{side:?}");
}

#[test]
fn flown_part_of_a_path_blocks_no_drone() {
    let (from, to) = (at(60.0, -100.0, 12.0), at(60.0, 100.0, 12.0));
    let leg = path(at(0.0, 0.0, 12.0), at(160.0, 0.0, 12.0));
    for (share, is_clear) in [(0.5, false), (0.54, true), (1.0, true)] {
        let mut known = traffic(&[]);
        known.update(
            seconds(0.0),
            NodeId(2),
            Some(Intent::of(path(from, to), share, false)),
        );
        assert_eq!(known.is_clear(seconds(1.0), leg), is_clear, "{share}");
    }
    // A parallel path stays parallel with half of it flown.
    let ahead = path(at(60.0, 0.0, 12.0), at(220.0, 0.0, 12.0));
    let mut known = traffic(&[]);
    known.update(seconds(0.0), NodeId(2), Some(Intent::of(ahead, 0.5, false)));
    assert!(known.is_clear(seconds(1.0), leg));
    let remaining = path(at(80.0, 0.0, 12.0), leg.to);
    assert!(!known.must_give_way(seconds(1.0), remaining, leg));
}

#[test]
fn all_give_way_to_a_drone_with_priority() {
    let (low, high) = (at(50.0, 0.0, 5.0), at(50.0, 0.0, 30.0));
    let mut known = traffic(&[]);
    let lands = Intent::of(path(high, at(50.0, 0.0, 15.0)), 0.0, true);
    known.update(seconds(0.0), NodeId(9), Some(lands));
    assert!(known.must_give_way(seconds(0.1), path(low, high), path(low, high)));
}

#[test]
fn silent_drone_out_of_range_blocks_its_path_until_it_must_have_arrived() {
    let there = at(60.0, 0.0, 12.0);
    let leg = path(at(0.0, 0.0, 12.0), at(160.0, 0.0, 12.0));
    // 500 m take 25 s.
    for (length_m, blocks_for_s) in [(10.0, 5.5), (500.0, 30.0)] {
        let known = traffic(&[(2, path(there, at(60.0, length_m, 12.0)))]);
        assert!(!known.is_clear(seconds(blocks_for_s), leg), "{length_m} m");
        assert!(
            known.is_clear(seconds(blocks_for_s + 0.1), leg),
            "{length_m} m"
        );
    }
}

#[test]
fn parallel_path_below_a_silent_drone_is_blocked() {
    let ahead = path(at(60.0, 0.0, 30.0), at(220.0, 0.0, 30.0));
    let below = path(at(0.0, 0.0, 12.0), at(160.0, 0.0, 12.0));
    let behind = path(at(0.0, 0.0, 30.0), at(160.0, 0.0, 30.0));
    let mut known = traffic(&[(9, ahead)]);
    let far = at(-500.0, 0.0, 12.0);
    for (at_s, is_clear) in [(3.0, true), (3.1, false)] {
        let now = seconds(at_s);
        known.update(now, NodeId(8), Some(intent(path(far, far))));
        for leg in [below, behind] {
            assert_eq!(known.is_clear(now, leg), is_clear, "{at_s}");
            assert_eq!(known.must_give_way(now, leg, leg), !is_clear, "{at_s}");
        }
    }
}

#[test]
fn silent_drone_at_the_edge_of_the_range_is_not_taken_for_dead() {
    let hovers = at(60.0, 0.0, 30.0);
    let leg = path(at(0.0, 0.0, 12.0), at(160.0, 0.0, 12.0));
    for (heard_m, is_clear) in [(65.0, true), (69.0, true), (70.0, false)] {
        let mut known = traffic(&[(9, path(hovers, hovers))]);
        let heard = at(-heard_m, 0.0, 12.0);
        known.update(seconds(4.0), NodeId(8), Some(intent(path(heard, heard))));
        assert_eq!(known.is_clear(seconds(4.0), leg), is_clear, "{heard_m} m");
    }
}

#[test]
fn silent_drone_has_arrived_when_an_order_to_fly_in_lockstep_comes() {
    let crossing = path(at(60.0, -60.0, 12.0), at(60.0, 60.0, 12.0));
    let down = path(at(60.0, 0.0, 12.0), at(60.0, 0.0, 0.0));
    let leg = path(at(0.0, 0.0, 12.0), at(160.0, 0.0, 12.0));
    // A drone is silent after 3 s.
    for (announced, ordered_s, is_clear) in [
        (crossing, 2.9, false),
        (crossing, 3.0, true),
        (down, 3.0, false),
    ] {
        let mut known = traffic(&[(2, announced)]);
        known.set_in_lockstep(seconds(ordered_s), true);
        assert_eq!(known.is_clear(seconds(3.1), leg), is_clear, "{ordered_s} s");
        known.set_in_lockstep(seconds(3.1), false);
        assert!(!known.is_clear(seconds(3.1), leg));
    }
}

#[test]
fn only_a_drone_in_lockstep_flies_among_followers() {
    let (here, ahead) = (at(60.0, 0.0, 12.0), at(64.0, 0.0, 12.0));
    let leg = path(at(0.0, 0.0, 12.0), at(160.0, 0.0, 12.0));
    let mut known = traffic(&[]);
    let is_following = Intent::of(path(here, ahead), 0.0, true);
    known.update(seconds(0.0), NodeId(9), Some(is_following));
    assert!(!known.is_clear(seconds(1.0), leg) && known.must_give_way(seconds(1.0), leg, leg));
    known.set_in_lockstep(seconds(0.0), true);
    assert!(known.is_clear(seconds(1.0), leg));
    known.config.has_followers = false;
    assert!(
        !known.is_clear(seconds(1.0), leg),
        "without followers it brakes"
    );
    known.config.has_followers = true;
    let lands = Intent::of(path(here, at(60.0, 0.0, 0.0)), 0.0, true);
    known.update(seconds(1.0), NodeId(9), Some(lands));
    assert!(!known.is_clear(seconds(1.0), leg));
}

#[test]
fn drone_brakes_behind_one_that_brakes_though_it_comes_to_rest_on_its_path() {
    let config = Config {
        has_followers: false,
        ..CONFIG
    };
    let mut known = Traffic::new(NodeId(5), config);
    let braking = path(at(126.0, 0.0, 80.0), at(176.0, 0.0, 80.0));
    known.update(
        seconds(0.0),
        NodeId(9),
        Some(Intent::of(braking, 0.0, true)),
    );
    let gives_way = |stop_m| {
        let rest = path(at(stop_m, 0.0, 80.0), at(400.0, 0.0, 80.0));
        known.must_give_way(seconds(0.1), rest, rest)
    };
    assert!(gives_way(136.0));
    assert!(!gives_way(173.0), "braking brings it too near anyway");
}

#[test]
fn space_below_a_silent_drone_is_blocked_until_it_is_down() {
    let leg = path(at(0.0, 0.0, 12.0), at(160.0, 0.0, 12.0));
    let above = path(at(0.0, 0.0, 40.0), at(160.0, 0.0, 40.0));
    let crosses = path(at(60.0, -100.0, 30.0), at(60.0, 100.0, 30.0));
    let there = path(at(60.0, 0.0, 30.0), at(60.0, 0.0, 30.0));
    for announced in [there, crosses] {
        for (at_s, blocks) in [(3.0, false), (3.1, true), (28.0, true), (28.1, false)] {
            let now = seconds(at_s);
            let mut known = traffic(&[(9, announced)]);
            assert!(
                known.is_clear(now, leg),
                "no drone is heard: it is out of range"
            );
            // Another drone is heard from farther away.
            let far = at(-500.0, 0.0, 12.0);
            known.update(now, NodeId(8), Some(intent(path(far, far))));
            assert_eq!(known.is_clear(now, leg), !blocks, "{announced:?} at {at_s}");
            assert_eq!(known.must_give_way(now, leg, leg), blocks);
            assert!(known.is_clear(now, above));
        }
    }
    // The end of its path is blocked for a while, a landing place for good.
    let at_its_altitude = path(at(0.0, 0.0, 30.0), at(160.0, 0.0, 30.0));
    let known = traffic(&[(9, there)]);
    assert!(!known.is_clear(seconds(30.0), at_its_altitude));
    assert!(known.is_clear(seconds(30.1), at_its_altitude));
    let known = traffic(&[(9, path(there.from, at(60.0, 0.0, 0.0)))]);
    assert!(!known.is_clear(seconds(28.0), leg) && known.is_clear(seconds(28.1), leg));
    let column = path(at(60.0, 2.0, 30.0), at(60.0, 2.0, 0.0));
    assert!(!known.is_clear(seconds(900.0), column));
    let mut known = known;
    let side = |known: &Traffic| {
        let side = known.landing_detour(seconds(900.0), column, ANYWHERE);
        side.unwrap()
    };
    let nearest = side(&known);
    assert!(nearest.horizontal_distance_m(column.to) > 10.0);
    // Another drone, which may not be heard, lands there as planned. Its own landing place may be there.
    let mut places = vec![at(900.0, 0.0, 0.0); 10];
    places[5] = nearest;
    known.config.landing_places = Some(places.clone().into());
    assert_eq!(side(&known), nearest);
    places.swap(5, 7);
    known.config.landing_places = Some(places.into());
    assert!(side(&known).horizontal_distance_m(nearest) >= 5.0);
}
