//! The fault plan of a run.

use std::collections::BTreeSet;

use muster_machines::identity::NodeId;

use super::event::Event;
use super::injection::Injection;
use super::timeline::Timeline;
use crate::scenario::{Distortion, DroneFault, Fault, FaultKind, Tampered, Target, Trigger, When};

/// The faults of a scenario, those of them that wait for a trigger, and what those injected met.
///
/// Invariant: a fault that waits for a trigger is scheduled once, at the first occurrence.
#[derive(Debug)]
pub(super) struct FaultPlan {
    faults: Vec<Fault>,
    /// Indices of those that wait.
    waiting: Vec<usize>,
    injections: Vec<Injection>,
}

impl FaultPlan {
    pub(super) fn new(faults: &[Fault]) -> Self {
        let waits = |fault: &Fault| matches!(fault.when, When::After(..));
        Self {
            faults: faults.to_vec(),
            waiting: (0..faults.len())
                .filter(|index| waits(&faults[*index]))
                .collect(),
            injections: Vec::new(),
        }
    }

    pub(super) fn get(&self, index: usize) -> &Fault {
        &self.faults[index]
    }

    /// Whether it may restart a drone's process.
    pub(super) fn restarts_processes(&self) -> bool {
        self.faults.iter().any(|fault| {
            matches!(
                fault.kind,
                FaultKind::Drone(_, DroneFault::Restart | DroneFault::Hang(None))
            )
        })
    }

    /// The drones whose frames must be recorded, since they may be replayed, forged or duplicated.
    pub(super) fn listened_to(&self, nodes: u32) -> BTreeSet<NodeId> {
        let mut listened_to = BTreeSet::new();
        for fault in &self.faults {
            if let FaultKind::Drone(target, DroneFault::Replay | DroneFault::Forge) = fault.kind {
                match target {
                    Target::Drone(drone) => listened_to.extend([drone]),
                    Target::Master => return (0..nodes).map(NodeId).collect(),
                }
            }
            let duplicates = |it: &Tampered| it.how == Distortion::Duplicate;
            match &fault.kind {
                FaultKind::Tamper(tampered) if duplicates(tampered) => match tampered.from {
                    Some(drone) => listened_to.extend([drone]),
                    None => return (0..nodes).map(NodeId).collect(),
                },
                _ => {}
            }
        }
        listened_to
    }

    /// Schedules the faults that have a time.
    pub(super) fn schedule_timed(&self, timeline: &mut Timeline) {
        for (index, fault) in self.faults.iter().enumerate() {
            if let When::At(at) = fault.when {
                timeline.schedule(at, Event::Fault { index, nth: 0 });
            }
        }
    }

    /// Schedules the faults that wait for this trigger.
    pub(super) fn trigger(&mut self, trigger: Trigger, timeline: &mut Timeline) {
        let faults = &self.faults;
        self.waiting.retain(|index| match faults[*index].when {
            When::After(awaited, after) if awaited == trigger => {
                let (index, nth) = (*index, 0);
                timeline.schedule_after(after, Event::Fault { index, nth });
                false
            }
            _ => true,
        });
    }

    /// Schedules the next time of a fault that happens several times.
    pub(super) fn schedule_next(&self, index: usize, nth: u32, timeline: &mut Timeline) {
        let (fault, nth) = (&self.faults[index], nth + 1);
        if nth < fault.times {
            timeline.schedule_after(fault.every, Event::Fault { index, nth });
        }
    }

    pub(super) fn record(&mut self, injection: Injection) {
        self.injections.push(injection);
    }

    /// What the faults met, in the order of their injection.
    pub(super) fn finish(self) -> Vec<Injection> {
        self.injections
    }
}
