//! Events that introduce a link that starts to a port that is open already.

use std::time::Duration;

use muster_msp::{Identity, Status, Telemetry as MspTelemetry};

use super::PortEvent;
use super::controller::{LOST_AFTER, Stage};
use crate::time::Timestamp;

/// Longest age of a status for new links. A link that runs sends RC for a second of silence, and so does one that takes over from
/// it; the newest status is older than the newest answer by up to three of its periods of 160 ms.
const STATUS_MAX: Duration = LOST_AFTER.saturating_add(Duration::from_millis(500));

/// What a port has reported of its controller. The owner of a port keeps one beside it.
#[derive(Debug, Default)]
pub struct Introduction {
    /// Who it is, and the stage that is granted with it.
    identity: Option<(Box<Identity>, Stage)>,
    /// The two newest statuses; a link believes what both report.
    statuses: [Option<(Timestamp, Status)>; 2],
}

impl Introduction {
    /// An event of the port is on its way to the link.
    pub fn take(&mut self, now: Timestamp, event: &PortEvent) {
        match event {
            PortEvent::Identified { identity, granted } => {
                *self = Self {
                    identity: Some((identity.clone(), *granted)),
                    statuses: [None, None],
                }
            }
            PortEvent::Closed => *self = Self::default(),
            PortEvent::Telemetry(MspTelemetry::Status(status)) => {
                self.statuses.rotate_left(1);
                self.statuses[1] = Some((now, status.clone()));
            }
            PortEvent::Telemetry(_)
            | PortEvent::Pose(_)
            | PortEvent::Flow(_)
            | PortEvent::Autopilot(_) => {}
        }
    }

    /// Events for a link that has just started: who the controller is, and its newest statuses, so that the link gives RC
    /// before the next one. Empty if the controller is not known.
    pub fn events(&self, now: Timestamp) -> impl Iterator<Item = PortEvent> + use<> {
        let identity = self.identity.clone();
        let is_fresh = |at: &Timestamp| self.identity.is_some() && now.since(*at) < STATUS_MAX;
        let fresh = self
            .statuses
            .iter()
            .flatten()
            .filter(|(at, _)| is_fresh(at));
        let statuses: Vec<_> = fresh
            .map(|(_, status)| PortEvent::Telemetry(MspTelemetry::Status(status.clone())))
            .collect();
        identity
            .map(|(identity, granted)| PortEvent::Identified { identity, granted })
            .into_iter()
            .chain(statuses)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(milliseconds: u64) -> Timestamp {
        Timestamp::from_nanos(milliseconds * 1_000_000)
    }

    fn status() -> PortEvent {
        PortEvent::Telemetry(MspTelemetry::Status(Status::default()))
    }

    fn identified() -> PortEvent {
        PortEvent::Identified {
            identity: Box::default(),
            granted: Stage::Tethered,
        }
    }

    #[test]
    fn new_link_gets_the_identity_behind_an_open_port_and_its_fresh_statuses() {
        let mut introduction = Introduction::default();
        introduction.take(at(0), &status());
        assert_eq!(introduction.events(at(0)).count(), 0, "no identity");
        introduction.take(at(10), &identified());
        assert!(introduction.events(at(10)).eq([identified()]));
        introduction.take(at(20), &status());
        let both = [identified(), status()];
        assert!(introduction.events(at(100)).eq(both));
        introduction.take(at(110), &status());
        introduction.take(at(120), &status());
        let all = [identified(), status(), status()];
        assert!(introduction.events(at(130)).eq(all), "the two newest");
        assert!(introduction.events(at(1_620)).eq([identified()]), "stale");
        introduction.take(at(1_630), &PortEvent::Closed);
        assert_eq!(introduction.events(at(1_630)).count(), 0);
    }
}
