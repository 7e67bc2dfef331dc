//! The twin of a swarm whose drones run as processes: the same world that a simulation has, told in real time what the
//! drones do. It knows where their vehicles are, so who would hear whom, when which fault of the plan befalls whom, and
//! which rules hold.
//!
//! What drones are told stays in their processes, so of the rules those about it are not checked: who is obeyed (2) and
//! how much waits (8); that nobody takes off untold (6) as far as drones show that they wait to.

use std::time::Duration;

use muster_machines::identity::NodeId;
use muster_machines::msp::FlightCommand;
use muster_machines::node::Observation;
use muster_machines::time::Timestamp;

use crate::engine::Progress;
use crate::report::{Flight, Report, summary};
use crate::scenario::Scenario;
use crate::scenario::{DroneFault, Fault, FaultKind};
pub use crate::world::ProcessState;
use crate::world::World;
use muster_runtime::vehicle::VehicleState;

/// The twin of a swarm.
#[derive(Debug)]
pub struct Twin {
    world: World,
    nodes: u32,
    steps: u64,
}

/// What a drone's process says of its drone.
#[derive(Debug, Clone, PartialEq)]
pub enum Said {
    /// Something was seen of it.
    Seen(Observation),
    /// It told its vehicle something.
    Commanded(FlightCommand),
    /// It has sent and let in this many frames more.
    Talked {
        /// Sent because something had changed or was missed.
        news: u64,
        /// Sent only because the time had come.
        keep_alives: u64,
        /// Let in.
        let_in: u64,
    },
    /// Its process has started, and its actors are about to be built.
    Started,
    /// Its process has ended.
    Ended,
}

impl Twin {
    /// Of the drones of a scenario, before any of them has done anything. It is to be so far `behind` their clocks, so that
    /// what several of them say is told in the order in which it happened; what a fault makes of a process is to be done
    /// at once.
    #[must_use]
    pub fn new(scenario: &Scenario, behind: Duration) -> Self {
        Self {
            world: World::mirroring(scenario, behind),
            nodes: scenario.plan.nodes(),
            steps: scenario.steps(),
        }
    }

    /// The drones and relays.
    pub fn nodes(&self) -> impl Iterator<Item = NodeId> + use<> {
        (0..self.nodes).map(NodeId)
    }

    /// Takes in that a drone said something at `at`, since the flight began; later than the twin's time, or now.
    pub fn hear(&mut self, at: Timestamp, drone: NodeId, said: Said) {
        match said {
            Said::Seen(seen) => self.world.was_seen(at, drone, seen),
            Said::Commanded(command) => self.world.was_commanded(at, drone, command),
            Said::Started => self.world.process_started(at, drone),
            Said::Ended => self.world.process_ended(at, drone),
            Said::Talked {
                news,
                keep_alives,
                let_in,
            } => {
                self.world.advance(at);
                self.world.has_talked(drone, [news, keep_alives, let_in]);
            }
        }
    }

    /// Lets everything happen that happens up to `now`, since the flight began.
    pub fn advance(&mut self, now: Timestamp) {
        self.world.advance(now);
    }

    /// How a drone's process is to be by now.
    #[must_use]
    pub fn process(&self, drone: NodeId) -> ProcessState {
        self.world.process(drone)
    }

    /// Whether a drone's vehicle does something else than its process told it, which hung meanwhile; told once.
    pub fn is_overruled(&mut self, drone: NodeId) -> bool {
        self.world.is_overruled(drone)
    }

    /// What a drone's vehicle is doing, for a process that is started again or was overruled.
    #[must_use]
    pub fn vehicle(&self, drone: NodeId) -> VehicleState {
        self.world.vehicle(drone)
    }

    /// The faults to inject into actors of processes since the last call, and how long each lasts.
    pub fn take_actor_faults(&mut self) -> Vec<(NodeId, DroneFault, Option<Duration>)> {
        self.world.take_actor_faults()
    }

    /// The chance that a frame from one drone would not reach another where they are, 0 to 1.
    #[must_use]
    pub fn loss(&self, from: NodeId, to: NodeId) -> f64 {
        self.world.loss(from, to)
    }

