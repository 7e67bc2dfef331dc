//! Agents and actors that fail, and limits of what an agent asks for.

use super::*;

type Cause = fn(&mut Drone) -> (Vec<Transmit>, Vec<Event>);

/// Failures that land a drone, in the swarm or not.
pub(super) const FAILURES: [(LandingReason, Cause); 3] = [
    (LandingReason::ActorGivenUp, |drone| {
        drone.input(Input::GiveUp)
    }),
    (LandingReason::FlightTime, |drone| drone.wait(601 * SECOND)),
    (LandingReason::BatteryLow, |drone| {
        drone.input(Input::Navigation(NavigationNotice::Failing {
            failure: Failure::BatteryLow,
            stop: Ned::HOME,
            is_airborne: true,
        }))
    }),
];

pub(super) fn assert_lands(mut drone: Drone, (reason, cause): (LandingReason, Cause)) {
    let (transmits, events) = cause(&mut drone);
    assert_eq!(goals(&transmits).last(), Some(&Goal::Land), "{reason:?}");
    assert!(events.contains(&Event::Landing(reason)), "{reason:?}");
}

#[test]
fn operators_and_failures_land_the_drone_whatever_its_agent_does() {
    let ordered: (LandingReason, Cause) = (LandingReason::MissionOver, |drone| {
        drone.order(
            4,
            &Order::Land {
                at: Ned::HOME,
                changes: 0,
                wave: 0,
                apart: true,
            },
        )
    });
    for cause in FAILURES.into_iter().chain([ordered]) {
        assert_lands(member_on_task(), cause);
    }
}

#[test]
fn restarted_agent_has_its_kept_state_and_its_drone_its_goal() {
    let mut drone = member_on_task();
    drone.restart();
    let (transmits, _) = drone.wait(Duration::ZERO);
    assert_eq!(goals(&transmits).first(), Some(&FIRST_GOAL));
    assert!(transmits.contains(&Transmit::Resync));
    assert!(transmits.contains(&Transmit::Locate));
    // Its navigation may have restarted, too.
    let (transmits, _) = drone.input(Input::Navigation(NavigationNotice::Resync));
    assert!(transmits.contains(&Transmit::Locate));
    assert_eq!(
        drone.calls(),
        Vec::<String>::new(),
        "it waits for its position"
    );
    drone.input(Input::Navigation(NavigationNotice::Position {
        position: Ned::new(80.0, 0.0, -30.0),
        velocity: Velocity::new(0.0, 0.0, 0.0),
    }));
    assert_eq!(drone.calls(), ["start at 80 m, kept Some([111, 110, 101])"]);
    assert_eq!(*drone.host.mission().drones_on_task(), ids(&[2]));
    // The routing repeats the newest order, which was acknowledged before.
    let order = Order::Task {
        drones: ids(&[0, 1, 2]),
    };
    drone.order(3, &order);
    assert_eq!(*drone.host.mission().drones_on_task(), ids(&[0, 1, 2]));
}

#[test]
fn failed_agent_is_built_anew_and_what_it_asked_for_is_not_done() {
    let mut drone = member_on_task();
    let (transmits, events) = drone.message(b"panic");
    assert_eq!(transmits, []);
    let failed = Event::AgentFailed("told to".to_owned());
    assert_eq!(events.as_slice(), std::slice::from_ref(&failed));
    drone.calls();
    drone.wait(Duration::ZERO);
    assert_eq!(drone.calls(), ["start at 0 m, kept Some([111, 110, 101])"]);
    let (_, events) = drone.message(b"panic");
    assert_eq!(events.as_slice(), std::slice::from_ref(&failed));
    drone.calls();
    drone.wait(SECOND / 2);
    assert_eq!(
        drone.calls(),
        Vec::<String>::new(),
        "the second restart backs off"
    );
    drone.wait(SECOND / 2);
    let (transmits, events) = drone.message(b"panic");
    assert!(events.contains(&Event::Landing(LandingReason::ActorGivenUp)));
    assert_eq!(goals(&transmits), [Goal::Land]);
}

