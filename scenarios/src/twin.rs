//! The twin of a swarm whose drones run as processes: the world of a simulation, which follows their reports in real time.
//! It knows the positions of their vehicles, the losses of their links, the faults of the plan, and checks the rules.
//!
//! The messages to actors stay in their processes, so rules 2 and 8 are not checked; nor is rule 7, since RC goes from a
//! process to its flight controller. Rule 6 is checked as far as drones report that they wait to take off.

use std::time::Duration;

use muster_controller::{Sticks, Truth};
use muster_machines::identity::NodeId;
use muster_machines::msp::FlightCommand;
use muster_machines::node::Observation;
use muster_machines::time::Timestamp;
use muster_runtime::vehicle::VehicleState;

use crate::engine::Progress;
use crate::report::{Flight, Report, summary};
use crate::scenario::{DroneFault, Fault, FaultKind, Scenario};
pub use crate::world::ProcessState;
use crate::world::{Ending, Mirror};

/// The twin of a swarm.
#[derive(Debug)]
pub struct Twin {
    mirror: Mirror,
    nodes: u32,
    steps: u64,
}

/// A message of a drone's process about its drone, or of the simulated aircraft that it flies by sticks.
#[derive(Debug, Clone, PartialEq)]
pub enum ProcessReport {
    /// An observation of its state machines.
    Observed(Observation),
    /// A command to its flight controller.
    Commanded(FlightCommand),
    /// Its aircraft with a flight controller flies like this. Due every [`LOOK_EVERY`](crate::controllers::LOOK_EVERY) while
    /// it is armed, and when it arms or disarms. With its sticks since the last look, if the controller tells them.
    Flew(Box<Truth>, Option<Sticks>),
    /// Frames sent and admitted since the last message of this kind.
    Traffic {
        /// Sent because of a change or a loss.
        news: u64,
        /// Sent because a period elapsed.
        keep_alives: u64,
        /// Admitted by the radio.
        let_in: u64,
    },
    /// The process has started and is about to start its actors.
    Started,
    /// The process has ended.
    Ended,
}

impl Twin {
    /// The twin at the start of a flight. It runs `delay` behind the processes' clocks, so that reports of several processes
    /// are taken in the order of their times. A new [`ProcessState`] must be put into effect at once.
    #[must_use]
    pub fn new(scenario: &Scenario, delay: Duration) -> Self {
        Self {
            mirror: Mirror::new(scenario, delay),
            nodes: scenario.plan.nodes(),
            steps: scenario.steps(),
        }
    }

    /// The drones and relays.
    pub fn nodes(&self) -> impl Iterator<Item = NodeId> + use<> {
        (0..self.nodes).map(NodeId)
    }

    /// Takes a report of `at`, since the start of the flight; one of before the twin's time is taken as of now.
    pub fn receive(&mut self, at: Timestamp, drone: NodeId, report: ProcessReport) {
        match report {
            ProcessReport::Observed(seen) => self.mirror.observed(at, drone, seen),
            ProcessReport::Commanded(command) => self.mirror.commanded(at, drone, command),
            ProcessReport::Flew(truth, sticks) => self.mirror.flew(at, drone, &truth, sticks),
            ProcessReport::Started => self.mirror.process_started(at, drone),
            ProcessReport::Ended => self.mirror.process_ended(at, drone),
            ProcessReport::Traffic {
                news,
                keep_alives,
                let_in,
            } => {
                self.mirror.advance(at);
                let frames = [news, keep_alives, let_in];
                self.mirror.count_frames(drone, frames);
            }
        }
    }

    /// Moves time to `now`, since the start of the flight, and handles all events until then.
    pub fn advance(&mut self, now: Timestamp) {
        self.mirror.advance(now);
    }

    /// The state that a drone's process must be in.
    #[must_use]
    pub fn process(&self, drone: NodeId) -> ProcessState {
        self.mirror.process(drone)
    }

    /// Whether a drone's flight controller has landed it while its process hung. Answers `true` once.
    pub fn take_overruled(&mut self, drone: NodeId) -> bool {
        self.mirror.take_overruled(drone)
    }

    /// The state of a drone's vehicle, for a process that is started again or was overruled.
    #[must_use]
    pub fn vehicle(&self, drone: NodeId) -> VehicleState {
        self.mirror.vehicle(drone)
    }

    /// The faults to inject into actors and flight controllers since the last call, and how long each lasts.
    pub fn take_faults(&mut self) -> Vec<(NodeId, DroneFault, Option<Duration>)> {
        self.mirror.take_faults()
    }

