use std::hash::{Hash, Hasher};
use std::sync::Arc;

use muster_machines::geometry::Ned;
use muster_machines::mission::Checkpoint;
use muster_machines::routing::LeaderEpoch;

/// Persistent state of a drone: the checkpoints of its two machines.
#[derive(Debug, Clone, PartialEq, Hash, Default)]
pub(crate) struct Journal {
    pub(crate) epoch: Log<LeaderEpoch>,
    pub(crate) mission: Log<Mission>,
}

/// Checkpoints of one machine: the synced one, and those written since. A crashing process loses some of the latter,
/// the newest first.
#[derive(Debug, Clone, PartialEq, Hash, Default)]
pub(crate) struct Log<T> {
    synced: T,
    written: Vec<T>,
}

/// A mission's checkpoint, hashed as part of a state.
#[derive(Debug, Clone, Default)]
pub(crate) struct Mission(pub Arc<Checkpoint>);

impl Journal {
    pub(crate) fn sync(&mut self) {
        self.epoch.sync();
        self.mission.sync();
    }
}

impl Mission {
    pub(crate) fn new(checkpoint: Checkpoint) -> Self {
        Self(Arc::new(checkpoint))
    }
}

impl<T: Clone + PartialEq> Log<T> {
    pub(crate) fn write(&mut self, checkpoint: T) {
        if *self.newest() != checkpoint {
            self.written.push(checkpoint);
        }
    }

    /// The checkpoint for an actor restarted after a panic; only a crash of the process loses checkpoints.
    pub(crate) fn newest(&self) -> &T {
        self.written.last().unwrap_or(&self.synced)
    }

    /// Number of writes that may be lost.
    pub(crate) const fn unsynced(&self) -> usize {
        self.written.len()
    }

    fn sync(&mut self) {
        self.crash(self.written.len());
    }

    /// Crash: only the first `found` of the unsynced checkpoints remain.
    pub(crate) fn crash(&mut self, found: usize) {
        self.written.truncate(found);
        if let Some(last) = self.written.pop() {
            self.synced = last;
            self.written.clear();
        }
    }
}

impl PartialEq for Mission {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0) || self.0 == other.0
    }
}

impl Hash for Mission {
    /// Destructured completely, so that a new field must be added here or excluded.
    fn hash<H: Hasher>(&self, hasher: &mut H) {
        let Checkpoint {
            leader,
            state,
            plan,
            routes,
            progress,
            orders,
            lockstep,
            landing,
            deadlines,
            lead,
            restarted,
            holds,
        } = &*self.0;
        (leader, state, plan.waypoints.len(), plan.is_complete).hash(hasher);
        (progress, orders, lockstep, deadlines).hash(hasher);
        (*routes as u8, landing.reason, restarted, holds).hash(hasher);
        for place in [Some(landing.at), landing.assembled_at] {
            place.map(bits).hash(hasher);
        }
        let Some(lead) = lead else { return };
        (lead.sequence, &lead.order, &lead.neighbours).hash(hasher);
        (&lead.members, &lead.acknowledged).hash(hasher);
        (&lead.silent, &lead.landing, &lead.left_out).hash(hasher);
        (lead.silence_tolerated_until, lead.hold).hash(hasher);
        assert!(lead.followed.is_none(), "the model has no following");
    }
}

fn bits(place: Ned) -> [u64; 3] {
    [place.north_m(), place.east_m(), place.altitude_m()].map(f64::to_bits)
}
