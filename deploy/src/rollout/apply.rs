//! Carries out a rollout: a thread a host, and one place that decides.

use std::collections::BTreeSet;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread;
use std::time::{Duration, Instant};

use muster_daemon::slots::protocol::SlotOrder;
use muster_daemon::slots::{DroneHealth, HostFacts};
use serde::Serialize;

use super::desired::Desired;
use super::look::{Found, look_at, named, of_hosts, on_all};
use super::plan::{HostPlan, Place, Work, waits_for};
use super::session::{Session, SessionError};
use super::waves::{Action, Event, HostState, Rollout, Sight};
use super::worker::{self, Job, Report, Worker, complaint};
use crate::hosts::Fleet;
use crate::release::Release;

/// Time between two decisions.
const PERIOD: Duration = Duration::from_millis(200);
/// Time that another operator's lock is waited for: a lost session ends after ten seconds.
const LOCK_MAX: Duration = Duration::from_secs(15);

/// A rollout to carry out.
#[derive(Debug)]
pub struct ApplyRequest<'a> {
    /// The fleet.
    pub fleet: &'a Fleet,
    /// The release.
    pub release: &'a Release,
    /// What each host should have.
    pub desired: &'a [Desired],
    /// Who asks, for others that find the hosts locked.
    pub operator: &'a str,
    /// Whether drones in flight are called down, a host at a time, and how many must go on flying.
    pub keep_flying: Option<usize>,
}

/// What goes on, for the operator.
#[derive(Debug)]
pub struct Progress<'a> {
    /// Name of the host.
    pub host: &'a str,
    /// What it does, in words.
    pub words: String,
}

/// How a host came out of a rollout.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum HostOutcome {
    /// It had the release already.
    Unchanged,
    /// It has the release now.
    Changed,
    /// It waits for drones in flight.
    Deferred,
    /// The release failed there, and the host went back by itself.
    WentBack,
    /// It was taken back with its wave.
    TakenBack,
    /// It could not be changed or taken back.
    Failed,
    /// Its wave was not reached.
    NotReached,
}

/// A host after a rollout.
#[derive(Debug, Clone, Serialize)]
pub struct Applied {
    /// Name of the host.
    pub name: String,
    /// Its wave, from 1.
    pub wave: usize,
    /// How it came out.
    pub outcome: HostOutcome,
    /// Why, or what the operator should know, in words.
    pub remark: Option<String>,
    /// Version that the host runs. `None` if it runs none, or was not seen.
    pub version: Option<String>,
    /// Time from when its release was asked for until it had proven itself or was taken back, in seconds.
    pub took_s: Option<f64>,
}

/// Carries out a rollout. Returns how each host came out, and why the rollout was stopped, if it was.
#[must_use]
pub fn apply(
    request: &ApplyRequest<'_>,
    watch: &mut dyn FnMut(Progress<'_>),
) -> (Vec<Applied>, Option<String>) {
    let waiting = AtomicUsize::new(request.fleet.hosts.len());
    let begun = on_all(request.fleet, |nth, _| {
        let begun = begin(request, nth);
        waiting.fetch_sub(1, Ordering::Relaxed);
        let (mut session, facts) = begun?;
        // A host on trial keeps the others waiting, and a host ends a session that is silent.
        while waiting.load(Ordering::Relaxed) > 0 {
            session.ask(&SlotOrder::Ping)?;
            thread::sleep(PERIOD);
        }
        Ok((session, facts))
    });
    let (sender, reports) = channel();
    let mut found = Vec::new();
    thread::scope(|scope| {
        let mut jobs = Vec::new();
        for (nth, begun) in begun.into_iter().enumerate() {
            let (job, to_do) = channel();
            jobs.push(job);
            found.push(match begun {
                Ok((session, facts)) => {
                    let worker = Worker {
                        run: &request.fleet.hosts[nth].run,
                        release: request.release,
                        desired: &request.desired[nth],
                        operator: request.operator,
                        reports: sender.clone(),
                        host: nth,
                        session: None,
                    };
                    let processor = session.processor.clone();
                    let worker = Worker {
                        session: Some(session),
                        ..worker
                    };
                    scope.spawn(move || worker.run(&to_do));
                    Ok((processor, facts))
                }
                Err(error) => Err(error),
            });
        }
        drop(sender);
        Applying::new(request, found, jobs).run(&reports, watch)
    })
}

/// Opens a host's session, locks the host and looks at it. Waits for a trial that is on.
fn begin(request: &ApplyRequest<'_>, nth: usize) -> Result<(Session, HostFacts), SessionError> {
    let start = Instant::now();
    let mut session = worker::open(&request.fleet.hosts[nth].run, request.release)?;
    loop {
        match worker::lock(&mut session, request.operator) {
            Err(SessionError::Busy(_)) if start.elapsed() < LOCK_MAX => thread::sleep(PERIOD),
            locked => break locked?,
        }
    }
    let gate = request.desired[nth].facts.gate;
    let trial_max = Duration::from_secs(u64::from(gate.within_s) + u64::from(gate.hold_s));
    loop {
        let facts = look_at(&mut session)?;
        if !facts.is_on_trial || start.elapsed() > LOCK_MAX + trial_max {
            return Ok((session, facts));
        }
        thread::sleep(PERIOD);
    }
}

/// A rollout that is carried out.
struct Applying<'a> {
    request: &'a ApplyRequest<'a>,
    plans: Vec<HostPlan>,
    rollout: Rollout,
    jobs: Vec<Sender<Job>>,
    facts: Vec<Option<HostFacts>>,
    /// When each host was last seen, and what it had dropped.
    dropped: Vec<Option<(Instant, u64)>>,
    /// How often systemd had started each host's drones again when its release had proven itself.
    restarts: Vec<Option<u32>>,
    began: Vec<Option<Instant>>,
    took: Vec<Option<Duration>>,
    start: Instant,
}