    /// The chance that a frame from one drone does not reach another at their present positions, 0 to 1.
    #[must_use]
    pub fn loss(&self, from: NodeId, to: NodeId) -> f64 {
        self.mirror.loss(from, to)
    }

    /// A number that rises whenever a loss may have changed.
    #[must_use]
    pub const fn loss_changes(&self) -> u64 {
        self.mirror.loss_changes()
    }

    /// Whether a drone is on its way from the ground to its slot.
    #[must_use]
    pub fn is_to_take_off(&self, drone: NodeId) -> bool {
        self.mirror.is_to_take_off(drone)
    }

    /// Whether the flight is over: no vehicle is in the air any more, or the time is up.
    #[must_use]
    pub fn is_flown(&self) -> bool {
        self.mirror.is_flown()
    }

    /// How far the flight is.
    #[must_use]
    pub fn progress(&self) -> Progress {
        Progress {
            done: self.mirror.steps_done().min(self.steps),
            total: self.steps,
            simulated_s: self.mirror.now().as_nanos() / 1_000_000_000,
        }
    }

    /// The report of the flight.
    #[must_use]
    pub fn finish(self, scenario: &Scenario, wall: Duration) -> (Report, Flight) {
        summary(scenario, None, &self.mirror.finish(Ending::Flown), wall)
    }

    /// The report of what was flown until now. Drones in the air break no rule.
    #[must_use]
    pub fn interrupt(self, scenario: &Scenario, wall: Duration) -> (Report, Flight) {
        let outcome = self.mirror.finish(Ending::Interrupted);
        let (mut report, flight) = summary(scenario, None, &outcome, wall);
        report.set_interrupted();
        (report, flight)
    }
}

