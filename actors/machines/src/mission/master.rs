//! How a master leads: it issues each order once all awaited members have executed the one before.

use std::time::Duration;

use super::{Barrier, Conduct, Event, Lead, Mission, Order, State, Step, Transmit};
use crate::flaw::{self, Flaw};
use crate::geometry::Ned;
use crate::identity::{Ballot, NodeSet};
use crate::time::Timestamp;
use crate::wire::{self, PLAN_PART_MAX};

impl Mission {
    /// By the operator: starts the mission as its first master.
    pub(super) fn start_mission(&mut self, now: Timestamp) {
        let formation = self.config.layout.formation();
        let may_lead = formation.centre() == self.config.id
            && self.durable.state == State::Start
            && !self.config.mission.is_empty();
        if !may_lead {
            self.outbox.event(Event::Refused);
            return;
        }
        let drones = formation.drones();
        let ballot = self.own_ballot(Ballot::FIRST_TERM);
        self.observe_ballot(ballot);
        self.durable.lead = Some(Lead::new(drones, self.config.id, None));
        self.durable.plan.waypoints = self.config.mission.to_vec();
        self.durable.holds = self.config.holds.clone();
        self.durable.plan.is_complete = true;
        self.durable.deadlines.limit = Some(now + self.config.set_up_limit);
        self.enter(State::SetUp);
        self.outbox.transmit(Transmit::Lead(ballot));
        self.order_plan_part(0);
        self.complete_order();
        self.advance_as_master(now);
    }

    /// Publishes an order and makes it this drone's own pending order.
    pub(super) fn issue_order(&mut self, order: &Order) {
        self.publish_order(order);
        self.durable.orders.pending = self.durable.lead.as_ref().map(|lead| lead.sequence);
    }

    /// Publishes an order, without executing it.
    pub(super) fn publish_order(&mut self, order: &Order) {
        if let (Some(lead), Some(ballot)) = (&mut self.durable.lead, self.durable.leader.ballot()) {
            lead.sequence += 1;
            lead.acknowledged = NodeSet::default();
            lead.order = wire::encode_order(order).into();
            self.outbox.transmit(Transmit::Publish {
                ballot,
                sequence: lead.sequence,
                order: lead.order.clone(),
            });
        }
    }

    fn order_plan_part(&mut self, index: usize) {
        let parts = self.durable.plan.waypoints.chunks(PLAN_PART_MAX);
        let count = parts.len();
        if let Some(part) = self.durable.plan.waypoints.chunks(PLAN_PART_MAX).nth(index) {
            let fits = "a mission of at most `waypoints_max` waypoints has fewer parts";
            let order = Order::Plan {
                index: u16::try_from(index).expect(fits),
                count: u16::try_from(count).expect(fits),
                waypoints: part.to_vec(),
                holds: self.durable.holds.part(index * PLAN_PART_MAX, part.len()),
            };
            self.issue_order(&order);
        }
    }

    /// Repeats the leader epoch and the newest order to a restarted routing.
    pub(super) fn resend_lead(&mut self) {
        if let (Some(lead), Some(ballot)) = (&self.durable.lead, self.durable.leader.ballot()) {
            self.outbox.transmit(Transmit::Lead(ballot));
            self.outbox.transmit(Transmit::Publish {
                ballot,
                sequence: lead.sequence,
                order: lead.order.clone(),
            });
        }
    }

    /// As master: records which members executed order `sequence`, and which are landing.
    pub(super) fn record_progress(
        &mut self,
        sequence: u32,
        acknowledged: &NodeSet,
        landing: &NodeSet,
    ) {
        if let Some(lead) = &mut self.durable.lead {
            lead.record_progress(sequence, acknowledged, landing);
        }
        self.mark_heard(acknowledged);
        self.mark_heard(landing);
    }

    /// As master: records that members were not heard for their time to live. Where they may have another master it waits until
    /// they are in their layers, out of the others' way.
    pub(super) fn mark_silent(&mut self, now: Timestamp, members: &NodeSet) {
        let Some(lead) = &mut self.durable.lead else {
            return;
        };
        let (grace, climb) = (self.config.spreading_grace, self.config.climb_limit);
        let elected_at = lead.elected_without(members);
        let waits_until = match self.durable.state {
            // Drones that wait for routes bear a master's silence for the grace. The climb follows at waypoint 0.
            State::TakingOff | State::NeighbourDiscovery | State::HopUpdate => {
                Some(now + grace + elected_at.map_or(Duration::ZERO, |_| climb))
            }
            State::WaypointReached { waypoint: 0 } => Some(now + grace + climb),
            _ => elected_at.map(|since| since + grace + climb),
        };
        let waits_until = waits_until.filter(|until| *until > now && !grace.is_zero());
        lead.mark_silent(members, waits_until);
    }

