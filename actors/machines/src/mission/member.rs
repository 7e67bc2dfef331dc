//! What a drone does that is led.

use std::time::Duration;

use super::{Event, LandingReason, Mission, Order, State, Transmit};
use crate::flaw::{self, Flaw};
use crate::geometry::Ned;
use crate::time::Timestamp;
use crate::wire::PLAN_PART_MAX;

impl Mission {
    pub(super) fn obey(&mut self, now: Timestamp, sequence: u32, order: Order) {
        let is_known =
            sequence <= self.durable.acknowledged || self.durable.pending == Some(sequence);
        if is_known {
            return;
        }
        match order {
            Order::Plan {
                index,
                count,
                waypoints,
                holds,
            } => self.store_plan(sequence, (index, count), &waypoints, &holds),
            Order::TakeOff { wave } => self.take_off(now, sequence, wave),
            Order::Move { waypoint, apart } => {
                self.hear_apart(apart);
                self.open(sequence, waypoint);
            }
            Order::Land {
                at,
                changes,
                wave,
                apart,
            } => {
                self.hear_apart(apart);
                self.go_to_land(now, sequence, (at, changes, wave));
            }
            Order::Reform {
                change,
                step,
                wave,
                apart,
            } => {
                self.hear_apart(apart);
                self.take_step(now, sequence, change, (step, wave));
            }
            Order::Follow { at, velocity } => self.keep_formation(at, velocity),
            Order::Assemble { at } => self.assemble(now, sequence, at),
        }
    }

    fn hear_apart(&mut self, apart: bool) {
        if apart {
            self.keep_apart();
        }
    }

    fn store_plan(
        &mut self,
        sequence: u32,
        (index, count): (u16, u16),
        waypoints: &[Ned],
        holds: &[Duration],
    ) {
        let on_the_ground = matches!(self.durable.state, State::Start | State::SetUp);
        let fits = self.durable.plan.len() == usize::from(index) * PLAN_PART_MAX
            && self.durable.plan.len() + waypoints.len() <= self.config.waypoints_max;
        if !on_the_ground || !fits || waypoints.len() > PLAN_PART_MAX {
            self.outbox.event(Event::Refused);
            return;
        }
        self.enter(State::SetUp);
        self.durable.holds.add_part(self.durable.plan.len(), holds);
        self.durable.plan.extend_from_slice(waypoints);
        self.durable.plan_complete = index + 1 >= count;
        self.durable.pending = Some(sequence);
        self.carried_out();
    }

    fn take_off(&mut self, now: Timestamp, sequence: u32, wave: u16) {
        let own_wave = self.layout().take_off_wave(self.config.id);
        let is_the_operators = self
            .durable
            .leader
            .ballot()
            .is_some_and(|it| !it.is_elected());
        match self.durable.state {
            // Without the whole mission a drone stays on the ground, at the word of a master that was elected, and at an
            // old word of one that it does not hear any more: others may be flying over it by now.
            State::SetUp
                if self.durable.plan_complete
                    && is_the_operators
                    && self.master_silent.is_none()
                    // Others may rest where the way of a drone leads that has missed its wave.
                    && own_wave >= wave =>
            {
                self.durable.wave = Some(wave);
                if own_wave == wave {
                    self.durable.pending = Some(sequence);
                    self.begin_to_fly(now);
                } else {
                    self.outbox.transmit(Transmit::Scatter);
                    self.acknowledge(sequence);
                }
            }
            State::TakingOff => self.carry_on(sequence),
            state if state.is_following() => self.acknowledge(sequence),
            _ => self.outbox.event(Event::Refused),
        }
    }

    fn open(&mut self, sequence: u32, waypoint: u16) {
        if self.durable.state == State::MovingToLand && flaw::has(Flaw::RejoinsWhileLanding) {
            self.durable.leaving = None;
            self.enter(State::MovingToWaypoint { waypoint });
            self.pursue_goal();
        }
        if !self.durable.state.is_following() || usize::from(waypoint) >= self.durable.plan.len() {
            self.outbox.event(Event::Refused);
            return;
        }
        if self.is_taking_off() {
            // It lands below its slot once it is there: on its way to it others may be below it.
            self.durable.leaving.get_or_insert(LandingReason::Late);
            return;
        }
        self.make_missed_changes(waypoint);
        let is_changing = matches!(self.durable.state, State::ChangingFormation { .. });
        if is_changing || self.durable.changes < self.changes_before(waypoint) {
            self.land(LandingReason::Late);
            return;
        }
        if self.durable.state == State::TakingOff {
            // In its slot, and the swarm goes on: routes come of themselves, or were missed.
            self.enter(State::WaypointReached { waypoint: 0 });
        }
        self.durable.opened = self.durable.opened.max(Some(waypoint));
        if self.reached() >= Some(waypoint) {
            // It is ahead of the master that was elected meanwhile.
            self.acknowledge(sequence);
        } else {
            self.durable.pending = Some(sequence);
        }
    }

