//! Failsafes: how a drone lands without its swarm. The most severe failure decides. A drone that descends on the spot
//! does nothing else any more; one that flies to a landing place never rejoins.
//!
//! A drone lands below its slot at its current or next waypoint. No path of the others crosses that column while they
//! wait for it. They wait until it is below all their paths. Out of lockstep the others' positions are unknown: there
//! the drone lands at a place that no path leads over.

use super::{Alone, Event, LandingReason, Lead, Mission, State, Succession, Transmit};
use crate::flaw::{self, Flaw};
use crate::geometry::Ned;
use crate::msp::LandingCause;
use crate::navigation::{Failure, Goal};
use crate::time::Timestamp;

/// Minimum altitude before the descent, in metres above home.
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

impl From<Option<LandingCause>> for LandingReason {
    fn from(cause: Option<LandingCause>) -> Self {
        match cause {
            None => Self::Controller,
            Some(LandingCause::Pilot) => Self::TakenOver,
            Some(LandingCause::Tilt) => Self::Tilt,
            Some(LandingCause::Thrust) => Self::Thrust,
            Some(LandingCause::Motors) => Self::Motors,
            Some(LandingCause::Volts) => Self::Volts,
        }
    }
}

impl Mission {
    /// Reacts to a failure of the vehicle, which would come to rest at `stop`.
    pub(super) fn handle_failure(
        &mut self,
        now: Timestamp,
        failure: Failure,
        stop: Ned,
        is_airborne: bool,
    ) {
        let reason = failure.into();
        match (self.durable.state, failure) {
            (State::Landing | State::Finished, _) => {}
            (State::Start | State::SetUp, _) => self.stay_on_ground(reason),
            (_, Failure::BatteryCritical) => self.land_on_the_spot(reason),
            (_, Failure::PositionLost) => {
                // Not announced before touchdown: the swarm must not fly over it during the descent.
                self.land_swarm_unless_elections();
                self.descend(reason);
            }
            (State::TakingOff, _) if !is_airborne => self.land_on_the_spot(reason),
            (State::MovingToLand, Failure::BatteryLow) => {}
            // The path to the landing place leaves the fence.
            (State::MovingToLand, Failure::Geofence) => self.land_on_the_spot(reason),
            // Its slot is elsewhere, and its destination known to its agent only.
            (State::OnTask | State::Independent, _) => self.land_on_the_spot(reason),
            (State::Following, _) if self.durable.lead.is_some() => self.end_following_for(reason),
            (State::Following, _) | (_, Failure::Geofence) => {
                let centre = stop - self.layout().slot(self.config.id, Ned::HOME);
                self.land_separately(now, centre, reason);
            }
            (_, Failure::BatteryLow) => {
                self.durable.landing.reason.get_or_insert(reason);
                self.land_separately_if_due(now);
            }
        }
    }

    /// Lands after the maximum flight time: as soon as it is in its slot, or on the spot after another leg limit.
    pub(super) fn end_flight_if_due(&mut self, now: Timestamp) {
        if self
            .durable
            .deadlines
            .flight_ends_at
            .is_none_or(|until| until > now)
        {
            return;
        }
        let reason = LandingReason::FlightTime;
        let is_landing_due = self.durable.landing.reason.is_some();
        self.durable.deadlines.flight_ends_at = None;
        if !self.durable.state.is_on_mission() {
            // On the ground, or landing within other limits.
        } else if is_landing_due {
            self.land_on_the_spot(reason);
        } else if self.is_on_task() {
            self.end_task(reason);
        } else {
            self.durable.deadlines.flight_ends_at = Some(now + self.config.leg_limit);
            if self.durable.state == State::Following {
                self.end_following_for(reason);
            }
            self.durable.landing.reason.get_or_insert(reason);
            self.land_separately_if_due(now);
        }
        self.checkpoint();
    }

    /// Stays on the ground for good, announces that, and gives up the lead.
    pub(super) fn stay_on_ground(&mut self, reason: LandingReason) {
        self.outbox.event(Event::Landing(reason));
        self.durable.deadlines.limit = None;
        self.durable.lead = None;
        self.enter(State::Finished);
        self.outbox.transmit(Transmit::Land);
        self.outbox.transmit(Transmit::Stop);
    }

    /// Lands on the spot. A master without elections orders its swarm to land too.
    pub(super) fn land_on_the_spot(&mut self, reason: LandingReason) {
        self.land_swarm_unless_elections();
        self.announce_and_descend(reason);
    }

    /// As master: orders the swarm to land, unless the members elect another master.
    fn land_swarm_unless_elections(&mut self) {
        if self.config.succession == Succession::Land {
            self.order_swarm_to_land();
        }
    }

