//! What a drone does that leads: one order after the other, each once all that it waits for have carried out the
//! one before.

use super::{Barrier, Event, Lead, Mission, Order, State, Step, Transmit};
use crate::flaw::{self, Flaw};
use crate::geometry::Ned;
use crate::identity::{Ballot, NodeSet};
use crate::time::Timestamp;
use crate::wire::{self, PLAN_PART_MAX};

impl Mission {
    pub(super) fn fly(&mut self, now: Timestamp) {
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
        self.hear_epoch(ballot);
        self.durable.lead = Some(Lead::over(drones, self.config.id));
        self.durable.plan = self.config.mission.to_vec();
        self.durable.holds = self.config.holds.clone();
        self.durable.plan_complete = true;
        self.durable.limit = Some(now + self.config.set_up_limit);
        self.enter(State::SetUp);
        self.outbox.transmit(Transmit::Lead(ballot));
        self.order_plan_part(0);
        self.carried_out();
        self.lead(now);
    }

    pub(super) fn give_order(&mut self, order: &Order) {
        self.announce(order);
        self.durable.pending = self.durable.lead.as_ref().map(|lead| lead.sequence);
    }

    /// Gives an order that nobody needs to carry out before the next.
    pub(super) fn announce(&mut self, order: &Order) {
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
        let parts = self.durable.plan.chunks(PLAN_PART_MAX);
        let count = parts.len();
        if let Some(part) = self.durable.plan.chunks(PLAN_PART_MAX).nth(index) {
            let fits = "a mission of at most `waypoints_max` waypoints has fewer parts";
            let order = Order::Plan {
                index: u16::try_from(index).expect(fits),
                count: u16::try_from(count).expect(fits),
                waypoints: part.to_vec(),
                holds: self.durable.holds.part(index * PLAN_PART_MAX, part.len()),
            };
            self.give_order(&order);
        }
    }

    /// Tells a restarted routing the leader epoch and the newest order once more.
    pub(super) fn repeat_lead(&mut self) {
        if let (Some(lead), Some(ballot)) = (&self.durable.lead, self.durable.leader.ballot()) {
            self.outbox.transmit(Transmit::Lead(ballot));
            self.outbox.transmit(Transmit::Publish {
                ballot,
                sequence: lead.sequence,
                order: lead.order.clone(),
            });
        }
    }

    /// Takes in how far members have got.
    pub(super) fn hear_progress(
        &mut self,
        sequence: u32,
        acknowledged: &NodeSet,
        landing: &NodeSet,
    ) {
        if let Some(lead) = &mut self.durable.lead {
            if sequence >= lead.sequence {
                lead.acknowledged.extend_from(acknowledged);
            }
            lead.landing.extend_from(landing);
        }
        self.hear_of(acknowledged);
        self.hear_of(landing);
    }

    /// Takes in that members have not been heard of for their time to live. While the swarm takes off it gives them as
    /// long again as they bear its own silence: by then they have a master of their own, and are out of the way.
    pub(super) fn miss(&mut self, now: Timestamp, members: &NodeSet) {
        let patience = self.config.spreading_patience;
        let takes_off = matches!(
            self.durable.state,
            State::TakingOff | State::NeighbourDiscovery | State::HopUpdate
        );
        let bears = takes_off && !patience.is_zero();
        if let Some(lead) = &mut self.durable.lead {
            lead.silent
                .extend_from(&members.intersection(&lead.members));
            if bears {
                lead.bears_silence_until = Some(now + patience);
            }
        }
    }

    /// As master: until when it waits for members that it does not hear of any more.
    pub(super) fn bears_silence_until(&self) -> Option<Timestamp> {
        self.durable.lead.as_ref()?.bears_silence_until
    }

    /// As master: goes on without those it does not hear of, if that was all that held it up.
    pub(super) fn end_patience_if_due(&mut self, now: Timestamp) {
        if self.bears_silence_until().is_none_or(|until| until > now) {
            return;
        }
        if let Some(lead) = &mut self.durable.lead {
            lead.bears_silence_until = None;
        }
        self.react(now);
        self.checkpoint();
    }

    /// Takes in that members are there.
    pub(super) fn hear_of(&mut self, members: &NodeSet) {
        if let Some(lead) = &mut self.durable.lead
            && !flaw::has(Flaw::OverlooksWhoReturns)
        {
            lead.silent = lead.silent.difference(members);
        }
    }

    /// Whether all that the master waits for have carried out its newest order.
    fn all_carried_out(&self) -> bool {
        self.durable.pending.is_none()
            && self
                .durable
                .lead
                .as_ref()
                .is_some_and(|lead| lead.awaited(self.barrier()).is_empty())
    }

    /// For whom it waits where it is now.
    fn barrier(&self) -> Barrier {
        match self.durable.state {
            State::WaypointReached { .. } if self.durable.wave.is_none() => self.config.barrier,
            _ => Barrier::Strict,
        }
    }

    /// Gives the next order once the last one is carried out.
    pub(super) fn lead(&mut self, now: Timestamp) {
        if let State::WaypointReached { .. } = self.durable.state {
            if self.durable.opened.is_none() {
                self.durable.opened = Some(0);
                let apart = self.is_apart();
                self.give_order(&Order::Move { waypoint: 0, apart });
                self.outbox.event(Event::Opened { waypoint: 0 });
            }
            self.carried_out();
        }
        if !self.all_carried_out() {
            return;
        }
        match self.durable.state {
            State::SetUp => self.go_on_setting_up(now),
            State::TakingOff => self.go_on_taking_off(now),
            State::WaypointReached { waypoint } => self.go_on_from(now, waypoint),
            State::ChangingFormation { change, step } => {
                if let Some(step) = self.next_step(change, step) {
                    self.order_step(now, change, step);
                }
            }
            State::Assembling => self.land_where_assembled(),
            _ => {}
        }
    }

