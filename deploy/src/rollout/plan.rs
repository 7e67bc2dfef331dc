//! What a rollout would change on a host, and why.

use std::collections::{BTreeMap, BTreeSet};

use muster_daemon::slots::{DroneHealth, HostFacts, SlotFacts};
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
    if is_changed && !have_common(&desired.facts.wire, &current.wire) {
        let version = &desired.facts.version;
        let message = format!(
            "{version} and {} have no frames in common: drones of both don't fly together",
            current.version
        );
        notes.push(message);
    }
    if is_changed && !have_common(&desired.facts.journal, &current.journal) {
        let message =
            "the new release does not read this journal: raise `flight` in the fleet's file";
        notes.push(message.to_owned());
    }
    notes
}

fn have_common(ours: &[u8], theirs: &[u8]) -> bool {
    ours.iter().any(|it| theirs.contains(it))
}

/// Why drones of a slot would not hear healthy drones of other hosts, to which they must prove themselves. `None` if they would.
pub(super) fn deaf_to<'a>(
    wanted: &SlotFacts,
    others: impl Iterator<Item = (&'a str, &'a HostFacts)>,
) -> Option<String> {
    let mut unheard = Vec::new();
    let mut has = String::new();
    for (name, facts) in others {
        let mut healths = facts.drones.values().map(|drone| &drone.health);
        let is_peer = healths.any(|it| matches!(it, DroneHealth::Healthy { .. }));
        let Some(current) = facts.current.as_ref().filter(|_| is_peer) else {
            continue;
        };
        let difference = match (&wanted.network, &current.network) {
            (Some(ours), Some(theirs)) if ours != theirs => format!("{theirs} there, {ours} here"),
            _ if !have_common(&wanted.wire, &current.wire) => "no frames in common".to_owned(),
            _ => continue,
        };
        unheard.push(name);
        has = difference;
    }
    let names = unheard.join(", ");
    (!unheard.is_empty()).then(|| {
        format!(
            "would not hear the drones of {names} ({has}): this can't come in waves; stop those drones first"
        )
    })
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
    use muster_daemon::slots::{DroneFacts, GateLimits};

    use super::*;

    fn slot(network: Option<&str>, wire: &[u8]) -> SlotFacts {
        SlotFacts {
            version: "0.1.0".to_owned(),
            release: String::new(),
            configuration: String::new(),
            wire: wire.to_vec(),
            journal: vec![1],
            drones: BTreeMap::new(),
            peers: BTreeSet::new(),
            gate: GateLimits {
                within_s: 60,
                hold_s: 10,
            },
            network: network.map(str::to_owned),
        }
    }

    fn host(slot: SlotFacts, health: DroneHealth) -> HostFacts {
        let drone = DroneFacts {
            health,
            in_flight: false,
            version: None,
            dropped: 0,
            restarts: 0,
        };
        HostFacts {
            current: Some(slot),
            good: None,
            rollback_slot: None,
            is_on_trial: false,
            good_for_s: None,
            failure: None,
            drones: BTreeMap::from([(0, drone)]),
            free_bytes: 0,
        }
    }

    fn healthy() -> DroneHealth {
        let proven = BTreeSet::new();
        DroneHealth::Healthy { proven }
    }

    fn why(wanted: &SlotFacts, other: &HostFacts) -> Option<String> {
        deaf_to(wanted, [("pi1", other)].into_iter())
    }

    #[test]
    fn another_transport_is_refused_while_others_are_healthy() {
        let quic = slot(Some("quic to 239.77.0.1:4700"), &[1]);
        let udp = || slot(Some("udp to 239.77.0.1:4700"), &[1]);
        let expected = "would not hear the drones of pi1 (udp to 239.77.0.1:4700 there, quic to 239.77.0.1:4700 here): this \
                        can't come in waves; stop those drones first";
        assert_eq!(why(&quic, &host(udp(), healthy())).unwrap(), expected);
        let stopped = DroneHealth::Dead("its process ended with exit code 0".to_owned());
        assert_eq!(why(&quic, &host(udp(), stopped)), None);
        assert_eq!(why(&udp(), &host(udp(), healthy())), None);
        let unknown = host(slot(None, &[1]), healthy());
        assert_eq!(why(&quic, &unknown), None, "an older program wrote it");
    }

    #[test]
    fn frames_that_no_healthy_drone_reads_are_refused() {
        let new = slot(None, &[2, 3]);
        let before = host(slot(None, &[1]), healthy());
        assert!(why(&new, &before).unwrap().contains("no frames in common"));
        let between = host(slot(None, &[1, 2]), healthy());
        assert_eq!(why(&new, &between), None);
    }

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
