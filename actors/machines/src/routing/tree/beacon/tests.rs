use super::super::tests::neighbourhood::member;
use super::*;
use crate::identity::NodeId;

fn config(beacon: Duration) -> Config {
    Config {
        id: NodeId(1),
        drones: 16,
        relays: 0,
        beacon,
        repair: Duration::from_millis(8),
        repair_max: Duration::from_millis(200),
        link_time_to_live: Duration::from_secs(5),
        time_to_live: Duration::from_secs(10),
        patience: Duration::from_secs(10),
    }
}

const NOW: Timestamp = Timestamp::from_nanos(1_000_000_000);

/// The shortest and the longest time until the next beacon, of a thousand that were set by `set`.
fn spread(
    core: &mut Core,
    beacon: Duration,
    mut set: impl FnMut(&mut Beacon, &mut Core),
) -> (Duration, Duration) {
    let pauses = (0..1_000).map(|_| {
        let mut next = Beacon::new(&config(beacon));
        next.set(NOW + Duration::from_secs(60));
        set(&mut next, core);
        next.deadline().unwrap().since(NOW)
    });
    let pauses: Vec<_> = pauses.collect();
    (*pauses.iter().min().unwrap(), *pauses.iter().max().unwrap())
}

/// Asserts that times are spread from `first` to `last`, and over nearly all of that.
fn assert_spread(spread: (Duration, Duration), first: Duration, last: Duration) {
    let tenth = (last - first) / 10;
    assert!((first..=first + tenth).contains(&spread.0), "{spread:?}");
    assert!((last - tenth..=last).contains(&spread.1), "{spread:?}");
}

#[test]
fn a_member_waits_longer_than_its_master_and_never_longer_than_its_turn() {
    for millis in [40, 100, 200, 1_000] {
        let beacon = Duration::from_millis(millis);
        let mut core = member(1);
        for has_children in [true, false] {
            let waits = spread(&mut core, beacon, |next, core| {
                next.said(core, NOW, (has_children, true), false);
            });
            let pace = if has_children {
                beacon
            } else {
                config(beacon).pace()
            };
            assert_spread(waits, pace * 5 / 4, pace * 11 / 8);
            assert!(waits.1 <= config(beacon).turn());
        }
    }
}

#[test]
fn a_master_keeps_its_period_and_halves_it_while_drones_change_places_and_links_lose_frames() {
    let mut core = member(0);
    for (millis, quick) in [(1_000, 500), (400, 250), (200, 200)] {
        let beacon = Duration::from_millis(millis);
        let quick = Duration::from_millis(quick);
        for (is_quick, is_lossy, pause) in [
            (false, true, beacon),
            (true, false, beacon),
            (true, true, quick),
        ] {
            let waits = spread(&mut core, beacon, |next, core| {
                next.quicken(is_quick);
                next.said(core, NOW, (true, is_lossy), false);
            });
            assert_eq!(waits, (pause, pause));
        }
    }
}

#[test]
fn who_has_been_landing_for_long_speaks_each_fourth_time() {
    let mut core = member(1);
    let beacon = Duration::from_secs(1);
    let waits = spread(&mut core, beacon, |next, core| {
        next.said(core, NOW, (false, true), true);
    });
    assert_eq!(waits, (beacon * LANDING_BEACONS, beacon * LANDING_BEACONS));
}

#[test]
fn those_that_pass_a_heartbeat_on_share_a_time_that_grows_with_their_number() {
    let mut core = member(1);
    let beacon = Duration::from_secs(1);
    for (has_children, neighbours, within) in [
        (true, 0, SPREAD_MIN),
        (true, 9, SPREAD * 10),
        (true, 5_000, beacon / SPREAD_SHARE),
        (false, 9, LEAF_SPREAD * 10),
        (false, usize::MAX, beacon / LEAF_SPREAD_SHARE),
    ] {
        let audience = Audience {
            has_children,
            neighbours,
        };
        let waits = spread(&mut core, beacon, |next, core| {
            next.soon(core, NOW, audience);
        });
        assert_spread(waits, Duration::ZERO, within);
    }
    let waits = spread(&mut core, beacon, |next, core| next.in_a_while(core, NOW));
    assert_spread(waits, beacon / 8, beacon / 4);
    let waits = spread(&mut core, beacon, |next, core| {
        next.for_new_neighbour(core, NOW);
    });
    assert_spread(waits, Duration::ZERO, SPREAD * 2 * 16);
}

#[test]
fn a_beacon_is_brought_forward_and_never_put_off() {
    let mut core = member(1);
    let mut beacon = Beacon::new(&config(Duration::from_secs(1)));
    let audience = Audience {
        has_children: false,
        neighbours: 60,
    };
    let calls: [fn(&mut Beacon, &mut Core, Audience); 3] = [
        |it, core, audience| it.soon(core, NOW, audience),
        |it, core, _| it.in_a_while(core, NOW),
        |it, core, _| it.for_new_neighbour(core, NOW),
    ];
    for call in calls {
        beacon.stop();
        call(&mut beacon, &mut core, audience);
        assert_eq!(beacon.deadline(), None, "who is done says nothing any more");
        let due = NOW + Duration::from_nanos(1);
        beacon.set(due);
        for _ in 0..100 {
            call(&mut beacon, &mut core, audience);
            assert!(beacon.deadline() <= Some(due));
        }
    }
}

#[test]
fn leaves_pass_a_heartbeat_on_ten_times_a_second_at_most_and_parents_each() {
    for (millis, turn) in [(20, 5), (40, 3), (99, 2), (100, 1), (1_000, 1)] {
        let mut core = member(1);
        let mut beacon = Beacon::new(&config(Duration::from_millis(millis)));
        let mut passed_on = 0;
        for heartbeat in 1..=60 {
            core.durable.heartbeats.master = heartbeat;
            assert!(beacon.is_its_turn(&core, true));
            if beacon.is_its_turn(&core, false) {
                beacon.said(&mut core, NOW, (false, true), false);
                passed_on += 1;
            }
        }
        assert_eq!(passed_on, 60 / turn, "{millis} ms");
    }
}
