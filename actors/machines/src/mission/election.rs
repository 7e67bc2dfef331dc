//! Leader epochs, and the election of a new master once the current one is silent.
//!
//! A ballot identifies a leader epoch. A drone's ballot never falls. Every drone that hears a better ballot adopts it,
//! masters too. Pending orders continue: the new master first repeats the order that it executes itself, and drones that
//! have executed it, or a later one, acknowledge at once.

use std::time::Duration;

use super::{
    Config, Elected, Event, Followed, LandingReason, Lead, Liveness, Mission, Order, RoutesPhase,
    State, Succession, Transmit,
};
use crate::flaw::{self, Flaw};
use crate::geometry::Ned;
use crate::identity::Ballot;
use crate::leader::{BallotDecision, LinkSymmetry};
use crate::navigation::Goal;
use crate::time::Timestamp;

/// Maximum number of back-offs before claiming leadership. Drones of worse rank seldom get to claim.
const BACK_OFFS_MAX: u32 = 8;

impl Config {
    /// Maximum back-off of a drone before it claims leadership.
    #[must_use]
    pub fn candidacy_back_off_max(&self) -> Duration {
        self.candidacy_back_off * BACK_OFFS_MAX
    }

    /// Additional tolerance for a silent master while routes change. Zero without elections.
    #[must_use]
    pub const fn spreading(&self) -> Duration {
        match self.succession {
            Succession::Elect => self.spreading_grace,
            Succession::Land => Duration::ZERO,
        }
    }
}

impl Mission {
    /// The drone's rank in the formation of the take-off.
    fn own_rank(&self) -> u32 {
        self.config.layout.formation().ranks()[self.config.id.0 as usize]
    }

    /// The drone's own ballot in a term.
    pub(super) fn own_ballot(&self, term: u32) -> Ballot {
        Ballot {
            term,
            rank: self.own_rank(),
            master: self.config.id,
        }
    }

    /// Adopts a ballot from the routing if it is better. Returns whether it is now the drone's ballot.
    pub(super) fn observe_ballot(&mut self, ballot: Ballot) -> bool {
        match self.durable.leader.observe(ballot, LinkSymmetry::Symmetric) {
            BallotDecision::Ignored => return false,
            BallotDecision::Same => {}
            BallotDecision::Adopted => self.start_epoch(ballot),
        }
        true
    }

    fn start_epoch(&mut self, ballot: Ballot) {
        self.outbox.event(Event::Follows(ballot));
        self.master_silent = None;
        self.master_lands = false;
        let has_own_limit =
            self.durable.orders.pending.is_some() || self.durable.state == State::MovingToLand;
        if self.durable.lead.take().is_some() && !has_own_limit {
            // The limit bounded the wait for the members.
            self.durable.deadlines.limit = None;
        }
        self.durable.orders.start_epoch();
        self.durable.progress.opened = self
            .durable
            .progress
            .opened
            .and(self.destination_waypoint());
        if self.durable.routes < RoutesPhase::Ready {
            self.durable.routes = RoutesPhase::None;
            if let State::NeighbourDiscovery | State::HopUpdate = self.durable.state {
                self.enter(State::TakingOff);
                // Already in its slot.
                self.durable.orders.pending = None;
            }
        }
    }

    /// The waypoint that the drone is at or flies to. `None` before and after the waypoints.
    pub(super) fn destination_waypoint(&self) -> Option<u16> {
        match self.durable.state {
            State::WaypointReached { waypoint } | State::MovingToWaypoint { waypoint } => {
                Some(waypoint)
            }
            State::ChangingFormation { change, .. } => Some(self.waypoint_of(change)),
            _ => None,
        }
    }

    /// The last reached waypoint. `None` before the first.
    pub(super) fn last_reached_waypoint(&self) -> Option<u16> {
        match self.durable.state {
            State::MovingToWaypoint { waypoint } => waypoint.checked_sub(1),
            _ => self.destination_waypoint(),
        }
    }

    /// When the drone replaces a silent master. `None` while it hears one, leads or lands.
    pub(super) fn succession_at(&self) -> Option<Timestamp> {
        if self.landing_after_leg().is_some() {
            return None;
        }
        let is_checked = match self.config.liveness {
            Liveness::Heartbeat if !flaw::has(Flaw::DetectsMasterLossAtWaypointsOnly) => {
                self.durable.state.is_on_mission()
            }
            Liveness::Heartbeat | Liveness::Thesis => self.durable.state.is_waiting(),
        };
        let since = self
            .master_silent
            .filter(|_| !flaw::has(Flaw::NeverClaims))
            .filter(|_| is_checked && self.durable.lead.is_none())?;
        let since = since + self.candidacy_back_off();
        Some(if self.durable.state.is_spreading() && !self.master_lands {
            since + self.config.spreading()
        } else {
            since
        })
    }

