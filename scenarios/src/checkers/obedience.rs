use muster_machines::identity::{Ballot, NodeId};
use muster_machines::mission::Input;
use muster_machines::node::{Address, Checkpoints, Effect, Envelope};
use muster_machines::routing::Notice;
use muster_machines::time::Timestamp;

use super::Violation;

/// Rule 2: no drone obeys an older ballot.
///
/// An order that comes to a mission under a ballot that the one it obeys beats must change nothing: in that step the
/// mission sends nothing, lets nothing be seen, and what it keeps of itself is what it had kept before.
#[derive(Debug, Default)]
pub(crate) struct ObedienceChecker {
    /// The drone whose mission is about to be told an order that it must not obey, and under which ballots.
    refuses: Option<(NodeId, [Ballot; 2])>,
}

impl ObedienceChecker {
    /// A machine of a drone is about to be told something; the drone obeys that ballot.
    /// What the world calls a member that the drone speaks of is told by `number`.
    pub(crate) fn told(
        &mut self,
        drone: NodeId,
        envelope: &Envelope,
        leader: Option<Ballot>,
        number: impl Fn(NodeId) -> NodeId,
    ) {
        if let Envelope::Mission(Input::Routing(Notice::Order { ballot, .. })) = envelope {
            let told = Ballot {
                master: number(ballot.master),
                ..*ballot
            };
            let newer = leader.filter(|leader| leader.beats(&told));
            self.refuses = newer.map(|newer| (drone, [told, newer]));
        }
    }

    /// Something else is about to happen: a mission that panicked at what it was told has done nothing.
    pub(crate) const fn keeps_going(&mut self) {
        self.refuses = None;
    }

    /// What came of a step, before it is carried out.
    pub(crate) fn stepped(
        &mut self,
        now: Timestamp,
        drone: NodeId,
        from: Address,
        effects: &[Effect],
        kept: &Checkpoints,
    ) -> Option<Violation> {
        let (told, [older, newer]) = self.refuses.take()?;
        let changes = |effect: &Effect| match effect {
            Effect::Keep(checkpoint) => !kept.holds(checkpoint),
            _ => true,
        };
        let is_heeded = (told, Address::Mission) == (drone, from) && effects.iter().any(changes);
        is_heeded.then(|| Violation {
            rule: 2,
            at: now,
            drones: vec![drone],
            what: format!("drone {drone} heeds an order under {older} while it obeys {newer}"),
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

    /// Whether a mission that obeys term 2 is found that does this on being told an order of a term.
    fn is_found(term: u32, effects: &[Effect]) -> bool {
        let mut kept = Checkpoints::default();
        kept.keep(keep(State::TakingOff));
        let mut checker = ObedienceChecker::default();
        let order = Notice::Order {
            ballot: ballot(term),
            sequence: 7,
            order: Bytes::new(),
        };
        let order = Envelope::Mission(Input::Routing(order));
        checker.told(DRONE, &order, Some(ballot(2)), |id| id);
        let found = checker.stepped(Timestamp::ZERO, DRONE, Address::Mission, effects, &kept);
        found.is_some_and(|violation| violation.rule == 2)
    }

    #[test]
    fn an_older_order_that_is_carried_out_is_found() {
        let event = mission::Event::State(State::Landing);
        let seen = Effect::Observe(Observation::Mission(event));
        assert!(is_found(1, std::slice::from_ref(&seen)));
        assert!(is_found(1, &[Effect::Keep(keep(State::Landing))]));
        assert!(!is_found(2, &[seen]), "it is of the epoch that is leader");
    }

    #[test]
    fn an_older_order_that_changes_nothing_is_right() {
        assert!(!is_found(1, &[Effect::Keep(keep(State::TakingOff))]));
        assert!(!is_found(1, &[]));
    }

    #[test]
    fn what_a_mission_does_that_panicked_at_an_order_and_is_built_anew_is_not_looked_at() {
        let mut checker = ObedienceChecker {
            refuses: Some((DRONE, [ballot(1), ballot(2)])),
        };
        checker.keeps_going();
        let effects = [Effect::Keep(keep(State::Landing))];
        let kept = Checkpoints::default();
        let found = checker.stepped(Timestamp::ZERO, DRONE, Address::Mission, &effects, &kept);
        assert_eq!(found, None);
    }
}
