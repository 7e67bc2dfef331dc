//! One flight of a swarm of processes, from start to end.

use std::collections::BTreeMap;
use std::time::Duration;

use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;
use muster_scenarios::report::{Flight, Report};
use muster_scenarios::scenario::DroneFault;
use muster_scenarios::twin::{ProcessReport, ProcessState, Twin};
use tokio::signal::unix::{Signal, SignalKind, signal};
use tokio::sync::mpsc::{self, UnboundedReceiver, UnboundedSender};
use tokio::time::{Instant as Deadline, MissedTickBehavior, interval, timeout_at};

use super::controllers::Controllers;
use super::folder::DroneFolder;
use super::follower::{Follower, TICK};
use super::host::{Launcher, end_launchers, start_launchers};
use super::losses::SentLosses;
use super::output::ProcessOutput;
use super::process::{DroneProcess, HostEvent, StartMode};
use super::{Request, START_MAX, SwarmError, Watcher};
use crate::hosts::Hosts;
use muster_daemon::clock::Clock;
use muster_daemon::control::{ActorFault, ControlMessage};

/// Delay of the twin behind the clock, in addition to the lag of the slowest host. Reports arrive within it.
const TWIN_DELAY: Duration = Duration::from_millis(50);
/// Delay of the twin that judges, in addition to that of the other. A busy machine's reports are seldom later.
const JUDGE_DELAY: Duration = Duration::from_secs(3);
/// Time for processes to exit by themselves once their drones are down.
const EXIT_MAX: Duration = Duration::from_secs(3);

/// Flies the drones; see [`super::fly`].
pub(super) async fn fly(
    request: &Request<'_>,
    (hosts, drones): (&Hosts, &[DroneFolder]),
    controllers: Controllers,
    watcher: Option<Watcher<'_>>,
) -> Result<(Report, Flight), SwarmError> {
    let (sender, events) = mpsc::unbounded_channel();
    let launchers = start_launchers(request, &hosts.hosts, drones, &sender).await?;
    let fleet = Launchers {
        by_drone: (hosts.hosts.iter().zip(&launchers))
            .flat_map(|(host, launcher)| host.drones.keys().map(move |id| (*id, launcher)))
            .collect(),
        _sender: sender,
        events,
    };
    let flown = fly_with(request, drones, (fleet, controllers), watcher).await;
    let uncertainty = end_launchers(launchers).await;
    let (mut report, flight) = flown?;
    if !request.emulates_radio {
        // Every drone heard every other.
        report.never_met.clear();
    }
    if let Some(program) = request.firmware {
        report.set_firmware(program);
    }
    report.clock_uncertainty_s = uncertainty.map(|it| it.as_secs_f64());
    Ok((report, flight))
}

/// The launchers on the hosts, and the events that they report.
struct Launchers<'a> {
    by_drone: BTreeMap<NodeId, &'a Launcher>,
    /// Keeps the channel open.
    _sender: UnboundedSender<HostEvent>,
    events: UnboundedReceiver<HostEvent>,
}

async fn fly_with<'a>(
    request: &'a Request<'a>,
    drones: &'a [DroneFolder],
    (launchers, controllers): (Launchers<'a>, Controllers),
    mut watcher: Option<Watcher<'_>>,
) -> Result<(Report, Flight), SwarmError> {
    let mut swarm = Swarm::start(request, drones, (launchers, controllers)).await?;
    let [mut terminate, mut interrupt] = termination_signals().map_err(SwarmError::Runtime)?;
    let mut ticks = interval(TICK);
    ticks.set_missed_tick_behavior(MissedTickBehavior::Skip);
    while !swarm.live.twin.is_flown() {
        tokio::select! {
            biased;
            _ = terminate.recv() => return Ok(swarm.interrupt()),
            _ = interrupt.recv() => return Ok(swarm.interrupt()),
            event = swarm.launchers.events.recv() => swarm.handle_event(event)?,
            _ = ticks.tick() => {
                swarm.advance();
                if let Some(watcher) = &mut watcher {
                    watcher(swarm.live.twin.progress());
                }
            }
        }
    }
    swarm.wait_for_exit().await;
    let (elapsed, stalls) = (swarm.elapsed(), swarm.controllers.stalls());
    let (mut report, flight) = swarm.judge.finish().finish(request.scenario, elapsed);
    report.firmware_stalls = stalls;
    Ok((report, flight))
}