/// Why a fault can't be injected into a process with a simulated vehicle; `None` if it can.
#[must_use]
pub fn refuses(fault: &Fault) -> Option<&'static str> {
    let FaultKind::Drone(_, fault) = fault.kind else {
        return match fault.kind {
            FaultKind::Tamper(_) => Some("frames between processes can't be tampered with"),
            FaultKind::Drone(..) | FaultKind::Links(..) | FaultKind::Jam { .. } => None,
        };
    };
    match fault {
        DroneFault::Kill
        | DroneFault::Restart
        | DroneFault::Hang(_)
        | DroneFault::CrashActor(_)
        | DroneFault::Controller(_) => None,
        DroneFault::CrashAircraft | DroneFault::Drain(_) | DroneFault::LoseGps => {
            Some("the vehicle simulated beside a process can't fail")
        }
        DroneFault::Replay | DroneFault::Forge => {
            Some("frames of a process can't be replayed or forged")
        }
        DroneFault::Skew(_) => Some("a process uses the clock of its computer"),
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

    /// The report and flight of a simulation, and those of a twin that receives the simulated drones' reports with this delay.
    /// The twin injects `faults` instead of the scenario's.
    fn both(scenario: &Scenario, delay: Duration, faults: &[Fault]) -> [(Report, Flight); 2] {
        let mut world = engine::flown(scenario);
        let mut reports = std::mem::take(&mut world.reports);
        let finished = ProcessReport::Observed(Observation::Mission(Event::State(State::Finished)));
        let ends: Vec<_> = (reports.iter())
            .filter(|(.., report)| *report == finished)
            .map(|(at, drone, _)| {
                (
                    *at + Duration::from_millis(500),
                    *drone,
                    ProcessReport::Ended,
                )
            })
            .collect();
        reports.extend(ends);
        reports.sort_by_key(|(at, ..)| *at);
        let simulated = summary(scenario, None, &world.finish(Ending::Flown), Duration::ZERO);
        let mut followed = scenario.clone();
        followed.faults = faults.to_vec();
        let mut twin = Twin::new(&followed, delay);
        let (mut now, mut states) = (
            Timestamp::ZERO,
            vec![ProcessState::Runs; twin.nodes().count()],
        );
        let mut reports = reports.into_iter().peekable();
        // It ends at the instant at which the last drone is down, as the simulation does.
        'flight: while !twin.is_flown() {
            now += Duration::from_millis(10);
            while let Some((at, drone, report)) = reports.next_if(|(at, ..)| *at <= now) {
                twin.receive(at, drone, report);
                if twin.is_flown() {
                    break 'flight;
                }
            }
            twin.advance(now);
            for (drone, state) in twin.nodes().zip(&mut states) {
                let process_state = twin.process(drone);
                if std::mem::replace(state, process_state) != process_state
                    && process_state == ProcessState::Ended
                {
                    twin.receive(now, drone, ProcessReport::Ended);
                }
            }
        }
        [simulated, twin.finish(scenario, Duration::ZERO)]
    }

    fn compare(scenario: &Scenario) {
        compare_delayed(scenario, Duration::ZERO, &scenario.faults);
    }

    /// Compares all but the counts of frames, which a twin gets apart.
    fn compare_delayed(scenario: &Scenario, delay: Duration, faults: &[Fault]) {
        let [simulated, twin] = both(scenario, delay, faults).map(|(mut report, _)| {
            for drone in &mut report.drones {
                (drone.messages_sent, drone.messages_received) = (0, 0);
                drone.messages_at_least = false;
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
    fn twin_reports_the_same_flight_as_the_simulation() {
        compare(&scenario("thesis-1.toml", &[]));
    }

    #[test]
    fn twin_injects_faults_and_checks_rules_as_the_simulation_does() {
        for name in ["kill-at-waypoint.toml", "cut-in-two.toml"] {
            compare(&scenario(name, &[]));
        }
    }

    #[test]
    fn counts_of_killed_processes_are_lower_bounds() {
        for name in ["kill-at-waypoint.toml", "returning-drone.toml"] {
            let scenario = scenario(name, &[]);
            let [simulated, twin] = both(&scenario, Duration::ZERO, &scenario.faults)
                .map(|(report, _)| report.drones.into_iter().map(|it| it.messages_at_least));
            assert!(simulated.into_iter().all(|it| !it), "{name}");
            assert_eq!(twin.filter(|it| *it).count(), 1, "{name}");
        }
    }

    #[test]
    fn twin_records_the_same_history_as_the_simulation() {
        for name in ["kill-at-waypoint.toml", "returning-drone.toml"] {
            let scenario = scenario(name, &[]);
            let [simulated, twin] =
                both(&scenario, Duration::ZERO, &scenario.faults).map(|(_, flight)| flight.history);
            assert!(!simulated.marks.is_empty());
            assert_eq!(twin.marks, simulated.marks);
            assert_eq!(twin.links, simulated.links);
            assert_eq!(twin.nodes, simulated.nodes);
        }
    }

    #[test]
    fn twin_follows_restarted_processes() {
        for name in ["returning-drone.toml", "hardware/swarm-restart.toml"] {
            compare(&scenario(name, &[]));
        }
    }

    #[test]
    fn faults_affect_a_delayed_twin_at_the_time_of_the_process() {
        let delay = Duration::from_millis(50);
        for fault in [
            "kind=\"kill\",drone=1",
            "kind=\"restart\",drone=1,for_s=2",
            "kind=\"hang\",drone=1,for_s=0.5",
        ] {
            let faults = |at_s: f64| format!("faults=[{{at_s={at_s},{fault}}}]");
            let affected = scenario("hardware/swarm-short.toml", &[&faults(9.05)]);
            let injected = scenario("hardware/swarm-short.toml", &[&faults(9.0)]);
            compare_delayed(&affected, delay, &injected.faults);
        }
    }

    #[test]
    fn a_process_that_ends_in_flight_without_a_fault_breaks_rule_9() {
        let scenario = scenario("hardware/swarm-short.toml", &[]);
        let reports = engine::flown(&scenario).reports;
        let mut twin = Twin::new(&scenario, Duration::from_millis(50));
        let end = Timestamp::from_secs_f64(9.0);
        for (at, drone, report) in reports.into_iter().filter(|(at, ..)| *at < end) {
            twin.receive(at, drone, report);
        }
        twin.receive(end, NodeId(3), ProcessReport::Ended);
        let (report, _) = twin.finish(&scenario, Duration::ZERO);
        let broken: Vec<_> = (report.violations.iter())
            .map(|it| (it.rule, &it.drones[..]))
            .collect();
        assert_eq!(broken, [(9, &[3][..])]);
    }

    #[test]
    fn process_hangs_on_when_one_hang_ends_as_the_next_begins() {
        let hang = "faults=[{at_s=3,kind=\"hang\",drone=0,for_s=1,times=3,every_s=1}]";
        let scenario = scenario("hardware/swarm-short.toml", &[hang]);
        for delay in [0, 50] {
            let delay = Duration::from_millis(delay);
            let mut twin = Twin::new(&scenario, delay);
            let end = Timestamp::from_secs_f64(6.0) + delay;
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
                    "{now:?}, delayed by {delay:?}"
                );
                now += Duration::from_millis(5);
            }
        }
    }
}