#[test]
fn agent_that_fails_in_a_timer_is_built_anew_at_once() {
    let mut drone = member_on_task();
    drone.message(b"panic in a timer");
    drone.calls();
    let (_, events) = drone.wait(SECOND);
    assert!(events.contains(&Event::AgentFailed("timed".to_owned())));
    assert_eq!(
        drone.calls(),
        ["timer 9", "start at 0 m, kept Some([111, 110, 101])"]
    );
    drone.wait(SECOND);
    assert!(drone.calls().contains(&"timer 7".to_owned()), "it goes on");
}

#[test]
fn messages_wait_for_an_agent_that_is_to_start() {
    let mut drone = member_in_slot();
    drone.message(b"early");
    drone.message(b"earlier than its task");
    assert_eq!(drone.calls(), Vec::<String>::new());
    drone.order(3, &Order::Task { drones: ids(&[2]) });
    let calls = [
        "start at 0 m, kept None",
        "message from 0: 5",
        "message from 0: 21",
    ];
    assert_eq!(drone.calls(), calls);
    for _ in 0..2 {
        drone.message(b"panic");
        drone.wait(Duration::ZERO);
    }
    drone.calls();
    drone.message(b"in its pause");
    assert_eq!(drone.calls(), Vec::<String>::new());
    drone.wait(SECOND);
    assert_eq!(drone.calls()[1], "message from 0: 12");
    // A drone that lands has no agent any more.
    drone.message(b"land");
    drone.calls();
    drone.message(b"late");
    drone.wait(SECOND);
    assert_eq!(drone.calls(), Vec::<String>::new());
}

#[test]
fn waiting_messages_are_bounded() {
    let mut drone = member_in_slot();
    for _ in 0..100 {
        drone.message(b"again");
    }
    drone.message(b"the last one");
    drone.order(3, &Order::Task { drones: ids(&[2]) });
    let calls = drone.calls();
    assert_eq!(calls.len(), 1 + crate::routing::messages::limits::QUEUE_MAX);
    assert_eq!(calls.last().unwrap(), "message from 0: 12");
}

#[test]
fn failed_agent_hears_again_where_its_drone_rests() {
    let mut drone = member_on_task();
    let arrived = Input::Navigation(NavigationNotice::Arrived(FIRST_GOAL));
    drone.input(arrived.clone());
    drone.message(b"panic");
    let (transmits, _) = drone.wait(Duration::ZERO);
    assert_eq!(
        goals(&transmits).first(),
        Some(&FIRST_GOAL),
        "navigation answers with an arrival"
    );
}

#[test]
fn arrivals_at_one_place_are_reported_one_after_another() {
    let mut drone = member_on_task();
    drone.calls();
    let arrived = Input::Navigation(NavigationNotice::Arrived(FIRST_GOAL));
    for expected in [1, 0, 0] {
        drone.input(arrived.clone());
        let calls = drone.calls();
        assert_eq!(calls, vec!["telemetry, arrived true"; expected]);
    }
    drone.wait(TELEMETRY_MIN / 2);
    assert_eq!(drone.calls(), Vec::<String>::new());
    drone.wait(TELEMETRY_MIN / 2);
    assert_eq!(drone.calls(), ["telemetry, arrived true"]);
    drone.input(arrived);
    drone.message(b"go on");
    drone.calls();
    drone.wait(TELEMETRY_MIN);
    assert_eq!(drone.calls(), Vec::<String>::new(), "it flies on");
}

#[test]
fn context_shows_the_timers_that_run() {
    struct Timing(Calls);
    impl Agent for Timing {
        fn start(&mut self, context: &mut Context<'_>) {
            for (timer, seconds) in [(1, 3), (2, 1), (3, 2), (1, 2)] {
                context.set_timer(TimerId(timer), seconds * SECOND);
            }
            context.cancel_timer(TimerId(2));
            let running: Vec<_> = context.timers().collect();
            self.0.lock().unwrap().push(format!("{running:?}"));
        }
    }
    let mut drone = member_in_slot();
    let calls = Arc::clone(&drone.calls);
    let factory = Factory::new(move || Box::new(Timing(Arc::clone(&calls))));
    drone.host.replace_factory(factory);
    drone.order(3, &Order::Task { drones: ids(&[2]) });
    assert_eq!(drone.calls(), ["[TimerId(3), TimerId(1)]"]);
}