    fn go_on_setting_up(&mut self, now: Timestamp) {
        let parts_given = self
            .durable
            .lead
            .as_ref()
            .map_or(0, |lead| lead.sequence as usize);
        if parts_given < self.durable.plan.len().div_ceil(PLAN_PART_MAX) {
            self.order_plan_part(parts_given);
            self.durable.limit = Some(now + self.config.set_up_limit);
            self.carried_out();
            return self.lead(now);
        }
        self.order_take_off(0);
        self.begin_to_fly(now);
    }

    fn order_take_off(&mut self, wave: u16) {
        self.durable.wave = Some(wave);
        self.give_order(&Order::TakeOff { wave });
    }

    /// Lets the next wave take off; after the last, routes are looked for.
    fn go_on_taking_off(&mut self, now: Timestamp) {
        let next = self.durable.wave.map_or(0, |wave| wave + 1);
        if next >= self.layout().take_off_waves() {
            self.durable.limit = None;
            return self.outbox.transmit(Transmit::Discover);
        }
        self.order_take_off(next);
        self.durable.limit = Some(now + self.config.take_off_limit);
        self.outbox.transmit(Transmit::Scatter);
        self.carried_out();
    }

    fn go_on_from(&mut self, now: Timestamp, waypoint: u16) {
        if !self.has_held(now, waypoint) {
            return;
        }
        let reopens = self.is_elected_epoch() && flaw::has(Flaw::ReopensWaypoints);
        let next = if reopens { waypoint } else { waypoint + 1 };
        if let Some(wave) = self.durable.wave {
            self.land_next_wave(now, wave + 1);
        } else if self.changes_before(next) > self.durable.changes {
            self.order_step(now, self.durable.changes, (Step::Climb, 0));
        } else if self.config.following.is_some() {
            self.start_being_followed(now);
        } else if usize::from(next) < self.durable.plan.len() {
            self.durable.opened = Some(next);
            let apart = self.is_apart();
            self.give_order(&Order::Move {
                waypoint: next,
                apart,
            });
            self.outbox.event(Event::Opened { waypoint: next });
            self.leave_for(now, next);
        } else {
            self.land_next_wave(now, 0);
        }
    }

    /// Lets a wave land around the last waypoint, this drone, too, if it is its own. Apart, each below its slot, all land at
    /// once.
    fn land_next_wave(&mut self, now: Timestamp, wave: u16) {
        let Some(last) = self.durable.plan.last().copied() else {
            return;
        };
        let last_wave = self.layout().landing_waves() - 1;
        if last_wave > 0 && self.is_elected_epoch() {
            // It may be in an earlier wave itself, and leads nobody once it lands.
            self.keep_apart();
        }
        let wave = if self.is_apart() { last_wave } else { wave };
        self.order_landing(last, wave);
        if self.layout().landing_wave(self.config.id) <= wave {
            self.begin_to_land(now, last);
        } else {
            self.durable.limit = Some(now + self.config.landing_limit);
            self.carried_out();
        }
    }

    fn order_landing(&mut self, centre: Ned, wave: u16) {
        let (changes, apart) = (self.durable.changes, self.is_apart());
        self.durable.wave = Some(wave);
        self.give_order(&Order::Land {
            at: centre,
            changes,
            wave,
            apart,
        });
    }

    /// Orders all to land around a centre at once: apart where it would take waves otherwise.
    pub(super) fn gather_at(&mut self, centre: Ned) {
        let last = self.layout().landing_waves() - 1;
        if last > 0 {
            self.keep_apart();
        }
        self.order_landing(centre, last);
    }

    /// As master: whether some of the swarm may be elsewhere, since nobody hears of them and they have not said that they
    /// land. From then on all are to fly in their layers, this drone, too.
    pub(super) fn is_apart(&mut self) -> bool {
        let strays = |lead: &Lead| {
            let mut missed = lead.silent.clone();
            missed.extend_from(&lead.left_out);
            !missed.difference(&lead.landing).is_empty()
        };
        if self.durable.lead.as_ref().is_some_and(strays) {
            self.keep_apart();
        }
        self.durable.in_layer
    }

    /// Flies without the members that did not get ready in time.
    pub(super) fn leave_out_the_late(&mut self) {
        let barrier = self.barrier();
        if let Some(lead) = &mut self.durable.lead
            && !flaw::has(Flaw::WaitsForEver)
        {
            let late = lead.awaited(barrier);
            lead.left_out.extend_from(&late);
            for id in late.iter() {
                self.outbox.event(Event::LeftOut(id));
            }
        }
    }

    /// A master that must land takes its swarm down with it, where the swarm is bound for.
    pub(super) fn abandon_swarm(&mut self) {
        if self.durable.lead.is_none() || !self.durable.state.is_following() {
            return;
        }
        let waypoint = |waypoint: u16| self.durable.plan.get(usize::from(waypoint)).copied();
        let bound_for = match self.durable.state {
            State::MovingToWaypoint { waypoint: next }
            | State::WaypointReached { waypoint: next } => waypoint(next),
            State::ChangingFormation { change, .. } => waypoint(self.waypoint_of(change)),
            State::Following | State::Assembling => self.followed_at(),
            _ => waypoint(0),
        };
        if let Some(centre) = bound_for {
            self.gather_at(centre);
        }
    }
}