fn termination_signals() -> std::io::Result<[Signal; 2]> {
    Ok([
        signal(SignalKind::terminate())?,
        signal(SignalKind::interrupt())?,
    ])
}

/// A flight in progress.
struct Swarm<'a> {
    request: &'a Request<'a>,
    drones: &'a [DroneFolder],
    /// Decides which process runs or hangs, and which frames it loses.
    live: Follower,
    /// The same once more, behind it, so that a report that comes late is taken in its order. Checks the rules, and reports.
    judge: Follower,
    launchers: Launchers<'a>,
    controllers: Controllers,
    processes: BTreeMap<NodeId, DroneProcess>,
    /// Started when the flight began.
    clock: Clock,
    losses: SentLosses,
}

impl<'a> Swarm<'a> {
    /// Starts all processes; the leader last, since it takes off at once.
    async fn start(
        request: &'a Request<'a>,
        drones: &'a [DroneFolder],
        (launchers, controllers): (Launchers<'a>, Controllers),
    ) -> Result<Self, SwarmError> {
        let lags = launchers.by_drone.values().map(|launcher| launcher.lag);
        let delay = TWIN_DELAY + lags.max().unwrap_or_default();
        let follower = |more| Follower::new(Twin::new(request.scenario, delay), delay + more);
        let mut swarm = Self {
            request,
            drones,
            live: follower(Duration::ZERO),
            judge: follower(JUDGE_DELAY),
            launchers,
            controllers,
            processes: BTreeMap::new(),
            clock: Clock::start(),
            losses: SentLosses::default(),
        };
        let leader = request.scenario.plan.centre();
        for folder in drones.iter().filter(|it| it.id != leader) {
            swarm.start_process(folder, StartMode::Waiting);
        }
        swarm.wait_until_ready().await?;
        swarm.clock = Clock::start();
        for folder in drones.iter().filter(|it| it.id == leader) {
            swarm.start_process(folder, StartMode::Leading);
        }
        swarm.wait_until_ready().await?;
        Ok(swarm)
    }

    /// Starts a drone's process and sends it the current frame losses.
    fn start_process(&mut self, folder: &DroneFolder, mode: StartMode) {
        let launcher = self.launchers.by_drone[&folder.id];
        let process = DroneProcess::start(self.request, launcher, folder, mode);
        self.processes.insert(folder.id, process);
        self.losses.forget(folder.id);
        self.send_losses();
    }

    /// The state of a drone's vehicle, as a message to its process.
    fn vehicle(&self, drone: NodeId) -> ControlMessage {
        ControlMessage::Vehicle {
            epoch: self.launchers.by_drone[&drone].host_time(self.clock.started()),
            state: Box::new(self.live.twin.vehicle(drone)),
        }
    }

    /// Waits until all started processes are ready.
    async fn wait_until_ready(&mut self) -> Result<(), SwarmError> {
        let deadline = Deadline::now() + START_MAX;
        let mut last_texts = BTreeMap::new();
        loop {
            let mut waiting = self.processes.iter().filter(|(_, it)| !it.is_ready());
            let Some((first, _)) = waiting.next() else {
                return Ok(());
            };
            let late = SwarmError::Late(*first);
            let event = timeout_at(deadline, self.launchers.events.recv()).await;
            let event = event.map_err(|_| late)?;
            if let Some(HostEvent::Output(id, ProcessOutput::Text(text))) = &event {
                last_texts.insert(*id, text.clone());
            }
            let ended = match &event {
                Some(HostEvent::Ended(drone)) => Some(*drone),
                _ => None,
            };
            self.handle_event(event)?;
            if let Some(drone) = ended {
                let last = last_texts.remove(&drone).unwrap_or_default();
                return Err(SwarmError::EndedEarly { drone, last });
            }
        }
    }

    /// Handles an event of a process or a host.
    ///
    /// # Errors
    /// [`SwarmError::HostLost`]: the state of its drones is unknown, so the flight can't be judged.
    fn handle_event(&mut self, event: Option<HostEvent>) -> Result<(), SwarmError> {
        match event {
            Some(HostEvent::Output(drone, ProcessOutput::Report(at, report))) => {
                let at = Timestamp::ZERO + at.since(self.clock.started());
                self.push(at, drone, report);
            }
            Some(HostEvent::Ended(drone)) => {
                let process = self.processes.get_mut(&drone);
                // The twin knows when a fault ended a process.
                if process.is_none_or(DroneProcess::mark_ended) {
                    let now = Timestamp::ZERO + self.elapsed();
                    self.push(now, drone, ProcessReport::Ended);
                }
            }
            Some(HostEvent::Output(drone, ProcessOutput::Ready)) => {
                if let Some(process) = self.processes.get_mut(&drone) {
                    process.mark_ready();
                }
            }
            Some(HostEvent::Lost { host, last }) => {
                return Err(SwarmError::HostLost { host, last });
            }
            Some(HostEvent::Output(_, ProcessOutput::Text(_))) | None => {}
        }
        Ok(())
    }

    /// Time since the start of the flight.
    fn elapsed(&self) -> Duration {
        self.clock.now().since(self.clock.started())
    }

    /// Adds a report of something that happened at `at`, since the start of the flight.
    fn push(&mut self, at: Timestamp, drone: NodeId, report: ProcessReport) {
        self.judge.push(at, drone, report.clone());
        self.live.push(at, drone, report);
    }

    /// Advances the twins to their delayed clocks and applies the decisions of the first to the processes.
    fn advance(&mut self) {
        let elapsed = self.elapsed();
        let now = Timestamp::ZERO + elapsed;
        let flown: Vec<_> = self.controllers.look(now).collect();
        for (drone, truth, sticks) in flown {
            self.push(now, drone, ProcessReport::Flew(Box::new(truth), sticks));
        }
        // In steps, even after a stall of this machine: a fault is applied before the twin passes it.
        while self.live.step(elapsed) {
            self.apply_process_states();
            self.inject_faults();
        }
        while self.judge.step(elapsed) {}
        (self.controllers).show_pilots(|drone| self.live.twin.is_to_take_off(drone));
        self.send_losses();
    }

    /// Stops, continues, kills and restarts processes as the twin decides.
    fn apply_process_states(&mut self) {
        for folder in self.drones {
            let id = folder.id;
            let state = self.live.twin.process(id);
            let Some(process) = self.processes.get_mut(&id) else {
                continue;
            };
            if process.set_state(state) && self.live.twin.take_overruled(id) {
                let vehicle = self.vehicle(id);
                self.processes[&id].send(&vehicle);
            } else if state == ProcessState::Runs && process.can_restart() {
                self.start_process(folder, StartMode::Resuming(self.vehicle(id)));
            }
        }
    }

    /// Injects faults of actors into their processes, and of flight controllers.
    fn inject_faults(&mut self) {
        for (drone, fault, duration) in self.live.twin.take_faults() {
            let (actor, fault) = match fault {
                DroneFault::Controller(fault) => {
                    self.controllers.affect(drone, fault, duration);
                    continue;
                }
                DroneFault::CrashActor(actor) => (actor, ActorFault::Crashes),
                DroneFault::Hang(Some(actor)) => {
                    let duration_s = duration.map(|it| it.as_secs_f64());
                    (actor, ActorFault::Hangs(duration_s))
                }
                _ => continue,
            };
            if let Some(process) = self.processes.get(&drone) {
                process.send(&ControlMessage::Inject { actor, fault });
            }
        }
    }

    /// Sends changed frame losses to the processes, if the radio is emulated.
    fn send_losses(&mut self) {
        if self.request.emulates_radio {
            self.losses.send_changes(&self.live.twin, &self.processes);
        }
    }

    /// The report of what was flown until now. The launchers end the processes.
    fn interrupt(mut self) -> (Report, Flight) {
        self.advance();
        self.judge.catch_up(&self.live);
        let (elapsed, stalls) = (self.elapsed(), self.controllers.stalls());
        let (mut report, flight) = (self.judge.twin).interrupt(self.request.scenario, elapsed);
        report.firmware_stalls = stalls;
        (report, flight)
    }

    /// Waits for the processes to exit by themselves and takes their last reports. Their launchers kill the rest.
    async fn wait_for_exit(&mut self) {
        let deadline = Deadline::now() + EXIT_MAX;
        let runs = |it: &DroneProcess| !it.is_ended();
        while self.processes.values().any(runs) {
            match timeout_at(deadline, self.launchers.events.recv()).await {
                // All drones are down: the loss of a host does not matter any more.
                Ok(event) => drop(self.handle_event(event)),
                Err(_) => break,
            }
        }
        self.judge.catch_up(&self.live);
    }
}