#[test]
fn long_description_of_a_failure_keeps_its_beginning_and_its_end() {
    struct Long;
    impl Agent for Long {
        fn start(&mut self, _context: &mut Context<'_>) {
            let calls = "  called from there\n".repeat(1_000);
            panic!("Traceback\n{calls}ValueError: on purpose");
        }
    }
    let mut drone = member_in_slot();
    drone.host.replace_factory(Factory::new(|| Box::new(Long)));
    let (_, events) = drone.order(3, &Order::Task { drones: ids(&[2]) });
    let what = events.iter().find_map(|event| match event {
        Event::AgentFailed(what) => Some(what.as_str()),
        _ => None,
    });
    let what = what.unwrap();
    assert!(what.starts_with("Traceback\n"), "{what}");
    assert!(what.ends_with("\nValueError: on purpose"), "{what}");
    assert!(what.chars().count() < 2_100, "{what}");
}

#[test]
fn restarted_navigation_is_given_the_goal_again() {
    let mut drone = member_on_task();
    let (transmits, _) = drone.input(Input::Navigation(NavigationNotice::Resync));
    assert_eq!(goals(&transmits).len(), 1);
}

#[test]
fn limits_of_messages_and_kept_states_are_errors() {
    struct Greedy(Calls);
    impl Agent for Greedy {
        fn start(&mut self, context: &mut Context<'_>) {
            let long = vec![0; MESSAGE_MAX + 1];
            let to = Destination::Leader;
            let error = context.send(to, &long, Reliability::BestEffort);
            let mut calls = self.0.lock().unwrap();
            calls.push(error.unwrap_err().to_string());
            calls.push(context.keep(&long[..=KEPT_MAX]).unwrap_err().to_string());
            let sent = (0..100).filter(|_| context.send(to, b"x", Reliability::BestEffort).is_ok());
            calls.push(sent.count().to_string());
        }
    }
    let mut drone = member_in_slot();
    let calls = Arc::clone(&drone.calls);
    let factory = Factory::new(move || Box::new(Greedy(Arc::clone(&calls))));
    drone.host.replace_factory(factory);
    let (transmits, _) = drone.order(3, &Order::Task { drones: ids(&[2]) });
    assert_eq!(messages(&transmits), MESSAGES_PER_STEP_MAX);
    assert_eq!(
        drone.calls(),
        [
            "1048577 bytes are too many; accepted are at most 1048576",
            "16385 bytes are too many; accepted are at most 16384",
            "64"
        ]
    );
}

#[test]
fn destinations_are_kept_above_the_ground_and_below_the_limit() {
    for (altitude_m, flown_m) in [(-3.0, ALTITUDE_MIN_M), (40.0, 40.0), (500.0, 100.0)] {
        struct To(f64);
        impl Agent for To {
            fn start(&mut self, context: &mut Context<'_>) {
                context.go_to(Ned::new(0.0, 0.0, -self.0));
            }
        }
        let mut drone = member_in_slot();
        let factory = Factory::new(move || Box::new(To(altitude_m)));
        drone.host.replace_factory(factory);
        let (transmits, _) = drone.order(3, &Order::Task { drones: ids(&[2]) });
        let to = Ned::new(0.0, 0.0, -flown_m);
        let goal = Goal::FlyTo {
            to,
            hold_altitude_m: flown_m,
        };
        assert_eq!(goals(&transmits), [goal]);
    }
}

#[test]
fn drone_that_is_not_in_its_slot_when_the_task_begins_lands() {
    let mut drone = Drone::new(2);
    let plan = Order::Plan {
        index: 0,
        count: 1,
        waypoints: vec![Ned::new(0.0, 0.0, -25.0)],
        holds: Vec::new(),
    };
    drone.order(1, &plan);
    drone.order(2, &Order::TakeOff { wave: 0 });
    let (_, events) = drone.order(
        3,
        &Order::Task {
            drones: ids(&[1, 2]),
        },
    );
    assert!(events.contains(&Event::Landing(LandingReason::Late)));
    assert_eq!(drone.calls(), Vec::<String>::new());
}
