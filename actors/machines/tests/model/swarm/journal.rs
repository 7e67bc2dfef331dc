use std::hash::{Hash, Hasher};
use std::sync::Arc;

use muster_machines::geometry::Ned;
use muster_machines::mission::Checkpoint;
use muster_machines::routing::LeaderEpoch;

/// What a drone remembers: what each of its two machines is rebuilt from.
#[derive(Debug, Clone, PartialEq, Hash, Default)]
pub(crate) struct Journal {
    pub(crate) epoch: Log<LeaderEpoch>,
    pub(crate) mission: Log<Mission>,
}

/// The checkpoints of one machine: the one that is on the disk for certain, and those written after it. Of the latter a
/// process that dies finds some again, from the oldest on.
#[derive(Debug, Clone, PartialEq, Hash, Default)]
pub(crate) struct Log<T> {
    synced: T,
    written: Vec<T>,
}

/// A mission's checkpoint, as a part of a state that is told apart from others.
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

    /// What an actor is rebuilt from that panicked: only its process's death loses anything.
    pub(crate) fn newest(&self) -> &T {
        self.written.last().unwrap_or(&self.synced)
    }

    /// How many writes may be lost.
    pub(crate) const fn unsynced(&self) -> usize {
        self.written.len()
    }

    fn sync(&mut self) {
        self.lose_all_but(self.written.len());
    }

    /// The process dies, and of what was not synced only the first `found` are found again.
    pub(crate) fn lose_all_but(&mut self, found: usize) {
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
    /// By every field: whoever adds one is asked here whether it tells states apart.
    fn hash<H: Hasher>(&self, hasher: &mut H) {
        let Checkpoint {
            leader,
            state,
            plan,
            plan_complete,
            routes,
            opened,
            changes,
            wave,
            pending,
            acknowledged,
            in_layer,
            catches_up,
            leaving,
            land_at,
            assembled_at,
            limit,
            flies_until,
            lead,
            restarted,
            holds,
        } = &*self.0;
        (leader, state, plan.len(), plan_complete).hash(hasher);
        (opened, changes, wave, pending, acknowledged).hash(hasher);
        (*routes as u8, in_layer, leaving, restarted).hash(hasher);
        (limit, flies_until, catches_up, holds).hash(hasher);
        for place in [Some(*land_at), *assembled_at] {
            place.map(bits).hash(hasher);
        }
        let Some(lead) = lead else { return };
        (lead.sequence, &lead.order, &lead.neighbours).hash(hasher);
        (&lead.members, &lead.acknowledged).hash(hasher);
        (&lead.silent, &lead.landing, &lead.left_out).hash(hasher);
        (lead.bears_silence_until, lead.hold).hash(hasher);
        assert!(lead.followed.is_none(), "nobody is followed in the model");
    }
}

fn bits(place: Ned) -> [u64; 3] {
    [place.north_m(), place.east_m(), place.altitude_m()].map(f64::to_bits)
}
