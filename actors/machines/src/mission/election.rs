//! Whom a drone obeys, and how it comes to lead when the master falls silent.
//!
//! A leader epoch is named by its ballot. The ballot that a drone obeys never falls; a drone that hears of a better one turns
//! to it, masters included. What is being carried out goes on meanwhile: the new master begins by giving the order again that
//! it is at itself, and drones that are there already, or farther, acknowledge at once.

use std::time::Duration;

use super::{
    Config, Event, Followed, LandingReason, Lead, Liveness, Mission, Order, RoutesPhase, State,
    Succession, Transmit,
};
use crate::flaw::{self, Flaw};
use crate::geometry::Ned;
use crate::identity::Ballot;
use crate::leader::{BallotDecision, LinkSymmetry};
use crate::time::Timestamp;

/// To so many drones that would lead rather one leaves it to say that they do: so few know, and others seldom come to it.
const BACK_OFFS_MAX: u32 = 8;

impl Config {
    /// How long a drone that misses its master leaves it to others to lead, at the most.
    #[must_use]
    pub fn candidacy_back_off_max(&self) -> Duration {
        self.candidacy_back_off * BACK_OFFS_MAX
    }

    /// How much longer a drone bears a silent master while the swarm spreads out: not at all if it lands without one.
    #[must_use]
    pub const fn spreading(&self) -> Duration {
        match self.succession {
            Succession::Elect => self.spreading_patience,
            Succession::Land => Duration::ZERO,
        }
    }
}

impl Mission {
    /// The rank that this drone took off with, whatever the formation is now.
    fn own_rank(&self) -> u32 {
        self.config.layout.formation().ranks()[self.config.id.0 as usize]
    }

    /// A ballot of this drone's own.
    pub(super) fn own_ballot(&self, term: u32) -> Ballot {
        Ballot {
            term,
            rank: self.own_rank(),
            master: self.config.id,
        }
    }

    /// Takes in whom the routing obeys; whether this drone does so, too.
    pub(super) fn hear_epoch(&mut self, ballot: Ballot) -> bool {
        match self.durable.leader.hear(ballot, LinkSymmetry::Mutual) {
            BallotDecision::Ignored => return false,
            BallotDecision::Same => {}
            BallotDecision::Turned => self.begin_epoch(ballot),
        }
        true
    }

    fn begin_epoch(&mut self, ballot: Ballot) {
        self.outbox.event(Event::Obeys(ballot));
        self.master_silent = None;
        self.master_lands = false;
        let has_own_limit =
            self.durable.pending.is_some() || self.durable.state == State::MovingToLand;
        if self.durable.lead.take().is_some() && !has_own_limit {
            // It was the limit of its patience with the others.
            self.durable.limit = None;
        }
        self.durable.acknowledged = 0;
        // Nobody waits any more for what an earlier master asked for, but it is still to be done.
        self.durable.pending = self.durable.pending.map(|_| 0);
        self.durable.opened = self.durable.opened.and(self.bound_for());
        if self.durable.routes < RoutesPhase::Ready {
            self.durable.routes = RoutesPhase::None;
            if let State::NeighbourDiscovery | State::HopUpdate = self.durable.state {
                self.enter(State::TakingOff);
                // It is in its slot.
                self.durable.pending = None;
            }
        }
    }

    /// Which waypoint the drone is at or makes for.
    pub(super) fn bound_for(&self) -> Option<u16> {
        match self.durable.state {
            State::WaypointReached { waypoint } | State::MovingToWaypoint { waypoint } => {
                Some(waypoint)
            }
            State::ChangingFormation { change, .. } => Some(self.waypoint_of(change)),
            _ => None,
        }
    }

    /// The highest waypoint that the drone has reached.
    pub(super) fn reached(&self) -> Option<u16> {
        match self.durable.state {
            State::MovingToWaypoint { waypoint } => waypoint.checked_sub(1),
            _ => self.bound_for(),
        }
    }

