//! What became of a swarm's mission, in words.

use muster_runtime::text::drones;
use muster_scenarios::report::{DroneReport, Report};

/// Most segments that are listed.
const LISTED_SEGMENTS_MAX: usize = 5;

/// Why a mission was not completed, and which drones never took off; `None` if there is nothing to say.
pub(super) fn note(report: &Report) -> Option<String> {
    if report.mission_completed {
        return stayed(report).map(|drones| flown_without(&drones));
    }
    Some(incomplete(report))
}

/// The drones that stayed on the ground without being lost there; `None` if there are none.
fn stayed(report: &Report) -> Option<String> {
    let stayed = report.drones.iter().filter(|it| it.stayed());
    let stayed: Vec<u32> = stayed.map(|it| it.id).collect();
    (!stayed.is_empty()).then(|| drones(&stayed))
}

fn flown_without(drones: &str) -> String {
    format!("flown without {drones}, never off the ground")
}

/// Why a mission was not completed.
fn incomplete(report: &Report) -> String {
    let has_flown = |drone: &DroneReport| drone.waypoints > 0 || drone.landed_because.is_some();
    let landed_early = |drone: &DroneReport| drone.landed_because.is_some();
    let (segments, some_landed) = (
        report.never_met.len(),
        report.drones.iter().any(landed_early),
    );
    let why = if !report.violations.is_empty() {
        "not completed: the run stopped when a rule was broken"
    } else if report.interrupted {
        "not completed: the flight was interrupted"
    } else if report.unchecked {
        "not completed"
    } else if segments > 0 && !some_landed {
        return format!("not completed by one swarm: {segments} segments flew it on their own");
    } else if !report.drones.iter().any(has_flown) {
        "not flown: no drone reached the first waypoint"
    } else {
        return match (stayed(report), some_landed) {
            (Some(drones), false) => format!("not completed by all: {}", flown_without(&drones)),
            (Some(drones), true) => format!("{EARLY}; {}", flown_without(&drones)),
            (None, _) => EARLY.to_owned(),
        };
    };
    why.to_owned()
}

const EARLY: &str = "not completed: drones landed before the mission was over";

/// The segments that flew the mission without ever hearing each other.
pub(super) fn never_met(report: &Report) -> String {
    let listed = report.never_met.iter().take(LISTED_SEGMENTS_MAX);
    let mut listed: Vec<_> = listed.map(|ids| drones(ids)).collect();
    if let Some(more @ 1..) = report.never_met.len().checked_sub(LISTED_SEGMENTS_MAX) {
        listed.push(format!("{more} more"));
    }
    format!(
        "{} segments never heard each other in their slots: {}; raise `radio.range_m` or lower `formation.spacing_m`",
        report.never_met.len(),
        listed.join("; "),
    )
}

/// The faults that were never injected; `None` if there are none.
pub(super) fn never_injected(report: &Report) -> Option<String> {
    let numbers: Vec<_> = report.never_injected.iter().map(usize::to_string).collect();
    (!numbers.is_empty()).then(|| {
        format!(
            "never injected, by number in the file: {}",
            numbers.join(", ")
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::sample;

    #[test]
    fn incomplete_mission_is_landed_only_if_drones_landed() {
        let (mut report, _) = sample::faulty();
        report.violations.clear();
        assert!(incomplete(&report).contains("landed"));
        let mut interrupted = report.clone();
        interrupted.set_interrupted();
        assert!(incomplete(&interrupted).ends_with("interrupted"));
        let (broken, _) = sample::faulty();
        assert!(!broken.violations.is_empty() && !incomplete(&broken).contains("landed"));
        for drone in &mut report.drones {
            (drone.waypoints, drone.landed_because) = (0, None);
        }
        assert!(incomplete(&report).starts_with("not flown"));
    }

    #[test]
    fn drones_that_never_took_off_are_named() {
        let (mut report, _) = sample::swarm(5);
        assert_eq!(note(&report), None);
        for id in [1, 4] {
            "start".clone_into(&mut report.drones[id].state);
        }
        let without = "flown without drones 1 and 4, never off the ground";
        assert_eq!(note(&report).as_deref(), Some(without));
        report.mission_completed = false;
        assert_eq!(
            note(&report),
            Some(format!("not completed by all: {without}"))
        );
        report.drones[0].landed_because = Some("the master was silent".to_owned());
        let note = note(&report).unwrap();
        assert!(
            note.contains("landed before") && note.ends_with(without),
            "{note}"
        );
    }
}