impl<'a> Applying<'a> {
    fn new(request: &'a ApplyRequest<'a>, found: Vec<Found>, jobs: Vec<Sender<Job>>) -> Self {
        let plans = of_hosts(request.fleet, request.release, request.desired, &found);
        let facts = found.into_iter().map(|it| it.ok().map(|it| it.1));
        let facts: Vec<_> = facts.collect();
        let states = plans.iter().map(|plan| match &plan.work {
            Work::Blocked { why } => HostState::Blocked(why.clone()),
            Work::None => HostState::Unchanged,
            _ if !plan.in_flight.is_empty() => HostState::Deferred,
            _ => HostState::Waiting,
        });
        let in_flight = plans.iter().map(|plan| plan.in_flight.len());
        let hosts = jobs.len();
        let places: Vec<_> = request
            .fleet
            .hosts
            .iter()
            .zip(request.desired)
            .zip(&facts)
            .collect();
        let places = places.iter().map(|((host, desired), facts)| {
            let current = facts.as_ref().and_then(|it| it.current.as_ref());
            let has = current.iter().flat_map(|it| it.drones.keys()).copied();
            Place {
                host: &host.name,
                wants: desired.facts.drones.keys().copied().collect(),
                has: has.collect(),
            }
        });
        let waits_for = waits_for(&places.collect::<Vec<_>>());
        Self {
            rollout: Rollout::new(
                request.fleet.waves.clone(),
                states.collect(),
                in_flight.collect(),
                waits_for,
                request.keep_flying,
            ),
            request,
            plans,
            jobs,
            facts,
            dropped: vec![None; hosts],
            restarts: vec![None; hosts],
            began: vec![None; hosts],
            took: vec![None; hosts],
            start: Instant::now(),
        }
    }

