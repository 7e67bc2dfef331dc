use std::time::Duration;

use muster_machines::mission::{self, Liveness};
use muster_machines::routing;
use muster_transport::sim::{Access, Config};

use crate::parts::UP_LOSS_MAX;

/// How long a swarm may take, once no link changes any more, until each part of it has its one master: detection +
/// 2 · diameter · hop + back-off.
///
/// Until whoever has lost its master has noticed; the word of it inwards and a claim outwards, however many claim; and
/// until what was lost on the way has been said so often that it got through. The last is also how long two parts take
/// at most to hear of each other that meet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Settling {
    /// How long a drone takes at most until it misses a master that is gone, and lands or claims to lead.
    pub detection: Duration,
    /// How much longer it takes while the swarm takes off or changes formation.
    pub spreading: Duration,
    /// How long news takes to a neighbour.
    pub hop: Duration,
    /// How long it takes at most until what is said at each turn has got through, and an answer that is, too.
    pub back_off: Duration,
}

/// How unlikely it must be that something is not heard within the back-off: as for a neighbour to be given up.
const ODDS: f64 = 1e-6;
/// The share of frames that is allowed for collisions, where radios share the medium.
const COLLISIONS: f64 = 0.1;

impl Settling {
    /// Of drones that are built with these two.
    pub(super) fn new(
        routing: &routing::Config,
        mission: &mission::Config,
        radio: &Config,
    ) -> Self {
        let (travel, collisions) = match radio.access {
            Access::Ideal { latency, jitter } => (latency + jitter, 0.0),
            Access::Csma { jitter, .. } => (jitter, COLLISIONS),
        };
        // The thesis's drones look only where they wait, which on a leg they don't.
        let on_a_leg = match mission.liveness {
            Liveness::Pulse => Duration::ZERO,
            Liveness::Thesis => mission.leg_limit,
        };
        Self {
            detection: routing.detection() + on_a_leg + mission.deference_max(),
            spreading: mission.spreading_patience,
            hop: routing.hop() + travel,
            back_off: routing.turn() * 2 * tries(worst_loss(radio).max(collisions)),
        }
    }

    /// For parts of at most so many hops across, which do not spread.
    #[must_use]
    pub fn time(&self, diameter: u32) -> Duration {
        self.detection + self.news(diameter)
    }

    /// How long it may take until all of such a part know what one of them says, and that they do.
    #[must_use]
    pub fn news(&self, diameter: u32) -> Duration {
        self.hop * 2 * diameter + self.back_off
    }
}

/// The share of frames that is lost at most on a link that is up.
fn worst_loss(radio: &Config) -> f64 {
    let range_m = radio.propagation.range_m();
    let lost = 1.0 - radio.propagation.delivery(range_m) * (1.0 - radio.loss);
    lost.min(UP_LOSS_MAX)
}

/// How often something must be said, of which that share is lost, to get through but for odds of [`ODDS`].
fn tries(loss: f64) -> u32 {
    let mut tries = 1;
    let mut missed = loss;
    while missed > ODDS {
        tries += 1;
        missed *= loss;
    }
    tries
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_lost_more_often_is_said_more_often() {
        assert_eq!([0.0, 0.05, 0.2, 0.4].map(tries), [1, 5, 9, 16]);
    }
}
