//! What a fault plan does to a world, and when.

use std::collections::BTreeSet;
use std::time::Duration;

use bytes::Bytes;
use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;

use super::tampering::paced;
use super::{Origin, Planned, Task, What, World};
use crate::scenario::{
    Distortion, DroneFault, Fault, FaultKind, Link, Links, Tampered, Target, Trigger, When,
};

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

    /// What one of its faults is.
    pub(super) fn kind(&self, index: usize) -> &FaultKind {
        &self.faults[index].kind
    }

    /// Whether a drone's process may start anew.
    pub(super) fn restarts_processes(&self) -> bool {
        self.faults.iter().any(|fault| {
            matches!(
                fault.kind,
                FaultKind::Drone(_, DroneFault::Restart | DroneFault::Hang(None))
            )
        })
    }

    /// Whose frames somebody listens to, to send them again or to speak in their name.
    pub(super) fn listened_to(&self, nodes: u32) -> BTreeSet<NodeId> {
        let mut listened_to = BTreeSet::new();
        for fault in &self.faults {
            if let FaultKind::Drone(target, DroneFault::Replay | DroneFault::Forge) = fault.kind {
                match target {
                    Target::Drone(drone) => listened_to.extend([drone]),
                    Target::Master => return (0..nodes).map(NodeId).collect(),
                }
            }
            let doubles = |it: &Tampered| it.how == Distortion::Duplicate;
            match &fault.kind {
                FaultKind::Tamper(tampered) if doubles(tampered) => match tampered.from {
                    Some(drone) => listened_to.extend([drone]),
                    None => return (0..nodes).map(NodeId).collect(),
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

/// What the medium calls the jammer of a fault.
fn jammer(index: usize) -> u32 {
    u32::try_from(index).unwrap_or(u32::MAX)
}

impl World {
    /// Something happened to a drone that faults may wait for.
    pub(super) fn occurs(&mut self, drone: NodeId, trigger: Trigger) {
        if !self.own_swarm().has(drone) {
            return;
        }
        let now = self.now;
        let (faults, heap) = (&self.plan.faults, &mut self.heap);
        self.plan.waiting.retain(|index| match faults[*index].when {
            When::After(awaited, after) if awaited == trigger => {
                let (index, nth) = (*index, 0);
                heap.plan(now + after, Planned::Fault { index, nth });
                false
            }
            _ => true,
        });
    }

    /// A fault befalls; whom to step for it, if that is not told by message.
    pub(super) fn inject(&mut self, index: usize, nth: u32) -> Option<Task> {
        self.record_injection(index);
        if self.checks {
            // A drone that fails now may have been heard by one that has come near since they were looked at.
            self.look_at_links();
        }
        self.process_changes += 1;
        let fault = self.plan.faults[index].clone();
        if nth + 1 < fault.times {
            let again = Planned::Fault {
                index,
                nth: nth + 1,
            };
            self.heap.plan(self.now + fault.every, again);
        }
        match &fault.kind {
            FaultKind::Drone(target, what) => {
                let drone = self.find_target(*target)?;
                if let Some(behind) = self.behind {
                    self.foresee(behind, drone, *what, fault.lasts);
                    return None;
                }
                return self.inject_into_drone(drone, *what, fault.lasts);
            }
            FaultKind::Links(links, link) => self.set_links(links, *link),
            FaultKind::Jam { centre, radius_m } => {
                self.medium.jam(jammer(index), *centre, *radius_m);
            }
            FaultKind::Tamper(tampered) => self.tampering.begin(index, *tampered),
        }
        if let Some(lasts) = fault.lasts {
            self.heap
                .plan(self.now + lasts, Planned::FaultOver { index });
        }
        self.look_at_elections();
        None
    }

    /// Something befalls a drone, until it is over by itself; whom to step for it.
    pub(super) fn inject_into_drone(
        &mut self,
        drone: NodeId,
        fault: DroneFault,
        lasts: Option<Duration>,
    ) -> Option<Task> {
        match fault {
            DroneFault::CrashActor(address) => {
                let what = What::Crash;
                return self.drone(drone).is_up(address).then_some(Task {
                    drone,
                    address,
                    what,
                });
            }
            DroneFault::Kill => self.kill(drone),
            DroneFault::CrashAircraft => self.crash_aircraft(drone),
            DroneFault::Restart => self.restart(drone, lasts.unwrap_or(RESTART_AFTER)),
            DroneFault::Hang(actor) => self.hang(drone, actor, lasts),
            DroneFault::Drain(to) => self.drain(drone, to),
            DroneFault::LoseGps => self.lose_position(drone, lasts),
            DroneFault::Replay => {
                let recorded = self.tampering.recorded(drone);
                self.play(drone, recorded, Origin::Replayed);
            }
            DroneFault::Forge => {
                let made_up = self.tampering.forgeries(drone);
                self.play(drone, made_up, Origin::Spurious);
            }
            DroneFault::Skew(ppm) => {
                self.skew(drone, ppm);
                if let Some(lasts) = lasts {
                    let over = Planned::Skew { drone, ppm: 0 };
                    self.heap.plan(self.now + lasts, over);
                }
            }
        }
        None
    }

    /// A fault that lasted is over; what befell a drone is over by itself.
    pub(super) fn is_over_now(&mut self, index: usize) {
        self.process_changes += 1;
        match self.plan.faults[index].kind.clone() {
            FaultKind::Drone(..) => {}
            FaultKind::Links(links, _) => self.set_links(&links, Link::Healed),
            FaultKind::Jam { .. } => self.medium.stop_jamming(jammer(index)),
            FaultKind::Tamper(_) => self.tampering.end(index),
        }
        self.look_at_elections();
    }

    /// Somebody sends frames where a drone is, one after another.
    fn play(&mut self, of: NodeId, frames: Vec<Bytes>, origin: Origin) {
        let audience = self.audience(of);
        for (index, datagram) in (0..).zip(frames) {
            for to in audience.iter().copied() {
                let is_told = self.swarm(of).has(to);
                let arrival = Planned::Arrive {
                    to,
                    datagram: datagram.clone(),
                    origin: if is_told { origin } else { Origin::Spurious },
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
        let now = self.now;
        for swarm in &mut self.swarms {
            let ids = links.from.iter().chain(&*links.to).copied();
            swarm.segments.stir(now, ids);
        }
    }

    /// Whom a fault befalls, if there is such a drone.
    pub(super) fn find_target(&self, target: Target) -> Option<NodeId> {
        match target {
            Target::Drone(drone) => Some(drone),
            Target::Master => (self.own_swarm().ids())
                .filter(|id| {
                    let drone = &self.drones[id.0 as usize];
                    drone.runs && !drone.given_up
                })
                .filter_map(|id| self.election.leader(id).filter(|it| it.master == id))
                .reduce(|best, ballot| if ballot.beats(&best) { ballot } else { best })
                .map(|ballot| ballot.master),
        }
    }
}
