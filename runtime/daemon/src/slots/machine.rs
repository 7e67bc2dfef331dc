//! What is done next to a host's slots. Three links say all: which slot runs, which has proven itself, and which did so before.
//!
//! A slot on trial is one that runs and is not good. Whatever interrupts a goal, reaching [`Goal::Settle`] next leaves a host
//! that runs its good slot.

use std::collections::BTreeSet;

/// Name of a slot: the version, and the first digits of a hash of everything in it.
pub(super) type SlotId = String;

/// A link to a slot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum SlotLink {
    /// The slot that runs.
    Current,
    /// The slot that has proven itself last.
    Good,
    /// The good slot before it, for a rollback.
    Previous,
}

/// A host's slots, as its disk shows them.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct Slots {
    /// Slots with all their files.
    pub(super) complete: BTreeSet<SlotId>,
    pub(super) current: Option<SlotId>,
    pub(super) good: Option<SlotId>,
    pub(super) previous: Option<SlotId>,
}

/// What a host's slots are to become.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Goal {
    /// Room for another slot: only the good one is left.
    Room,
    /// This slot runs, on trial.
    Try(SlotId),
    /// The running slot is good.
    Keep,
    /// The good slot runs.
    Settle,
    /// The good slot before this one runs and is the good one again.
    RollBack,
}

/// One change of the disk, which is done whole or not at all.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Step {
    /// Sets a link, or removes it.
    Set(SlotLink, Option<SlotId>),
    /// Removes a slot that no link leads to.
    Remove(SlotId),
}

impl Slots {
    /// Whether a slot runs that has not proven itself.
    pub(super) fn is_on_trial(&self) -> bool {
        self.current != self.good
    }

    /// The slot that [`Goal::RollBack`] leads to. `None` if there is none.
    pub(super) fn rollback_slot(&self) -> Option<&SlotId> {
        self.previous
            .as_ref()
            .filter(|it| Some(*it) != self.good.as_ref())
    }

    /// The next step to a goal; `None` once it is reached, or if it can't be.
    pub(super) fn next(&self, goal: &Goal) -> Option<Step> {
        let set = |link, to: &Option<SlotId>| Some(Step::Set(link, to.clone()));
        match goal {
            Goal::Room | Goal::Try(_) if self.is_settled_for(goal) => None,
            Goal::Try(slot) if self.complete.contains(slot) => {
                Some(Step::Set(SlotLink::Current, Some(slot.clone())))
            }
            Goal::Try(_) => None,
            Goal::Keep if self.current.is_none() => None,
            Goal::Keep
                if self.is_on_trial() && self.good.is_some() && self.previous != self.good =>
            {
                set(SlotLink::Previous, &self.good)
            }
            Goal::Keep if self.is_on_trial() => set(SlotLink::Good, &self.current),
            Goal::Keep => self.unlinked(),
            Goal::RollBack if !self.is_on_trial() && self.rollback_slot().is_some() => {
                set(SlotLink::Good, &self.previous)
            }
            Goal::Room | Goal::Settle | Goal::RollBack if self.is_on_trial() => {
                set(SlotLink::Current, &self.good)
            }
            Goal::Room if self.previous.is_some() => set(SlotLink::Previous, &None),
            Goal::Settle | Goal::RollBack
                if self.previous.is_some() && self.previous == self.good =>
            {
                set(SlotLink::Previous, &None)
            }
            Goal::Room | Goal::Settle | Goal::RollBack => self.unlinked(),
        }
    }

    /// Whether a slot that is to be tried runs already.
    fn is_settled_for(&self, goal: &Goal) -> bool {
        matches!(goal, Goal::Try(slot) if self.current.as_ref() == Some(slot))
    }

