use muster_machines::identity::{Ballot, NodeId};
use muster_machines::mission::Event;
use muster_machines::time::Timestamp;

use super::Violation;

/// Rule 1, (a) and (b): only the drone named in a ballot leads under it; the ballot that a drone follows never falls, not
/// even by a restart.
#[derive(Debug)]
pub(crate) struct ElectionChecker {
    /// The ballot that each drone follows.
    leader: Vec<Option<Ballot>>,
    /// Time at which each drone began to follow that leader.
    since: Vec<Timestamp>,
}

impl ElectionChecker {
    pub(crate) fn new(drones: usize) -> Self {
        Self {
            leader: vec![None; drones],
            since: vec![Timestamp::ZERO; drones],
        }
    }

    pub(crate) fn observe(
        &mut self,
        now: Timestamp,
        drone: NodeId,
        event: &Event,
    ) -> Option<Violation> {
        if let Event::Follows(_) = event {
            self.since[drone.0 as usize] = now;
        }
        let leader = &mut self.leader[drone.0 as usize];
        let violation = |what| Violation {
            rule: 1,
            at: now,
            drones: vec![drone],
            what,
        };
        match *event {
            Event::Follows(ballot) => match leader.replace(ballot) {
                Some(before) if !ballot.beats(&before) => Some(violation(format!(
                    "drone {drone} turned from {before} to {ballot}, which is not better"
                ))),
                _ => None,
            },
            Event::Opened { .. } | Event::LeftOut(_)
                if leader.is_none_or(|ballot| ballot.master != drone) =>
            {
                let leader = leader.map_or_else(|| "no ballot".to_owned(), |it| it.to_string());
                let what = format!("drone {drone} acted as master while it followed {leader}");
                Some(violation(what))
            }
            _ => None,
        }
    }

    /// When a drone turned to the ballot that it follows; 0 if to none.
    pub(crate) fn since(&self, drone: NodeId) -> Timestamp {
        self.since[drone.0 as usize]
    }

    /// The ballot that a drone follows.
    pub(crate) fn leader(&self, drone: NodeId) -> Option<Ballot> {
        self.leader[drone.0 as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn ballot(term: u32, rank: u32) -> Ballot {
        Ballot {
            term,
            rank,
            master: NodeId(rank),
        }
    }

    fn observe(checker: &mut ElectionChecker, drone: u32, event: &Event) -> bool {
        let found = checker.observe(Timestamp::ZERO, NodeId(drone), event);
        found.is_some_and(|violation| violation.rule == 1)
    }

    #[test]
    fn a_falling_ballot_breaks_the_rule() {
        let mut checker = ElectionChecker::new(2);
        assert!(!observe(&mut checker, 1, &Event::Follows(ballot(1, 0))));
        assert!(!observe(&mut checker, 1, &Event::Follows(ballot(2, 1))));
        assert!(!observe(&mut checker, 1, &Event::Follows(ballot(2, 0))));
        assert!(observe(&mut checker, 1, &Event::Follows(ballot(2, 1))));
        assert!(
            observe(&mut checker, 1, &Event::Follows(ballot(2, 1))),
            "nor may it stay"
        );
    }

    #[test]
    fn leading_under_the_ballot_of_another_breaks_the_rule() {
        let mut checker = ElectionChecker::new(2);
        let opens = Event::Opened { waypoint: 3 };
        assert!(observe(&mut checker, 0, &opens), "it has no ballot yet");
        observe(&mut checker, 0, &Event::Follows(ballot(1, 0)));
        assert!(!observe(&mut checker, 0, &opens));
        observe(&mut checker, 1, &Event::Follows(ballot(1, 0)));
        assert!(observe(&mut checker, 1, &opens));
        assert!(observe(&mut checker, 1, &Event::LeftOut(NodeId(0))));
    }
}
