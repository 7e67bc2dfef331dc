//! How a member executes the master's orders.

use std::time::Duration;

use super::{Event, LandingReason, Mission, Order, State, Transmit};
use crate::flaw::{self, Flaw};
use crate::geometry::Ned;
use crate::time::Timestamp;

impl Mission {
    pub(super) fn execute_order(&mut self, now: Timestamp, sequence: u32, order: Order) {
        // A restarted drone is on task, but does not know the others on task: it executes a known order again.
        let is_task_update = matches!(order, Order::Task { .. }) && self.is_on_task();
        if self.durable.orders.is_known(sequence) && !is_task_update {
            return;
        }
        if let Order::Move { apart: true, .. }
        | Order::Land { apart: true, .. }
        | Order::Reform { apart: true, .. } = order
        {
            self.leave_lockstep();
        }
        match order {
            Order::Plan {
                index,
                count,
                waypoints,
                holds,
            } => self.execute_plan(sequence, (index, count), &waypoints, &holds),
            Order::TakeOff { wave } => self.execute_take_off(now, sequence, wave),
            Order::Move { waypoint, .. } => self.execute_move(sequence, waypoint),
            Order::Land {
                at, changes, wave, ..
            } => self.execute_landing(now, sequence, (at, changes, wave)),
            Order::Reform {
                change, step, wave, ..
            } => self.execute_step(now, sequence, change, (step, wave)),
            Order::Follow { at, velocity } => self.execute_follow(at, velocity),
            Order::Assemble { at } => self.execute_assembly(now, sequence, at),
            Order::Task { drones } => self.execute_task(sequence, drones),
        }
    }

    fn execute_plan(
        &mut self,
        sequence: u32,
        (index, count): (u16, u16),
        waypoints: &[Ned],
        holds: &[Duration],
    ) {
        let known = self.durable.plan.waypoints.len();
        let waypoints_max = self.config.waypoints_max;
        let is_on_ground = matches!(self.durable.state, State::Start | State::SetUp);
        let is_stored =
            is_on_ground && (self.durable.plan).append((index, count), waypoints, waypoints_max);
        if !is_stored {
            self.outbox.event(Event::Refused);
            return;
        }
        self.enter(State::SetUp);
        self.durable.holds.add_part(known, holds);
        self.durable.orders.pending = Some(sequence);
        self.complete_order();
    }

    fn execute_take_off(&mut self, now: Timestamp, sequence: u32, wave: u16) {
        let own_wave = self.layout().take_off_wave(self.config.id);
        let ballot = self.durable.leader.ballot();
        let is_initial_epoch = ballot.is_some_and(|it| !it.is_elected());
        match self.durable.state {
            // Under an elected or silent master others may already fly over the drone.
            State::SetUp
                if self.durable.plan.is_complete
                    && is_initial_epoch
                    && self.master_silent.is_none()
                    // After its own wave others may hover on its path.
                    && own_wave >= wave =>
            {
                self.durable.progress.wave = Some(wave);
                if own_wave == wave {
                    self.durable.orders.pending = Some(sequence);
                    self.start_take_off(now);
                } else {
                    self.outbox.transmit(Transmit::TopologyChanges);
                    self.acknowledge(sequence);
                }
            }
            State::TakingOff => self.continue_as_order(sequence),
            state if state.is_on_mission() => self.acknowledge(sequence),
            _ => self.outbox.event(Event::Refused),
        }
    }

    fn execute_move(&mut self, sequence: u32, waypoint: u16) {
        if self.durable.state == State::MovingToLand && flaw::has(Flaw::RejoinsWhileLanding) {
            self.durable.landing.reason = None;
            self.enter(State::MovingToWaypoint { waypoint });
            self.send_goal();
        }
        if !self.durable.state.is_on_mission()
            || usize::from(waypoint) >= self.durable.plan.waypoints.len()
        {
            self.outbox.event(Event::Refused);
            return;
        }
        if self.is_on_task() {
            // The master was elected before it heard that the task has begun.
            return self.continue_as_order(sequence);
        }
        if self.is_taking_off() {
            // Others may be below its path: it lands once it is in its slot.
            self.durable
                .landing
                .reason
                .get_or_insert(LandingReason::Late);
            return;
        }
        self.skip_missed_changes(waypoint);
        let is_changing = matches!(self.durable.state, State::ChangingFormation { .. });
        if is_changing || self.durable.progress.changes < self.changes_before(waypoint) {
            self.announce_and_descend(LandingReason::Late);
            return;
        }
        if self.durable.state == State::TakingOff {
            // The swarm leaves: the routing finds routes later.
            self.enter(State::WaypointReached { waypoint: 0 });
        }
        self.durable.progress.opened = self.durable.progress.opened.max(Some(waypoint));
        if self.last_reached_waypoint() >= Some(waypoint) {
            // An elected master may be behind this drone, whose leg stays pending.
            self.acknowledge_at_waypoint(sequence);
        } else {
            self.durable.orders.pending = Some(sequence);
        }
    }

