use super::super::tests::neighbourhood::member;
use super::*;
use crate::identity::NodeId;

fn config(heartbeat_period: Duration) -> Config {
    Config {
        id: NodeId(1),
        drones: 16,
        relays: 0,
        heartbeat_period,
        landing_period: heartbeat_period * 3,
        repair: Duration::from_millis(8),
        repair_max: Duration::from_millis(200),
        link_time_to_live: Duration::from_secs(5),
        time_to_live: Duration::from_secs(10),
        route_timeout: Duration::from_secs(10),
    }
}

const NOW: Timestamp = Timestamp::from_nanos(1_000_000_000);

/// Shortest and longest time until the next heartbeat in 1,000 calls of `set`.
fn spread(
    shared: &mut SharedState,
    heartbeat_period: Duration,
    mut set: impl FnMut(&mut HeartbeatTimer, &mut SharedState),
) -> (Duration, Duration) {
    let pauses = (0..1_000).map(|_| {
        let mut timer = HeartbeatTimer::new(&config(heartbeat_period));
        timer.schedule_at(NOW + Duration::from_secs(60));
        set(&mut timer, shared);
        timer.deadline().unwrap().since(NOW)
    });
    let pauses: Vec<_> = pauses.collect();
    (*pauses.iter().min().unwrap(), *pauses.iter().max().unwrap())
}

/// Asserts that times cover nearly all of `first` to `last`.
fn assert_spread(spread: (Duration, Duration), first: Duration, last: Duration) {
    let tenth = (last - first) / 10;
    assert!((first..=first + tenth).contains(&spread.0), "{spread:?}");
    assert!((last - tenth..=last).contains(&spread.1), "{spread:?}");
}

#[test]
fn member_period_exceeds_the_masters_and_stays_below_silence_max() {
    for millis in [40, 100, 200, 1_000] {
        let heartbeat_period = Duration::from_millis(millis);
        let mut shared = member(1);
        for has_children in [true, false] {
            let waits = spread(&mut shared, heartbeat_period, |timer, shared| {
                timer.record_sent(shared, NOW, (has_children, true), false);
            });
            let period = if has_children {
                heartbeat_period
            } else {
                config(heartbeat_period).leaf_period()
            };
            assert_spread(waits, period * 5 / 4, period * 11 / 8);
            assert!(waits.1 <= config(heartbeat_period).silence_max());
        }
    }
}

#[test]
fn master_halves_its_period_on_lossy_links_during_changes() {
    let mut shared = member(0);
    for (millis, fast) in [(1_000, 500), (400, 250), (200, 200)] {
        let heartbeat_period = Duration::from_millis(millis);
        let fast = Duration::from_millis(fast);
        for (is_fast, is_lossy, pause) in [
            (false, true, heartbeat_period),
            (true, false, heartbeat_period),
            (true, true, fast),
        ] {
            let waits = spread(&mut shared, heartbeat_period, |timer, shared| {
                timer.set_fast(is_fast);
                timer.record_sent(shared, NOW, (true, is_lossy), false);
            });
            assert_eq!(waits, (pause, pause));
        }
    }
}

#[test]
fn settled_landing_drone_has_a_period_of_its_own() {
    let mut shared = member(1);
    let heartbeat_period = Duration::from_secs(1);
    let waits = spread(&mut shared, heartbeat_period, |timer, shared| {
        timer.record_sent(shared, NOW, (false, true), true);
    });
    assert_eq!(waits, (heartbeat_period * 3, heartbeat_period * 3));
}

#[test]
fn forwarding_spread_grows_with_the_number_of_neighbours() {
    let mut shared = member(1);
    let heartbeat_period = Duration::from_secs(1);
    for (has_children, neighbours, within) in [
        (true, 0, SPREAD_MIN),
        (true, 9, SPREAD * 10),
        (true, 5_000, heartbeat_period / SPREAD_SHARE),
        (false, 9, LEAF_SPREAD * 10),
        (false, usize::MAX, heartbeat_period / LEAF_SPREAD_SHARE),
    ] {
        let contention = Contention {
            has_children,
            neighbours,
        };
        let waits = spread(&mut shared, heartbeat_period, |timer, shared| {
            timer.schedule_soon(shared, NOW, contention);
        });
        assert_spread(waits, Duration::ZERO, within);
    }
    let waits = spread(&mut shared, heartbeat_period, |timer, shared| {
        timer.schedule_later(shared, NOW);
    });
    assert_spread(waits, heartbeat_period / 8, heartbeat_period / 4);
    let waits = spread(&mut shared, heartbeat_period, |timer, shared| {
        timer.schedule_for_new_neighbour(shared, NOW);
    });
    assert_spread(waits, Duration::ZERO, SPREAD * 2 * 16);
}

#[test]
fn heartbeat_is_never_postponed() {
    let mut shared = member(1);
    let mut timer = HeartbeatTimer::new(&config(Duration::from_secs(1)));
    let contention = Contention {
        has_children: false,
        neighbours: 60,
    };
    let calls: [fn(&mut HeartbeatTimer, &mut SharedState, Contention); 3] = [
        |it, shared, contention| it.schedule_soon(shared, NOW, contention),
        |it, shared, _| it.schedule_later(shared, NOW),
        |it, shared, _| it.schedule_for_new_neighbour(shared, NOW),
    ];
    for call in calls {
        timer.stop();
        call(&mut timer, &mut shared, contention);
        assert_eq!(timer.deadline(), None, "a stopped timer stays stopped");
        let due = NOW + Duration::from_nanos(1);
        timer.schedule_at(due);
        for _ in 0..100 {
            call(&mut timer, &mut shared, contention);
            assert!(timer.deadline() <= Some(due));
        }
    }
}

#[test]
fn leaves_forward_at_most_ten_heartbeats_a_second() {
    for (millis, turn) in [(20, 5), (40, 3), (99, 2), (100, 1), (1_000, 1)] {
        let mut shared = member(1);
        let mut timer = HeartbeatTimer::new(&config(Duration::from_millis(millis)));
        let mut forwarded = 0;
        for heartbeat in 1..=60 {
            shared.durable.heartbeats.master = heartbeat;
            assert!(timer.is_forward_due(&shared, true));
            if timer.is_forward_due(&shared, false) {
                timer.record_sent(&mut shared, NOW, (false, true), false);
                forwarded += 1;
            }
        }
        assert_eq!(forwarded, 60 / turn, "{millis} ms");
    }
}
