//! Notices from the routing, and what a restarted routing is told.

use super::{Event, Mission, RoutesPhase, State, Succession, Transmit};
use crate::identity::{Ballot, NodeSet};
use crate::routing::Notice as RoutingNotice;
use crate::time::Timestamp;
use crate::wire;

impl Mission {
    pub(super) fn handle_routing(&mut self, now: Timestamp, notice: RoutingNotice) {
        if self.is_independent() && notice != RoutingNotice::Resync {
            return;
        }
        match notice {
            RoutingNotice::Leader(ballot) => self.handle_leader(now, ballot),
            RoutingNotice::Order {
                ballot,
                sequence,
                order,
            } => self.handle_order(now, ballot, sequence, &order),
            RoutingNotice::Progress {
                sequence,
                acknowledged,
                landing,
            } => self.record_progress(sequence, &acknowledged, &landing),
            RoutingNotice::Neighbours(neighbours) => {
                if let Some(lead) = &mut self.durable.lead {
                    lead.neighbours = neighbours;
                }
            }
            RoutingNotice::Silent(members) => self.mark_silent(now, &members),
            RoutingNotice::Returned(members) => self.mark_heard(&members),
            RoutingNotice::MasterSilent => {
                self.master_silent.get_or_insert(now);
            }
            RoutingNotice::MasterReturned => {
                self.master_silent = None;
                if self.durable.state == State::SetUp {
                    // The order to take off may have been missed.
                    self.outbox.transmit(Transmit::Resync);
                }
            }
            // Without elections the master orders the swarm to land itself.
            RoutingNotice::MasterLands if self.config.succession == Succession::Elect => {
                self.master_lands = true;
                self.master_silent.get_or_insert(now);
            }
            RoutingNotice::MasterLands => {}
            RoutingNotice::DiscoveryStarted => self.advance_routes(RoutesPhase::Discovery),
            RoutingNotice::HopUpdateStarted => self.advance_routes(RoutesPhase::HopUpdate),
            RoutingNotice::RoutesReady => self.advance_routes(RoutesPhase::Ready),
            RoutingNotice::Resync => self.resync_routing(),
            // For agents.
            RoutingNotice::Message { .. } | RoutingNotice::Sent(_) => {}
        }
    }

    fn handle_leader(&mut self, now: Timestamp, ballot: Ballot) {
        let is_followed = self.observe_ballot(ballot);
        if is_followed && ballot.master == self.config.id && self.durable.lead.is_none() {
            // This drone led and lost that state: the swarm has no master.
            self.master_silent.get_or_insert(now);
        }
    }

    fn handle_order(&mut self, now: Timestamp, ballot: Ballot, sequence: u32, order: &[u8]) {
        if !self.observe_ballot(ballot) || self.durable.lead.is_some() {
            return;
        }
        match wire::decode_order(order) {
            Ok(order) => self.execute_order(now, sequence, order),
            Err(_) => self.outbox.event(Event::Refused),
        }
    }

    fn advance_routes(&mut self, phase: RoutesPhase) {
        self.durable.routes = self.durable.routes.max(phase);
        let is_in_slot = match self.durable.state {
            State::TakingOff => self.durable.orders.pending.is_none(),
            State::NeighbourDiscovery | State::HopUpdate => true,
            _ => false,
        };
        if is_in_slot {
            self.enter_routes_state();
        }
    }

    /// Enters the state of a drone in its slot that matches the routing's progress.
    pub(super) fn enter_routes_state(&mut self) {
        match self.durable.routes {
            RoutesPhase::None => {}
            RoutesPhase::Discovery => self.enter(State::NeighbourDiscovery),
            RoutesPhase::HopUpdate => self.enter(State::HopUpdate),
            RoutesPhase::Ready => self.enter(State::WaypointReached { waypoint: 0 }),
        }
    }

    /// Repeats to a restarted routing what it needs to know.
    pub(super) fn resync_routing(&mut self) {
        self.resend_lead();
        if let Some(lead) = &mut self.durable.lead {
            // The restarted routing starts every member's time to live anew.
            lead.silent = NodeSet::default();
        } else if self.leader() != Some(self.config.id) {
            // It looks for a silent master anew, and does not tell of one that has returned.
            (self.master_silent, self.master_lands) = (None, false);
        }
        self.send_acknowledgement();
        match self.durable.state {
            // Announced once it is below the others.
            State::MovingToLand if self.durable.landing.reason.is_some() => {}
            State::MovingToLand | State::Landing if self.is_awaited_on_ground() => {}
            State::MovingToLand | State::Landing => self.outbox.transmit(Transmit::Land),
            State::Finished => self.outbox.transmit(Transmit::Stop),
            State::Independent => self.outbox.transmit(Transmit::Leave),
            _ => {}
        }
    }
}
