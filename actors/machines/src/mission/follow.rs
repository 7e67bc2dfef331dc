//! The following protocol: members keep formation on the live position of a master that flies by hand or along a path.
//!
//! Set-up, take-off and landing are as in a mission with waypoints. In between the master publishes its position and
//! velocity once a period. Members don't acknowledge these orders, as the next one replaces them. Relays extend the
//! range.

use std::time::Duration;

use super::{Event, Followed, LandingReason, Mission, Order, State, Transmit};
use crate::geometry::{Ned, Velocity};
use crate::navigation::Goal;
use crate::time::Timestamp;

/// Configuration of the following protocol.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Following {
    /// Period at which the master publishes its position.
    pub period: Duration,
    /// How long members extrapolate the last position. Then they stop.
    pub hold: Duration,
    /// Whether a pilot flies the master by hand. Otherwise it flies along the mission, without barriers.
    pub is_piloted: bool,
}

/// Below this speed, in m/s, a master has stopped.
const STOPPED_MPS: f64 = 0.1;

impl Mission {
    fn followed_mut(&mut self) -> Option<&mut Followed> {
        self.durable.lead.as_mut()?.followed.as_mut()
    }

    /// As master: starts to be followed.
    pub(super) fn start_following(&mut self, now: Timestamp) {
        let Some(at) = self.durable.plan.waypoints.first().copied() else {
            return;
        };
        if let Some(lead) = &mut self.durable.lead {
            lead.followed = Some(Followed {
                destination_waypoint: 0,
                next_fix: now,
                at,
                is_ending: false,
            });
        }
        self.enter(State::Following);
        self.leave_lockstep_if_elected();
        self.fly_to_next_waypoint(now);
    }

    /// As master: flies to the next waypoint, or stops after the last. With a pilot, waits for the operator.
    fn fly_to_next_waypoint(&mut self, now: Timestamp) {
        let is_piloted = self.config.following().is_some_and(|it| it.is_piloted);
        let waypoints = self.durable.plan.waypoints.len();
        let leg_limit = self.config.leg_limit;
        let Some(followed) = self.followed_mut() else {
            return;
        };
        if is_piloted {
            self.durable.deadlines.limit = None;
        } else if usize::from(followed.destination_waypoint) + 1 < waypoints {
            followed.destination_waypoint += 1;
            self.durable.deadlines.limit = Some(now + leg_limit);
        } else {
            followed.is_ending = true;
            self.durable.deadlines.limit = None;
        }
        self.send_goal();
    }

    /// The goal of a followed master. `None` for members: their goals come with the orders.
    pub(super) fn following_goal(&self) -> Option<Goal> {
        let followed = self.durable.lead.as_ref()?.followed?;
        if followed.is_ending {
            return Some(Goal::Hold);
        }
        if self.config.following()?.is_piloted {
            return Some(Goal::Yield);
        }
        let waypoint = self
            .durable
            .plan
            .waypoints
            .get(usize::from(followed.destination_waypoint))?;
        if self.durable.lockstep.in_layer {
            return Some(self.goal_in_layer(*waypoint));
        }
        let to = self.layout().slot(self.config.id, *waypoint);
        let hold_altitude_m = self.altitude_alone_m(*waypoint);
        Some(Goal::FlyTo {
            to,
            hold_altitude_m,
        })
    }

    /// As master: after the hold at a waypoint, flies to the next one.
    pub(super) fn complete_following_leg(&mut self, now: Timestamp) {
        let followed = self.followed_mut().filter(|followed| !followed.is_ending);
        if let Some(destination_waypoint) = followed.map(|followed| followed.destination_waypoint)
            && self.advance_hold(now, destination_waypoint)
        {
            self.fly_to_next_waypoint(now);
        }
    }

    /// By the operator: stops the followed master. Once it is at rest the swarm assembles around it and lands. A swarm on
    /// task lands where its drones are.
    pub(super) fn end_following(&mut self) {
        if self.is_on_task() && self.durable.lead.is_some() {
            self.order_swarm_to_land();
            return self.end_task(LandingReason::MissionOver);
        }
        let is_followed = self.durable.state == State::Following;
        match self.followed_mut().filter(|_| is_followed) {
            Some(followed) => {
                followed.is_ending = true;
                self.durable.deadlines.limit = None;
                self.send_goal();
            }
            None => self.outbox.event(Event::Refused),
        }
    }

    /// As master: when the next position is due.
    pub(super) fn next_fix(&self) -> Option<Timestamp> {
        let followed = self.durable.lead.as_ref()?.followed?;
        (self.durable.state == State::Following).then_some(followed.next_fix)
    }

