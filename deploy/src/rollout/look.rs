//! Looks at all hosts of a fleet at once, and plans what a rollout would change.

use std::thread;
use std::time::Instant;

use muster_daemon::audit::Finding;
use muster_daemon::slots::HostFacts;
use muster_daemon::slots::protocol::{SlotOrder, SlotReply};
use serde::Serialize;

use super::desired::Desired;
use super::plan::{HostPlan, Work, deaf_to};
use super::session::{Session, SessionError};
use super::worker;
use crate::hosts::{Fleet, FleetHost};
use crate::release::Release;
use crate::remote::own_connection;

/// A host and what it says of itself.
#[derive(Debug)]
pub struct Looked {
    /// Name of the host.
    pub name: String,
    /// What it says, or why it does not.
    pub facts: Result<HostFacts, SessionError>,
}

/// Looks at all hosts in parallel. The result is in the order of the hosts.
#[must_use]
pub fn look(fleet: &Fleet) -> Vec<Looked> {
    let looked = on_all(fleet, |_, host| ask(Session::open(&host.run, None)?));
    let named = looked.into_iter().zip(&fleet.hosts);
    named
        .map(|(facts, host)| Looked {
            name: host.name.clone(),
            facts,
        })
        .collect()
}

/// Does something with all hosts in parallel.
pub(super) fn on_all<T: Send>(
    fleet: &Fleet,
    work: impl Fn(usize, &FleetHost) -> T + Sync,
) -> Vec<T> {
    let work = &work;
    std::thread::scope(|scope| {
        let hosts = fleet.hosts.iter().enumerate();
        let threads = hosts.map(|(nth, host)| scope.spawn(move || work(nth, host)));
        let threads: Vec<_> = threads.collect();
        let results = threads.into_iter().map(|it| it.join());
        results
            .map(|it| it.expect("the work does not panic"))
            .collect()
    })
}

fn ask(mut session: Session) -> Result<HostFacts, SessionError> {
    look_at(&mut session)
}

pub(super) fn look_at(session: &mut Session) -> Result<HostFacts, SessionError> {
    match session.ask(&SlotOrder::Look)? {
        SlotReply::Host(facts) => Ok(*facts),
        other => Err(SessionError::Refused(format!("unexpected reply {other:?}"))),
    }
}

/// A host and what a rollout would change on it.
#[derive(Debug, Serialize)]
pub struct Planned {
    /// Name of the host.
    pub name: String,
    /// Its wave, from 1.
    pub wave: usize,
    /// What would be changed.
    #[serde(flatten)]
    pub plan: HostPlan,
}

/// Plans a rollout. Nothing is changed on any host.
#[must_use]
pub fn plan(fleet: &Fleet, release: &Release, desired: &[Desired]) -> Vec<Planned> {
    let found = on_all(fleet, |_, host| {
        let mut session = worker::open(&host.run, release)?;
        let facts = look_at(&mut session)?;
        Ok((session.processor.clone(), facts))
    });
    named(fleet, of_hosts(fleet, release, desired, &found))
}

/// A host's processor and what it says of itself.
pub(super) type Found = Result<(String, HostFacts), SessionError>;

/// The plans for all hosts from what they say.
pub(super) fn of_hosts(
    fleet: &Fleet,
    release: &Release,
    desired: &[Desired],
    found: &[Found],
) -> Vec<HostPlan> {
    let hosts = desired.iter().zip(found);
    let mut plans: Vec<_> = hosts
        .map(|(desired, found)| of_host(desired, release, found))
        .collect();
    let names = fleet.hosts.iter().map(|host| host.name.as_str());
    let seen = names.zip(found.iter().map(|it| it.as_ref().ok().map(|it| &it.1)));
    let seen: Vec<_> = seen.collect();
    for (nth, plan) in plans.iter_mut().enumerate() {
        let others = seen.iter().enumerate().filter(|(other, _)| *other != nth);
        let others = others.filter_map(|(_, (name, facts))| Some((*name, (*facts)?)));
        if plan.changes()
            && let Some(why) = deaf_to(&desired[nth].facts, others)
        {
            plan.work = Work::Blocked { why };
        }
    }
    plans
}

fn of_host(desired: &Desired, release: &Release, found: &Found) -> HostPlan {
    let (processor, facts) = match found {
        Ok(found) => found,
        Err(error) => return HostPlan::blocked(error.to_string()),
    };
    match desired.slot(release, processor, Default::default()) {
        Ok((_, contents)) => HostPlan::new(desired, facts, contents.len() as u64),
        Err(error) => HostPlan::blocked(error.to_string()),
    }
}