    /// Back-off before claiming leadership, longer for worse ranks. Without it all drones would claim at once, and each
    /// claim would flood the swarm.
    fn candidacy_back_off(&self) -> Duration {
        let own = self.own_rank();
        let lost = self.durable.leader.ballot();
        let better = own - u32::from(lost.is_some_and(|lost| lost.rank < own));
        self.config.candidacy_back_off * better.min(BACK_OFFS_MAX)
    }

    /// Claims leadership or lands, as configured.
    pub(super) fn start_succession(&mut self, now: Timestamp) {
        match self.config.succession {
            Succession::Elect => self.claim_leadership(now),
            Succession::Land => self.land_after_leg(LandingReason::MasterSilent),
        }
    }

    /// Leads from now on, under a better ballot than the current one. Lands if it can't lead.
    fn claim_leadership(&mut self, now: Timestamp) {
        let term = self.durable.leader.next_term();
        let Some(term) = term.filter(|_| self.durable.plan.is_complete) else {
            return self.announce_and_descend(LandingReason::MasterSilent);
        };
        let replaced = self.durable.leader.ballot().map(|it| it.master);
        let elected = Elected { at: now, replaced };
        let ballot = self.own_ballot(term);
        self.observe_ballot(ballot);
        let drones = self.config.layout.formation().drones();
        self.durable.lead = Some(Lead::new(drones, self.config.id, Some(elected)));
        self.outbox.transmit(Transmit::Lead(ballot));
        self.hold_in_layer_if_needed();
        self.repeat_own_order(now);
        self.advance_as_master(now);
    }

    /// As newly elected master: issues the order that the drone itself executes.
    fn repeat_own_order(&mut self, now: Timestamp) {
        // Members of an elected master move into their layers by themselves, once they are at a waypoint.
        let apart = self.durable.lockstep.in_layer;
        let (order, limit) = match self.durable.state {
            State::TakingOff | State::NeighbourDiscovery | State::HopUpdate => {
                // Drones on the ground refuse it. It continues once those in the air are in their slots.
                let wave = self.layout().take_off_waves() - 1;
                self.durable.progress.wave = Some(wave);
                (Order::TakeOff { wave }, self.config.take_off_limit)
            }
            // `advance_as_master` opens the first waypoint.
            State::WaypointReached { .. } if self.durable.progress.opened.is_none() => return,
            State::WaypointReached { waypoint } | State::MovingToWaypoint { waypoint } => {
                (Order::Move { waypoint, apart }, self.config.leg_limit)
            }
            State::ChangingFormation { change, step } => {
                let wave = self.durable.progress.wave.unwrap_or(0);
                let order = Order::Reform {
                    change,
                    step,
                    wave,
                    apart,
                };
                (order, self.config.leg_limit)
            }
            State::Assembling => {
                let at = self.durable.landing.assembled_at.unwrap_or(Ned::HOME);
                (Order::Assemble { at }, self.config.leg_limit)
            }
            State::Following => return self.assemble_after_master_loss(now),
            State::OnTask => return self.resume_task(),
            State::Start
            | State::SetUp
            | State::MovingToLand
            | State::Landing
            | State::Finished
            | State::Independent => return,
        };
        let is_executing = self.durable.orders.pending.is_some();
        self.issue_order(&order);
        if !is_executing {
            self.complete_order_at_waypoint();
        }
        self.durable.deadlines.limit = Some(now + limit);
    }

    /// As newly elected master: stops and assembles the swarm, as the lost master's path is unknown.
    fn assemble_after_master_loss(&mut self, now: Timestamp) {
        if let Some(lead) = &mut self.durable.lead {
            lead.followed = Some(Followed {
                destination_waypoint: 0,
                next_fix: now,
                at: Ned::HOME,
                is_ending: true,
            });
        }
        self.leave_lockstep_if_elected();
        // Without news of the lost master it comes to rest by itself, and climbs into its layer.
        if !matches!(self.given_goal, Some(Goal::Track { .. })) {
            self.send_goal();
        }
    }
}
