//! A second protocol on the same routing: the others keep formation on the live position of a master that is flown by
//! hand or along a path, wherever they are in reach of it, over others too.
//!
//! Set-up, take-off and landing are those of a mission. In between the master gives an order each period that says
//! where it is and how it moves; nobody acknowledges it, for the next one replaces it.

use std::time::Duration;

use super::{Event, Followed, LandingReason, Mission, Order, State, Transmit};
use crate::geometry::{Ned, Velocity};
use crate::navigation::Goal;
use crate::time::Timestamp;

/// How a master is followed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Following {
    /// How often it tells the others where it is.
    pub period: Duration,
    /// For how long the others go on as they were told last; they come to rest then.
    pub hold: Duration,
    /// Whether a pilot flies it by hand; otherwise it flies along the mission, and waits for nobody.
    pub is_piloted: bool,
}

/// How slow a master is that has stopped, in m/s.
const STILL_MPS: f64 = 0.1;

impl Mission {
    fn followed(&mut self) -> Option<&mut Followed> {
        self.durable.lead.as_mut()?.followed.as_mut()
    }

    /// As master: from now on it is followed.
    pub(super) fn start_being_followed(&mut self, now: Timestamp) {
        let Some(at) = self.durable.plan.first().copied() else {
            return;
        };
        if let Some(lead) = &mut self.durable.lead {
            lead.followed = Some(Followed {
                bound_for: 0,
                next_fix: now,
                at,
                is_ending: false,
            });
        }
        self.enter(State::Following);
        self.follow_apart();
        self.fly_on(now);
    }

    /// Makes for the next waypoint, or ends the following at the last; a pilot does as he likes.
    fn fly_on(&mut self, now: Timestamp) {
        let is_piloted = self.config.following.is_some_and(|it| it.is_piloted);
        let waypoints = self.durable.plan.len();
        let leg_limit = self.config.leg_limit;
        let Some(followed) = self.followed() else {
            return;
        };
        if is_piloted {
            self.durable.limit = None;
        } else if usize::from(followed.bound_for) + 1 < waypoints {
            followed.bound_for += 1;
            self.durable.limit = Some(now + leg_limit);
        } else {
            followed.is_ending = true;
            self.durable.limit = None;
        }
        self.pursue_goal();
    }

    /// What a master wants that is followed; the others are told where to be by each order.
    pub(super) fn goal_as_followed(&self) -> Option<Goal> {
        let followed = self.durable.lead.as_ref()?.followed?;
        if followed.is_ending {
            return Some(Goal::Hold);
        }
        if self.config.following?.is_piloted {
            return Some(Goal::Yield);
        }
        let waypoint = self.durable.plan.get(usize::from(followed.bound_for))?;
        if self.durable.in_layer {
            return Some(self.goal_in_layer(*waypoint));
        }
        let to = self.layout().slot(self.config.id, *waypoint);
        let hold_altitude_m = self.altitude_alone_m(*waypoint);
        Some(Goal::FlyTo {
            to,
            hold_altitude_m,
        })
    }

    pub(super) fn arrived_as_followed(&mut self, now: Timestamp) {
        let followed = self.followed().filter(|followed| !followed.is_ending);
        if let Some(bound_for) = followed.map(|followed| followed.bound_for)
            && self.has_held(now, bound_for)
        {
            self.fly_on(now);
        }
    }

    /// By the operator: the master stops, and once it is at rest all assemble around it and land.
    pub(super) fn end_following(&mut self) {
        let is_followed = self.durable.state == State::Following;
        match self.followed().filter(|_| is_followed) {
            Some(followed) => {
                followed.is_ending = true;
                self.durable.limit = None;
                self.pursue_goal();
            }
            None => self.outbox.event(Event::Refused),
        }
    }

    /// When a master next tells the others where it is.
    pub(super) fn next_fix(&self) -> Option<Timestamp> {
        let followed = self.durable.lead.as_ref()?.followed?;
        (self.durable.state == State::Following).then_some(followed.next_fix)
    }

