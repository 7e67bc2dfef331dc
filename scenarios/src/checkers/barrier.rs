use std::collections::BTreeSet;

use muster_machines::identity::{Ballot, NodeId};
use muster_machines::mission::{Barrier, Event, State};
use muster_machines::time::Timestamp;

use super::Violation;

/// Rule 3: waypoints open one by one, each once every live member of the master's part that is not landing has reached
/// the one before; no drone skips one. Of the master's part are those whom links that are up connect with it, and who obey it
/// for long enough that it knows.
/// Where the master waits for its neighbours only, it may open one before the others have reached the one before.
#[derive(Debug)]
pub(crate) struct BarrierChecker {
    barrier: Barrier,
    /// The highest waypoint opened, by whomever.
    opened: Option<u16>,
    /// Under which ballot a waypoint was opened last, and which.
    last: Option<(Option<Ballot>, u16)>,
    drones: Vec<Progress>,
}

#[derive(Debug, Clone, Copy, Default)]
struct Progress {
    state: State,
    reached: Option<u16>,
}

impl BarrierChecker {
    pub(crate) fn new(barrier: Barrier, drones: usize) -> Self {
        Self {
            barrier,
            opened: None,
            last: None,
            drones: vec![Progress::default(); drones],
        }
    }

    pub(crate) fn observe(
        &mut self,
        now: Timestamp,
        drone: NodeId,
        event: &Event,
        epoch: Option<Ballot>,
        part: impl FnOnce() -> BTreeSet<NodeId>,
    ) -> Option<Violation> {
        match *event {
            Event::State(state) => self.enters(now, drone, state),
            Event::Opened { waypoint } => {
                let awaited = match self.barrier {
                    Barrier::Strict => part(),
                    Barrier::Neighbours => BTreeSet::new(),
                };
                self.opens(now, (drone, epoch), waypoint, &awaited)
            }
            _ => None,
        }
    }

    /// A drone's mission may not be there any more to say what it does: it is being brought down, or its process has ended.
    /// It counts again once it says so.
    pub(crate) fn given_up(&mut self, drone: NodeId) {
        self.drones[drone.0 as usize].state = State::Landing;
    }

    fn enters(&mut self, now: Timestamp, drone: NodeId, state: State) -> Option<Violation> {
        let progress = &mut self.drones[drone.0 as usize];
        progress.state = state;
        let next = progress.reached.map_or(0, |reached| reached + 1);
        match state {
            State::WaypointReached { waypoint } => {
                progress.reached = progress.reached.max(Some(waypoint));
                None
            }
            State::MovingToWaypoint { waypoint } if waypoint > next => Some(Violation {
                rule: 3,
                at: now,
                drones: vec![drone],
                what: format!("drone {drone} makes for waypoint {waypoint} before waypoint {next}"),
            }),
            _ => None,
        }
    }

