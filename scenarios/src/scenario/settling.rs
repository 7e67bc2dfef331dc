use std::time::Duration;

use muster_machines::mission::{self, Liveness};
use muster_machines::routing;
use muster_transport::sim::{Access, Bursts, Config};

use crate::segments::UP_LOSS_MAX;

/// Worst-case time until each segment has one master, once no link changes any more: detection + 2 · diameter · hop +
/// retransmission.
///
/// Detection ends when every drone that lost its master has noticed. Then a report goes inwards and a claim outwards, each over
/// the diameter. Retransmission ends when lost frames were repeated often enough to be received. It is also the time in which
/// two segments that meet hear of each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Settling {
    /// Longest time until a drone misses a lost master, and lands or claims leadership.
    pub detection: Duration,
    /// Additional detection time during take-off and changes of formation.
    pub spreading: Duration,
    /// Time of an announcement to a neighbour.
    pub hop: Duration,
    /// Longest time until a frame that is repeated each period was received, and so was its answer.
    pub retransmission: Duration,
    /// Most hops over which heartbeats arrive often enough; `None` without such a limit. Drones beyond miss a live master again
    /// and again, and there is no bound.
    ///
    /// Policy `flood` has a limit: each hop forwards only the newest heartbeat that it has received, so that fewer arrive per
    /// hop, with longer pauses.
    pub hops_max: Option<u32>,
    /// Longest delay of a frame that the protocol puts up with; a link with longer ones counts as grey.
    pub tolerated_delay: Duration,
}

/// Accepted probability that a frame is not received within the retransmission time, or that a drone misses a live master; as
/// for a lost neighbour.
const ODDS: f64 = 1e-6;
/// Share of frames assumed to collide on a shared medium.
const COLLISIONS: f64 = 0.1;
/// Most periods that are counted; more are taken as this many, which promises fewer hops.
const AWAITED_MAX: u32 = 200;
/// Pauses that are less likely are ignored.
const PAUSE_ODDS_MIN: f64 = 1e-12;

impl Settling {
    /// Of drones with these configurations.
    pub(super) fn new(
        routing: &routing::Config,
        mission: &mission::Config,
        radio: &Config,
    ) -> Self {
        let (travel, collisions) = match radio.access {
            Access::Ideal { latency, jitter } => (latency + jitter, 0.0),
            Access::Csma { jitter, .. } => (jitter, COLLISIONS),
        };
        // The thesis's drones check at waypoints only, not on a leg.
        let on_a_leg = match mission.liveness {
            Liveness::Heartbeat => Duration::ZERO,
            Liveness::Thesis => mission.leg_limit,
        };
        let turn = routing.silence_max();
        let losses = Losses::worst(radio, collisions);
        let hops_max = routing
            .periods_to_timeout()
            .and_then(|turns| losses.hops_max(turns, turn, mission.layout.formation().drones()));
        Self {
            detection: routing.detection_max() + on_a_leg + mission.candidacy_back_off_max(),
            spreading: mission.spreading(),
            hop: routing.hop_latency() + travel,
            retransmission: turn * 2 * losses.tries(turn),
            hops_max,
            tolerated_delay: routing.tolerated_delay(),
        }
    }

    /// Whether the bound holds for a segment of this diameter, in hops.
    #[must_use]
    pub fn applies_to(&self, diameter: u32) -> bool {
        self.hops_max.is_none_or(|hops| diameter <= hops)
    }

    /// The bound for segments of at most this diameter, in hops; without `spreading`.
    #[must_use]
    pub fn time(&self, diameter: u32) -> Duration {
        self.detection + self.propagation(diameter)
    }

    /// Longest time until all of such a segment know an announcement, and its sender knows that they do.
    #[must_use]
    pub fn propagation(&self, diameter: u32) -> Duration {
        self.hop * 2 * diameter + self.retransmission
    }
}

/// Most losses of a link that is up.
#[derive(Debug, Clone, Copy)]
struct Losses {
    /// Share of frames lost outside of bursts.
    outside: f64,
    bursts: Option<Bursts>,
}

impl Losses {
    /// The losses at the range of the radio, at least `collisions`. The mean of a link that is up, bursts included, is at most
    /// [`UP_LOSS_MAX`].
    fn worst(radio: &Config, collisions: f64) -> Self {
        // If bursts alone lose more, no link is up.
        let bursts = radio.bursts.filter(|it| it.mean_loss() <= UP_LOSS_MAX);
        let in_bursts = bursts.map_or(0.0, |it| it.mean_loss());
        let range_m = radio.propagation.range_m();
        let lost = 1.0 - radio.propagation.delivery(range_m) * (1.0 - radio.loss);
        let outside_max = 1.0 - (1.0 - UP_LOSS_MAX) / (1.0 - in_bursts);
        let outside = lost.max(collisions).min(outside_max);
        Self { outside, bursts }
    }

    /// Number of frames, one each `turn`, of which at least one is received, except with probability [`ODDS`].
    fn tries(self, turn: Duration) -> u32 {
        let tries = (1..).zip(self.missed(turn));
        let mut enough = tries.skip_while(|(_, missed)| *missed > ODDS);
        enough.next().map_or(u32::MAX, |(tries, _)| tries)
    }