/// Plans with the names and waves of their hosts.
pub(super) fn named(fleet: &Fleet, plans: Vec<HostPlan>) -> Vec<Planned> {
    let plans = plans.into_iter().zip(&fleet.hosts).zip(0..);
    plans
        .map(|((plan, host), nth)| {
            let wave = fleet
                .waves
                .iter()
                .position(|wave| wave.hosts.contains(&nth));
            Planned {
                name: host.name.clone(),
                wave: wave.map_or(0, |wave| wave + 1),
                plan,
            }
        })
        .collect()
}

/// Runs the release before the current one on the named hosts; on all if none is named. Hosts with drones in flight are left
/// alone. Waits until the drones are healthy. Returns the hosts with the slots that they run, or what went wrong.
#[must_use]
pub fn roll_back(
    fleet: &Fleet,
    names: &[String],
    operator: &str,
) -> Vec<(String, Result<String, SessionError>)> {
    let rolled = on_all(fleet, |_, host| {
        let is_named = names.is_empty() || names.contains(&host.name);
        is_named.then(|| (host.name.clone(), roll_back_host(host, operator)))
    });
    rolled.into_iter().flatten().collect()
}

fn roll_back_host(host: &FleetHost, operator: &str) -> Result<String, SessionError> {
    let mut session = Session::open(&host.run, None)?;
    worker::lock(&mut session, operator)?;
    let facts = look_at(&mut session)?;
    if let Some((id, _)) = facts.drones.iter().find(|(_, drone)| drone.in_flight) {
        return Err(SessionError::Refused(format!(
            "drone {id} takes part in a flight"
        )));
    }
    let Some(to) = facts.rollback_slot else {
        return Err(SessionError::Refused(
            "there is no release before this one".to_owned(),
        ));
    };
    session.ask(&SlotOrder::RollBack)?;
    let start = Instant::now();
    loop {
        let facts = look_at(&mut session)?;
        match worker::complaint(&facts) {
            None => return Ok(to),
            Some(why) if start.elapsed() > worker::BACK_MAX => {
                let why = format!("runs {to}, which is not healthy: {why}");
                return Err(SessionError::Refused(why));
            }
            Some(_) => thread::sleep(worker::PERIOD),
        }
    }
}

/// Audits all hosts in parallel. With `fixes`, sets what can be set, and lets it be undone after a minute unless another session
/// can be opened. A host without a release gets the program of the given one.
#[must_use]
pub fn audit(
    fleet: &Fleet,
    release: Option<&Release>,
    fixes: Option<&str>,
    asks_for_updates: bool,
) -> Vec<(String, Result<Vec<Finding>, SessionError>)> {
    // Only a new login shows that the operator is not locked out.
    let fleet = &with_own_connections(fleet);
    let audited = on_all(fleet, |_, host| {
        let open = || {
            let mut session = match release {
                Some(release) => worker::open(&host.run, release)?,
                None => Session::open(&host.run, None)?,
            };
            if asks_for_updates {
                session.ask(&SlotOrder::WithUpdates)?;
            }
            Ok(session)
        };
        match fixes {
            None => findings(open()?, &SlotOrder::Audit),
            Some(operator) => fix(open, operator),
        }
    });
    let names = fleet.hosts.iter().map(|host| host.name.clone());
    names.zip(audited).collect()
}

/// The fleet, reached by connections that no other command shares.
fn with_own_connections(fleet: &Fleet) -> Fleet {
    let mut fleet = fleet.clone();
    for host in &mut fleet.hosts {
        host.run = own_connection(&host.run);
    }
    fleet
}

fn findings(mut session: Session, order: &SlotOrder) -> Result<Vec<Finding>, SessionError> {
    match session.ask(order)? {
        SlotReply::Findings(findings) => Ok(findings),
        other => Err(SessionError::Refused(format!("unexpected reply {other:?}"))),
    }
}

/// Fixes a host. The first session's end and the second's begin show that the operator is not locked out.
fn fix(
    open: impl Fn() -> Result<Session, SessionError>,
    operator: &str,
) -> Result<Vec<Finding>, SessionError> {
    let mut session = open()?;
    worker::lock(&mut session, operator)?;
    let left = findings(session, &SlotOrder::Fix)?;
    let mut session = open()?;
    worker::lock(&mut session, operator)?;
    session.ask(&SlotOrder::ConfirmFix)?;
    Ok(left)
}
