//! What a drone does that can't go on with its swarm, or has none left. Of several failures the most severe decides: a
//! drone that comes down on the spot does nothing else any more, one that goes to land never rejoins.
//!
//! A drone goes to land below its slot at the waypoint that it is at or makes for. No way of the others leads through
//! that column while they wait for it; it holds them up until it is below all that they may fly. In a layer of its own it
//! does not know where the others are: there it makes for a place that none of their ways leads over.

use super::{Alone, Event, LandingReason, Lead, Mission, State, Succession, Transmit};
use crate::flaw::{self, Flaw};
use crate::geometry::Ned;
use crate::navigation::{Failure, Goal};
use crate::time::Timestamp;

/// The lowest that a drone goes other than to land, in metres.
const LOWEST_M: f64 = 2.0;

impl From<Failure> for LandingReason {
    fn from(failure: Failure) -> Self {
        match failure {
            Failure::BatteryLow => Self::BatteryLow,
            Failure::Geofence => Self::Geofence,
            Failure::PositionLost => Self::PositionLost,
            Failure::BatteryCritical => Self::BatteryCritical,
        }
    }
}

impl Mission {
    /// Something about the aircraft fails, which would come to rest at `stop`.
    pub(super) fn fail(&mut self, now: Timestamp, failure: Failure, stop: Ned, is_airborne: bool) {
        let reason = failure.into();
        match (self.durable.state, failure) {
            (State::Landing | State::Finished, _) => {}
            (State::Start | State::SetUp, _) => self.stay_down(reason),
            (_, Failure::BatteryCritical) => self.come_down(reason),
            (_, Failure::PositionLost) => {
                // It has held the swarm up, which is not to fly on over it while it comes down: who waits goes on once
                // it is on the ground and says so.
                self.leave_swarm();
                self.descend(reason);
            }
            (State::TakingOff, _) if !is_airborne => self.come_down(reason),
            (State::MovingToLand, Failure::BatteryLow) => {}
            // The way to land leads out of the fence.
            (State::MovingToLand, Failure::Geofence) => self.come_down(reason),
            (State::Following, _) if self.durable.lead.is_some() => self.end_following_for(reason),
            (State::Following, _) | (_, Failure::Geofence) => {
                let centre = stop - self.layout().slot(self.config.id, Ned::HOME);
                self.leave(now, centre, reason);
            }
            (_, Failure::BatteryLow) => {
                self.durable.leaving.get_or_insert(reason);
                self.leave_if_due(now);
            }
        }
    }

    /// Goes to land once it has flown for as long as it may, however little the mission has got on: soon in its slot, or
    /// then wherever it is.
    pub(super) fn end_flight_if_due(&mut self, now: Timestamp) {
        if self.durable.flies_until.is_none_or(|until| until > now) {
            return;
        }
        let reason = LandingReason::FlightTime;
        let is_last_call = self.durable.leaving.is_some();
        self.durable.flies_until = None;
        if !self.durable.state.is_following() {
            // It is on the ground, or on its way there within limits of its own.
        } else if is_last_call {
            self.come_down(reason);
        } else {
            self.durable.flies_until = Some(now + self.config.leg_limit);
            if self.durable.state == State::Following {
                self.end_following_for(reason);
            }
            self.durable.leaving.get_or_insert(reason);
            self.leave_if_due(now);
        }
        self.checkpoint();
    }

    /// Never takes off; nobody is to wait for it, and a swarm that it would have led stays down.
    pub(super) fn stay_down(&mut self, reason: LandingReason) {
        self.outbox.event(Event::Landing(reason));
        self.durable.limit = None;
        self.durable.lead = None;
        self.enter(State::Finished);
        self.outbox.transmit(Transmit::Land);
        self.outbox.transmit(Transmit::Stop);
    }

    /// Lands on the spot, whatever becomes of the others.
    pub(super) fn come_down(&mut self, reason: LandingReason) {
        self.leave_swarm();
        self.land(reason);
    }

    /// A master that must land takes its swarm down with it or, where there are elections, leaves it to another: that it
    /// lands is known at once to all that hear it.
    fn leave_swarm(&mut self) {
        if self.config.succession == Succession::Land {
            self.abandon_swarm();
        }
    }

