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

/// The last ballot of all drones, which must be the same.
pub(crate) fn common_ballot(drones: &[&Process]) -> Value {
    let last = |drone: &&Process| drone.ballots().last().cloned();
    let ballots: Vec<_> = drones.iter().map(last).collect();
    assert!(
        ballots.iter().all(|ballot| *ballot == ballots[0]),
        "{ballots:?}"
    );
    ballots[0].clone().unwrap()
}

#[test]
fn five_processes_complete_a_mission() {
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
    assert_eq!(common_ballot(&all)["master"], MASTER);
}

#[test]
fn killed_master_is_replaced_and_does_not_take_off_again() {
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
        "on the ground, with an incomplete mission"
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
    let ballot = common_ballot(&survivors);
    assert!(ballot["term"].as_u64().unwrap() > 1, "{ballot}");
}

/// Three cases in one flight, since a flight takes half a minute.
#[test]
fn recalled_revoked_and_diskless_drones_land_and_the_others_continue() {
    let fleet = Fleet::new();
    let unable = fleet.start_with_little_disk(1);
    let mut drones: Vec<_> = [0, 3, 4].map(|id| fleet.start(id, &[])).into();
    drones.insert(1, unable);
    drones.insert(MASTER as usize, fleet.start(MASTER, &["--fly"]));

    let in_flight = json!({ "State": { "MovingToWaypoint": { "waypoint": 1 } } });
    let recalled = &mut drones[4];
    recalled.wait_for_mission(&in_flight);
    recalled.signal("TERM");
    recalled.wait_for_mission(&state("Landing"));
    recalled.signal("TERM");

    drones[0].wait_for_mission(&in_flight);
    fleet.keys(&["revoke", "ours", "0"]);
    // The revoked drone reads the list last.
    for id in [MASTER as usize, 3, 0] {
        drones[id].signal("HUP");
        drones[id].wait_for("files reloaded", |line| line["number"] == 2);
    }

    drones[1].wait_for("a write error", |line| line["level"] == "ERROR");
    let (code, output) = fleet.get(1, "/health");
    assert_eq!(code, 503);
    assert!(output.contains("the journal can't be written"), "{output}");

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
