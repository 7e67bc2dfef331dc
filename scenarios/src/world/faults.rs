//! What a fault plan does to a world, and when.

use std::collections::BTreeSet;
use std::time::Duration;

use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;

use super::tampering::paced;
use super::{Planned, Task, What, World};
use crate::scenario::{Fault, FaultKind, Link, Links, Occasion, Target, When};

/// A scenario's fault plan, and which of it still waits for something to happen first.
#[derive(Debug)]
pub(super) struct Plan {
    faults: Vec<Fault>,
    waiting: Vec<usize>,
}

/// How long a process takes to be there again, unless the plan says otherwise.
pub(super) const RESTART_AFTER: Duration = Duration::from_secs(1);

impl Plan {
    pub(super) fn new(faults: &[Fault]) -> Self {
        let waits = |fault: &Fault| matches!(fault.when, When::After(..));
        Self {
            faults: faults.to_vec(),
            waiting: (0..faults.len())
                .filter(|index| waits(&faults[*index]))
                .collect(),
        }
    }

    /// Whether a drone's process may start anew.
    pub(super) fn restarts_processes(&self) -> bool {
        self.faults
            .iter()
            .any(|fault| matches!(fault.kind, FaultKind::Restart(_) | FaultKind::Hang(_, None)))
    }

    /// Whose frames somebody listens to, to send them again or to speak in their name.
    pub(super) fn listened_to(&self, nodes: u32) -> BTreeSet<NodeId> {
        let all = || (0..nodes).map(NodeId).collect();
        let mut listened_to = BTreeSet::new();
        for fault in &self.faults {
            match fault.kind {
                FaultKind::Replay(target) | FaultKind::Forge(target) => match target {
                    Target::Drone(drone) => listened_to.extend([drone]),
                    Target::Master => return all(),
                },
                _ => {}
            }
        }
        listened_to
    }

    /// What happens at a time of its own, and when.
    pub(super) fn timed(&self) -> impl Iterator<Item = (usize, Timestamp)> + '_ {
        self.faults
            .iter()
            .enumerate()
            .filter_map(|(index, fault)| match fault.when {
                When::At(at) => Some((index, at)),
                When::After(..) => None,
            })
    }
}

impl World {
    /// Something happened to a drone that faults may wait for.
    pub(super) fn occurs(&mut self, drone: NodeId, occasion: Occasion) {
        if !self.own_swarm().has(drone) {
            return;
        }
        let now = self.now;
        let (faults, heap) = (&self.plan.faults, &mut self.heap);
        self.plan.waiting.retain(|index| match faults[*index].when {
            When::After(awaited, after) if awaited == occasion => {
                let (index, nth) = (*index, 0);
                heap.plan(now + after, Planned::Fault { index, nth });
                false
            }
            _ => true,
        });
    }

    /// A fault befalls; whom to step for it, if that is not told by message.
    pub(super) fn befall(&mut self, index: usize, nth: u32) -> Option<Task> {
        let fault = self.plan.faults[index].clone();
        if nth + 1 < fault.times {
            let again = Planned::Fault {
                index,
                nth: nth + 1,
            };
            self.heap.plan(self.now + fault.every, again);
        }
        match &fault.kind {
            FaultKind::CrashActor(target, address) => {
                let drone = self.find_target(*target)?;
                let what = What::Crash;
                return self.drone(drone).is_up(*address).then_some(Task {
                    drone,
                    address: *address,
                    what,
                });
            }
            FaultKind::Kill(target) => {
                if let Some(drone) = self.find_target(*target) {
                    self.kill(drone);
                }
            }
            FaultKind::CrashAircraft(target) => {
                if let Some(drone) = self.find_target(*target) {
                    self.crash_aircraft(drone);
                }
            }
            FaultKind::Restart(target) => {
                if let Some(drone) = self.find_target(*target) {
                    self.restart(drone, fault.lasts.unwrap_or(RESTART_AFTER));
                }
                return None;
            }
            FaultKind::Hang(target, actor) => {
                let drone = self.find_target(*target)?;
                self.hang(drone, *actor);
                if let Some(lasts) = fault.lasts {
                    let over = Planned::GoOn {
                        drone,
                        hangs: self.drone(drone).hangs,
                    };
                    self.heap.plan(self.now + lasts, over);
                }
                return None;
            }
            FaultKind::Drain(target, to) => {
                if let Some(drone) = self.find_target(*target) {
                    self.drain(drone, *to);
                }
                return None;
            }
            FaultKind::LoseGps(target) => {
                if let Some(drone) = self.find_target(*target) {
                    self.lose_position(drone, fault.lasts);
                }
                return None;
            }
            FaultKind::Links(links, link) => self.set_links(links, *link),
            FaultKind::Jam { centre, radius_m } => {
                let jammer = u32::try_from(index).unwrap_or(u32::MAX);
                self.medium.jam(jammer, *centre, *radius_m);
            }
            FaultKind::Tamper(tampered) => self.tampering.begin(index, *tampered),
            FaultKind::Replay(target) => {
                if let Some(drone) = self.find_target(*target) {
                    self.replay(drone);
                }
            }
            FaultKind::Forge(target) => {
                if let Some(drone) = self.find_target(*target) {
                    self.forge(drone);
                }
            }
            FaultKind::Skew(target, ppm) => {
                let drone = self.find_target(*target)?;
                self.skew(drone, *ppm);
                if let Some(lasts) = fault.lasts {
                    let over = Planned::Skew { drone, ppm: 0 };
                    self.heap.plan(self.now + lasts, over);
                }
                return None;
            }
        }
        if let Some(lasts) = fault.lasts {
            self.heap
                .plan(self.now + lasts, Planned::FaultOver { index });
        }
        self.look_at_elections();
        None
    }