    /// Lands at the end of the current leg, whose path is its own. On the spot if it flies none.
    pub(super) fn land_after_leg(&mut self, reason: LandingReason) {
        let is_on_leg = match self.durable.state {
            State::TakingOff | State::ChangingFormation { .. } => {
                self.durable.orders.pending.is_some()
            }
            State::MovingToWaypoint { .. } => true,
            _ => false,
        };
        if is_on_leg {
            self.durable.landing.reason = Some(reason);
            self.outbox.event(Event::Landing(reason));
        } else {
            self.announce_and_descend(reason);
        }
    }

    /// Why the drone lands at the end of its leg. `None` if it does not.
    pub(super) fn landing_after_leg(&self) -> Option<LandingReason> {
        self.durable.landing.reason.filter(|reason| {
            matches!(
                reason,
                LandingReason::MasterSilent | LandingReason::MissionOver
            )
        })
    }

    /// Lands by itself if it has a reason and is in its slot. Returns whether it does.
    pub(super) fn land_separately_if_due(&mut self, now: Timestamp) -> bool {
        let is_alone = self.config.alone == Alone::Land && self.is_alone();
        if is_alone && self.durable.state == State::Following {
            self.end_following_for(LandingReason::Alone);
        }
        if is_alone && self.is_on_task() {
            self.end_task(LandingReason::Alone);
            return true;
        }
        let alone = is_alone.then_some(LandingReason::Alone);
        let (Some(reason), Some(centre)) = (
            self.durable.landing.reason.or(alone),
            self.held_slot_centre(),
        ) else {
            return false;
        };
        self.land_separately(now, self.landing_centre(centre), reason);
        true
    }

    /// Whether it lands below its slot, out of lockstep with the others.
    pub(super) fn lands_below_slot(&self) -> bool {
        self.durable.lockstep.in_layer && self.layout().lands_below_slot()
    }

    /// Centre of the drone's landing that is due around `centre`. Out of lockstep it is moved to where no path leads
    /// over the landing place.
    pub(super) fn landing_centre(&self, centre: Ned) -> Ned {
        if !self.lands_below_slot() {
            return centre;
        }
        self.flight_plan()
            .landing_centre(self.config.id, self.durable.progress.changes, centre)
    }

    /// The centre around which the drone is in its slot. `None` if it is not in its slot.
    fn held_slot_centre(&self) -> Option<Ned> {
        let waypoint = match self.durable.state {
            State::WaypointReached { waypoint } => waypoint,
            State::NeighbourDiscovery | State::HopUpdate => 0,
            State::TakingOff if self.durable.orders.pending.is_none() => 0,
            _ => return None,
        };
        self.durable.plan.waypoint(waypoint)
    }

    /// Whether the drone is a master in the air that lost all members.
    fn is_alone(&self) -> bool {
        let is_alone = self.durable.lead.as_ref().is_some_and(Lead::is_alone);
        self.durable.state.is_on_mission() && is_alone
    }

    /// Flies below its slot around `centre` and lands there.
    fn land_separately(&mut self, now: Timestamp, centre: Ned, reason: LandingReason) {
        if self.config.succession == Succession::Land && self.durable.lead.is_some() {
            return self.land_on_the_spot(reason);
        }
        // Acknowledged on the ground only: until it announces its landing the others wait for it.
        self.durable.orders.pending = None;
        let is_reported = self.landing_after_leg() == Some(reason);
        self.durable.landing.reason = Some(reason);
        self.durable.landing.at = centre;
        self.durable.deadlines.limit = Some(now + self.config.leg_limit);
        self.enter(State::MovingToLand);
        if !is_reported {
            self.outbox.event(Event::Landing(reason));
        }
        self.send_goal();
    }

    /// Below its slot, one layer below the others' paths.
    pub(super) fn separate_landing_goal(&self) -> Option<Goal> {
        let slot = self.layout().slot(self.config.id, self.durable.landing.at);
        let below_m = slot.altitude_m() - self.layout().layer_spacing_m();
        let to = slot.at_altitude(below_m.max(LOWEST_M));
        Some(Goal::TransitTo { to })
    }

    /// As followed master: stops, assembles the swarm and lands with it.
    fn end_following_for(&mut self, reason: LandingReason) {
        if self.durable.landing.reason.is_none() {
            self.durable.landing.reason = Some(reason);
            self.end_following();
        }
    }

    /// Altitude of the drone's own layer around a centre, and its hold altitude in lockstep, in metres above home.
    pub(super) fn altitude_alone_m(&self, centre: Ned) -> f64 {
        if flaw::has(Flaw::SkipsLayers) {
            return centre.altitude_m();
        }
        self.flight_plan()
            .altitude_alone_m(self.config.id, self.durable.progress.changes, centre)
    }
}
