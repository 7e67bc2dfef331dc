use muster_machines::identity::{Ballot, NodeId};
use muster_machines::mission::Input;
use muster_machines::node::{Address, Checkpoints, Effect, Envelope};
use muster_machines::routing::Notice;
use muster_machines::time::Timestamp;

use super::Violation;

/// Rule 2: no drone follows an older ballot.
///
/// An order under a ballot that the drone's own ballot beats must change nothing. In that step its mission sends nothing,
/// reports no event, and keeps the checkpoint that it had kept before.
#[derive(Debug, Default)]
pub(crate) struct ObedienceChecker {
    /// A drone whose mission receives an order that it must ignore: the order's ballot, and the drone's own.
    must_ignore: Option<(NodeId, [Ballot; 2])>,
}

impl ObedienceChecker {
    /// An actor is about to receive a message while its drone follows `leader`. `number` gives the world's number of a
    /// member that the message names.
    pub(crate) fn receives(
        &mut self,
        drone: NodeId,
        envelope: &Envelope,
        leader: Option<Ballot>,
        number: impl Fn(NodeId) -> NodeId,
    ) {
        if let Envelope::Mission(Input::Routing(Notice::Order { ballot, .. })) = envelope {
            let received = Ballot {
                master: number(ballot.master),
                ..*ballot
            };
            let newer = leader.filter(|leader| leader.beats(&received));
            self.must_ignore = newer.map(|newer| (drone, [received, newer]));
        }
    }

    /// The next task is about to be taken: a mission that panicked at its order has done nothing.
    pub(crate) const fn before_task(&mut self) {
        self.must_ignore = None;
    }

    /// A step yields effects that have yet to be carried out.
    pub(crate) fn yields(
        &mut self,
        now: Timestamp,
        drone: NodeId,
        from: Address,
        effects: &[Effect],
        kept: &Checkpoints,
    ) -> Option<Violation> {
        let (receiver, [older, newer]) = self.must_ignore.take()?;
        let changes = |effect: &Effect| match effect {
            Effect::StoreCheckpoint(checkpoint) => !kept.holds(checkpoint),
            _ => true,
        };
        let is_followed =
            (receiver, Address::Mission) == (drone, from) && effects.iter().any(changes);
        is_followed.then(|| Violation {
            rule: 2,
            at: now,
            drones: vec![drone],
            what: format!("drone {drone} follows an order under {older} while it follows {newer}"),
        })
    }
}

#[cfg(test)]
mod tests {
    use bytes::Bytes;
    use muster_machines::mission::{self, State};
    use muster_machines::node::{Checkpoint, Observation};

    use super::*;

    const DRONE: NodeId = NodeId(3);

    const fn ballot(term: u32) -> Ballot {
        Ballot {
            term,
            rank: 1,
            master: NodeId(1),
        }
    }

    fn keep(state: State) -> Checkpoint {
        let checkpoint = mission::Checkpoint {
            state,
            ..mission::Checkpoint::default()
        };
        Checkpoint::Mission(Box::new(checkpoint))
    }

    /// Whether a mission under term 2 breaks the rule that answers an order of a term with these effects.
    fn breaks_rule(term: u32, effects: &[Effect]) -> bool {
        let mut kept = Checkpoints::default();
        kept.keep(keep(State::TakingOff));
        let mut checker = ObedienceChecker::default();
        let order = Notice::Order {
            ballot: ballot(term),
            sequence: 7,
            order: Bytes::new(),
        };
        let order = Envelope::Mission(Input::Routing(order));
        checker.receives(DRONE, &order, Some(ballot(2)), |id| id);
        let found = checker.yields(Timestamp::ZERO, DRONE, Address::Mission, effects, &kept);
        found.is_some_and(|violation| violation.rule == 2)
    }

    #[test]
    fn following_an_older_order_breaks_the_rule() {
        let event = mission::Event::State(State::Landing);
        let seen = Effect::Observe(Observation::Mission(event));
        assert!(breaks_rule(1, std::slice::from_ref(&seen)));
        assert!(breaks_rule(
            1,
            &[Effect::StoreCheckpoint(keep(State::Landing))]
        ));
        assert!(
            !breaks_rule(2, &[seen]),
            "the order is of the current leader"
        );
    }

    #[test]
    fn an_older_order_may_be_ignored() {
        assert!(!breaks_rule(
            1,
            &[Effect::StoreCheckpoint(keep(State::TakingOff))]
        ));
        assert!(!breaks_rule(1, &[]));
    }

    #[test]
    fn a_mission_that_panicked_at_an_order_is_not_checked() {
        let mut checker = ObedienceChecker {
            must_ignore: Some((DRONE, [ballot(1), ballot(2)])),
        };
        checker.before_task();
        let effects = [Effect::StoreCheckpoint(keep(State::Landing))];
        let kept = Checkpoints::default();
        let found = checker.yields(Timestamp::ZERO, DRONE, Address::Mission, &effects, &kept);
        assert_eq!(found, None);
    }
}
