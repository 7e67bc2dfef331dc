//! Random fault plans.
//!
//! All kinds of faults that the vehicles can have are equally likely. A fault is injected at a time, at a waypoint or on a
//! trigger. It hits the master, any drone, or several drones at once; once or repeatedly; for a limited time or for good.
//! Link faults affect the links between two drones or between two groups of drones.

use std::sync::Arc;
use std::time::Duration;

use muster_machines::identity::NodeId;
use muster_machines::msp::controller::Receiver;
use muster_machines::node::Address;
use muster_machines::time::Timestamp;
use muster_runtime::plan::Plan;
use muster_runtime::vehicle::VehicleKind;
use muster_scenarios::scenario::{
    ControllerFault, Distortion, DroneFault, Fault, FaultKind, LinkFault, Links, Scenario,
    Tampered, Target, Trigger, When,
};
use rand::seq::{IndexedRandom, SliceRandom};
use rand::{Rng, RngExt};

/// A kind of fault: its name in scenario files, and a function that draws one.
type Kind<R> = (&'static str, fn(&mut Generator<'_, R>) -> FaultKind);

/// Shortest duration of a temporary fault, in milliseconds, and maximum number of doublings (up to half a minute). All
/// doublings are equally likely.
const DURATION_MIN_MS: u64 = 50;
const DURATION_DOUBLINGS: u32 = 9;
/// Maximum delay of a fault after its trigger, in milliseconds.
const AFTER_MAX_MS: u64 = 4_000;
/// Maximum number of injections of a fault.
const TIMES_MAX: u32 = 4;
/// Maximum time between injections, in milliseconds.
const EVERY_MAX_MS: u64 = 6_000;
/// Maximum delay of frames, in milliseconds.
const DELAY_MAX_MS: u64 = 100;
/// Maximum clock drift, in ppm: a hundred times that of a crystal.
const PPM_MAX: i32 = 5_000;
/// Range of the share of frames that are lost or tampered with.
const SHARE: (f64, f64) = (0.05, 1.0);

/// Range of the share of bytes that are lost or altered.
const BYTES: (f64, f64) = (0.001, 0.2);
/// Range of the share of thrust that is lost. Of more than half of it no aircraft lands whole.
const THRUST: (f64, f64) = (0.05, 0.6);
/// Range of the vibration, in °/s: Betaflight's motors tremble beyond some 20.
const SHAKE_DPS: (f64, f64) = (1.0, 25.0);
/// Range of the voltage that a battery loses: a pack of four cells has 16.8 V.
const SAG_V: (f64, f64) = (0.1, 4.0);

/// The kinds of faults that happen to the vehicles of a plan.
fn kinds_for<R: Rng>(plan: &Plan) -> impl Iterator<Item = Kind<R>> {
    let own = match plan.vehicle_kind {
        VehicleKind::ClosedForm => Vec::new(),
        VehicleKind::Msp => controller_kinds().to_vec(),
    };
    let (vehicle, receiver) = (plan.vehicle_kind, plan.receiver);
    let all = kinds().into_iter().chain(own);
    all.filter(move |(name, _)| match *name {
        "drain" => vehicle != VehicleKind::Msp,
        "take-over" => receiver == Receiver::Override,
        _ => true,
    })
}

/// Faults of flight controllers.
fn controller_kinds<R: Rng>() -> [Kind<R>; 9] {
    [
        ("freeze-controller", |it| {
            it.on_controller(ControllerFault::Freeze)
        }),
        ("close-port", |it| {
            it.on_controller(ControllerFault::ClosePort)
        }),
        ("lose-bytes", |it| {
            let share = it.thousandths(BYTES);
            it.on_controller(ControllerFault::LoseBytes(share))
        }),
        ("corrupt-bytes", |it| {
            let share = it.thousandths(BYTES);
            it.on_controller(ControllerFault::CorruptBytes(share))
        }),
        ("delay-bytes", |it| {
            let by = it.milliseconds(1..=DELAY_MAX_MS);
            it.on_controller(ControllerFault::DelayBytes(by))
        }),
        ("sag-battery", |it| {
            let volts = it.thousandths(SAG_V);
            it.on_controller(ControllerFault::SagBattery(volts))
        }),
        ("weaken-motor", |it| {
            let share = it.thousandths(THRUST);
            let motor = it.rng.random_ratio(1, 2);
            let motor = motor.then(|| it.rng.random_range(1..=4));
            it.on_controller(ControllerFault::WeakenMotor(motor, share))
        }),
        ("shake", |it| {
            let dps = it.thousandths(SHAKE_DPS);
            it.on_controller(ControllerFault::Shake(dps))
        }),
        ("take-over", |it| {
            it.on_controller(ControllerFault::TakeOver)
        }),
    ]
}

