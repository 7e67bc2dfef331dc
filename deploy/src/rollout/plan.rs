//! What a rollout would change on a host, and why.

use std::collections::{BTreeMap, BTreeSet};

use muster_daemon::slots::HostFacts;
use serde::Serialize;

use super::desired::Desired;

/// What is to be done with a host.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case", tag = "kind")]
pub enum Work {
    /// It has what it should have.
    None,
    /// It has no release yet.
    Install,
    /// It has another release.
    Upgrade {
        /// Version that runs.
        from: String,
    },
    /// It has the release with another configuration.
    Configure,
    /// It can't be changed now; why, in words.
    Blocked {
        /// The reason.
        why: String,
    },
}

/// The plan for one host.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct HostPlan {
    /// What is to be done.
    pub work: Work,
    /// Drones that are armed or take part in a flight: the host waits for them.
    pub in_flight: Vec<u32>,
    /// What the operator should know, in words.
    pub notes: Vec<String>,
}

impl HostPlan {
    /// For a host that can't be reached.
    #[must_use]
    pub fn blocked(why: impl Into<String>) -> Self {
        Self {
            work: Work::Blocked { why: why.into() },
            in_flight: Vec::new(),
            notes: Vec::new(),
        }
    }

    /// Plans the change of a host. `bytes` is the size of its new slot.
    #[must_use]
    pub fn new(desired: &Desired, found: &HostFacts, bytes: u64) -> Self {
        let flying = found.drones.iter().filter(|(_, drone)| drone.in_flight);
        let work = work(desired, found, bytes);
        Self {
            in_flight: flying.map(|(id, _)| *id).collect(),
            notes: notes(desired, found, &work),
            work,
        }
    }

    /// Whether the host is to be changed.
    #[must_use]
    pub const fn changes(&self) -> bool {
        matches!(
            self.work,
            Work::Install | Work::Upgrade { .. } | Work::Configure
        )
    }
}

fn work(desired: &Desired, found: &HostFacts, bytes: u64) -> Work {
    let id = desired.id();
    let is_good = found.good.as_ref() == Some(&id);
    match &found.current {
        Some(current) if current.id() == id && is_good => Work::None,
        _ if found.free_bytes < bytes => {
            let (needed, free) = (bytes.div_ceil(1_000_000), found.free_bytes / 1_000_000);
            let why = format!("needs {needed} MB of free space, found {free} MB");
            Work::Blocked { why }
        }
        None => Work::Install,
        Some(current) if current.release == desired.facts.release => Work::Configure,
        Some(current) => Work::Upgrade {
            from: current.version.clone(),
        },
    }
}

fn notes(desired: &Desired, found: &HostFacts, work: &Work) -> Vec<String> {
    let mut notes = Vec::new();
    if let Some(failure) = &found.failure {
        notes.push(format!("{} was taken back: {}", failure.slot, failure.why));
    }
    let Some(current) = &found.current else {
        return notes;
    };
    let is_changed = !matches!(work, Work::None | Work::Blocked { .. });
    let common = |ours: &[u8], theirs: &[u8]| ours.iter().any(|it| theirs.contains(it));
    if is_changed && !common(&desired.facts.wire, &current.wire) {
        let version = &desired.facts.version;
        let message = format!(
            "{version} and {} have no frames in common: drones of both don't fly together",
            current.version
        );
        notes.push(message);
    }
    if is_changed && !common(&desired.facts.journal, &current.journal) {
        let message =
            "the new release does not read this journal: raise `flight` in the fleet's file";
        notes.push(message.to_owned());
    }
    notes
}

/// A host and its drones.
pub(super) struct Place<'a> {
    /// Name of the host.
    pub(super) host: &'a str,
    /// Drones that it should have.
    pub(super) wants: BTreeSet<u32>,
    /// Drones of its running slot.
    pub(super) has: BTreeSet<u32>,
}

/// For each host, the hosts that must be changed before it, and why: they lose a drone that it gets, and no drone may run
/// twice.
pub(super) fn waits_for(places: &[Place<'_>]) -> Vec<BTreeMap<usize, String>> {
    let waits = places.iter().enumerate().map(|(nth, place)| {
        let others = places.iter().enumerate().filter(|(other, _)| *other != nth);
        let losing = others.filter_map(|(other, at)| {
            let mut lost = at.has.difference(&at.wants);
            let moved = lost.find(|id| place.wants.contains(id) && !place.has.contains(id))?;
            let why = format!(
                "drone {moved} still runs on {}, which must be changed first",
                at.host
            );
            Some((other, why))
        });
        losing.collect()
    });
    waits.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn host_that_gets_a_drone_waits_for_the_one_that_loses_it() {
        let place = |host, has: &[u32], wants: &[u32]| Place {
            host,
            wants: wants.iter().copied().collect(),
            has: has.iter().copied().collect(),
        };
        let moved = waits_for(&[
            place("a", &[0], &[0, 1]),
            place("b", &[1, 2], &[2]),
            place("c", &[3], &[3]),
        ]);
        let why = "drone 1 still runs on b, which must be changed first";
        let expected = [(1, why.to_owned())].into();
        assert_eq!(moved, [expected, BTreeMap::new(), BTreeMap::new()]);
    }
}
