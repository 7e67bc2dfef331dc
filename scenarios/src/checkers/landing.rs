//! Rule 5: every aircraft ends on the ground in time, and whole.

use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;

use super::Violation;

/// All drones end on the ground, disarmed, within the time limit. `armed` are those that do not.
pub(crate) fn check(now: Timestamp, armed: Vec<NodeId>) -> Option<Violation> {
    (!armed.is_empty()).then(|| Violation {
        rule: 5,
        at: now,
        what: format!(
            "{} drones are still armed at the end of the run",
            armed.len()
        ),
        drones: armed,
    })
}

/// Whether the aircraft of a flight controller has broken by itself: it touched the ground too fast or too much tilted.
#[derive(Debug, Default)]
pub(crate) struct Wrecks {
    is_excused: bool,
    is_broken: bool,
}

impl Wrecks {
    /// A fault of the plan breaks the aircraft, or leaves it without control.
    pub(crate) const fn excuse(&mut self) {
        self.is_excused = true;
    }

    /// Whether the aircraft is a wreck now.
    pub(crate) const fn look(&mut self, is_wreck: bool) {
        self.is_broken |= is_wreck && !self.is_excused;
    }

    /// Whether a drone's aircraft has broken by itself.
    pub(crate) fn check(&self, now: Timestamp, drone: NodeId) -> Option<Violation> {
        self.is_broken.then(|| Violation {
            rule: 5,
            at: now,
            drones: vec![drone],
            what: format!("the aircraft of drone {drone} broke when it touched the ground"),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_aircraft_that_breaks_by_itself_breaks_the_rule() {
        let mut broken = Wrecks::default();
        broken.look(false);
        assert!(broken.check(Timestamp::ZERO, NodeId(0)).is_none());
        broken.look(true);
        assert!(broken.check(Timestamp::ZERO, NodeId(0)).is_some());
        let mut excused = Wrecks::default();
        excused.excuse();
        excused.look(true);
        assert!(excused.check(Timestamp::ZERO, NodeId(0)).is_none());
    }
}