    /// As master: until when it waits for silent members.
    pub(super) fn silence_tolerated_until(&self) -> Option<Timestamp> {
        self.durable.lead.as_ref()?.silence_tolerated_until
    }

    /// As master: stops waiting for silent members once their grace is over.
    pub(super) fn end_silence_tolerance_if_due(&mut self, now: Timestamp) {
        if self
            .silence_tolerated_until()
            .is_none_or(|until| until > now)
        {
            return;
        }
        if let Some(lead) = &mut self.durable.lead {
            lead.silence_tolerated_until = None;
        }
        self.advance(now);
        self.checkpoint();
    }

    /// As master: records that members were heard.
    pub(super) fn mark_heard(&mut self, members: &NodeSet) {
        if let Some(lead) = &mut self.durable.lead
            && !flaw::has(Flaw::IgnoresReturnedMembers)
        {
            lead.mark_heard(members);
        }
    }

    /// Whether this drone and all awaited members have executed the newest order.
    fn all_completed(&self) -> bool {
        self.durable.orders.pending.is_none()
            && self
                .durable
                .lead
                .as_ref()
                .is_some_and(|lead| lead.awaited(self.barrier()).is_empty())
    }

    /// The barrier that applies in the current state.
    fn barrier(&self) -> Barrier {
        match self.durable.state {
            State::WaypointReached { .. } if self.durable.progress.wave.is_none() => {
                self.config.barrier
            }
            _ => Barrier::Strict,
        }
    }

    /// Issues the next order once the last one is executed.
    pub(super) fn advance_as_master(&mut self, now: Timestamp) {
        if let State::WaypointReached { waypoint } = self.durable.state {
            if self.durable.progress.opened.is_none() {
                self.durable.progress.opened = Some(0);
                let apart = self.leave_lockstep_if_strays();
                self.issue_order(&Order::Move { waypoint: 0, apart });
                self.outbox.event(Event::Opened { waypoint: 0 });
            }
            self.climb_if_strays(now, waypoint);
            self.complete_order_at_waypoint();
        }
        if !self.all_completed() {
            return;
        }
        match self.durable.state {
            State::SetUp => self.advance_set_up(now),
            State::TakingOff => self.advance_take_off(now),
            State::WaypointReached { waypoint } => self.advance_from_waypoint(now, waypoint),
            State::ChangingFormation { change, step } => {
                if let Some(step) = self.next_step(change, step) {
                    self.order_step(now, change, step);
                }
            }
            State::Assembling => self.land_where_assembled(),
            _ => {}
        }
    }

    /// Sends the next part of the plan. After the last part, orders the take-off.
    fn advance_set_up(&mut self, now: Timestamp) {
        let parts_given = self
            .durable
            .lead
            .as_ref()
            .map_or(0, |lead| lead.sequence as usize);
        if parts_given < self.durable.plan.waypoints.len().div_ceil(PLAN_PART_MAX) {
            self.order_plan_part(parts_given);
            self.durable.deadlines.limit = Some(now + self.config.set_up_limit);
            self.complete_order();
            return self.advance_as_master(now);
        }
        self.order_take_off(0);
        self.start_take_off(now);
    }

    fn order_take_off(&mut self, wave: u16) {
        self.durable.progress.wave = Some(wave);
        self.issue_order(&Order::TakeOff { wave });
    }

    /// Orders the next wave to take off. After the last wave, starts neighbour discovery.
    fn advance_take_off(&mut self, now: Timestamp) {
        let next = self.durable.progress.wave.map_or(0, |wave| wave + 1);
        if next >= self.layout().take_off_waves() {
            self.durable.deadlines.limit = None;
            return self.outbox.transmit(Transmit::Discover);
        }
        self.order_take_off(next);
        self.durable.deadlines.limit = Some(now + self.config.take_off_limit);
        self.outbox.transmit(Transmit::TopologyChanges);
        self.complete_order();
    }