    fn opens(
        &mut self,
        now: Timestamp,
        (master, epoch): (NodeId, Option<Ballot>),
        waypoint: u16,
        awaited: &BTreeSet<NodeId>,
    ) -> Option<Violation> {
        let next = self.opened.map_or(0, |opened| opened + 1);
        self.opened = self.opened.max(Some(waypoint));
        // Whoever was elected may not know, or not be told by anyone in its part, how far the master before it had got.
        let is_next = match self.last.replace((epoch, waypoint)) {
            Some((last, opened)) if last == epoch => waypoint == opened + 1,
            _ => waypoint <= next,
        };
        if !is_next {
            return Some(Violation {
                rule: 3,
                at: now,
                drones: vec![master],
                what: format!("waypoint {waypoint} was opened where waypoint {next} was next"),
            });
        }
        let before = waypoint.checked_sub(1)?;
        let behind: Vec<NodeId> = (0..)
            .map(NodeId)
            .zip(&self.drones)
            .filter(|(_, drone)| drone.state.is_following() && drone.reached < Some(before))
            .map(|(id, _)| id)
            .filter(|id| awaited.contains(id))
            .collect();
        (!behind.is_empty()).then(|| Violation {
            rule: 3,
            at: now,
            what: format!(
                "waypoint {waypoint} was opened before all had reached waypoint {before}"
            ),
            drones: behind,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn observe(
        checker: &mut BarrierChecker,
        now: Timestamp,
        drone: NodeId,
        event: &Event,
    ) -> Option<Violation> {
        checker.observe(now, drone, event, None, || [NodeId(0), NodeId(1)].into())
    }

    const REACHED_0: Event = Event::State(State::WaypointReached { waypoint: 0 });

    fn checker_at_waypoint_0(barrier: Barrier) -> BarrierChecker {
        let mut checker = BarrierChecker::new(barrier, 2);
        for event in [REACHED_0, Event::Opened { waypoint: 0 }] {
            assert_eq!(
                observe(&mut checker, Timestamp::ZERO, NodeId(0), &event),
                None
            );
        }
        checker
    }

    #[test]
    fn a_waypoint_opened_before_all_are_there_is_found() {
        let mut checker = checker_at_waypoint_0(Barrier::Strict);
        let on_the_way = Event::State(State::HopUpdate);
        assert_eq!(
            observe(&mut checker, Timestamp::ZERO, NodeId(1), &on_the_way),
            None
        );
        let found = observe(
            &mut checker,
            Timestamp::ZERO,
            NodeId(0),
            &Event::Opened { waypoint: 1 },
        );
        assert_eq!(
            found.map(|violation| violation.drones),
            Some(vec![NodeId(1)])
        );
    }

    #[test]
    fn nobody_waits_for_a_drone_that_lands() {
        let mut checker = checker_at_waypoint_0(Barrier::Strict);
        for state in [State::HopUpdate, State::Landing] {
            assert_eq!(
                observe(
                    &mut checker,
                    Timestamp::ZERO,
                    NodeId(1),
                    &Event::State(state)
                ),
                None
            );
        }
        let found = observe(
            &mut checker,
            Timestamp::ZERO,
            NodeId(0),
            &Event::Opened { waypoint: 1 },
        );
        assert_eq!(found, None);
    }

    #[test]
    fn a_skipped_waypoint_is_found() {
        let mut checker = checker_at_waypoint_0(Barrier::Strict);
        let leaps = Event::State(State::MovingToWaypoint { waypoint: 2 });
        assert!(observe(&mut checker, Timestamp::ZERO, NodeId(0), &leaps).is_some());
        let opens = Event::Opened { waypoint: 2 };
        assert!(observe(&mut checker, Timestamp::ZERO, NodeId(0), &opens).is_some());
    }

    #[test]
    fn nobody_waits_for_a_drone_that_no_radio_reaches() {
        let mut checker = checker_at_waypoint_0(Barrier::Strict);
        let on_the_way = Event::State(State::HopUpdate);
        observe(&mut checker, Timestamp::ZERO, NodeId(1), &on_the_way);
        let opens = Event::Opened { waypoint: 1 };
        let found = checker.observe(Timestamp::ZERO, NodeId(0), &opens, None, || {
            [NodeId(0)].into()
        });
        assert_eq!(found, None);
    }

    #[test]
    fn a_master_that_waits_for_its_neighbours_skips_no_waypoint_either() {
        let mut checker = checker_at_waypoint_0(Barrier::Neighbours);
        let on_the_way = Event::State(State::HopUpdate);
        observe(&mut checker, Timestamp::ZERO, NodeId(1), &on_the_way);
        let mut opens = |waypoint| {
            let opened = Event::Opened { waypoint };
            observe(&mut checker, Timestamp::ZERO, NodeId(0), &opened)
        };
        assert_eq!(opens(1), None);
        assert!(opens(3).is_some());
    }
}
