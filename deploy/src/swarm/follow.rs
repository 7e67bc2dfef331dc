//! A flight of processes, from their start to their end.

use std::collections::BTreeMap;
use std::time::Duration;

use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;
use muster_scenarios::report::{Flight, Report};
use muster_scenarios::scenario::DroneFault;
use muster_scenarios::twin::{ProcessState, Said, Twin};
use tokio::signal::unix::{Signal, SignalKind, signal};
use tokio::sync::mpsc::{self, UnboundedReceiver, UnboundedSender};
use tokio::time::{Instant as Deadline, MissedTickBehavior, interval, timeout_at};

use super::child::{Begin, DroneProcess, News};
use super::folder::DroneFolder;
use super::host::{Agent, end_agents, start_agents};
use super::hosts::Hosts;
use super::said::Spoken;
use super::{Request, START_MAX, SwarmError, Watcher};
use muster_daemon::clock::Clock;
use muster_daemon::control::{ActorFault, ControlMessage, Losses};

/// How far the twin is behind the clock, beside what it takes to hear of other hosts and is not known of their clocks.
const BEHIND: Duration = Duration::from_millis(50);
/// How often the twin goes on.
const TICK: Duration = Duration::from_millis(5);
/// How long processes may take to end by themselves, once their drones are down.
const END_MAX: Duration = Duration::from_secs(3);
/// By how much a chance to be lost must have changed for a process to be told.
const LOSS_STEP: f64 = 0.01;

/// Flies the drones; see [`super::fly`].
pub(super) async fn fly(
    request: &Request<'_>,
    (hosts, drones): (&Hosts, &[DroneFolder]),
    watcher: Option<Watcher<'_>>,
) -> Result<(Report, Flight), SwarmError> {
    let (sender, news) = mpsc::unbounded_channel();
    let agents = start_agents(request, &hosts.hosts, drones, &sender).await?;
    let crew = Crew {
        by_drone: (hosts.hosts.iter().zip(&agents))
            .flat_map(|(host, agent)| host.drones.keys().map(move |id| (*id, agent)))
            .collect(),
        _sender: sender,
        news,
    };
    let flown = fly_with(request, drones, crew, watcher).await;
    let uncertainty = end_agents(agents).await;
    let (mut report, flight) = flown?;
    report.clock_uncertainty_s = uncertainty.map(|it| it.as_secs_f64());
    Ok((report, flight))
}

/// Who does on the hosts what is to be done.
struct Crew<'a> {
    by_drone: BTreeMap<NodeId, &'a Agent>,
    /// Held so that there may always be news.
    _sender: UnboundedSender<News>,
    news: UnboundedReceiver<News>,
}

async fn fly_with<'a>(
    request: &'a Request<'a>,
    drones: &'a [DroneFolder],
    crew: Crew<'a>,
    mut watcher: Option<Watcher<'_>>,
) -> Result<(Report, Flight), SwarmError> {
    let mut swarm = Swarm::start(request, drones, crew).await?;
    let [mut terminate, mut interrupt] = ends().map_err(SwarmError::Runtime)?;
    let mut ticks = interval(TICK);
    ticks.set_missed_tick_behavior(MissedTickBehavior::Skip);
    while !swarm.twin.is_flown() {
        tokio::select! {
            biased;
            _ = terminate.recv() => return Err(SwarmError::Interrupted),
            _ = interrupt.recv() => return Err(SwarmError::Interrupted),
            news = swarm.crew.news.recv() => swarm.hear(news)?,
            _ = ticks.tick() => {
                swarm.go_on();
                if let Some(watcher) = &mut watcher {
                    watcher(swarm.twin.progress());
                }
            }
        }
    }
    swarm.let_end().await;
    let lasted = swarm.lasted();
    Ok(swarm.twin.finish(request.scenario, lasted))
}

fn ends() -> std::io::Result<[Signal; 2]> {
    Ok([
        signal(SignalKind::terminate())?,
        signal(SignalKind::interrupt())?,
    ])
}