    /// As master: requests its own position if one is due.
    pub(super) fn locate_if_due(&mut self, now: Timestamp) {
        let period = self.config.following().map(|it| it.period);
        let (Some(due), Some(period)) = (self.next_fix().filter(|due| *due <= now), period) else {
            return;
        };
        if let Some(followed) = self.followed_mut() {
            followed.next_fix = due.next_period(period, now);
        }
        self.outbox.transmit(Transmit::Locate);
        self.checkpoint();
    }

    /// As master: publishes its position, or orders the swarm to assemble once it has stopped.
    pub(super) fn handle_position(&mut self, now: Timestamp, at: Ned, velocity: Velocity) {
        if self.durable.state != State::Following {
            return;
        }
        // An elected master's slot is not the centre.
        let at = at - self.layout().slot(self.config.id, Ned::HOME);
        let at = at.at_altitude(self.altitude_in_lockstep_m(at));
        let Some(followed) = self.followed_mut() else {
            return;
        };
        followed.at = at;
        if followed.is_ending && velocity.0.norm() < STOPPED_MPS {
            self.issue_order(&Order::Assemble { at });
            self.start_assembling(now, at);
        } else {
            self.publish_order(&Order::Follow { at, velocity });
        }
    }

    /// Altitude of the formation's centre, in metres above home. A master in its own layer takes that of its waypoint.
    fn altitude_in_lockstep_m(&self, at: Ned) -> f64 {
        let lead = self.durable.lead.as_ref();
        let destination_waypoint = lead.and_then(|lead| Some(lead.followed?.destination_waypoint));
        let waypoint =
            destination_waypoint.and_then(|it| self.durable.plan.waypoints.get(usize::from(it)));
        let is_piloted = self.config.following().is_some_and(|it| it.is_piloted);
        match waypoint {
            Some(waypoint) if self.durable.lockstep.in_layer && !is_piloted => {
                waypoint.altitude_m()
            }
            _ => at.altitude_m(),
        }
    }

    /// As master: the last published position.
    pub(super) fn followed_at(&self) -> Option<Ned> {
        Some(self.durable.lead.as_ref()?.followed?.at)
    }

    /// As member: keeps its slot around a moving centre.
    pub(super) fn execute_follow(&mut self, at: Ned, velocity: Velocity) {
        let Some(following) = self.config.following() else {
            self.outbox.event(Event::Refused);
            return;
        };
        if !self.ensure_can_follow() {
            return;
        }
        self.enter(State::Following);
        self.leave_lockstep_if_elected();
        self.durable.deadlines.limit = None;
        self.durable.orders.pending = None;
        let slot = self.layout().slot(self.config.id, at);
        let hold_altitude_m = self.altitude_alone_m(at);
        let to = if self.durable.lockstep.in_layer {
            slot.at_altitude(hold_altitude_m)
        } else {
            slot
        };
        self.give_goal(Goal::Track {
            to,
            hold_altitude_m,
            velocity,
            hold: following.hold,
        });
    }

    /// Leaves lockstep under an elected master, as other drones may follow another one.
    pub(super) fn leave_lockstep_if_elected(&mut self) {
        if self.is_elected_epoch() && !self.durable.lockstep.in_layer {
            self.leave_lockstep();
        }
    }

    /// As member: flies to its slot around the stopped master.
    pub(super) fn execute_assembly(&mut self, now: Timestamp, sequence: u32, at: Ned) {
        if self.ensure_can_follow() {
            self.leave_lockstep_if_elected();
            self.durable.orders.pending = Some(sequence);
            self.start_assembling(now, at);
        }
    }

    fn start_assembling(&mut self, now: Timestamp, at: Ned) {
        self.durable.landing.assembled_at = Some(at);
        self.durable.deadlines.limit = Some(now + self.config.leg_limit);
        self.enter(State::Assembling);
        self.send_goal();
    }

    /// Whether the drone can follow the master. It lands if it is not in its slot of the final formation.
    pub(super) fn ensure_can_follow(&mut self) -> bool {
        if !self.durable.state.is_on_mission() {
            self.outbox.event(Event::Refused);
            return false;
        }
        let is_changing = matches!(self.durable.state, State::ChangingFormation { .. });
        let is_behind = usize::from(self.durable.progress.changes) < self.config.changes.len();
        if self.is_taking_off() || is_changing || is_behind {
            self.announce_and_descend(LandingReason::Late);
            return false;
        }
        true
    }

    /// As master: lands with the assembled swarm.
    pub(super) fn land_where_assembled(&mut self) {
        if let Some(at) = self.durable.landing.assembled_at {
            self.order_landing_at_once(at);
            self.announce_and_descend(
                self.durable
                    .landing
                    .reason
                    .unwrap_or(LandingReason::MissionOver),
            );
        }
    }
}
