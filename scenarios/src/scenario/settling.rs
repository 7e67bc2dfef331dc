use std::time::Duration;

use muster_machines::mission::{self, Liveness};
use muster_machines::routing;
use muster_transport::sim::{Access, Bursts, Config};

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
        let turn = routing.turn();
        Self {
            detection: routing.detection() + on_a_leg + mission.deference_max(),
            spreading: mission.spreading_patience,
            hop: routing.hop() + travel,
            back_off: turn * 2 * Losses::worst(radio, collisions).tries(turn),
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

/// What a link that is up loses at most.
#[derive(Debug, Clone, Copy)]
struct Losses {
    /// The share of frames that is lost outside of bursts.
    outside: f64,
    bursts: Option<Bursts>,
}

impl Losses {
    /// At the range of the radio, with at least that share for collisions. The mean of a link that is up, bursts included, is
    /// at most [`UP_LOSS_MAX`].
    fn worst(radio: &Config, collisions: f64) -> Self {
        // Where bursts alone lose more, no link is up.
        let bursts = radio.bursts.filter(|it| it.mean_loss() <= UP_LOSS_MAX);
        let in_bursts = bursts.map_or(0.0, |it| it.mean_loss());
        let range_m = radio.propagation.range_m();
        let lost = 1.0 - radio.propagation.delivery(range_m) * (1.0 - radio.loss);
        let outside_max = 1.0 - (1.0 - UP_LOSS_MAX) / (1.0 - in_bursts);
        let outside = lost.max(collisions).min(outside_max);
        Self { outside, bursts }
    }

    /// How often something must be said, once in each `turn`, to get through but for odds of [`ODDS`].
    fn tries(self, turn: Duration) -> u32 {
        let (share, loss) = self.bursts.map_or((0.0, 0.0), |it| (it.share(), it.loss));
        // The odds that nothing has got through and the link is in a burst, or is not.
        let (mut in_burst, mut clear) = (share, 1.0 - share);
        let mut tries = 0;
        loop {
            tries += 1;
            clear *= self.outside;
            in_burst *= 1.0 - (1.0 - self.outside) * (1.0 - loss);
            let missed = clear + in_burst;
            if missed <= ODDS {
                return tries;
            }
            if let Some(bursts) = self.bursts {
                in_burst = missed * bursts.share_after(in_burst / missed, turn);
                clear = missed - in_burst;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TURN: Duration = Duration::from_millis(100);

    fn tries(outside: f64, bursts: Option<Bursts>) -> u32 {
        Losses { outside, bursts }.tries(TURN)
    }

    #[test]
    fn what_is_lost_more_often_is_said_more_often() {
        let tries = |loss| tries(loss, None);
        assert_eq!([0.0, 0.05, 0.2, 0.4].map(tries), [1, 5, 9, 16]);
    }

    #[test]
    fn longer_bursts_take_more_tries_at_the_same_mean_loss() {
        let tries = |burst_ms| {
            let length = Duration::from_millis(burst_ms);
            let bursts = Bursts {
                every: length * 19,
                length,
                loss: 1.0,
            };
            tries(0.0, Some(bursts))
        };
        assert_eq!(tries(10), 5, "as a loss of 0.05: no burst lasts a turn");
        // By hand: 0.05 · exp(-0.1 · tries) is 1e-6 after 108.
        assert!((95..=120).contains(&tries(1_000)), "{}", tries(1_000));
    }
}
