//! What a plan may hold.
//!
//! Every kind of fault is as likely as any other. It befalls at a time of the flight, at a waypoint, or upon an occasion;
//! a master, or any drone, or several at once; once, or several times; for a while, or for good. Links are those between two
//! drones or between two halves of the swarm.

use std::sync::Arc;
use std::time::Duration;

use muster_machines::identity::NodeId;
use muster_machines::node::Address;
use muster_machines::time::Timestamp;
use rand::seq::{IndexedRandom, SliceRandom};
use rand::{Rng, RngExt};

use crate::scenario::{
    Distortion, DroneFault, Fault, FaultKind, Link, Links, Scenario, Tampered, Target, Trigger,
    When,
};

/// A kind of fault, by the name that a scenario file has for it.
type Kind<R> = (&'static str, fn(&mut Drawing<'_, R>) -> FaultKind);

/// The shortest that a fault lasts which is over after a while, in milliseconds, and how often that is doubled at most:
/// half a minute. Each doubling is as likely.
const LASTS_MIN_MS: u64 = 50;
const LASTS_DOUBLINGS: u32 = 9;
/// How much later than an occasion a fault befalls, at most, in milliseconds.
const AFTER_MAX_MS: u64 = 4_000;
/// How often a fault befalls, at most.
const TIMES_MAX: u32 = 4;
/// The longest time from one to the next, in milliseconds.
const EVERY_MAX_MS: u64 = 6_000;
/// How much later frames may arrive, in milliseconds.
const LATE_MAX_MS: u64 = 100;
/// How many millionths a clock gains or loses, at most: a hundred times what a crystal does.
const PPM_MAX: i32 = 5_000;
/// The least and the largest share of frames that are lost, or tampered with.
const SHARE: (f64, f64) = (0.05, 1.0);

fn kinds<R: Rng>() -> [Kind<R>; 28] {
    [
        ("crash radio", |it| {
            it.affects(DroneFault::CrashActor(Address::Radio))
        }),
        ("crash routing", |it| {
            it.affects(DroneFault::CrashActor(Address::Routing))
        }),
        ("crash mission", |it| {
            it.affects(DroneFault::CrashActor(Address::Mission))
        }),
        ("crash navigation", |it| {
            it.affects(DroneFault::CrashActor(Address::Navigation))
        }),
        ("crash msp", |it| {
            it.affects(DroneFault::CrashActor(Address::Msp))
        }),
        ("hang radio", |it| {
            it.affects(DroneFault::Hang(Some(Address::Radio)))
        }),
        ("hang routing", |it| {
            it.affects(DroneFault::Hang(Some(Address::Routing)))
        }),
        ("hang mission", |it| {
            it.affects(DroneFault::Hang(Some(Address::Mission)))
        }),
        ("hang navigation", |it| {
            it.affects(DroneFault::Hang(Some(Address::Navigation)))
        }),
        ("hang msp", |it| {
            it.affects(DroneFault::Hang(Some(Address::Msp)))
        }),
        ("hang", |it| it.affects(DroneFault::Hang(None))),
        ("restart", |it| it.affects(DroneFault::Restart)),
        ("kill", |it| it.affects(DroneFault::Kill)),
        ("crash_aircraft", |it| it.affects(DroneFault::CrashAircraft)),
        ("lose_gps", |it| it.affects(DroneFault::LoseGps)),
        ("drain", |it| {
            let to = it.hundredths(0.0, 0.3);
            it.affects(DroneFault::Drain(to))
        }),
        ("replay", |it| it.affects(DroneFault::Replay)),
        ("forge", |it| it.affects(DroneFault::Forge)),
        ("skew", |it| {
            let ppm = it.rng.random_range(-PPM_MAX..=PPM_MAX);
            it.affects(DroneFault::Skew(ppm))
        }),
        ("cut", |it| FaultKind::Links(it.links(), Link::Cut)),
        ("one_way", |it| FaultKind::Links(it.links(), Link::OneWay)),
        ("degrade", |it| {
            let loss = it.hundredths(SHARE.0, SHARE.1);
            FaultKind::Links(it.links(), Link::Degraded(loss))
        }),
        ("heal", |it| FaultKind::Links(it.links(), Link::Healed)),
        ("jam", |it| it.disc()),
        ("corrupt", |it| it.tampers(Distortion::Corrupt)),
        ("duplicate", |it| it.tampers(Distortion::Duplicate)),
        ("delay", |it| {
            let by = it.milliseconds(1..=LATE_MAX_MS);
            it.tampers(Distortion::Delay(by))
        }),
        ("reorder", |it| {
            let by = it.milliseconds(1..=LATE_MAX_MS);
            it.tampers(Distortion::Reorder(by))
        }),
    ]
}

/// The kinds of faults that there are.
pub(super) fn names() -> impl Iterator<Item = &'static str> {
    kinds::<rand_chacha::ChaCha8Rng>()
        .into_iter()
        .map(|(name, _)| name)
}

/// Draws from one to `most` faults for a scenario. Times are whole milliseconds, so that a file says them exactly.
pub(super) fn draw<R: Rng>(scenario: &Scenario, most: u32, rng: &mut R) -> Vec<Fault> {
    let mut drawing = Drawing {
        nodes: scenario.plan.nodes(),
        scenario,
        rng,
    };
    let number = drawing.rng.random_range(1..=most) as usize;
    let mut faults = Vec::with_capacity(number);
    while faults.len() < number {
        let fault = drawing.fault();
        faults.push(fault.clone());
        let FaultKind::Drone(_, what) = fault.kind else {
            continue;
        };
        while faults.len() < number && drawing.rng.random_ratio(1, 3) {
            let kind = FaultKind::Drone(Target::Drone(drawing.node()), what);
            let fault = fault.clone();
            faults.push(Fault { kind, ..fault });
        }
    }
    faults
}