    /// The probabilities that no frame was received after one turn, two, and so on.
    fn missed(self, turn: Duration) -> impl Iterator<Item = f64> {
        let (share, loss) = self.bursts.map_or((0.0, 0.0), |it| (it.share(), it.loss));
        // The states in which none was received: in a burst, and outside.
        let (mut in_burst, mut clear) = (share, 1.0 - share);
        std::iter::from_fn(move || {
            clear *= self.outside;
            in_burst *= 1.0 - (1.0 - self.outside) * (1.0 - loss);
            let missed = clear + in_burst;
            if let Some(bursts) = self.bursts.filter(|_| missed > 0.0) {
                in_burst = missed * bursts.share_after(in_burst / missed, turn);
                clear = missed - in_burst;
            }
            Some(missed)
        })
    }

    /// Most hops, below `most`, over which a number that rises each turn is seen to rise within `awaited` turns, except with
    /// probability [`ODDS`]. `None` if there is no limit below `most`.
    fn hops_max(self, awaited: u32, turn: Duration, most: u32) -> Option<u32> {
        let mut hops = (0..most).zip(self.unrisen(awaited, turn));
        hops.find(|(_, odds)| *odds > ODDS).map(|(hops, _)| hops)
    }

    /// The probabilities that a number that rises each turn, and of which each hop forwards the newest, does not rise within
    /// `awaited` turns: one hop away, two, and so on.
    ///
    /// Followed from the end of the line back to its start: a drone's number at an instant is its neighbour's number at the last
    /// reception. The number has not risen between two instants if both lead back to the same frame.
    fn unrisen(self, awaited: u32, turn: Duration) -> impl Iterator<Item = f64> {
        let awaited = awaited.clamp(1, AWAITED_MAX) as usize;
        let missed: Vec<f64> = self.missed(turn).take(2 * awaited).collect();
        let before = std::iter::once(&1.0).chain(&missed);
        let heard_last = before.zip(&missed).map(|(before, after)| before - after);
        let pauses: Vec<f64> = heard_last
            .take_while(|odds| *odds > PAUSE_ODDS_MIN)
            .collect();
        // The probabilities that both are this many turns apart and not yet the same frame; the last includes all beyond.
        let mut apart = vec![0.0; 2 * awaited + 1];
        apart[awaited] = 1.0;
        let mut unrisen = 0.0;
        std::iter::from_fn(move || {
            let mut later_back = vec![0.0; apart.len()];
            for (turns, odds) in apart.iter().enumerate().skip(1) {
                unrisen += odds * missed[turns - 1];
                for (ago, pause) in pauses.iter().enumerate().take(turns) {
                    later_back[turns - ago] += odds * pause;
                }
            }
            apart.fill(0.0);
            for (turns, odds) in later_back.iter().enumerate() {
                for (ago, pause) in pauses.iter().enumerate() {
                    apart[(turns + ago).min(2 * awaited)] += odds * pause;
                }
            }
            Some(unrisen)
        })
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt as _, SeedableRng as _};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    const TURN: Duration = Duration::from_millis(100);

    fn tries(outside: f64, bursts: Option<Bursts>) -> u32 {
        Losses { outside, bursts }.tries(TURN)
    }

    /// Without bursts.
    const fn losing(outside: f64) -> Losses {
        Losses {
            outside,
            bursts: None,
        }
    }

    #[test]
    fn higher_loss_takes_more_tries() {
        let tries = |loss| tries(loss, None);
        assert_eq!([0.0, 0.05, 0.2, 0.4].map(tries), [1, 5, 9, 16]);
    }

    fn hops_max(outside: f64, awaited: u32) -> Option<u32> {
        losing(outside).hops_max(awaited, TURN, 1_000)
    }

    #[test]
    fn forwarded_number_has_a_limit_of_hops() {
        assert_eq!(hops_max(0.0, 20), None, "no losses");
        assert_eq!(hops_max(0.3, 20), Some(8));
        assert_eq!(hops_max(0.3, 11), Some(0), "0.3 to the 11th is 1.8e-6");
        assert!(hops_max(0.1, 20) > hops_max(0.3, 20) && hops_max(0.3, 20) > hops_max(0.4, 20));
        assert!(hops_max(0.3, 25) > hops_max(0.3, 20));
    }

    /// Simulates a line of drones with random losses, without the assumptions of the calculation.
    #[test]
    fn probability_of_no_rise_matches_a_simulation() {
        let (loss, awaited, hops) = (0.3, 8, 6);
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let (mut numbers, mut rose_at) = (vec![0_u32; hops + 1], 0);
        let (turns, mut unrisen) = (300_000, 0);
        for turn in 1..=turns {
            numbers[0] = turn;
            for hop in (1..=hops).rev() {
                if random.random_bool(1.0 - loss) && numbers[hop] != numbers[hop - 1] {
                    numbers[hop] = numbers[hop - 1];
                    if hop == hops {
                        rose_at = turn;
                    }
                }
            }
            unrisen += u32::from(turn - rose_at >= awaited);
        }
        let simulated = f64::from(unrisen) / f64::from(turns);
        let mut calculated = losing(loss).unrisen(awaited, TURN);
        let calculated = calculated.nth(hops - 1).unwrap();
        assert!(
            (calculated / simulated - 1.0).abs() < 0.1,
            "{calculated} {simulated}"
        );
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
