//! The navigation goal that follows from the mission's state.

use super::{Mission, State};
use crate::flaw::{self, Flaw};
use crate::geometry::Ned;
use crate::navigation::Goal;

impl Mission {
    /// The goal in the current state. `None` on the ground, and while the routing finds routes.
    pub(super) fn goal(&self) -> Option<Goal> {
        match self.durable.state {
            // On task the agent sets the goals.
            State::Start | State::SetUp | State::OnTask | State::Independent => None,
            State::TakingOff | State::NeighbourDiscovery | State::HopUpdate
                if self.durable.lockstep.in_layer && !self.is_taking_off() =>
            {
                self.durable
                    .plan
                    .waypoint(0)
                    .map(|centre| self.goal_in_layer(centre))
            }
            State::TakingOff => self.take_off_goal(),
            State::NeighbourDiscovery | State::HopUpdate => None,
            State::WaypointReached { waypoint } | State::MovingToWaypoint { waypoint } => {
                let centre = self.durable.plan.waypoint(waypoint)?;
                let slot = self.layout().slot(self.config.id, centre);
                Some(self.goal_at_slot(centre, slot))
            }
            State::ChangingFormation { change, step } => {
                let to = self.step_target(change, step)?;
                if self.flies_in_own_layer() {
                    return Some(Goal::TransitTo { to });
                }
                // The column or the sector is its own, so it holds where it is.
                Some(Goal::FlyTo {
                    to,
                    hold_altitude_m: to.altitude_m(),
                })
            }
            State::Following => self.following_goal(),
            State::Assembling => {
                let centre = self.durable.landing.assembled_at?;
                Some(self.goal_at_slot(centre, centre))
            }
            State::MovingToLand => self.moving_to_land_goal(),
            State::Landing | State::Finished => Some(Goal::Land),
        }
    }

    fn take_off_goal(&self) -> Option<Goal> {
        let (id, layout) = (self.config.id, self.layout());
        let to = layout.slot(id, self.durable.plan.waypoint(0)?);
        let layer_m = if flaw::has(Flaw::TakesOffInOneLayer) {
            0.0
        } else {
            layout.take_off_layers_m()[id.0 as usize]
        };
        Some(Goal::TakeOff {
            to,
            transit_altitude_m: to.altitude_m() + layer_m,
            arm: !self.durable.restarted,
        })
    }

    /// Whether a goal leads the drone out of lockstep with the others, to its own altitude. To hold altitudes the navigation goes
    /// by itself.
    pub(super) fn is_out_of_lockstep(&self, goal: Goal) -> bool {
        match goal {
            Goal::TransitTo { .. } => {
                self.durable.state != State::MovingToLand
                    || !self.lands_in_lockstep() && !self.lands_below_others()
            }
            Goal::Track { .. } => self.durable.lockstep.in_layer,
            _ => false,
        }
    }

    /// Whether the drone lands by itself, below the paths of the others.
    fn lands_below_others(&self) -> bool {
        self.durable.landing.reason.is_some() && !self.flies_in_own_layer()
    }

    /// Whether the drone lands around the centre from which all do, in lockstep with them.
    fn lands_in_lockstep(&self) -> bool {
        let at = self.durable.landing.at;
        let ends = [
            self.durable.plan.waypoints.last().copied(),
            self.durable.landing.assembled_at,
        ];
        ends.contains(&Some(at)) && !self.durable.lockstep.in_layer
    }

    /// The drone's slot around a centre: in its own layer if it is not in lockstep. In lockstep its hold altitude is the
    /// layer above `below`.
    fn goal_at_slot(&self, centre: Ned, below: Ned) -> Goal {
        if self.durable.lockstep.in_layer {
            return self.goal_in_layer(centre);
        }
        Goal::FlyTo {
            to: self.layout().slot(self.config.id, centre),
            hold_altitude_m: self.altitude_alone_m(below),
        }
    }

    /// Above the drone's slot around a centre, in its own layer.
    pub(super) fn goal_in_layer(&self, centre: Ned) -> Goal {
        let slot = self.layout().slot(self.config.id, centre);
        let to = slot.at_altitude(self.altitude_alone_m(centre));
        Goal::TransitTo { to }
    }

    fn moving_to_land_goal(&self) -> Option<Goal> {
        if self.lands_below_others() {
            return self.separate_landing_goal();
        }
        let (id, layout, at) = (self.config.id, self.layout(), self.durable.landing.at);
        let place = if flaw::has(Flaw::LandsOnOnePoint) {
            at
        } else if self.lands_below_slot() {
            layout.slot(id, at)
        } else {
            layout.landing_place(id, at)
        };
        let to = place.at_altitude(self.landing_altitude_m());
        Some(Goal::TransitTo { to })
    }

    /// Altitude of the flight to the landing place, in metres above home: in lockstep, from where all are, the drone's
    /// landing layer; otherwise its own layer.
    fn landing_altitude_m(&self) -> f64 {
        let at = self.durable.landing.at;
        if flaw::has(Flaw::FliesToLandingInOneLayer) {
            at.altitude_m()
        } else if self.lands_in_lockstep() {
            at.altitude_m() + self.layout().landing_layers_m()[self.config.id.0 as usize]
        } else {
            self.altitude_alone_m(at)
        }
    }
}