struct Drawing<'a, R> {
    scenario: &'a Scenario,
    nodes: u32,
    rng: &'a mut R,
}

impl<R: Rng> Drawing<'_, R> {
    fn fault(&mut self) -> Fault {
        let (_, kind) = kinds().choose(self.rng).copied().expect("there are kinds");
        let kind = kind(self);
        let lasts = kind.can_last() && self.rng.random_ratio(4, 5);
        let lasts = lasts.then(|| self.length());
        let repeats = self.rng.random_ratio(1, 8);
        let (times, every) = if repeats {
            let times = self.rng.random_range(2..=TIMES_MAX);
            (times, self.milliseconds(100..=EVERY_MAX_MS))
        } else {
            (1, Duration::ZERO)
        };
        Fault {
            when: self.when(),
            kind,
            lasts,
            times,
            every,
        }
    }

    fn when(&mut self) -> When {
        let waypoints = u16::try_from(self.scenario.plan.waypoints.len()).unwrap_or(u16::MAX);
        let trigger = match self.rng.random_range(0..10) {
            0 => Trigger::TakingOff,
            1 => Trigger::Elected,
            2 => Trigger::Settled,
            3 => Trigger::Landing,
            4 | 5 => Trigger::Waypoint(self.rng.random_range(0..waypoints.max(1))),
            _ => {
                let flight = self.scenario.plan.limits.flight.as_millis();
                let at = self.milliseconds(0..=u64::try_from(flight).unwrap_or(u64::MAX));
                return When::At(Timestamp::ZERO + at);
            }
        };
        let at_once = self.rng.random_ratio(1, 3);
        let after = if at_once {
            Duration::ZERO
        } else {
            self.milliseconds(1..=AFTER_MAX_MS)
        };
        When::After(trigger, after)
    }

    fn affects(&mut self, fault: DroneFault) -> FaultKind {
        let target = if self.rng.random_ratio(2, 5) {
            Target::Master
        } else {
            Target::Drone(self.node())
        };
        FaultKind::Drone(target, fault)
    }

    fn tampers(&mut self, how: Distortion) -> FaultKind {
        let from = self.rng.random_ratio(1, 2).then(|| self.node());
        let share = self.hundredths(SHARE.0, SHARE.1);
        FaultKind::Tamper(Tampered { from, share, how })
    }

    /// The links between two drones or two halves; a swarm of one has none.
    fn links(&mut self) -> Links {
        let mut ids: Vec<_> = (0..self.nodes).map(NodeId).collect();
        if self.rng.random_ratio(1, 2) {
            ids.shuffle(self.rng);
            ids.truncate(2);
        } else if self.rng.random_ratio(1, 2) {
            ids.shuffle(self.rng);
        }
        let near = self.rng.random_range(1..ids.len().max(2)).min(ids.len());
        let mut far = ids.split_off(near);
        ids.sort_unstable();
        far.sort_unstable();
        Links {
            from: Arc::from(ids),
            to: Arc::from(far),
        }
    }

    /// A disc around a drone's slot at a waypoint.
    fn disc(&mut self) -> FaultKind {
        let waypoint =
            *(self.scenario.plan.waypoints.choose(self.rng)).expect("a mission has some");
        let drones = self.scenario.plan.layout.formation().drones();
        let id = NodeId(self.rng.random_range(0..drones));
        let mut centre = self
            .scenario
            .plan
            .layout
            .slot(id, waypoint)
            .at_altitude(0.0);
        centre.0 = centre.0.map(f64::round);
        let range_m = self.scenario.radio.propagation.range_m();
        FaultKind::Jam {
            centre,
            radius_m: self.rng.random_range(10.0..=range_m.max(20.0)).round(),
        }
    }

    fn node(&mut self) -> NodeId {
        NodeId(self.rng.random_range(0..self.nodes))
    }

    fn length(&mut self) -> Duration {
        let least = LASTS_MIN_MS << self.rng.random_range(0..LASTS_DOUBLINGS);
        self.milliseconds(least..=least * 2)
    }

    fn milliseconds(&mut self, range: std::ops::RangeInclusive<u64>) -> Duration {
        Duration::from_millis(self.rng.random_range(range))
    }

    /// A number of hundredths.
    fn hundredths(&mut self, least: f64, most: f64) -> f64 {
        (self.rng.random_range(least..=most) * 100.0).round() / 100.0
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::scenario::{self, written};

    fn chaos() -> (std::path::PathBuf, Scenario) {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("chaos.toml");
        let scenario = scenario::load(&path, &[]).unwrap();
        (path, scenario)
    }

    #[test]
    fn every_kind_is_drawn_and_bears_the_name_that_it_has() {
        let (_, scenario) = chaos();
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for (name, kind) in kinds() {
            let mut drawing = Drawing {
                nodes: scenario.plan.nodes(),
                scenario: &scenario,
                rng: &mut rng,
            };
            assert_eq!(kind(&mut drawing).name(), name);
        }
    }

    #[test]
    fn a_file_says_what_was_drawn() {
        let (path, scenario) = chaos();
        let text = std::fs::read_to_string(&path).unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        for _ in 0..300 {
            let faults = draw(&scenario, 6, &mut rng);
            let mission = "missions/yard.waypoints";
            let written = written((&path, &text), &[], &faults, mission).unwrap();
            let read = scenario::load_from(&path, &[], &|file| {
                if file == path {
                    Ok(written.clone())
                } else {
                    muster_runtime::diagnostic::read_text(file)
                }
            });
            assert_eq!(read.unwrap().faults, faults);
        }
    }
}