fn kinds<R: Rng>() -> [Kind<R>; 28] {
    [
        ("crash-actor radio", |it| {
            it.on_drone(DroneFault::CrashActor(Address::Radio))
        }),
        ("crash-actor routing", |it| {
            it.on_drone(DroneFault::CrashActor(Address::Routing))
        }),
        ("crash-actor mission", |it| {
            it.on_drone(DroneFault::CrashActor(Address::Mission))
        }),
        ("crash-actor navigation", |it| {
            it.on_drone(DroneFault::CrashActor(Address::Navigation))
        }),
        ("crash-actor msp", |it| {
            it.on_drone(DroneFault::CrashActor(Address::Msp))
        }),
        ("hang radio", |it| {
            it.on_drone(DroneFault::Hang(Some(Address::Radio)))
        }),
        ("hang routing", |it| {
            it.on_drone(DroneFault::Hang(Some(Address::Routing)))
        }),
        ("hang mission", |it| {
            it.on_drone(DroneFault::Hang(Some(Address::Mission)))
        }),
        ("hang navigation", |it| {
            it.on_drone(DroneFault::Hang(Some(Address::Navigation)))
        }),
        ("hang msp", |it| {
            it.on_drone(DroneFault::Hang(Some(Address::Msp)))
        }),
        ("hang", |it| it.on_drone(DroneFault::Hang(None))),
        ("restart", |it| it.on_drone(DroneFault::Restart)),
        ("kill", |it| it.on_drone(DroneFault::Kill)),
        ("crash-aircraft", |it| {
            it.on_drone(DroneFault::CrashAircraft)
        }),
        ("lose-gps", |it| it.on_drone(DroneFault::LoseGps)),
        ("drain", |it| {
            let to = it.hundredths(0.0, 0.3);
            it.on_drone(DroneFault::Drain(to))
        }),
        ("replay", |it| it.on_drone(DroneFault::Replay)),
        ("forge", |it| it.on_drone(DroneFault::Forge)),
        ("skew", |it| {
            let ppm = it.rng.random_range(-PPM_MAX..=PPM_MAX);
            it.on_drone(DroneFault::Skew(ppm))
        }),
        ("cut", |it| FaultKind::Links(it.links(), LinkFault::Cut)),
        ("one-way", |it| {
            FaultKind::Links(it.links(), LinkFault::OneWay)
        }),
        ("degrade", |it| {
            let loss = it.hundredths(SHARE.0, SHARE.1);
            FaultKind::Links(it.links(), LinkFault::Degraded(loss))
        }),
        ("heal", |it| FaultKind::Links(it.links(), LinkFault::Healed)),
        ("jam", |it| it.jamming()),
        ("corrupt", |it| it.tampering(Distortion::Corrupt)),
        ("duplicate", |it| it.tampering(Distortion::Duplicate)),
        ("delay", |it| {
            let by = it.milliseconds(1..=DELAY_MAX_MS);
            it.tampering(Distortion::Delay(by))
        }),
        ("reorder", |it| {
            let by = it.milliseconds(1..=DELAY_MAX_MS);
            it.tampering(Distortion::Reorder(by))
        }),
    ]
}

/// Names of all kinds of faults.
pub(super) fn names() -> impl Iterator<Item = &'static str> {
    let all = kinds::<rand_chacha::ChaCha8Rng>().into_iter();
    all.chain(controller_kinds()).map(|(name, _)| name)
}

/// Draws one to `max` faults for a scenario. Times are whole milliseconds, so that files hold them exactly.
pub(super) fn draw<R: Rng>(scenario: &Scenario, max: u32, rng: &mut R) -> Vec<Fault> {
    let mut generator = Generator {
        nodes: scenario.plan.nodes(),
        scenario,
        rng,
    };
    let number = generator.rng.random_range(1..=max) as usize;
    let mut faults = Vec::with_capacity(number);
    while faults.len() < number {
        let fault = generator.fault();
        faults.push(fault.clone());
        let FaultKind::Drone(_, what) = fault.kind else {
            continue;
        };
        while faults.len() < number && generator.rng.random_ratio(1, 3) {
            let kind = FaultKind::Drone(Target::Drone(generator.node()), what);
            let fault = fault.clone();
            faults.push(Fault { kind, ..fault });
        }
    }
    faults
}