    /// Lands at the end of the way that it is on, which nobody else's leads through, or on the spot if it is on none.
    pub(super) fn land_after_this(&mut self, reason: LandingReason) {
        let is_on_its_way = match self.durable.state {
            State::TakingOff | State::ChangingFormation { .. } => self.durable.pending.is_some(),
            State::MovingToWaypoint { .. } => true,
            _ => false,
        };
        if is_on_its_way {
            self.durable.leaving = Some(reason);
            self.outbox.event(Event::Landing(reason));
        } else {
            self.land(reason);
        }
    }

    /// Why it lands at the end of the way that it is on, if it does: nobody leads it any farther.
    pub(super) fn lands_after_this(&self) -> Option<LandingReason> {
        self.durable.leaving.filter(|reason| {
            matches!(
                reason,
                LandingReason::MasterSilent | LandingReason::MissionOver
            )
        })
    }

    /// Goes to land as soon as it is in its slot, if it has a reason; whether it does.
    pub(super) fn leave_if_due(&mut self, now: Timestamp) -> bool {
        let is_alone = self.config.alone == Alone::Land && self.is_alone();
        if is_alone && self.durable.state == State::Following {
            self.end_following_for(LandingReason::Alone);
        }
        let alone = is_alone.then_some(LandingReason::Alone);
        let (Some(reason), Some(centre)) = (self.durable.leaving.or(alone), self.in_slot_around())
        else {
            return false;
        };
        self.leave(now, self.clearing(centre), reason);
        true
    }

    /// Whether it lands below its slot, out of lockstep with the others.
    pub(super) fn lands_apart(&self) -> bool {
        self.durable.in_layer && self.layout().lands_apart()
    }

    /// Around which centre it comes down that would come down around this one: in a layer of its own, where nobody's way
    /// leads, for it does not know where the others are.
    pub(super) fn clearing(&self, centre: Ned) -> Ned {
        if !self.lands_apart() {
            return centre;
        }
        self.flown()
            .clearing(self.config.id, self.durable.changes, centre)
    }

    /// Around which centre the drone is in its slot, if it is.
    fn in_slot_around(&self) -> Option<Ned> {
        let waypoint = match self.durable.state {
            State::WaypointReached { waypoint } => waypoint,
            State::NeighbourDiscovery | State::HopUpdate => 0,
            State::TakingOff if self.durable.pending.is_none() => 0,
            _ => return None,
        };
        self.durable.plan.get(usize::from(waypoint)).copied()
    }

    /// Whether it leads nobody that it still hears of, though there were others.
    fn is_alone(&self) -> bool {
        let is_alone = self.durable.lead.as_ref().is_some_and(Lead::is_alone);
        self.durable.state.is_following() && is_alone
    }

    /// Goes to land below its slot around `centre`.
    fn leave(&mut self, now: Timestamp, centre: Ned, reason: LandingReason) {
        if self.config.succession == Succession::Land && self.durable.lead.is_some() {
            return self.come_down(reason);
        }
        // It has not carried out what it was told until nobody needs to wait for it any more.
        self.durable.pending = None;
        let is_known = self.lands_after_this() == Some(reason);
        self.durable.leaving = Some(reason);
        self.durable.land_at = centre;
        self.durable.limit = Some(now + self.config.leg_limit);
        self.enter(State::MovingToLand);
        if !is_known {
            self.outbox.event(Event::Landing(reason));
        }
        self.pursue_goal();
    }

    /// Below its slot, and below all that the others may fly.
    pub(super) fn goal_alone(&self) -> Option<Goal> {
        let slot = self.layout().slot(self.config.id, self.durable.land_at);
        let below_m = slot.altitude_m() - self.layout().pitch_m();
        let to = slot.at_altitude(below_m.max(LOWEST_M));
        Some(Goal::TransitTo { to })
    }

    /// As master that is followed: stops, calls the others together and lands with them.
    fn end_following_for(&mut self, reason: LandingReason) {
        if self.durable.leaving.is_none() {
            self.durable.leaving = Some(reason);
            self.end_following();
        }
    }

    /// How high a drone flies around a centre that is not in lockstep, and holds while others fly on, in metres above home.
    pub(super) fn altitude_alone_m(&self, centre: Ned) -> f64 {
        if flaw::has(Flaw::ForgetsLayers) {
            return centre.altitude_m();
        }
        self.flown()
            .altitude_alone_m(self.config.id, self.durable.changes, centre)
    }
}