    pub(super) fn locate_if_due(&mut self, now: Timestamp) {
        let period = self.config.following.map(|it| it.period);
        let (Some(due), Some(period)) = (self.next_fix().filter(|due| *due <= now), period) else {
            return;
        };
        if let Some(followed) = self.followed() {
            // After a stall it does not catch up on what it has left out.
            let next = due + period;
            followed.next_fix = if next > now { next } else { now + period };
        }
        self.outbox.transmit(Transmit::Locate);
        self.checkpoint();
    }

    /// As master: tells the others where it is, or calls them together once it has stopped.
    pub(super) fn located(&mut self, now: Timestamp, at: Ned, velocity: Velocity) {
        if self.durable.state != State::Following {
            return;
        }
        // Whoever was elected is not at the centre.
        let at = at - self.layout().slot(self.config.id, Ned::HOME);
        let at = at.at_altitude(self.altitude_in_lockstep_m(at));
        let Some(followed) = self.followed() else {
            return;
        };
        followed.at = at;
        if followed.is_ending && velocity.0.norm() < STILL_MPS {
            self.give_order(&Order::Assemble { at });
            self.enter_assembly(now, at);
        } else {
            self.announce(&Order::Follow { at, velocity });
        }
    }

    /// How high the centre is that a master leads from its own layer: as the waypoint that it makes for, or that it is at.
    fn altitude_in_lockstep_m(&self, at: Ned) -> f64 {
        let lead = self.durable.lead.as_ref();
        let bound_for = lead.and_then(|lead| Some(lead.followed?.bound_for));
        let waypoint = bound_for.and_then(|it| self.durable.plan.get(usize::from(it)));
        let is_piloted = self.config.following.is_some_and(|it| it.is_piloted);
        match waypoint {
            Some(waypoint) if self.durable.in_layer && !is_piloted => waypoint.altitude_m(),
            _ => at.altitude_m(),
        }
    }

    /// As master: where it was when it last told.
    pub(super) fn followed_at(&self) -> Option<Ned> {
        Some(self.durable.lead.as_ref()?.followed?.at)
    }

    /// As member: keeps its slot around a centre that moves.
    pub(super) fn keep_formation(&mut self, at: Ned, velocity: Velocity) {
        let Some(following) = self.config.following else {
            self.outbox.event(Event::Refused);
            return;
        };
        if !self.may_follow() {
            return;
        }
        self.enter(State::Following);
        self.follow_apart();
        self.durable.limit = None;
        self.durable.pending = None;
        let slot = self.layout().slot(self.config.id, at);
        let hold_altitude_m = self.altitude_alone_m(at);
        let to = if self.durable.in_layer {
            slot.at_altitude(hold_altitude_m)
        } else {
            slot
        };
        self.outbox.transmit(Transmit::Goal(Goal::Track {
            to,
            hold_altitude_m,
            velocity,
            hold: following.hold,
        }));
    }

    /// Under a master that was elected, others may follow another one: each flies in its own layer.
    fn follow_apart(&mut self) {
        if self.is_elected_epoch() && !self.durable.in_layer {
            self.keep_apart();
        }
    }

    pub(super) fn assemble(&mut self, now: Timestamp, sequence: u32, at: Ned) {
        if self.may_follow() {
            self.durable.pending = Some(sequence);
            self.enter_assembly(now, at);
        }
    }

    fn enter_assembly(&mut self, now: Timestamp, at: Ned) {
        self.durable.assembled_at = Some(at);
        self.durable.limit = Some(now + self.config.leg_limit);
        self.enter(State::Assembling);
        self.pursue_goal();
    }

    /// Whether the drone is where it can follow from; one that is not in its slot of the formation in force lands.
    fn may_follow(&mut self) -> bool {
        if !self.durable.state.is_following() {
            self.outbox.event(Event::Refused);
            return false;
        }
        let is_changing = matches!(self.durable.state, State::ChangingFormation { .. });
        let is_behind = usize::from(self.durable.changes) < self.config.changes.len();
        if self.is_taking_off() || is_changing || is_behind {
            self.land(LandingReason::Late);
            return false;
        }
        true
    }

    /// As master: all are around it.
    pub(super) fn land_where_assembled(&mut self) {
        if let Some(at) = self.durable.assembled_at {
            self.gather_at(at);
            self.land(self.durable.leaving.unwrap_or(LandingReason::MissionOver));
        }
    }
}