struct Generator<'a, R> {
    scenario: &'a Scenario,
    nodes: u32,
    rng: &'a mut R,
}

impl<R: Rng> Generator<'_, R> {
    fn fault(&mut self) -> Fault {
        let kinds: Vec<Kind<R>> = kinds_for(&self.scenario.plan).collect();
        let (_, kind) = (kinds.choose(self.rng)).expect("the list of kinds is not empty");
        let kind = kind(self);
        let lasts = kind.can_end() && self.rng.random_ratio(4, 5);
        let lasts = lasts.then(|| self.duration());
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
            duration: lasts,
            times,
            every,
        }
    }

    fn when(&mut self) -> When {
        let plan = &self.scenario.plan;
        let waypoints = match plan.follow {
            // It reaches no other.
            Some(_) => 1,
            None => u16::try_from(plan.waypoints.len()).unwrap_or(u16::MAX),
        };
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

    fn on_drone(&mut self, fault: DroneFault) -> FaultKind {
        let target = if self.rng.random_ratio(2, 5) {
            Target::Master
        } else {
            Target::Drone(self.node())
        };
        FaultKind::Drone(target, fault)
    }

    fn on_controller(&mut self, fault: ControllerFault) -> FaultKind {
        self.on_drone(DroneFault::Controller(fault))
    }

    fn tampering(&mut self, how: Distortion) -> FaultKind {
        let from = self.rng.random_ratio(1, 2).then(|| self.node());
        let share = self.hundredths(SHARE.0, SHARE.1);
        FaultKind::Tamper(Tampered { from, share, how })
    }

    /// Links between two drones or two groups; empty for a swarm of one.
    fn links(&mut self) -> Links {
        let mut ids: Vec<_> = (0..self.nodes).map(NodeId).collect();
        if self.rng.random_ratio(1, 2) {
            ids.shuffle(self.rng);
            ids.truncate(2);
        } else if self.rng.random_ratio(1, 2) {
            ids.shuffle(self.rng);
        }
        let first = self.rng.random_range(1..ids.len().max(2)).min(ids.len());
        let mut far = ids.split_off(first);
        ids.sort_unstable();
        far.sort_unstable();
        Links {
            from: Arc::from(ids),
            to: Arc::from(far),
        }
    }

    /// Jamming in a disc around a drone's slot at a waypoint.
    fn jamming(&mut self) -> FaultKind {
        let waypoint =
            *(self.scenario.plan.waypoints.choose(self.rng)).expect("a mission has waypoints");
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

    fn duration(&mut self) -> Duration {
        let least = DURATION_MIN_MS << self.rng.random_range(0..DURATION_DOUBLINGS);
        self.milliseconds(least..=least * 2)
    }

    fn milliseconds(&mut self, range: std::ops::RangeInclusive<u64>) -> Duration {
        Duration::from_millis(self.rng.random_range(range))
    }

    /// A number with three decimals.
    fn thousandths(&mut self, (least, most): (f64, f64)) -> f64 {
        (self.rng.random_range(least..=most) * 1_000.0).round() / 1_000.0
    }

    /// A number with two decimals.
    fn hundredths(&mut self, least: f64, most: f64) -> f64 {
        (self.rng.random_range(least..=most) * 100.0).round() / 100.0
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use muster_scenarios::scenario::{self, written};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;

    fn search(name: &str) -> (std::path::PathBuf, Scenario) {
        let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/..")).join(name);
        let scenario = scenario::load(&path, &[]).unwrap();
        (path, scenario)
    }

    #[test]
    fn every_kind_is_drawn_with_its_name() {
        let (_, scenario) = search("chaos.toml");
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for (name, kind) in kinds().into_iter().chain(controller_kinds()) {
            let mut generator = Generator {
                nodes: scenario.plan.nodes(),
                scenario: &scenario,
                rng: &mut rng,
            };
            assert_eq!(kind(&mut generator).name(), name);
        }
    }

    #[test]
    fn drawn_faults_survive_a_scenario_file() {
        for name in ["chaos.toml", "chaos-controllers.toml"] {
            survive_a_file(name);
        }
    }

    fn survive_a_file(name: &str) {
        let (path, scenario) = search(name);
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
