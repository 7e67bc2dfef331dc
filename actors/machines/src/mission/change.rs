//! A change of formation at a waypoint, step by step: what the master orders and what the others do.

use super::{Event, LandingReason, Mission, Order, State, Step, Transmit};
use crate::flaw::{self, Flaw};
use crate::formation::Layering;
use crate::geometry::Ned;
use crate::time::Timestamp;

impl Mission {
    /// How many changes of formation are made before the swarm makes for a waypoint.
    pub(super) fn changes_before(&self, waypoint: u16) -> u16 {
        self.flown().changes_before(waypoint.into())
    }

    /// At which waypoint a change is made.
    pub(super) fn waypoint_of(&self, change: u16) -> u16 {
        let change = self.config.changes.get(usize::from(change));
        change.map_or(0, |change| change.waypoint())
    }

    /// Where a step of a change leads this drone.
    pub(super) fn corner(&self, change: u16, step: Step) -> Option<Ned> {
        let change = self.config.changes.get(usize::from(change))?;
        let wave = change.wave(self.config.id);
        let waypoint = self.durable.plan.get(usize::from(change.waypoint()))?;
        let [mut above_old, mut above_new, new] = change.path(self.config.id, *waypoint);
        if flaw::has(Flaw::CrossesInOneSector) {
            let altitude_m = waypoint.altitude_m();
            (above_old, above_new) = (
                above_old.at_altitude(altitude_m),
                above_new.at_altitude(altitude_m),
            );
        }
        Some(match (self.flies_in_own_layer(), step) {
            (false, Step::Climb) => above_old,
            (false, Step::Cross) if self.durable.wave < Some(wave) => above_old,
            (false, Step::Cross) => above_new,
            (false, Step::Descend) => new,
            (true, step) => {
                let altitude_m = self.altitude_alone_m(*waypoint);
                let over = if step == Step::Climb {
                    above_old
                } else {
                    above_new
                };
                over.at_altitude(altitude_m)
            }
        })
    }

    /// Whether it flies in a layer of its own: nobody is in its way there, whatever the others do.
    pub(super) fn flies_in_own_layer(&self) -> bool {
        self.durable.in_layer && self.layout().layering() == Layering::Each
    }

    /// As master: orders a step and takes it.
    pub(super) fn order_step(&mut self, now: Timestamp, change: u16, (step, wave): (Step, u16)) {
        let apart = self.is_apart();
        self.give_order(&Order::Reform {
            change,
            step,
            wave,
            apart,
        });
        self.step(now, change, (step, wave));
    }

    /// The step after one of a change, and which wave takes it; `None` after the last.
    pub(super) fn next_step(&self, change: u16, step: Step) -> Option<(Step, u16)> {
        let change = self.config.changes.get(usize::from(change))?;
        let next_wave = self.durable.wave.map_or(0, |wave| wave + 1);
        if step == Step::Cross && next_wave < change.waves() {
            return Some((Step::Cross, next_wave));
        }
        step.next().map(|next| (next, 0))
    }

    fn step(&mut self, now: Timestamp, change: u16, (step, wave): (Step, u16)) {
        self.durable.wave = (step == Step::Cross).then_some(wave);
        self.enter(State::ChangingFormation { change, step });
        self.durable.in_layer |= self.is_elected_epoch();
        self.outbox.transmit(Transmit::Scatter);
        self.durable.limit = Some(now + self.config.leg_limit);
        self.pursue_goal();
    }

    /// As member: takes a step if it has taken the one before; whoever has not would be in the others' way, and lands.
    pub(super) fn take_step(
        &mut self,
        now: Timestamp,
        sequence: u32,
        change: u16,
        (step, wave): (Step, u16),
    ) {
        if !self.durable.state.is_following() || usize::from(change) >= self.config.changes.len() {
            self.outbox.event(Event::Refused);
            return;
        }
        self.skip_routes_in_layer();
        let at = (self.durable.changes, self.durable.state);
        match at {
            (done, _) if done > change => return self.acknowledge(sequence),
            (
                _,
                State::ChangingFormation {
                    change: current,
                    step: last,
                },
            ) if current == change => {
                let last = (last, self.durable.wave.unwrap_or(0));
                if last > (step, wave) {
                    return self.acknowledge(sequence);
                }
                if last == (step, wave) {
                    return self.carry_on(sequence);
                }
            }
            _ => {}
        }
        let waypoint = self.waypoint_of(change);
        let is_ready = match self.durable.state {
            State::WaypointReached { waypoint: at } => {
                step == Step::Climb && at == waypoint && change == self.durable.changes
            }
            State::ChangingFormation {
                change: current,
                step: last,
            } => {
                let next = self.next_step(change, last);
                current == change && next == Some((step, wave)) && self.durable.pending.is_none()
            }
            _ => false,
        };
        // In a layer of its own it is in nobody's way, whichever step it takes.
        let is_there = self.bound_for() == Some(waypoint)
            && !matches!(self.durable.state, State::MovingToWaypoint { .. });
        let is_ready = is_ready || is_there && self.flies_in_own_layer();
        if !is_ready && self.flies_in_own_layer() && !self.is_taking_off() {
            return self.catch_up(waypoint);
        }
        if !is_ready {
            self.land(LandingReason::Late);
            return;
        }
        self.durable.pending = Some(sequence);
        self.step(now, change, (step, wave));
    }

    /// In a layer of its own it is in nobody's way: it makes for the waypoint at which the others change formation, and
    /// asks then what they are at.
    fn catch_up(&mut self, waypoint: u16) {
        self.make_missed_changes(waypoint);
        self.durable.opened = self.durable.opened.max(Some(waypoint));
        self.durable.catches_up = true;
    }

    /// In its slot, but in a layer of its own, it is at waypoint 0 already where the others have gone on: routes come of
    /// themselves, or were missed.
    fn skip_routes_in_layer(&mut self) {
        let finds_routes = matches!(
            self.durable.state,
            State::TakingOff | State::NeighbourDiscovery | State::HopUpdate
        );
        if finds_routes && !self.is_taking_off() && self.flies_in_own_layer() {
            self.enter(State::WaypointReached { waypoint: 0 });
        }
    }

    /// A step has been taken.
    pub(super) fn stepped(&mut self, now: Timestamp, change: u16, step: Step) {
        // Nobody who lives takes longer for a step than a leg may take.
        let waits = self.durable.lead.is_some();
        self.durable.limit = waits.then(|| now + self.config.leg_limit);
        if step.next().is_none() {
            self.durable.changes = change + 1;
            let waypoint = self.waypoint_of(change);
            self.enter(State::WaypointReached { waypoint });
        }
        self.carried_out();
        if let Some(reason) = self.lands_after_this() {
            // Nobody leads it through the steps that are left.
            self.land(reason);
        }
    }
}
