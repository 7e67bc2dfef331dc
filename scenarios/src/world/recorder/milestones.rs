use std::collections::BTreeMap;

use muster_machines::mission::State;
use muster_machines::time::Timestamp;

use super::Frames;

/// A swarm's wait at a waypoint: its first arrival, its last and the last departure, with the frames sent until then.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Crossing {
    pub(crate) begun: Option<Frames>,
    arrived: Option<Timestamp>,
    pub(crate) left: Option<Departure>,
}

/// The last departure from a waypoint so far.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Departure {
    /// The last arrival before it. One that comes later waits for nobody.
    pub(crate) arrived: Timestamp,
    pub(crate) at: Timestamp,
    pub(crate) sent: Frames,
}

/// A change of formation: when the first drone began it, when the last ended it, and how many did.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Change {
    pub(crate) begun: Timestamp,
    pub(crate) done: Option<Timestamp>,
    pub(crate) drones: u32,
}

/// What a swarm's drones have reached together.
///
/// Invariant: `steps_done` counts each arrival of a drone at a waypoint, and each landing.
#[derive(Debug, Default)]
pub(super) struct Milestones {
    /// By waypoint.
    pub(super) barriers: BTreeMap<u16, Crossing>,
    /// By the number of the change.
    pub(super) changes: BTreeMap<u16, Change>,
    steps_done: u64,
}

impl Milestones {
    pub(super) const fn steps_done(&self) -> u64 {
        self.steps_done
    }

    /// A drone has landed.
    pub(super) const fn landed(&mut self) {
        self.steps_done += 1;
    }

    /// A drone changes from one state to another; `sent` are the frames sent so far.
    pub(super) fn enters(
        &mut self,
        now: Timestamp,
        before: Option<State>,
        state: State,
        sent: Frames,
    ) {
        if let Some(State::WaypointReached { waypoint }) = before {
            let crossing = self.barriers.entry(waypoint).or_default();
            crossing.left = crossing.arrived.map(|arrived| Departure {
                arrived,
                at: now,
                sent,
            });
        }
        if let State::ChangingFormation { change, .. } = state {
            self.changes.entry(change).or_insert(Change {
                begun: now,
                done: None,
                drones: 0,
            });
        }
        if let (Some(State::ChangingFormation { change, .. }), State::WaypointReached { .. }) =
            (before, state)
            && let Some(change) = self.changes.get_mut(&change)
        {
            change.done = Some(now);
            change.drones += 1;
        }
        if let State::WaypointReached { waypoint } = state {
            let crossing = self.barriers.entry(waypoint).or_default();
            crossing.begun.get_or_insert(sent);
            crossing.arrived = Some(now);
            self.steps_done += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drone_that_arrives_after_the_others_have_left_is_in_no_wait() {
        let (mut milestones, sent) = (Milestones::default(), Frames::default());
        let at = Timestamp::from_nanos;
        let reached = State::WaypointReached { waypoint: 1 };
        let moves = State::MovingToWaypoint { waypoint: 2 };
        milestones.enters(at(10), None, reached, sent);
        milestones.enters(at(30), Some(reached), moves, sent);
        milestones.enters(at(40), None, reached, sent);
        let left = milestones.barriers[&1].left.unwrap();
        assert_eq!((left.arrived, left.at), (at(10), at(30)));
    }
}