    /// After the hold: lands the next wave, changes formation, opens the next waypoint or starts to land.
    fn advance_from_waypoint(&mut self, now: Timestamp, waypoint: u16) {
        if !self.advance_hold(now, waypoint) {
            return;
        }
        let reopens = self.is_elected_epoch() && flaw::has(Flaw::ReopensWaypoints);
        let next = if reopens { waypoint } else { waypoint + 1 };
        if let Some(wave) = self.durable.progress.wave {
            self.land_next_wave(now, wave + 1);
        } else if self.changes_before(next) > self.durable.progress.changes {
            self.order_step(now, self.durable.progress.changes, (Step::Climb, 0));
        } else if self.config.following().is_some() {
            self.start_following(now);
        } else if self.config.conduct == Conduct::Task {
            self.start_task();
        } else if usize::from(next) < self.durable.plan.waypoints.len() {
            self.durable.progress.opened = Some(next);
            let apart = self.leave_lockstep_if_strays();
            self.issue_order(&Order::Move {
                waypoint: next,
                apart,
            });
            self.outbox.event(Event::Opened { waypoint: next });
            self.start_leg(now, next);
        } else {
            self.land_next_wave(now, 0);
        }
    }

    /// Orders a wave to land around the last waypoint. Out of lockstep all land at once, each below its slot.
    fn land_next_wave(&mut self, now: Timestamp, wave: u16) {
        let Some(last) = self.durable.plan.waypoints.last().copied() else {
            return;
        };
        let last_wave = self.layout().landing_waves() - 1;
        if last_wave > 0 && self.is_elected_epoch() {
            // An elected master may be in an earlier wave than its members, and can't lead them once it lands.
            self.leave_lockstep();
        }
        let wave = if self.leave_lockstep_if_strays() {
            last_wave
        } else {
            wave
        };
        self.order_landing(last, wave);
        if self.layout().landing_wave(self.config.id) <= wave {
            self.move_to_landing_place(now, last);
        } else {
            self.durable.deadlines.limit = Some(now + self.config.landing_limit);
            self.complete_order();
        }
    }

    fn order_landing(&mut self, centre: Ned, wave: u16) {
        let (changes, apart) = (
            self.durable.progress.changes,
            self.leave_lockstep_if_strays(),
        );
        self.durable.progress.wave = Some(wave);
        self.issue_order(&Order::Land {
            at: centre,
            changes,
            wave,
            apart,
        });
    }

    /// Orders all waves to land around a centre at once. A swarm with several waves leaves lockstep for that.
    pub(super) fn order_landing_at_once(&mut self, centre: Ned) {
        let last = self.layout().landing_waves() - 1;
        if last > 0 {
            self.leave_lockstep();
        }
        self.order_landing(centre, last);
    }

    /// As master at a waypoint: if some members may fly elsewhere, orders all to climb into their own layers first, each above
    /// its slot. They leave together, once all are there.
    fn climb_if_strays(&mut self, now: Timestamp, waypoint: u16) {
        let flies_mission =
            self.config.following().is_none() && self.config.conduct != Conduct::Task;
        let lands = self.durable.progress.wave.is_some();
        if flies_mission
            && !lands
            && !self.durable.lockstep.in_layer
            && self.leave_lockstep_if_strays()
        {
            self.issue_order(&Order::Move {
                waypoint,
                apart: true,
            });
            self.durable.deadlines.limit = Some(now + self.config.leg_limit);
        }
    }

    /// As master: leaves lockstep if some members may fly elsewhere. Returns whether all must fly in their own layers.
    pub(super) fn leave_lockstep_if_strays(&mut self) -> bool {
        if self.durable.lead.as_ref().is_some_and(Lead::has_strays) {
            self.leave_lockstep();
        }
        self.durable.lockstep.in_layer
    }

    /// As master: stops waiting for the members that have not executed the newest order.
    pub(super) fn leave_out_late_members(&mut self) {
        let barrier = self.barrier();
        if let Some(lead) = &mut self.durable.lead
            && !flaw::has(Flaw::WaitsForever)
        {
            let late = lead.awaited(barrier);
            lead.left_out.extend_from(&late);
            for id in late.iter() {
                self.outbox.event(Event::LeftOut(id));
            }
        }
    }

    /// As master: orders the swarm to land around its current destination.
    pub(super) fn order_swarm_to_land(&mut self) {
        if self.durable.lead.is_none() || !self.durable.state.is_on_mission() {
            return;
        }
        let waypoint = |waypoint: u16| self.durable.plan.waypoint(waypoint);
        let destination_waypoint = match self.durable.state {
            State::MovingToWaypoint { waypoint: next }
            | State::WaypointReached { waypoint: next } => waypoint(next),
            State::ChangingFormation { change, .. } => waypoint(self.waypoint_of(change)),
            State::Following | State::Assembling => self.followed_at(),
            _ => waypoint(0),
        };
        if let Some(centre) = destination_waypoint {
            self.order_landing_at_once(centre);
        }
    }
}