    /// When another master is needed, unless the one that is missed returns.
    pub(super) fn succeeds_at(&self) -> Option<Timestamp> {
        if self.lands_after_this().is_some() {
            return None;
        }
        let looks = match self.config.liveness {
            Liveness::Heartbeat if !flaw::has(Flaw::MissesMasterAtWaypointsOnly) => {
                self.durable.state.is_following()
            }
            Liveness::Heartbeat | Liveness::Thesis => self.durable.state.is_waiting(),
        };
        let since = self
            .master_silent
            .filter(|_| !flaw::has(Flaw::NeverClaims))
            .filter(|_| looks && self.durable.lead.is_none())?;
        let since = since + self.candidacy_back_off();
        Some(if self.durable.state.is_spreading() && !self.master_lands {
            since + self.config.spreading()
        } else {
            since
        })
    }

    /// How long it leaves it to others of better rank to lead: else all that miss a master at the same moment would claim to
    /// lead, and each would have to hear of all others.
    fn candidacy_back_off(&self) -> Duration {
        let own = self.own_rank();
        let missed = self.durable.leader.ballot();
        let better = own - u32::from(missed.is_some_and(|missed| missed.rank < own));
        self.config.candidacy_back_off * better.min(BACK_OFFS_MAX)
    }

    /// The master is silent: another is needed.
    pub(super) fn succeed(&mut self, now: Timestamp) {
        match self.config.succession {
            Succession::Elect => self.claim(now),
            Succession::Land => self.land_after_this(LandingReason::MasterSilent),
        }
    }

    /// Leads from now on, under a ballot better than the one obeyed so far.
    fn claim(&mut self, now: Timestamp) {
        let term = self.durable.leader.next_term();
        let Some(term) = term.filter(|_| self.durable.plan_complete) else {
            return self.land(LandingReason::MasterSilent);
        };
        let ballot = self.own_ballot(term);
        self.hear_epoch(ballot);
        let drones = self.config.layout.formation().drones();
        self.durable.lead = Some(Lead::over(drones, self.config.id));
        self.outbox.transmit(Transmit::Lead(ballot));
        self.order_again(now);
        self.lead(now);
        self.wait_in_layer();
    }

    /// Gives the order that the drone itself is at.
    fn order_again(&mut self, now: Timestamp) {
        // Whoever is led by a drone that was elected takes to its layer by itself, once it is at a waypoint.
        let apart = self.durable.in_layer;
        let (order, limit) = match self.durable.state {
            State::TakingOff | State::NeighbourDiscovery | State::HopUpdate => {
                // Nobody on the ground takes off at its word: it goes on once those in the air are in their slots.
                let wave = self.layout().take_off_waves() - 1;
                self.durable.wave = Some(wave);
                (Order::TakeOff { wave }, self.config.take_off_limit)
            }
            // Nobody has opened the first waypoint yet.
            State::WaypointReached { .. } if self.durable.opened.is_none() => return,
            State::WaypointReached { waypoint } | State::MovingToWaypoint { waypoint } => {
                (Order::Move { waypoint, apart }, self.config.leg_limit)
            }
            State::ChangingFormation { change, step } => {
                let wave = self.durable.wave.unwrap_or(0);
                let order = Order::Reform {
                    change,
                    step,
                    wave,
                    apart,
                };
                (order, self.config.leg_limit)
            }
            State::Assembling => {
                let at = self.durable.assembled_at.unwrap_or(Ned::HOME);
                (Order::Assemble { at }, self.config.leg_limit)
            }
            State::Following => return self.end_following_of_another(now),
            State::Start
            | State::SetUp
            | State::MovingToLand
            | State::Landing
            | State::Finished => return,
        };
        let is_under_way = self.durable.pending.is_some();
        self.give_order(&order);
        if !is_under_way {
            self.carried_out();
        }
        self.durable.limit = Some(now + limit);
    }

    /// Stops, for nobody knows where the master that was followed would have gone, and calls the others together.
    fn end_following_of_another(&mut self, now: Timestamp) {
        if let Some(lead) = &mut self.durable.lead {
            lead.followed = Some(Followed {
                bound_for: 0,
                next_fix: now,
                at: Ned::HOME,
                is_ending: true,
            });
        }
        self.pursue_goal();
    }
}
