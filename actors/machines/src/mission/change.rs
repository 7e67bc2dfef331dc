//! Changes of formation at waypoints. The master orders each step; all take it in lockstep.

use super::{Event, LandingReason, Mission, Order, State, Step, Transmit};
use crate::flaw::{self, Flaw};
use crate::formation::Layering;
use crate::geometry::Ned;
use crate::time::Timestamp;

impl Mission {
    /// Number of changes of formation before the leg to a waypoint.
    pub(super) fn changes_before(&self, waypoint: u16) -> u16 {
        self.flight_plan().changes_before(waypoint.into())
    }

    /// The waypoint of a change; 0 for an unknown change.
    pub(super) fn waypoint_of(&self, change: u16) -> u16 {
        let change = self.config.changes.get(usize::from(change));
        change.map_or(0, |change| change.waypoint())
    }

    /// Target of a step of a change for this drone. `None` if the change or its waypoint is unknown.
    pub(super) fn step_target(&self, change: u16, step: Step) -> Option<Ned> {
        let change = self.config.changes.get(usize::from(change))?;
        let wave = change.wave(self.config.id);
        let waypoint = self
            .durable
            .plan
            .waypoints
            .get(usize::from(change.waypoint()))?;
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
            (false, Step::Cross) if self.durable.progress.wave < Some(wave) => above_old,
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

    /// Whether the drone flies in a layer that no other drone uses.
    pub(super) fn flies_in_own_layer(&self) -> bool {
        self.durable.lockstep.in_layer && self.layout().layering() == Layering::PerDrone
    }

    /// As master: orders a step and starts it.
    pub(super) fn order_step(&mut self, now: Timestamp, change: u16, (step, wave): (Step, u16)) {
        let apart = self.leave_lockstep_if_strays();
        self.issue_order(&Order::Reform {
            change,
            step,
            wave,
            apart,
        });
        self.start_step(now, change, (step, wave));
    }

    /// The step after `step` of a change, and its wave. `None` after the last.
    pub(super) fn next_step(&self, change: u16, step: Step) -> Option<(Step, u16)> {
        let change = self.config.changes.get(usize::from(change))?;
        let next_wave = self.durable.progress.wave.map_or(0, |wave| wave + 1);
        if step == Step::Cross && next_wave < change.waves() {
            return Some((Step::Cross, next_wave));
        }
        step.next().map(|next| (next, 0))
    }

    fn start_step(&mut self, now: Timestamp, change: u16, (step, wave): (Step, u16)) {
        self.durable.progress.wave = (step == Step::Cross).then_some(wave);
        self.enter(State::ChangingFormation { change, step });
        if self.is_elected_epoch() {
            self.durable.lockstep.in_layer = true;
        }
        self.durable.lockstep.climbs = false;
        self.outbox.transmit(Transmit::TopologyChanges);
        self.durable.deadlines.limit = Some(now + self.config.leg_limit);
        self.send_goal();
    }

    /// As member: starts a step if the one before is done. In its own layer it flies to the waypoint of the change first, even
    /// if it counts the change as completed. Otherwise lands, out of the others' paths.
    pub(super) fn execute_step(
        &mut self,
        now: Timestamp,
        sequence: u32,
        change: u16,
        (step, wave): (Step, u16),
    ) {
        if !self.durable.state.is_on_mission() || usize::from(change) >= self.config.changes.len() {
            self.outbox.event(Event::Refused);
            return;
        }
        self.skip_routes_in_layer();
        let has_skipped = self.flies_in_own_layer() && self.is_before(self.waypoint_of(change));
        if self.durable.progress.changes > change && !has_skipped {
            return self.acknowledge_at_waypoint(sequence);
        }
        if let State::ChangingFormation {
            change: current,
            step: last,
        } = self.durable.state
            && current == change
        {
            let last = (last, self.durable.progress.wave.unwrap_or(0));
            if last > (step, wave) {
                return self.acknowledge(sequence);
            }
            if last == (step, wave) {
                return self.continue_as_order(sequence);
            }
        }
        if self.is_ready_for_step(change, (step, wave)) {
            self.durable.orders.pending = Some(sequence);
            self.start_step(now, change, (step, wave));
        } else if self.flies_in_own_layer() && !self.is_taking_off() {
            self.catch_up(self.waypoint_of(change));
        } else {
            self.announce_and_descend(LandingReason::Late);
        }
    }

    /// Whether the drone is at an earlier waypoint, or on a leg to this one at most.
    fn is_before(&self, waypoint: u16) -> bool {
        self.destination_waypoint().is_some() && self.last_reached_waypoint() < Some(waypoint)
    }

    /// Whether the drone has taken the step before. In its own layer it may start with any step at the waypoint.
    fn is_ready_for_step(&self, change: u16, (step, wave): (Step, u16)) -> bool {
        let waypoint = self.waypoint_of(change);
        let is_next = match self.durable.state {
            State::WaypointReached { waypoint: at } => {
                step == Step::Climb && at == waypoint && change == self.durable.progress.changes
            }
            State::ChangingFormation {
                change: current,
                step: last,
            } => {
                let next = self.next_step(change, last);
                current == change
                    && next == Some((step, wave))
                    && self.durable.orders.pending.is_none()
            }
            _ => false,
        };
        let is_at_waypoint = self.destination_waypoint() == Some(waypoint)
            && !matches!(self.durable.state, State::MovingToWaypoint { .. });
        is_next || is_at_waypoint && self.flies_in_own_layer()
    }

    /// In its own layer: flies to the waypoint of the change, and then requests the newest order.
    fn catch_up(&mut self, waypoint: u16) {
        self.skip_missed_changes(waypoint);
        self.durable.progress.opened = self.durable.progress.opened.max(Some(waypoint));
        self.durable.lockstep.catches_up = true;
    }

    /// In its own layer above its slot: proceeds to waypoint 0 without waiting for routes. The routing finds them later.
    fn skip_routes_in_layer(&mut self) {
        let finds_routes = matches!(
            self.durable.state,
            State::TakingOff | State::NeighbourDiscovery | State::HopUpdate
        );
        if finds_routes && !self.is_taking_off() && self.flies_in_own_layer() {
            self.enter(State::WaypointReached { waypoint: 0 });
        }
    }

    /// Completes a step of a change and acknowledges it.
    pub(super) fn complete_step(&mut self, now: Timestamp, change: u16, step: Step) {
        // A master waits no longer than the members' steps may take.
        let is_master = self.durable.lead.is_some();
        self.durable.deadlines.limit = is_master.then(|| now + self.config.leg_limit);
        if step.next().is_none() {
            self.durable.progress.changes = change + 1;
            let waypoint = self.waypoint_of(change);
            self.enter(State::WaypointReached { waypoint });
        }
        self.complete_order();
        if let Some(reason) = self.landing_after_leg() {
            // Without a master it can't take the remaining steps.
            self.announce_and_descend(reason);
        }
    }
}