    /// Removes a slot that no link leads to.
    fn unlinked(&self) -> Option<Step> {
        let links = [&self.current, &self.good, &self.previous];
        let mut slots = self.complete.iter();
        let unlinked = slots.find(|slot| links.iter().all(|link| link.as_ref() != Some(slot)));
        unlinked.cloned().map(Step::Remove)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// The disk after a step.
    fn after(mut slots: Slots, step: Step) -> Slots {
        match step {
            Step::Set(SlotLink::Current, to) => slots.current = to,
            Step::Set(SlotLink::Good, to) => slots.good = to,
            Step::Set(SlotLink::Previous, to) => slots.previous = to,
            Step::Remove(slot) => {
                let removed = slots.complete.remove(&slot);
                assert!(removed, "{slot} is not there");
            }
        }
        slots
    }

    /// Takes at most `steps` steps to a goal, as a process that is killed after them.
    fn killed_after(mut slots: Slots, goal: &Goal, steps: usize) -> Slots {
        for _ in 0..steps {
            let Some(step) = slots.next(goal) else { break };
            slots = after(slots, step);
            assert_can_roll_back(&slots);
        }
        slots
    }

    /// No link leads nowhere: the host could be cut off now.
    fn assert_can_roll_back(slots: &Slots) {
        for link in [&slots.current, &slots.good, &slots.previous] {
            let is_there = link.as_ref().is_none_or(|it| slots.complete.contains(it));
            assert!(is_there, "{slots:?}");
        }
    }

    const ENOUGH: usize = 100;

    fn reached(slots: Slots, goal: &Goal) -> Slots {
        let slots = killed_after(slots, goal, ENOUGH);
        assert_eq!(slots.next(goal), None, "{goal:?} is not reached: {slots:?}");
        slots
    }

    /// A host with a new slot that is not tried yet.
    fn installed(slots: Slots, slot: &str) -> Slots {
        let mut slots = reached(slots, &Goal::Room);
        slots.complete.insert(slot.to_owned());
        slots
    }

    fn upgraded(slots: Slots, slot: &str) -> Slots {
        let slots = reached(installed(slots, slot), &Goal::Try(slot.to_owned()));
        assert!(slots.is_on_trial());
        reached(slots, &Goal::Keep)
    }

    #[test]
    fn first_slot_that_fails_leaves_none() {
        let slots = reached(installed(Slots::default(), "a"), &Goal::Try("a".to_owned()));
        assert_eq!(reached(slots, &Goal::Settle), Slots::default());
    }

    #[test]
    fn upgrade_keeps_the_slot_before_for_a_rollback() {
        let slots = upgraded(upgraded(Slots::default(), "a"), "b");
        assert_eq!(slots.current.as_deref(), Some("b"));
        assert_eq!(slots.rollback_slot().map(String::as_str), Some("a"));
        let slots = reached(slots, &Goal::RollBack);
        assert_eq!(slots.current.as_deref(), Some("a"));
        assert_eq!(slots.good, slots.current);
        assert_eq!(slots.rollback_slot(), None);
        assert_eq!(slots.complete.len(), 1, "the slot that was left is removed");
    }

    #[test]
    fn slot_that_fails_its_trial_is_removed() {
        let slots = installed(upgraded(Slots::default(), "a"), "b");
        let slots = reached(slots, &Goal::Try("b".to_owned()));
        let slots = reached(slots, &Goal::Settle);
        assert_eq!(slots, upgraded(Slots::default(), "a"));
    }

    #[test]
    fn slot_that_is_not_there_is_not_tried() {
        let slots = upgraded(Slots::default(), "a");
        assert_eq!(slots.next(&Goal::Try("b".to_owned())), None);
    }

    fn goals() -> impl Strategy<Value = (u8, usize)> {
        (0_u8..6, 0_usize..5)
    }

    proptest! {
        #[test]
        fn host_killed_at_any_step_settles_on_a_slot_that_proved_itself(kills in prop::collection::vec(goals(), 1..40)) {
            let mut slots = upgraded(Slots::default(), "s0");
            let mut proven = BTreeSet::from(["s0".to_owned()]);
            for (nth, (goal, steps)) in (1..).zip(kills) {
                let tried = slots.complete.iter().next_back().cloned().unwrap_or_default();
                let goal = match goal {
                    0 => {
                        slots = killed_after(slots, &Goal::Room, steps);
                        if slots.next(&Goal::Room).is_none() {
                            slots.complete.insert(format!("s{nth}"));
                        }
                        continue;
                    }
                    1 | 2 => Goal::Try(tried),
                    3 => {
                        proven.extend(slots.current.clone());
                        Goal::Keep
                    }
                    4 => Goal::Settle,
                    _ => Goal::RollBack,
                };
                slots = killed_after(slots, &goal, steps);
                prop_assert!(slots.complete.len() <= 3, "{slots:?}");
                let settled = reached(slots.clone(), &Goal::Settle);
                prop_assert_eq!(&settled.current, &settled.good);
                prop_assert!(settled.current.is_some_and(|it| proven.contains(&it)));
            }
        }
    }
}
