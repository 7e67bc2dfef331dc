//! Whole flights, in real time.

use serde_json::{Value, json};

use super::fleet::{Fleet, MASTER, Process};

pub(crate) fn state(name: &str) -> Value {
    json!({ "State": name })
}

pub(crate) fn others(
    fleet: &mut [Process],
    than: u32,
) -> impl Iterator<Item = (u32, &mut Process)> {
    (0..).zip(fleet).filter(move |(id, _)| *id != than)
}

/// The very last ballot that each has obeyed is one and the same.
pub(crate) fn agreed(drones: &[&Process]) -> Value {
    let last = |drone: &&Process| drone.leader().last().cloned();
    let ballots: Vec<_> = drones.iter().map(last).collect();
    assert!(
        ballots.iter().all(|ballot| *ballot == ballots[0]),
        "{ballots:?}"
    );
    ballots[0].clone().unwrap()
}

#[test]
fn five_processes_fly_a_mission_and_end_well() {
    let fleet = Fleet::new();
    let mut drones = fleet.fly();
    for drone in &mut drones {
        assert_eq!(drone.end(), Some(0));
        let events = drone.missions();
        for event in [
            state("TakingOff"),
            json!({ "Landing": "MissionOver" }),
            state("Finished"),
        ] {
            assert!(events.contains(&event), "{event}: {events:#?}");
        }
    }
    let all: Vec<_> = drones.iter().collect();
    assert_eq!(agreed(&all)["master"], MASTER);
}

#[test]
fn when_their_master_is_killed_the_others_elect_one_and_fly_on_and_it_does_not_take_off_again() {
    let fleet = Fleet::new();
    let mut drones = fleet.fly();
    let master = &mut drones[MASTER as usize];
    master.wait_for_mission(&json!({ "Opened": { "waypoint": 1 } }));
    master.signal("KILL");
    assert_eq!(master.end(), None);

    let mut again = fleet.start(MASTER, &["--fly"]);
    assert_eq!(
        again.end(),
        Some(4),
        "it is down, and its mission was not flown"
    );
    assert!(!again.missions().contains(&state("TakingOff")));

    for (id, drone) in others(&mut drones, MASTER) {
        assert_eq!(drone.end(), Some(0), "drone {id}");
        assert!(
            drone
                .missions()
                .contains(&json!({ "Landing": "MissionOver" }))
        );
    }
    let survivors: Vec<_> = others(&mut drones, MASTER).map(|(_, it)| &*it).collect();
    let ballot = agreed(&survivors);
    assert!(ballot["term"].as_u64().unwrap() > 1, "{ballot}");
}

/// One flight for three, for a flight takes half a minute: of drones that come down each for its own reason.
#[test]
fn drones_that_are_called_down_or_expelled_or_can_not_write_come_down_and_the_others_fly_on() {
    let fleet = Fleet::new();
    let unable = fleet.start_with_little_disk(1);
    let mut drones: Vec<_> = [0, 3, 4].map(|id| fleet.start(id, &[])).into();
    drones.insert(1, unable);
    drones.insert(MASTER as usize, fleet.start(MASTER, &["--fly"]));

    let under_way = json!({ "State": { "MovingToWaypoint": { "waypoint": 1 } } });
    let called = &mut drones[4];
    called.wait_for_mission(&under_way);
    called.signal("TERM");
    called.wait_for_mission(&state("Landing"));
    called.signal("TERM");

    drones[0].wait_for_mission(&under_way);
    fleet.keys(&["revoke", "ours", "0"]);
    // The expelled drone itself hears of it last.
    for id in [MASTER as usize, 3, 0] {
        drones[id].signal("HUP");
        drones[id].wait_for("that it read its files again", |line| line["number"] == 2);
    }

    drones[1].wait_for("that it can't write", |line| line["level"] == "ERROR");
    let (code, said) = fleet.ask(1, "/health");
    assert_eq!(code, 503);
    assert!(said.contains("the journal can't be written"), "{said}");

    let codes: Vec<_> = drones.iter_mut().map(Process::end).collect();
    assert_eq!(codes, [0, 1, 0, 0, 0].map(Some));
    for (id, reason) in (0..).zip([
        "Recalled",
        "JournalLost",
        "MissionOver",
        "MissionOver",
        "Recalled",
    ]) {
        let events = drones[id].missions();
        assert!(
            events.contains(&json!({ "Landing": reason })),
            "drone {id}: {events:#?}"
        );
        assert!(
            events.contains(&state("Finished")),
            "drone {id}: {events:#?}"
        );
    }
    assert!(drones[3].dropped("revoked") > 0);
}
