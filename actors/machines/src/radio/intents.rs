use std::collections::BTreeMap;
use std::time::Duration;

use super::Transmit;
use crate::identity::NodeId;
use crate::time::Timestamp;
use crate::traffic::Intent;
use crate::wire::{INTENT_MAX, PAYLOAD_MAX};

/// Interval at which an unchanged intent is passed on.
const INTENT_REPEATED_AFTER: Duration = Duration::from_secs(1);

/// Whether a frame with this payload has room for an intent.
pub(super) const fn has_room_for_intent(payload: &[u8]) -> bool {
    payload.len() <= PAYLOAD_MAX - INTENT_MAX
}

/// The own intent and those of other drones.
#[derive(Debug, Default)]
pub(super) struct Intents {
    own: Option<Intent>,
    /// Intents of others, with the time when each was last passed on, after it was heard.
    others: BTreeMap<NodeId, (Intent, Timestamp)>,
}

impl Intents {
    /// Sets the own intent; returns whether it changed.
    pub(super) fn set_own(&mut self, intent: Option<Intent>) -> bool {
        let is_changed = self.own != intent;
        self.own = intent;
        is_changed
    }

    /// The own intent, if a frame with this payload has room for it.
    #[inline]
    pub(super) fn own_for(&self, payload: &[u8]) -> Option<Intent> {
        self.own.filter(|_| has_room_for_intent(payload))
    }

    /// Last intents of other drones for the navigation, however old, with the time when each was last passed on.
    pub(super) fn of_others(&self) -> impl Iterator<Item = Transmit> {
        (self.others.iter()).map(|(sender, (intent, at))| Transmit::Traffic {
            sender: *sender,
            intent: Some(*intent),
            heard_at: *at,
        })
    }

    /// Whether no intent of another drone is known.
    #[inline]
    pub(super) fn are_unknown(&self) -> bool {
        self.others.is_empty()
    }

    /// Updates the intent of another drone. Returns whether to pass it on: it changed, or was not passed on for a while.
    #[inline]
    pub(super) fn update(
        &mut self,
        now: Timestamp,
        sender: NodeId,
        intent: Option<Intent>,
    ) -> bool {
        let before = self.others.get(&sender);
        let is_due = match (intent, before) {
            (None, before) => before.is_some(),
            (Some(_), None) => true,
            (Some(intent), Some((before, at))) => {
                *before != intent || now.since(*at) >= INTENT_REPEATED_AFTER
            }
        };
        if is_due {
            match intent {
                Some(intent) => self.others.insert(sender, (intent, now)),
                None => self.others.remove(&sender),
            };
        }
        is_due
    }
}
