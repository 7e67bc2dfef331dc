use std::net::{Ipv4Addr, TcpListener};

use super::*;

/// A service. Its process started at 1 before the trial, and at 2 since.
fn unit([state, result, code, restarts]: [&str; 4], started_us: u64) -> Unit {
    Unit::read(&format!(
        "ActiveState={state}\nResult={result}\nExecMainStatus={code}\nNRestarts={restarts}\n\
         ExecMainStartTimestampMonotonic={started_us}\nActiveEnterTimestampMonotonic=3\n"
    ))
}

const BEFORE: Before = Before {
    restarts: 1,
    started_us: 1,
};

#[test]
fn health_follows_from_service_and_answer() {
    use DroneHealth::{Dead, Healthy, Starting, Unhealthy};
    type Case = (
        [&'static str; 4],
        Option<&'static [&'static str]>,
        fn(&DroneHealth) -> bool,
    );
    let table: [Case; 9] = [
        (["active", "success", "0", "1"], Some(&[]), |it| {
            matches!(it, Healthy { .. })
        }),
        (["active", "success", "0", "1"], Some(&["x"]), |it| {
            matches!(it, Unhealthy(_))
        }),
        (["active", "success", "0", "1"], None, |it| {
            matches!(it, Unhealthy(_))
        }),
        (["active", "success", "0", "2"], Some(&[]), |it| {
            matches!(it, Dead(_))
        }),
        (["activating", "success", "0", "1"], None, |it| {
            matches!(it, Starting(_))
        }),
        (["activating", "watchdog", "6", "1"], None, |it| {
            matches!(it, Dead(_))
        }),
        (["failed", "exit-code", "1", "1"], None, |it| {
            matches!(it, Dead(_))
        }),
        (["failed", "exit-code", "2", "1"], None, |it| {
            matches!(it, Dead(_))
        }),
        (["inactive", "success", "0", "1"], None, |it| {
            matches!(it, Dead(_))
        }),
    ];
    for (properties, faults, expected) in table {
        let answer = faults.map(|faults| Answer {
            faults: faults.iter().map(ToString::to_string).collect(),
            ..Answer::default()
        });
        let unit = unit(properties, 2);
        let health = health(&unit, answer.as_ref(), Flight::NotBegun, BEFORE);
        assert!(expected(&health), "{properties:?}: {health:?}");
    }
}

#[test]
fn flight_is_over_only_by_the_journal() {
    let ends = [
        ["inactive", "success", "0", "1"],
        ["failed", "exit-code", "2", "1"],
    ];
    for properties in ends {
        for flight in [Flight::NotBegun, Flight::Ongoing] {
            let health = health(&unit(properties, 2), None, flight, BEFORE);
            assert!(
                matches!(health, DroneHealth::Dead(_)),
                "{flight:?}: {health:?}"
            );
        }
        let seen = health(&unit(properties, 2), None, Flight::Over, BEFORE);
        assert_eq!(seen, DroneHealth::FlightOver);
    }
    let crashed = unit(["failed", "exit-code", "1", "1"], 2);
    // It was ready before its last start, at 4, only.
    let refuses_its_file = unit(ends[1], 4);
    for unit in [crashed, refuses_its_file] {
        let health = health(&unit, None, Flight::Over, BEFORE);
        assert!(matches!(health, DroneHealth::Dead(_)), "{health:?}");
    }
}

#[test]
fn process_that_did_not_start_since_the_switch_proves_nothing() {
    for properties in [
        ["inactive", "success", "0", "0"],
        ["failed", "exit-code", "2", "0"],
    ] {
        let health = health(&unit(properties, 1), None, Flight::Over, BEFORE);
        assert!(matches!(health, DroneHealth::Starting(_)), "{health:?}");
    }
}

#[test]
fn drone_that_does_not_answer_is_in_flight_unless_its_journal_excludes_it() {
    for (state, flight, expected) in [
        ("active", Flight::Ongoing, true),
        ("activating", Flight::Ongoing, true),
        ("active", Flight::NotBegun, false),
        ("active", Flight::Over, false),
        ("inactive", Flight::Ongoing, false),
        ("failed", Flight::Ongoing, false),
    ] {
        let unit = unit([state, "success", "0", "0"], 1);
        assert_eq!(
            takes_part(&unit, None, flight),
            expected,
            "{state} {flight:?}"
        );
    }
    let answer = Answer::default();
    let active = unit(["active", "success", "0", "0"], 1);
    assert!(!takes_part(&active, Some(&answer), Flight::Ongoing));
}

#[test]
fn drone_with_a_silent_controller_is_unhealthy() {
    let healthy = unit(["active", "success", "0", "0"], 2);
    for (state, is_well) in [("open", true), ("silent", false), ("closed", false)] {
        let json = format!("{{\"faults\":[],\"port\":{{\"state\":\"{state}\",\"rc_sent\":7}}}}");
        let answer: Answer = serde_json::from_str(&json).unwrap();
        let health = health(&healthy, Some(&answer), Flight::NotBegun, BEFORE);
        assert_eq!(
            matches!(health, DroneHealth::Healthy { .. }),
            is_well,
            "{state}"
        );
    }
}

#[test]
fn answer_that_drips_in_ends_in_time() {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    let address = listener.local_addr().unwrap();
    std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        while stream.write_all(b"x").is_ok() {
            std::thread::sleep(ANSWER_MAX / 10);
        }
    });
    let start = Instant::now();
    assert!(ask(address).is_none());
    assert!(start.elapsed() < 3 * ANSWER_MAX, "{:?}", start.elapsed());
}