    /// A fault that lasted is over.
    pub(super) fn is_over_now(&mut self, index: usize) {
        match self.plan.faults[index].kind.clone() {
            FaultKind::Links(links, _) => self.set_links(&links, Link::Healed),
            FaultKind::Jam { .. } => {
                let jammer = u32::try_from(index).unwrap_or(u32::MAX);
                self.medium.stop_jamming(jammer);
            }
            FaultKind::Tamper(_) => self.tampering.end(index),
            // Each ends by itself, for the drone that it befell.
            FaultKind::CrashActor(..)
            | FaultKind::Kill(_)
            | FaultKind::CrashAircraft(_)
            | FaultKind::Restart(_)
            | FaultKind::Drain(..)
            | FaultKind::LoseGps(_)
            | FaultKind::Hang(..)
            | FaultKind::Replay(_)
            | FaultKind::Forge(_)
            | FaultKind::Skew(..) => {}
        }
        self.look_at_elections();
    }

    /// All that a drone has sent so far is sent again.
    fn replay(&mut self, of: NodeId) {
        let audience = self.audience(of);
        for (index, (datagram, heard_by)) in (0..).zip(self.tampering.recorded(of)) {
            for to in audience.iter().copied() {
                let arrival = Planned::Arrive {
                    to,
                    datagram: datagram.clone(),
                    is_genuine: !heard_by.contains(to),
                };
                self.heap.plan(paced(self.now, index), arrival);
            }
        }
    }

    /// Somebody speaks in a drone's name.
    fn forge(&mut self, of: NodeId) {
        let audience = self.audience(of);
        for (index, datagram) in (0..).zip(self.tampering.forgeries(of)) {
            for to in audience.iter().copied() {
                let arrival = Planned::Arrive {
                    to,
                    datagram: datagram.clone(),
                    is_genuine: false,
                };
                self.heap.plan(paced(self.now, index), arrival);
            }
        }
    }

    /// Who may hear a drone.
    fn audience(&self, from: NodeId) -> Vec<NodeId> {
        let others = (0..).map(NodeId).take(self.drones.len());
        others
            .filter(|id| *id != from && self.medium.loss(from, *id) < 1.0)
            .collect()
    }

    fn set_links(&mut self, links: &Links, link: Link) {
        let (there, back) = match link {
            Link::Cut => (Some(1.0), Some(1.0)),
            Link::OneWay => (None, Some(1.0)),
            Link::Degraded(loss) => (Some(loss), Some(loss)),
            Link::Healed => (None, None),
        };
        for from in links.from.iter().copied() {
            for to in links.to.iter().copied() {
                self.medium.set_loss(from, to, there);
                self.medium.set_loss(to, from, back);
            }
        }
    }

    /// Whom a fault befalls, if there is such a drone.
    fn find_target(&self, target: Target) -> Option<NodeId> {
        match target {
            Target::Drone(drone) => Some(drone),
            Target::Master => (self.own_swarm().ids())
                .filter(|id| {
                    let drone = &self.drones[id.0 as usize];
                    drone.runs && !drone.given_up
                })
                .filter_map(|id| self.election.obeyed(id).filter(|it| it.master == id))
                .reduce(|best, ballot| if ballot.beats(&best) { ballot } else { best })
                .map(|ballot| ballot.master),
        }
    }
}
