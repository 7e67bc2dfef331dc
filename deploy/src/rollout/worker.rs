//! One host during a rollout: a thread that looks at it, and does what the rollout asks for.

use std::collections::BTreeSet;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender};
use std::thread;
use std::time::{Duration, Instant};

use muster_daemon::slots::protocol::{SlotOrder, SlotReply};
use muster_daemon::slots::{DroneHealth, HostFacts};

use super::desired::Desired;
use super::session::{Session, SessionError};
use crate::release::Release;

/// Time between two looks at a host.
pub(super) const PERIOD: Duration = Duration::from_millis(500);
/// Time for a host to come back after its connection was lost: a restart of a Raspberry Pi takes half of it.
pub(super) const AWAY_MAX: Duration = Duration::from_secs(90);
/// Time for the release before to be healthy again.
pub(super) const BACK_MAX: Duration = Duration::from_secs(30);

/// What a host is asked for.
#[derive(Debug)]
pub(super) enum Job {
    /// Install the slot and try it; each drone must hear these.
    Change { peers: BTreeSet<u32> },
    /// Run the release before it.
    TakeBack,
    /// Call these drones down.
    Recall { drones: Vec<u32> },
}

/// What a host reports.
#[derive(Debug)]
pub(super) enum Report {
    /// How it looks.
    Facts(Box<HostFacts>),
    /// What it does now, in words.
    Phase(&'static str),
    /// The release has proven itself.
    Changed(Box<HostFacts>),
    /// It did not take the release, or went back by itself; why, in words.
    Failed(String),
    /// Its drones took off before the release was tried.
    Deferred,
    /// It was lost, is another operator's or did not begin the trial, and has not been changed; why, in words.
    Blocked(String),
    /// It runs the release before, or could not; why, in words.
    TakenBack(Result<(), String>),
    /// It can't be reached for now; why, in words.
    Away(String),
}

/// A host and how to reach it.
pub(super) struct Worker<'a> {
    pub(super) run: &'a [String],
    pub(super) release: &'a Release,
    pub(super) desired: &'a Desired,
    pub(super) operator: &'a str,
    pub(super) session: Option<Session>,
    pub(super) reports: Sender<(usize, Report)>,
    pub(super) host: usize,
}