    /// Acknowledges an order that is done already. A drone that climbs into its layer does so once it is there.
    pub(super) fn acknowledge_at_waypoint(&mut self, sequence: u32) {
        if self.climbs_at_waypoint() {
            self.durable.orders.pending = Some(sequence);
        } else {
            self.acknowledge(sequence);
        }
    }

    /// In its own layer, counts the changes before `waypoint` as completed: the next leg leads into the new formation.
    pub(super) fn skip_missed_changes(&mut self, waypoint: u16) {
        if !self.flies_in_own_layer() {
            return;
        }
        if let State::ChangingFormation { change, .. } = self.durable.state {
            let waypoint = self.waypoint_of(change);
            self.enter(State::WaypointReached { waypoint });
        }
        self.durable.progress.changes = self
            .durable
            .progress
            .changes
            .max(self.changes_before(waypoint));
    }

    /// The pending order continues as order `sequence`. Without one, acknowledges at once.
    pub(super) fn continue_as_order(&mut self, sequence: u32) {
        match &mut self.durable.orders.pending {
            Some(pending) => *pending = sequence,
            None => self.acknowledge(sequence),
        }
    }

    /// Whether the drone is still flying to its slot.
    pub(super) fn is_taking_off(&self) -> bool {
        self.durable.state == State::TakingOff && self.durable.orders.pending.is_some()
    }

    /// Wave `wave` lands around `at`, in the formation after so many changes.
    fn execute_landing(
        &mut self,
        now: Timestamp,
        sequence: u32,
        (at, changes, wave): (Ned, u16, u16),
    ) {
        if !self.durable.state.is_on_mission() || usize::from(changes) > self.config.changes.len() {
            self.outbox.event(Event::Refused);
            return;
        }
        if self.is_on_task() {
            self.durable.orders.pending = Some(sequence);
            return self.end_task(LandingReason::MissionOver);
        }
        if self.is_on_reserved_path() {
            // The path to a landing place would cross the others' reserved paths.
            if self.landing_after_leg().is_none() {
                self.land_after_leg(LandingReason::MissionOver);
            }
            return;
        }
        self.durable.progress.changes = changes;
        self.durable.progress.wave = Some(wave);
        if self.layout().landing_wave(self.config.id) > wave {
            return self.acknowledge(sequence);
        }
        self.durable.orders.pending = Some(sequence);
        self.move_to_landing_place(now, at);
    }

    /// Whether the next wave waits until this drone is on the ground. It announces its landing only then. A pure relay has
    /// no wave.
    pub(super) fn is_awaited_on_ground(&self) -> bool {
        let (id, layout) = (self.config.id, self.layout());
        let is_drone = id.0 < layout.formation().drones();
        let lands_in_wave = self.durable.landing.reason.is_none() && !self.lands_below_slot();
        is_drone && lands_in_wave && layout.landing_wave(id) + 1 < layout.landing_waves()
    }

    /// Whether the drone is taking off or taking a step of a change. It is then on a path that no other path crosses.
    const fn is_on_reserved_path(&self) -> bool {
        let has_reserved_paths = matches!(
            self.durable.state,
            State::TakingOff | State::ChangingFormation { .. }
        );
        has_reserved_paths && self.durable.orders.pending.is_some()
    }

    /// Flies to the landing place around `at`.
    pub(super) fn move_to_landing_place(&mut self, now: Timestamp, at: Ned) {
        self.durable.landing.reason = None;
        self.durable.landing.at = at;
        if self.lands_below_slot() {
            // The others' positions are unknown: it lands below its slot at its own current or next waypoint.
            let waypoint = self.destination_waypoint().map(usize::from);
            let destination_waypoint =
                waypoint.and_then(|waypoint| self.durable.plan.waypoints.get(waypoint));
            self.durable.landing.at =
                self.landing_centre(destination_waypoint.copied().unwrap_or(at));
        }
        self.durable.deadlines.limit = Some(now + self.config.leg_limit);
        self.enter(State::MovingToLand);
        self.outbox
            .event(Event::Landing(LandingReason::MissionOver));
        if !self.is_awaited_on_ground() {
            self.outbox.transmit(Transmit::Land);
        }
        self.send_goal();
    }

    /// Flies to the next open waypoint, acknowledges a reached one, and replaces a lost master.
    pub(super) fn advance_as_member(&mut self, now: Timestamp) {
        if let State::WaypointReached { waypoint } = self.durable.state {
            if Some(waypoint) < self.durable.progress.opened {
                self.start_leg(now, waypoint + 1);
            } else {
                self.complete_order_at_waypoint();
            }
        }
        if self.succession_at().is_some_and(|at| at <= now) {
            self.start_succession(now);
        }
    }
}