    /// In a layer of its own a drone needs no steps to take the shape that the others have: its next leg leads into it.
    pub(super) fn make_missed_changes(&mut self, waypoint: u16) {
        if !self.flies_in_own_layer() {
            return;
        }
        if let State::ChangingFormation { change, .. } = self.durable.state {
            let waypoint = self.waypoint_of(change);
            self.enter(State::WaypointReached { waypoint });
        }
        self.durable.changes = self.durable.changes.max(self.changes_before(waypoint));
    }

    /// What was being carried out for an earlier master is now for this order; if it is done, that is said at once.
    pub(super) fn carry_on(&mut self, sequence: u32) {
        match &mut self.durable.pending {
            Some(pending) => *pending = sequence,
            None => self.acknowledge(sequence),
        }
    }

    /// Whether the drone is still on the way to its slot.
    pub(super) fn is_taking_off(&self) -> bool {
        self.durable.state == State::TakingOff && self.durable.pending.is_some()
    }

    /// `wave` is the one that lands around `at`, after so many changes of formation.
    fn go_to_land(&mut self, now: Timestamp, sequence: u32, (at, changes, wave): (Ned, u16, u16)) {
        if !self.durable.state.is_following() || usize::from(changes) > self.config.changes.len() {
            self.outbox.event(Event::Refused);
            return;
        }
        if self.is_on_a_way_of_its_own() {
            // Others are still on theirs: it does not lead through these to a landing place.
            if self.lands_after_this().is_none() {
                self.land_after_this(LandingReason::MissionOver);
            }
            return;
        }
        self.durable.changes = changes;
        self.durable.wave = Some(wave);
        if self.layout().landing_wave(self.config.id) > wave {
            return self.acknowledge(sequence);
        }
        self.durable.pending = Some(sequence);
        self.begin_to_land(now, at);
    }

    /// Whether the next wave lands only once this drone is on the ground; it does not count as landing until then.
    pub(super) fn is_awaited_on_ground(&self) -> bool {
        let wave = self.layout().landing_wave(self.config.id);
        let lands_in_wave = self.durable.leaving.is_none() && !self.lands_apart();
        lands_in_wave && wave + 1 < self.layout().landing_waves()
    }

    /// Whether it takes off, or takes a step of a change: each flies a way then that nobody else's leads through, and none
    /// that leads to land.
    const fn is_on_a_way_of_its_own(&self) -> bool {
        let is_under_way = matches!(
            self.durable.state,
            State::TakingOff | State::ChangingFormation { .. }
        );
        is_under_way && self.durable.pending.is_some()
    }

    /// Makes for the landing place around `at`.
    pub(super) fn begin_to_land(&mut self, now: Timestamp, at: Ned) {
        self.durable.leaving = None;
        self.durable.land_at = at;
        if self.lands_apart() {
            // Below its slot where it is, or is bound for: others may be coming down, or fly on, it does not know where.
            let waypoint = self.bound_for().map(usize::from);
            let bound_for = waypoint.and_then(|waypoint| self.durable.plan.get(waypoint));
            self.durable.land_at = self.clearing(bound_for.copied().unwrap_or(at));
        }
        self.durable.limit = Some(now + self.config.leg_limit);
        self.enter(State::MovingToLand);
        self.outbox
            .event(Event::Landing(LandingReason::MissionOver));
        if !self.is_awaited_on_ground() {
            self.outbox.transmit(Transmit::Land);
        }
        self.pursue_goal();
    }

    /// Goes on to what has been opened, acknowledges what has been reached, lands if there is nobody to follow.
    pub(super) fn follow(&mut self, now: Timestamp) {
        if let State::WaypointReached { waypoint } = self.durable.state {
            if Some(waypoint) < self.durable.opened {
                self.leave_for(now, waypoint + 1);
            } else {
                self.carried_out();
            }
        }
        if self.succeeds_at().is_some_and(|at| at <= now) {
            self.succeed(now);
        }
    }
}