    fn run(
        mut self,
        reports: &Receiver<(usize, Report)>,
        watch: &mut dyn FnMut(Progress<'_>),
    ) -> (Vec<Applied>, Option<String>) {
        let mut wave = usize::MAX;
        loop {
            for action in self.rollout.poll(self.start.elapsed()) {
                self.act(action, watch);
            }
            if self.rollout.is_over() {
                return self.end();
            }
            let (now, soaks) = self.rollout.wave();
            if soaks.is_some() && wave != now {
                wave = now;
                for host in &self.request.fleet.waves[now].hosts {
                    let is_changed = self.rollout.hosts()[*host] == HostState::Changed;
                    if is_changed {
                        self.say(*host, "soaks".to_owned(), watch);
                    }
                }
            }
            match reports.recv_timeout(PERIOD) {
                Ok((host, report)) => self.take(host, report, watch),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => thread::sleep(PERIOD),
            }
        }
    }

    fn say(&self, host: usize, words: String, watch: &mut dyn FnMut(Progress<'_>)) {
        let host = &self.request.fleet.hosts[host].name;
        watch(Progress { host, words });
    }

    fn act(&mut self, action: Action, watch: &mut dyn FnMut(Progress<'_>)) {
        let (host, job, words) = match action {
            Action::Change(host) => {
                let peers = self.peers_of(host);
                (host, Job::Change { peers }, "is to be changed")
            }
            Action::TakeBack(host) => (host, Job::TakeBack, "is taken back"),
            Action::Recall(host) => {
                let facts = self.facts[host].iter().flat_map(|it| &it.drones);
                let flying = facts.filter(|(_, drone)| drone.in_flight);
                let drones = flying.map(|(id, _)| *id).collect();
                (host, Job::Recall { drones }, "calls its drones down")
            }
        };
        self.began[host] = Some(Instant::now());
        self.say(host, words.to_owned(), watch);
        if self.jobs[host].send(job).is_err() {
            let event = match action {
                Action::TakeBack(_) => Event::TakenBack(Err("can't be reached".to_owned())),
                _ => Event::Failed("can't be reached".to_owned()),
            };
            self.rollout.handle(self.start.elapsed(), host, event);
        }
    }

    /// Drones of other hosts that are healthy: a new release must prove itself to them.
    fn peers_of(&self, host: usize) -> BTreeSet<u32> {
        let others = self
            .facts
            .iter()
            .enumerate()
            .filter(|(nth, _)| *nth != host);
        let drones = others.flat_map(|(_, facts)| facts.iter().flat_map(|it| &it.drones));
        let healthy = drones.filter(|(_, it)| matches!(it.health, DroneHealth::Healthy { .. }));
        healthy.map(|(id, _)| *id).collect()
    }

    fn take(&mut self, host: usize, report: Report, watch: &mut dyn FnMut(Progress<'_>)) {
        let now = self.start.elapsed();
        let event = match report {
            Report::Phase(words) => return self.say(host, words.to_owned(), watch),
            Report::Away(why) => {
                if let Some(facts) = &mut self.facts[host] {
                    // A new release need not prove itself to drones that nobody sees.
                    facts.drones.clear();
                }
                Event::Seen(Sight {
                    in_flight: None,
                    complaint: Some(why),
                    dropped_per_s: 0.0,
                })
            }
            Report::Facts(facts) => Event::Seen(self.sight(host, *facts)),
            Report::Changed(facts) => {
                self.restarts[host] = Some(restarts(&facts));
                self.facts[host] = Some(*facts);
                self.say(host, "has the release".to_owned(), watch);
                Event::Changed
            }
            Report::Failed(why) => {
                self.say(host, format!("went back: {why}"), watch);
                Event::Failed(why)
            }
            Report::Deferred => {
                self.say(host, "its drones took off".to_owned(), watch);
                Event::Deferred
            }
            Report::Blocked(why) => {
                self.say(host, format!("is left out: {why}"), watch);
                Event::Blocked(why)
            }
            Report::TakenBack(result) => {
                self.say(host, "was taken back".to_owned(), watch);
                Event::TakenBack(result)
            }
        };
        if !matches!(event, Event::Seen(_)) {
            self.took[host] = self.began[host].map(|it| it.elapsed());
        }
        self.rollout.handle(now, host, event);
    }

    /// How a host looks.
    fn sight(&mut self, host: usize, facts: HostFacts) -> Sight {
        let dropped = facts
            .drones
            .values()
            .map(|drone| drone.dropped)
            .max()
            .unwrap_or(0);
        let before = self.dropped[host].replace((Instant::now(), dropped));
        let rate = before.map(|(at, before)| {
            #[expect(clippy::cast_precision_loss, reason = "counts are far below 2^52")]
            let more = dropped.saturating_sub(before) as f64;
            more / at.elapsed().as_secs_f64().max(0.1)
        });
        let sight = Sight {
            in_flight: Some(
                facts
                    .drones
                    .values()
                    .filter(|drone| drone.in_flight)
                    .count(),
            ),
            complaint: complaint(&facts).or_else(|| {
                let more = self.restarts[host].is_some_and(|before| restarts(&facts) > before);
                more.then(|| "a drone's process was started again".to_owned())
            }),
            dropped_per_s: rate.unwrap_or(0.0),
        };
        self.facts[host] = Some(facts);
        sight
    }

    fn end(self) -> (Vec<Applied>, Option<String>) {
        let planned = named(self.request.fleet, self.plans.clone());
        let hosts = planned.into_iter().zip(self.rollout.hosts()).enumerate();
        let applied = hosts.map(|(nth, (planned, state))| {
            let (outcome, remark) = outcome(state);
            let notes = planned.plan.notes;
            let current = self.facts[nth].as_ref().and_then(|it| it.current.as_ref());
            Applied {
                name: planned.name,
                wave: planned.wave,
                outcome,
                remark: remark.or_else(|| (!notes.is_empty()).then(|| notes.join("; "))),
                version: current.map(|it| it.version.clone()),
                took_s: self.took[nth].map(|it| it.as_secs_f64()),
            }
        });
        let names: Vec<_> = self.request.fleet.hosts.iter().map(|it| &it.name).collect();
        let stopped = self.rollout.stopped().map(|why| with_names(why, &names));
        (applied.collect(), stopped)
    }
}

/// Why a rollout stopped, with the host's name instead of its number.
fn with_names(why: &str, names: &[&String]) -> String {
    let named = why.strip_prefix("host ").and_then(|rest| {
        let (number, rest) = rest.split_once(':')?;
        let name = names.get(number.parse::<usize>().ok()?)?;
        Some(format!("{name}:{rest}"))
    });
    named.unwrap_or_else(|| why.to_owned())
}

/// How often systemd has started a host's drones again.
fn restarts(facts: &HostFacts) -> u32 {
    facts.drones.values().map(|drone| drone.restarts).sum()
}

fn outcome(state: &HostState) -> (HostOutcome, Option<String>) {
    match state {
        HostState::Unchanged => (HostOutcome::Unchanged, None),
        HostState::Changed => (HostOutcome::Changed, None),
        HostState::Deferred | HostState::Recalled { .. } => {
            let why = "its drones take part in a flight";
            (HostOutcome::Deferred, Some(why.to_owned()))
        }
        HostState::Failed(why) => (HostOutcome::WentBack, Some(why.clone())),
        HostState::TakenBack(Ok(())) => (HostOutcome::TakenBack, None),
        HostState::TakenBack(Err(why)) | HostState::Blocked(why) => {
            (HostOutcome::Failed, Some(why.clone()))
        }
        HostState::Waiting | HostState::Changing | HostState::TakingBack => {
            (HostOutcome::NotReached, None)
        }
    }
}
