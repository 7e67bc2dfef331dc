use std::time::Duration;

use muster_machines::mission::{self, Liveness};
use muster_machines::routing;
use muster_transport::sim::{Access, Bursts, Config};

use crate::segments::UP_LOSS_MAX;

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
    /// Over how many hops a drone hears of a master that lives often enough; nothing where there is no such limit. Over
    /// more, drones miss a master that lives again and again, and no time to settle is promised.
    ///
    /// Flooding has one, as each hop passes on only the newest number that it has heard: those that pass get fewer hop by
    /// hop, and the pauses between them longer.
    pub hops_max: Option<u32>,
}

/// How unlikely it must be that something is not heard within the back-off, or that a master that lives is not heard of for
/// as long as a drone waits for that: as for a neighbour to be given up.
const ODDS: f64 = 1e-6;
/// The share of frames that is allowed for collisions, where radios share the medium.
const COLLISIONS: f64 = 0.1;
/// So many turns count as if they were no more: fewer hops are promised than could be.
const AWAITED_MAX: u32 = 200;
/// Pauses that are less likely count as none.
const PAUSE_ODDS_MIN: f64 = 1e-12;

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
            Liveness::Heartbeat => Duration::ZERO,
            Liveness::Thesis => mission.leg_limit,
        };
        let turn = routing.turn();
        let losses = Losses::worst(radio, collisions);
        let hops_max = routing
            .awaited_turns()
            .and_then(|turns| losses.hops_max(turns, turn, mission.layout.formation().drones()));
        Self {
            detection: routing.detection() + on_a_leg + mission.candidacy_back_off_max(),
            spreading: mission.spreading(),
            hop: routing.hop() + travel,
            back_off: turn * 2 * losses.tries(turn),
            hops_max,
        }
    }

    /// Whether a part of at most so many hops across is to have one master by then, and keep it.
    #[must_use]
    pub fn is_owed(&self, diameter: u32) -> bool {
        self.hops_max.is_none_or(|hops| diameter <= hops)
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
        let tries = (1..).zip(self.missed(turn));
        let mut enough = tries.skip_while(|(_, missed)| *missed > ODDS);
        enough.next().map_or(u32::MAX, |(tries, _)| tries)
    }

    /// The odds that nothing has got through after one turn, two, and so on.
    fn missed(self, turn: Duration) -> impl Iterator<Item = f64> {
        let (share, loss) = self.bursts.map_or((0.0, 0.0), |it| (it.share(), it.loss));
        // Where the link is in a burst, or is not.
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

    /// Over how many of at most `most` hops a number that rises with each turn is heard to rise at least once in `awaited`
    /// turns, but for odds of [`ODDS`]; nothing if over all.
    fn hops_max(self, awaited: u32, turn: Duration, most: u32) -> Option<u32> {
        let mut hops = (0..most).zip(self.unrisen(awaited, turn));
        hops.find(|(_, odds)| *odds > ODDS).map(|(hops, _)| hops)
    }

    /// The odds that a number that rises with each turn, and of which each hop passes on the newest that it has heard, does not
    /// rise in `awaited` turns: one hop away, two, and so on.
    ///
    /// Followed from the end of the line back to its start: what a drone says at an instant its neighbour said when it was
    /// heard last. The number has not risen between two instants if both lead back to the same frame.
    fn unrisen(self, awaited: u32, turn: Duration) -> impl Iterator<Item = f64> {
        let awaited = awaited.clamp(1, AWAITED_MAX) as usize;
        let missed: Vec<f64> = self.missed(turn).take(2 * awaited).collect();
        let before = std::iter::once(&1.0).chain(&missed);
        let heard_last = before.zip(&missed).map(|(before, after)| before - after);
        let pauses: Vec<f64> = heard_last
            .take_while(|odds| *odds > PAUSE_ODDS_MIN)
            .collect();
        // The odds that both are so many turns apart, and not yet the same frame; those farther apart count as the last.
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
    fn what_is_lost_more_often_is_said_more_often() {
        let tries = |loss| tries(loss, None);
        assert_eq!([0.0, 0.05, 0.2, 0.4].map(tries), [1, 5, 9, 16]);
    }

    fn hops_max(outside: f64, awaited: u32) -> Option<u32> {
        losing(outside).hops_max(awaited, TURN, 1_000)
    }

    #[test]
    fn a_number_that_each_hop_repeats_rises_too_seldom_beyond_some_hops() {
        assert_eq!(hops_max(0.0, 20), None, "each frame is heard");
        assert_eq!(hops_max(0.3, 20), Some(8));
        assert_eq!(hops_max(0.3, 11), Some(0), "0.3 to the 11th is 1.8e-6");
        assert!(hops_max(0.1, 20) > hops_max(0.3, 20) && hops_max(0.3, 20) > hops_max(0.4, 20));
        assert!(hops_max(0.3, 25) > hops_max(0.3, 20));
    }

    /// What a line of drones does that hear each other at random, without what the calculation supposes.
    #[test]
    fn how_often_it_does_not_rise_is_as_in_a_simulation() {
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