impl Worker<'_> {
    /// Looks and does jobs until the rollout drops its end.
    pub(super) fn run(mut self, jobs: &Receiver<Job>) {
        loop {
            let report = match jobs.recv_timeout(PERIOD) {
                Ok(Job::Change { peers }) => self.change(&peers),
                Ok(Job::TakeBack) => Report::TakenBack(self.take_back()),
                Ok(Job::Recall { drones }) => match self.recall(&drones) {
                    Ok(()) => Report::Phase("calls its drones down"),
                    Err(error) => Report::Blocked(error.to_string()),
                },
                Err(RecvTimeoutError::Timeout) => match self.look() {
                    Ok(facts) => Report::Facts(facts),
                    Err(error) => Report::Away(error.to_string()),
                },
                Err(RecvTimeoutError::Disconnected) => return,
            };
            self.report(report);
        }
    }

    fn report(&self, report: Report) {
        // The rollout is over if nobody listens.
        let _ = self.reports.send((self.host, report));
    }

    /// The session, opened and locked again if it was lost.
    fn session(&mut self) -> Result<&mut Session, SessionError> {
        if self.session.is_none() {
            let mut session = open(self.run, self.release)?;
            match lock(&mut session, self.operator) {
                // The host has not noticed yet that the session before was lost.
                Err(SessionError::Busy(other)) if other == self.operator => {
                    return Err(SessionError::Lost(
                        "the last session has not ended".to_owned(),
                    ));
                }
                locked => locked?,
            }
            self.session = Some(session);
        }
        Ok(self.session.as_mut().expect("it was just opened"))
    }

    fn ask(&mut self, order: &SlotOrder, bytes: Vec<u8>) -> Result<SlotReply, SessionError> {
        let asked = self.session()?.ask_with(order, bytes);
        if matches!(asked, Err(SessionError::Lost(_))) {
            self.session = None;
        }
        asked
    }

    fn look(&mut self) -> Result<Box<HostFacts>, SessionError> {
        match self.ask(&SlotOrder::Look, Vec::new())? {
            SlotReply::Host(facts) => Ok(facts),
            other => Err(SessionError::Refused(format!("unexpected reply {other:?}"))),
        }
    }

    /// Looks until `is_done`, or until the time is up. A lost connection is opened again: the host goes on by itself.
    fn look_until(
        &mut self,
        limit: Duration,
        is_done: impl Fn(&HostFacts) -> bool,
    ) -> Result<Box<HostFacts>, SessionError> {
        let (start, mut last_seen) = (Instant::now(), Instant::now());
        loop {
            match self.look() {
                Ok(facts) => {
                    last_seen = Instant::now();
                    if is_done(&facts) || start.elapsed() > limit {
                        return Ok(facts);
                    }
                    self.report(Report::Facts(facts));
                }
                Err(SessionError::Lost(why)) => {
                    if last_seen.elapsed() > AWAY_MAX {
                        return Err(SessionError::Lost(why));
                    }
                    self.report(Report::Away(why));
                }
                Err(error) => return Err(error),
            }
            thread::sleep(PERIOD);
        }
    }

    fn change(&mut self, peers: &BTreeSet<u32>) -> Report {
        let tried = match self.install(peers) {
            Ok(slot) => match self.begin_trial(&slot) {
                Ok(()) => self.await_trial(&slot),
                Err(error) => return Report::Blocked(error.to_string()),
            },
            Err(error @ (SessionError::Lost(_) | SessionError::Busy(_))) => {
                return Report::Blocked(error.to_string());
            }
            Err(error) => Err(error),
        };
        tried.unwrap_or_else(|error| Report::Failed(error.to_string()))
    }

    /// Installs the release. Returns the slot.
    fn install(&mut self, peers: &BTreeSet<u32>) -> Result<String, SessionError> {
        let processor = self.session()?.processor.clone();
        let slot = self.desired.slot(self.release, &processor, peers.clone());
        let (incoming, contents) = slot.map_err(|error| SessionError::OtherProcessor(error.0))?;
        self.report(Report::Phase("gets the release"));
        match self.ask(&SlotOrder::Install(Box::new(incoming)), contents)? {
            SlotReply::Installed { slot } => Ok(slot),
            other => Err(SessionError::Refused(format!("unexpected reply {other:?}"))),
        }
    }

    /// Lets the host try a slot. It refuses if a drone that was started by hand may be in flight, and has not changed then.
    fn begin_trial(&mut self, slot: &str) -> Result<(), SessionError> {
        self.report(Report::Phase("is on trial"));
        let slot = slot.to_owned();
        // Without a reply the trial may have begun, and the host says how it ends.
        match self.ask(&SlotOrder::Try { slot }, Vec::new()) {
            Ok(_) | Err(SessionError::Lost(_)) => Ok(()),
            Err(error) => Err(error),
        }
    }

    fn await_trial(&mut self, slot: &String) -> Result<Report, SessionError> {
        let gate = self.desired.facts.gate;
        let limit =
            Duration::from_secs(u64::from(gate.within_s) + u64::from(gate.hold_s)) + BACK_MAX;
        let facts = self.look_until(limit, |facts| !facts.is_on_trial)?;
        if facts.good.as_ref() == Some(slot) {
            return Ok(Report::Changed(facts));
        }
        let failure = facts.failure.as_ref().filter(|it| it.slot == *slot);
        let why = match failure {
            Some(failure) => failure.why.clone(),
            None if facts.drones.values().any(|drone| drone.in_flight) => {
                self.report(Report::Facts(facts));
                return Ok(Report::Deferred);
            }
            None if facts.is_on_trial => "the trial did not end in time".to_owned(),
            None => {
                let why = "the host did not begin the trial".to_owned();
                return Ok(Report::Blocked(why));
            }
        };
        // The host went back by itself; the release before is healthy again before this is said.
        self.report(Report::Phase("goes back"));
        let back = self.look_until(BACK_MAX, is_well)?;
        if back.good.as_ref() == Some(slot) {
            // A busy host has judged late.
            return Ok(Report::Changed(back));
        }
        let is_back = is_well(&back) || back.current.is_none();
        self.report(Report::Facts(back));
        if !is_back {
            return Ok(Report::Failed(format!(
                "{why}; the release before is not healthy"
            )));
        }
        Ok(Report::Failed(why))
    }

    fn take_back(&mut self) -> Result<(), String> {
        let id = self.desired.id();
        let back = self.roll_back(&id).and_then(|()| {
            self.look_until(BACK_MAX, |facts| {
                facts.good.as_ref() != Some(&id) && is_well(facts)
            })
        });
        match back {
            Ok(facts) if facts.good.as_ref() == Some(&id) => Err(match facts.rollback_slot {
                Some(_) => "the host did not go back".to_owned(),
                None => "there is no release before it".to_owned(),
            }),
            Ok(facts) if !is_well(&facts) => Err("the release before is not healthy".to_owned()),
            Ok(_) => Ok(()),
            Err(error) => Err(error.to_string()),
        }
    }

    /// Asks for the release before this slot. A lost host is waited for, and looked at before it is asked again: it may have
    /// gone back without a reply.
    fn roll_back(&mut self, slot: &String) -> Result<(), SessionError> {
        let start = Instant::now();
        loop {
            let facts = self.look_until(Duration::ZERO, |_| true)?;
            if facts.good.as_ref() != Some(slot) {
                return Ok(());
            }
            match self.ask(&SlotOrder::RollBack, Vec::new()) {
                Err(SessionError::Lost(why)) if start.elapsed() <= AWAY_MAX => {
                    self.report(Report::Away(why));
                    thread::sleep(PERIOD);
                }
                // Without a reply the next looks tell.
                Ok(_) | Err(SessionError::Lost(_)) => return Ok(()),
                Err(error) => return Err(error),
            }
        }
    }

    fn recall(&mut self, drones: &[u32]) -> Result<(), SessionError> {
        for drone in drones {
            self.ask(&SlotOrder::Recall { drone: *drone }, Vec::new())?;
        }
        Ok(())
    }
}

