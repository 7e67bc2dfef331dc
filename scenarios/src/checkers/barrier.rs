use std::collections::BTreeSet;

use muster_machines::identity::{Ballot, NodeId};
use muster_machines::mission::{Barrier, Event, State};
use muster_machines::time::Timestamp;

use super::Violation;

/// Rule 3: waypoints open one by one, and no drone skips one. Each opens once all live members of the master's segment that
/// are not landing have reached the one before. Members count once they have followed the master for long enough that it
/// knows. A master that waits for its neighbours only may open a waypoint before the others have reached the one before.
#[derive(Debug)]
pub(crate) struct BarrierChecker {
    barrier: Barrier,
    /// The highest waypoint opened by any master.
    opened: Option<u16>,
    /// The ballot under which the last waypoint was opened, and that waypoint.
    last: Option<(Option<Ballot>, u16)>,
    drones: Vec<Progress>,
}

#[derive(Debug, Clone, Copy, Default)]
struct Progress {
    state: State,
    reached: Option<u16>,
}

impl BarrierChecker {
    /// Drones at the start of a mission.
    pub(crate) fn new(barrier: Barrier, drones: usize) -> Self {
        Self {
            barrier,
            opened: None,
            last: None,
            drones: vec![Progress::default(); drones],
        }
    }

    /// A drone's mission reports an event under `epoch`; `awaited` yields whom it must await.
    pub(crate) fn observe(
        &mut self,
        now: Timestamp,
        drone: NodeId,
        event: &Event,
        epoch: Option<Ballot>,
        awaited: impl FnOnce() -> BTreeSet<NodeId>,
    ) -> Option<Violation> {
        match *event {
            Event::State(state) => self.enters(now, drone, state),
            Event::Opened { waypoint } => {
                let awaited = match self.barrier {
                    Barrier::Strict => awaited(),
                    Barrier::Neighbours => BTreeSet::new(),
                };
                self.opens(now, (drone, epoch), waypoint, &awaited)
            }
            _ => None,
        }
    }

    /// A drone's mission may have stopped: the drone is not awaited until it reports a state again.
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
                what: format!("drone {drone} flies to waypoint {waypoint} before waypoint {next}"),
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
        // An elected master may not know, nor anyone in its segment, which waypoint its predecessor had opened.
        let is_next = match self.last.replace((epoch, waypoint)) {
            Some((last, opened)) if last == epoch => waypoint == opened + 1,
            _ => waypoint <= next,
        };
        if !is_next {
            return Some(Violation {
                rule: 3,
                at: now,
                drones: vec![master],
                what: format!("waypoint {waypoint} was opened although waypoint {next} was next"),
            });
        }
        let before = waypoint.checked_sub(1)?;
        let behind: Vec<NodeId> = (0..)
            .map(NodeId)
            .zip(&self.drones)
            .filter(|(_, drone)| drone.state.is_on_mission() && drone.reached < Some(before))
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
    fn opening_a_waypoint_before_all_have_arrived_breaks_the_rule() {
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
    fn a_landing_drone_is_not_awaited() {
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
    fn skipping_a_waypoint_breaks_the_rule() {
        let mut checker = checker_at_waypoint_0(Barrier::Strict);
        let skips = Event::State(State::MovingToWaypoint { waypoint: 2 });
        assert!(observe(&mut checker, Timestamp::ZERO, NodeId(0), &skips).is_some());
        let opens = Event::Opened { waypoint: 2 };
        assert!(observe(&mut checker, Timestamp::ZERO, NodeId(0), &opens).is_some());
    }

    #[test]
    fn a_drone_out_of_reach_is_not_awaited() {
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
    fn a_master_that_awaits_its_neighbours_must_not_skip_a_waypoint() {
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