    /// A number that rises whenever those chances may be others than before.
    #[must_use]
    pub const fn loss_changes(&self) -> u64 {
        self.world.loss_changes()
    }

    /// Whether the flight is over: nobody is in the air any more, or the time is up.
    #[must_use]
    pub fn is_flown(&self) -> bool {
        self.world.is_flown()
    }

    /// How far the flight is.
    #[must_use]
    pub fn progress(&self) -> Progress {
        Progress {
            done: self.world.steps_done().min(self.steps),
            total: self.steps,
            simulated_s: self.world.now().as_nanos() / 1_000_000_000,
        }
    }

    /// What came of the flight.
    #[must_use]
    pub fn finish(self, scenario: &Scenario, wall: Duration) -> (Report, Flight) {
        summary(scenario, None, &self.world.finish(), wall)
    }
}

/// Why a fault can't befall a process whose vehicle is simulated in it; nothing if it can.
#[must_use]
pub fn refuses(fault: &Fault) -> Option<&'static str> {
    let FaultKind::Drone(_, fault) = fault.kind else {
        return match fault.kind {
            FaultKind::Tamper(_) => Some("nobody tampers with frames between processes"),
            FaultKind::Drone(..) | FaultKind::Links(..) | FaultKind::Jam { .. } => None,
        };
    };
    match fault {
        DroneFault::Kill
        | DroneFault::Restart
        | DroneFault::Hang(_)
        | DroneFault::CrashActor(_) => None,
        DroneFault::CrashAircraft | DroneFault::Drain(_) | DroneFault::LoseGps => {
            Some("a vehicle that is simulated in a process does not fail")
        }
        DroneFault::Replay | DroneFault::Forge => Some("nobody speaks in the name of a process"),
        DroneFault::Skew(_) => Some("a process has its machine's clock"),
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use muster_machines::mission::{Event, State};

    use super::*;
    use crate::engine;
    use crate::scenario::{Override, load};

    fn scenario(name: &str, changes: &[&str]) -> Scenario {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(name);
        let changes: Vec<Override> = changes.iter().map(|it| it.parse().unwrap()).collect();
        load(&path, &changes).unwrap()
    }

    /// What a simulation makes of a scenario, and what a twin does that is so far behind and told what the simulated drones
    /// say, and when their processes end: `faults` befall it, in the place of the scenario's.
    fn both(scenario: &Scenario, behind: Duration, faults: &[Fault]) -> [Report; 2] {
        let mut world = engine::flown(scenario);
        let mut said = std::mem::take(&mut world.said);
        let finished = Said::Seen(Observation::Mission(Event::State(State::Finished)));
        let ends: Vec<_> = (said.iter())
            .filter(|(_, _, said)| *said == finished)
            .map(|(at, drone, _)| (*at + Duration::from_millis(500), *drone, Said::Ended))
            .collect();
        said.extend(ends);
        said.sort_by_key(|(at, ..)| *at);
        let (simulated, _) = summary(scenario, None, &world.finish(), Duration::ZERO);
        let mut told = scenario.clone();
        told.faults = faults.to_vec();
        let mut twin = Twin::new(&told, behind);
        let (mut now, mut stood) = (
            Timestamp::ZERO,
            vec![ProcessState::Runs; twin.nodes().count()],
        );
        let mut said = said.into_iter().peekable();
        // It is over at the very time at which the last is down, as in the simulation.
        'flight: while !twin.is_flown() {
            now += Duration::from_millis(10);
            while let Some((at, drone, said)) = said.next_if(|(at, ..)| *at <= now) {
                twin.hear(at, drone, said);
                if twin.is_flown() {
                    break 'flight;
                }
            }
            twin.advance(now);
            for (drone, stood) in twin.nodes().zip(&mut stood) {
                let process_state = twin.process(drone);
                if std::mem::replace(stood, process_state) != process_state
                    && process_state == ProcessState::Ended
                {
                    twin.hear(now, drone, Said::Ended);
                }
            }
        }
        let (twin, _) = twin.finish(scenario, Duration::ZERO);
        [simulated, twin]
    }

    fn compare(scenario: &Scenario) {
        compare_behind(scenario, Duration::ZERO, &scenario.faults);
    }

    /// Without what a twin is not told: frames.
    fn compare_behind(scenario: &Scenario, behind: Duration, faults: &[Fault]) {
        let [simulated, twin] = both(scenario, behind, faults).map(|mut report| {
            for drone in &mut report.drones {
                (drone.messages_sent, drone.messages_received) = (0, 0);
            }
            for barrier in &mut report.barriers {
                (barrier.transmissions, barrier.keep_alives, barrier.retries) = (0, 0, 0);
            }
            report.means.messages_received = 0.0;
            report.medium = None;
            report
        });
        assert_eq!(simulated.violations, []);
        assert_eq!(
            serde_json::to_value(&twin).unwrap(),
            serde_json::to_value(&simulated).unwrap()
        );
    }

    #[test]
    fn a_twin_that_hears_what_drones_say_reports_what_they_do() {
        compare(&scenario("thesis-1.toml", &[]));
    }

    #[test]
    fn a_twin_kills_and_judges_as_the_simulation_does() {
        for name in ["kill-at-waypoint.toml", "cut-in-two.toml"] {
            compare(&scenario(name, &[]));
        }
    }

    #[test]
    fn a_twin_follows_processes_that_start_again() {
        for name in ["returning-drone.toml", "hardware/swarm-restart.toml"] {
            compare(&scenario(name, &[]));
        }
    }

    #[test]
    fn what_befalls_a_process_befalls_its_drone_once_the_twin_that_is_behind_is_there() {
        let behind = Duration::from_millis(50);
        for fault in ["kill=1", "restart=1,for_s=2", "hang=1,for_s=0.5"] {
            let faults = |at_s: f64| format!("faults=[{{at_s={at_s},{fault}}}]");
            let affects = scenario("hardware/swarm-short.toml", &[&faults(9.05)]);
            let told = scenario("hardware/swarm-short.toml", &[&faults(9.0)]);
            compare_behind(&affects, behind, &told.faults);
        }
    }

    #[test]
    fn a_process_that_ends_in_mid_flight_though_nothing_befell_it_breaks_a_rule() {
        let scenario = scenario("hardware/swarm-short.toml", &[]);
        let said = engine::flown(&scenario).said;
        let mut twin = Twin::new(&scenario, Duration::from_millis(50));
        let end = Timestamp::from_secs_f64(9.0);
        for (at, drone, said) in said.into_iter().filter(|(at, ..)| *at < end) {
            twin.hear(at, drone, said);
        }
        twin.hear(end, NodeId(3), Said::Ended);
        let (report, _) = twin.finish(&scenario, Duration::ZERO);
        let broken: Vec<_> = (report.violations.iter())
            .map(|it| (it.rule, &it.drones[..]))
            .collect();
        assert_eq!(broken, [(9, &[3][..])]);
    }

    #[test]
    fn a_hang_that_is_over_when_the_next_begins_does_not_let_the_process_run_in_between() {
        let hang = "faults=[{at_s=3,hang=0,for_s=1,times=3,every_s=1}]";
        let scenario = scenario("hardware/swarm-short.toml", &[hang]);
        for behind in [0, 50] {
            let behind = Duration::from_millis(behind);
            let mut twin = Twin::new(&scenario, behind);
            let end = Timestamp::from_secs_f64(6.0) + behind;
            let mut now = Timestamp::ZERO;
            while now < end + Duration::from_secs(1) {
                let hangs = now >= Timestamp::from_secs_f64(3.0) && now < end;
                let process_state = if hangs {
                    ProcessState::Hangs
                } else {
                    ProcessState::Runs
                };
                twin.advance(now);
                assert_eq!(
                    twin.process(NodeId(0)),
                    process_state,
                    "{now:?}, behind {behind:?}"
                );
                now += Duration::from_millis(5);
            }
        }
    }
}