/// Whether all drones of a host run and report no fault. A drone is also well after its flight.
pub(super) fn is_well(facts: &HostFacts) -> bool {
    let is_well = |health: &DroneHealth| {
        matches!(
            health,
            DroneHealth::Healthy { .. } | DroneHealth::FlightOver
        )
    };
    !facts.is_on_trial && facts.drones.values().all(|drone| is_well(&drone.health))
}

/// What is wrong with a host, in words. `None` if it is well.
pub(super) fn complaint(facts: &HostFacts) -> Option<String> {
    if is_well(facts) {
        return None;
    }
    let mut drones = facts.drones.iter();
    drones.find_map(|(id, drone)| match &drone.health {
        DroneHealth::Healthy { .. } | DroneHealth::FlightOver => None,
        DroneHealth::Starting(words) | DroneHealth::Unhealthy(words) | DroneHealth::Dead(words) => {
            Some(format!("drone {id}: {words}"))
        }
    })
}

/// Opens a session; a host without a release gets the program of this one.
pub(super) fn open(run: &[String], release: &Release) -> Result<Session, SessionError> {
    let program = |processor: &str| {
        let content = release.files.get(&format!("{processor}/musterd"));
        content.map(Vec::as_slice)
    };
    Session::open(run, Some(&program))
}

/// Locks a host against other operators for as long as the session lasts.
pub(super) fn lock(session: &mut Session, operator: &str) -> Result<(), SessionError> {
    let operator = operator.to_owned();
    session.ask(&SlotOrder::Lock { operator }).map(drop)
}

#[cfg(test)]
mod tests;
