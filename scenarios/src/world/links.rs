//! Observation of the radio links, on which rules 1 and 3 rest.

use std::time::Duration;

use muster_machines::identity::NodeId;
use muster_machines::mission::State;
use muster_machines::node::Address;
use muster_machines::time::Timestamp;

use super::air::Air;
use super::core::Core;
use super::processes::Processes;
use super::swarm::Swarm;

/// Interval of looks at the links while drones fly, besides those at events that depend on them: at 10 m/s each, two
/// drones come 20 m nearer to each other meanwhile.
const LOOK_EVERY: Duration = Duration::from_secs(1);
/// A look within this time is recent: a drone flies less than 1 m meanwhile.
const RECENT: Duration = Duration::from_millis(50);

/// When links were looked at last, and whether anything has changed since.
///
/// Invariant: the swarms' segments are those of the last look; a look while `medium_changes` is the medium's present number
/// would find nothing new.
#[derive(Debug)]
pub(super) struct LinkWatch {
    next_at: Timestamp,
    /// The medium's number of changes at the last look. `None` if drones have changed since.
    medium_changes: Option<u64>,
}

impl LinkWatch {
    pub(super) const fn new() -> Self {
        Self {
            next_at: Timestamp::ZERO,
            medium_changes: None,
        }
    }

    /// A drone may have changed what it does, or whether it relays frames.
    pub(super) const fn invalidate(&mut self) {
        self.medium_changes = None;
    }

    /// Whether it is time for the next periodic look.
    pub(super) fn is_due(&self, now: Timestamp) -> bool {
        now >= self.next_at
    }

    /// Whether the last look is recent.
    pub(super) fn is_recent(&self, now: Timestamp) -> bool {
        now + LOOK_EVERY < self.next_at + RECENT
    }

    /// Updates the segments of all swarms.
    pub(super) fn look(&mut self, core: &mut Core, processes: &Processes, air: &mut Air) {
        let now = core.now();
        self.next_at = now + LOOK_EVERY;
        let changes = Some(air.changes());
        if self.medium_changes == changes {
            return;
        }
        self.medium_changes = changes;
        let nodes = core.swarms.nodes();
        let live: Vec<_> = (0..nodes)
            .map(NodeId)
            .map(|id| activity(id, core.swarms.of(id), processes))
            .collect();
        let links = air.links(core.swarms.tolerated_delay());
        for swarm in core.swarms.iter_mut() {
            let mut own = live.clone();
            for (id, live) in (0..).map(NodeId).zip(&mut own) {
                *live = live.filter(|_| swarm.has(id));
            }
            let has_changed = swarm.segments.look(now, own, links.clone());
            let ends = swarm.segments.links().iter().map(|link| link.ends());
            swarm.recorder.links(ends);
            if has_changed {
                swarm.recorder.looked(now, &swarm.segments);
            }
            let propagation = swarm.settled.settling().propagation(nodes);
            swarm.segments.forget_older(now, propagation);
        }
    }
}

/// A number that changes when a drone fails or does something else. `None` if it does not relay frames.
fn activity(id: NodeId, swarm: &Swarm, processes: &Processes) -> Option<u32> {
    if !relays_frames(id, swarm, processes) {
        return None;
    }
    let recorder = &swarm.recorder;
    let failures = recorder.restarts_of(id) + processes[id].actors.hangs();
    let activity = match recorder.state(id) {
        State::Start | State::SetUp | State::Finished => 0,
        State::MovingToLand => 1,
        // A master that goes to land alone announces it only now.
        State::Landing => 2,
        state if state.is_spreading() => 3,
        _ => 4,
    };
    Some(failures * 5 + activity)
}

/// Whether a drone relays frames of the swarm: its radio and routing run, and it has neither finished, left nor lost its mission.
pub(super) fn relays_frames(id: NodeId, swarm: &Swarm, processes: &Processes) -> bool {
    let actors = &processes[id].actors;
    let runs = |address| actors.is_up(address) && !actors.is_hung(address);
    runs(Address::Radio)
        && runs(Address::Routing)
        && actors.is_up(Address::Mission)
        && swarm.recorder.state(id) != State::Finished
        && !swarm.recorder.of(id).has_left
}