/// A flight under way.
struct Swarm<'a> {
    request: &'a Request<'a>,
    drones: &'a [DroneFolder],
    twin: Twin,
    /// How far the twin is behind the clock.
    behind: Duration,
    crew: Crew<'a>,
    processes: BTreeMap<NodeId, DroneProcess>,
    /// Started when the flight began.
    clock: Clock,
    /// What was said and is to be told to the twin, by when and as the how manieth.
    said: BTreeMap<(Timestamp, u64), (NodeId, Said)>,
    heard: u64,
    /// What each process was told last of what it does not hear.
    told: BTreeMap<NodeId, Losses>,
    losses_as_of: Option<u64>,
    twin_is_at: Timestamp,
}

impl<'a> Swarm<'a> {
    /// Starts all processes, the one that leads last; it is told to fly.
    async fn start(
        request: &'a Request<'a>,
        drones: &'a [DroneFolder],
        crew: Crew<'a>,
    ) -> Result<Self, SwarmError> {
        let lags = crew.by_drone.values().map(|agent| agent.lag);
        let behind = BEHIND + lags.max().unwrap_or_default();
        let mut swarm = Self {
            request,
            drones,
            twin: Twin::new(request.scenario, behind),
            behind,
            crew,
            processes: BTreeMap::new(),
            clock: Clock::start(),
            said: BTreeMap::new(),
            heard: 0,
            told: BTreeMap::new(),
            losses_as_of: None,
            twin_is_at: Timestamp::ZERO,
        };
        let leader = request.scenario.plan.centre();
        for folder in drones.iter().filter(|it| it.id != leader) {
            swarm.add(folder, Begin::Waiting);
        }
        swarm.wait_until_ready().await?;
        swarm.clock = Clock::start();
        for folder in drones.iter().filter(|it| it.id == leader) {
            swarm.add(folder, Begin::Leading);
        }
        swarm.wait_until_ready().await?;
        Ok(swarm)
    }

    /// Starts a drone's process, which is told at once whom it does not hear.
    fn add(&mut self, folder: &DroneFolder, begin: Begin) {
        let agent = self.crew.by_drone[&folder.id];
        let process = DroneProcess::start(self.request, agent, folder, begin);
        self.processes.insert(folder.id, process);
        self.told.remove(&folder.id);
        self.losses_as_of = None;
        if self.request.emulates_radio {
            self.tell_losses();
        }
    }

    /// What a drone's vehicle is doing, for its process.
    fn vehicle(&self, drone: NodeId) -> ControlMessage {
        ControlMessage::Vehicle {
            epoch: self.crew.by_drone[&drone].theirs(self.clock.started()),
            state: Box::new(self.twin.vehicle(drone)),
        }
    }

    /// Waits until all that were started say that they are there.
    async fn wait_until_ready(&mut self) -> Result<(), SwarmError> {
        let deadline = Deadline::now() + START_MAX;
        let mut last_words = BTreeMap::new();
        loop {
            let mut waiting = self.processes.iter().filter(|(_, it)| !it.is_ready());
            let Some((first, _)) = waiting.next() else {
                return Ok(());
            };
            let late = SwarmError::Late(*first);
            let news = timeout_at(deadline, self.crew.news.recv()).await;
            let news = news.map_err(|_| late)?;
            if let Some(News::Said(id, Spoken::Words(words))) = &news {
                last_words.insert(*id, words.clone());
            }
            let ended = match &news {
                Some(News::Ended(drone)) => Some(*drone),
                _ => None,
            };
            self.hear(news)?;
            if let Some(drone) = ended {
                let last = last_words.remove(&drone).unwrap_or_default();
                return Err(SwarmError::EndedEarly { drone, last });
            }
        }
    }

    /// Takes in what comes of processes.
    ///
    /// # Errors
    /// When it is that a host is lost: what its drones do is not known, and what the others do can't be judged.
    fn hear(&mut self, news: Option<News>) -> Result<(), SwarmError> {
        match news {
            Some(News::Said(drone, Spoken::Of(at, said))) => {
                self.note(
                    Timestamp::ZERO + at.since(self.clock.started()),
                    drone,
                    said,
                );
            }
            Some(News::Ended(drone)) => {
                let process = self.processes.get_mut(&drone);
                // That one was ended by the plan is known, and when.
                if process.is_none_or(DroneProcess::has_ended) {
                    self.note(Timestamp::ZERO + self.lasted(), drone, Said::Ended);
                }
            }
            Some(News::Said(drone, Spoken::Ready)) => {
                if let Some(process) = self.processes.get_mut(&drone) {
                    process.is_there();
                }
            }
            Some(News::Lost { host, last }) => return Err(SwarmError::HostLost { host, last }),
            Some(News::Said(_, Spoken::Words(_))) | None => {}
        }
        Ok(())
    }

