//! What an actor must get: events of the port for the link to the vehicle, an order to land for the mission.

use muster_machines::mission::LandingReason;
use muster_machines::msp::PortEvent;

/// Port events that wait until the link to the vehicle runs and has room.
///
/// Invariant: a link that missed that its port was closed learns that before it is introduced to the port.
#[derive(Debug, Default)]
pub(super) struct PendingPortEvents {
    /// The link had no room for the event that its port was closed.
    closing: bool,
    /// The link has started, or had no room for the identity of the flight controller.
    introduction: bool,
}

impl PendingPortEvents {
    /// The link starts or is started again.
    pub(super) const fn link_starts(&mut self) {
        self.introduction = true;
    }

    /// Posts what waits. `introduction` yields the events for a link that has just started; `post` returns whether the link
    /// had room.
    pub(super) fn deliver<I: Iterator<Item = PortEvent>>(
        &mut self,
        introduction: impl FnOnce() -> I,
        mut post: impl FnMut(PortEvent) -> bool,
    ) {
        if self.closing {
            self.closing = !post(PortEvent::Closed);
        }
        if self.introduction && !self.closing {
            self.introduction = !introduction().all(post);
        }
    }

    /// Posts a new event. If the link has no room now, or has missed that its port was closed, an event that it must not miss
    /// waits.
    pub(super) fn post(&mut self, event: PortEvent, post: impl FnOnce(PortEvent) -> bool) {
        let is_closed = matches!(event, PortEvent::Closed);
        let is_identified = matches!(event, PortEvent::Identified { .. });
        if self.closing || !post(event) {
            self.closing |= is_closed;
            self.introduction |= is_identified;
        }
    }
}

/// An order to land. Each mission gets it, since one that fails takes with it what it had not handled; one that lands already
/// does nothing more.
#[derive(Debug, Default)]
pub(super) struct LandingOrder {
    /// Why, once it was given.
    reason: Option<LandingReason>,
    /// Whether the mission that runs has it.
    is_delivered: bool,
}

impl LandingOrder {
    /// The first reason holds.
    pub(super) fn give(&mut self, reason: LandingReason) {
        self.reason.get_or_insert(reason);
    }

    /// A mission starts or is started again.
    pub(super) const fn mission_starts(&mut self) {
        self.is_delivered = false;
    }

    /// `post` returns whether the mission runs and has room.
    pub(super) fn deliver(&mut self, post: impl FnOnce(LandingReason) -> bool) {
        if let Some(reason) = self.reason.filter(|_| !self.is_delivered) {
            self.is_delivered = post(reason);
        }
    }
}

#[cfg(test)]
mod tests {
    use muster_machines::msp::controller::Stage;
    use muster_msp::{Status, Telemetry};

    use super::*;

    fn identified() -> PortEvent {
        PortEvent::Identified {
            identity: Box::default(),
            granted: Stage::Bench,
        }
    }

    fn status() -> PortEvent {
        PortEvent::Telemetry(Telemetry::Status(Status::default()))
    }

    /// The events that a link with room for `room` of them gets.
    fn delivered(pending: &mut PendingPortEvents, room: usize) -> Vec<PortEvent> {
        let mut delivered = Vec::new();
        let introduction = || [identified(), status()].into_iter();
        pending.deliver(introduction, |event| {
            let has_room = delivered.len() < room;
            if has_room {
                delivered.push(event);
            }
            has_room
        });
        delivered
    }

    #[test]
    fn missed_closing_is_delivered_before_the_introduction() {
        let mut pending = PendingPortEvents::default();
        pending.link_starts();
        pending.post(PortEvent::Closed, |_| false);
        assert!(delivered(&mut pending, 0).is_empty());
        assert_eq!(delivered(&mut pending, 1), [PortEvent::Closed]);
        // An introduction that did not fit is repeated as a whole.
        assert_eq!(delivered(&mut pending, 1), [identified()]);
        assert_eq!(delivered(&mut pending, 2), [identified(), status()]);
        assert!(delivered(&mut pending, 2).is_empty());
    }

    #[test]
    fn identity_waits_while_a_missed_closing_does() {
        let mut pending = PendingPortEvents::default();
        pending.post(PortEvent::Closed, |_| false);
        pending.post(identified(), |_| true);
        assert_eq!(
            delivered(&mut pending, 3),
            [PortEvent::Closed, identified(), status()]
        );
    }

    #[test]
    fn missed_identity_is_delivered_later_and_missed_telemetry_is_not() {
        let mut pending = PendingPortEvents::default();
        pending.post(status(), |_| false);
        pending.post(identified(), |_| true);
        assert!(delivered(&mut pending, 2).is_empty());
        pending.post(identified(), |_| false);
        assert_eq!(delivered(&mut pending, 2), [identified(), status()]);
    }

    #[test]
    fn mission_that_is_started_again_gets_the_order_to_land_again() {
        let mut order = LandingOrder::default();
        let given = |order: &mut LandingOrder, has_room| {
            let mut given = None;
            order.deliver(|reason| {
                given = Some(reason);
                has_room
            });
            given
        };
        assert_eq!(given(&mut order, true), None);
        order.give(LandingReason::Recalled);
        order.give(LandingReason::JournalLost);
        assert_eq!(given(&mut order, false), Some(LandingReason::Recalled));
        assert_eq!(given(&mut order, true), Some(LandingReason::Recalled));
        assert_eq!(given(&mut order, true), None, "once to each mission");
        order.mission_starts();
        assert_eq!(given(&mut order, true), Some(LandingReason::Recalled));
    }
}