    /// For how long the flight has lasted.
    fn lasted(&self) -> Duration {
        self.clock.now().since(self.clock.started())
    }

    /// Keeps something for the twin to be told when it is there.
    fn note(&mut self, at: Timestamp, drone: NodeId, said: Said) {
        self.heard += 1;
        self.said.insert((at, self.heard), (drone, said));
    }

    /// Lets the twin go on, and the processes be as it says.
    fn go_on(&mut self) {
        let until = Timestamp::ZERO + self.lasted().saturating_sub(self.behind);
        // Not all at once, should the machine have stood still: what befalls a process is done before the twin is there.
        while self.twin_is_at < until {
            let now = until.min(self.twin_is_at + TICK);
            while let Some(first) = self.said.first_entry()
                && first.key().0 <= now
            {
                let ((at, _), (drone, said)) = first.remove_entry();
                self.twin.hear(at, drone, said);
            }
            self.twin.advance(now);
            self.twin_is_at = now;
            self.let_processes_be();
            self.inject_actor_faults();
        }
        if self.request.emulates_radio {
            self.tell_losses();
        }
    }

    fn let_processes_be(&mut self) {
        for folder in self.drones {
            let id = folder.id;
            let process_state = self.twin.process(id);
            let Some(process) = self.processes.get_mut(&id) else {
                continue;
            };
            if process.be(process_state) && self.twin.is_overruled(id) {
                let vehicle = self.vehicle(id);
                self.processes[&id].tell(&vehicle);
            } else if process_state == ProcessState::Runs && process.can_start_again() {
                self.add(folder, Begin::Again(self.vehicle(id)));
            }
        }
    }

    /// Injects faults of actors into their processes.
    fn inject_actor_faults(&mut self) {
        for (drone, fault, lasts) in self.twin.take_actor_faults() {
            let (actor, fault) = match fault {
                DroneFault::CrashActor(actor) => (actor, ActorFault::Crashes),
                DroneFault::Hang(Some(actor)) => {
                    (actor, ActorFault::Hangs(lasts.map(|it| it.as_secs_f64())))
                }
                _ => continue,
            };
            if let Some(process) = self.processes.get(&drone) {
                process.tell(&ControlMessage::Inject { actor, fault });
            }
        }
    }

    /// Lets each process know whom it does not hear, if that has changed.
    fn tell_losses(&mut self) {
        let as_of = Some(self.twin.loss_changes());
        if self.losses_as_of == as_of {
            return;
        }
        let mut are_all_told = true;
        for (to, process) in &self.processes {
            if self.twin.process(*to) == ProcessState::Hangs {
                are_all_told = false;
                continue;
            }
            let others = self.twin.nodes().filter(|from| from != to);
            let losses = Losses::of(others.map(|from| (from, self.twin.loss(from, *to))));
            let known = self.told.get(to);
            if known.is_some_and(|known| !known.differs(&losses, LOSS_STEP)) {
                continue;
            }
            if process.tell(&ControlMessage::Losses(losses.clone())) {
                self.told.insert(*to, losses);
            } else {
                are_all_told &= process.is_ended();
            }
        }
        self.losses_as_of =
            as_of.filter(|_| are_all_told && self.told.len() == self.processes.len());
    }

    /// Gives the processes time to end by themselves, and hears what they still say; their agents kill whoever is left.
    async fn let_end(&mut self) {
        let deadline = Deadline::now() + END_MAX;
        let runs = |it: &DroneProcess| !it.is_ended();
        while self.processes.values().any(runs) {
            match timeout_at(deadline, self.crew.news.recv()).await {
                // All drones are down: a host that is lost now is missed no more.
                Ok(news) => drop(self.hear(news)),
                Err(_) => break,
            }
        }
        while let Some(((at, _), (drone, said))) = self.said.pop_first() {
            self.twin.hear(at, drone, said);
        }
    }
}
