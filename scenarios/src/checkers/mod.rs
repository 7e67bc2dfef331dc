//! The rules that must always hold: one file for each, fed with what happens.
//!
//! Rules have the numbers of the design's list of invariants.

mod admission;
mod arming;
mod barrier;
mod bounds;
mod election;
mod failure;
mod landing;
mod obedience;
mod progress;
mod rc;
mod separation;
mod settled;

use std::time::Duration;

use muster_machines::identity::{Ballot, NodeId};
use muster_machines::mission::Event;
use muster_machines::msp::FlightCommand;
use muster_machines::node::{Address, Checkpoints, Effect, Envelope, StepOutput};
use muster_machines::time::Timestamp;

use self::admission::AdmissionChecker;
pub(crate) use self::arming::ArmSwitch;
use self::arming::ArmingChecker;
pub(crate) use self::barrier::BarrierChecker;
use self::bounds::BoundsChecker;
use self::election::ElectionChecker;
use self::failure::FailureChecker;
pub(crate) use self::landing::Wrecks;
use self::obedience::ObedienceChecker;
use self::progress::ProgressChecker;
pub use self::rc::RC_GAP_MAX;
pub(crate) use self::rc::RcGaps;
pub(crate) use self::separation::SeparationChecker;
pub(crate) use self::settled::{MemberState, SettledChecker};

/// A violation of a rule.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Violation {
    pub(crate) rule: u8,
    pub(crate) at: Timestamp,
    pub(crate) drones: Vec<NodeId>,
    pub(crate) what: String,
}

/// The rules about drones, and the first violation of any rule. Rules about a whole swarm (1c, 3) or its vehicles (4) are
/// checked where their state is, and reported here.
///
/// Invariant: only the first violation is kept; none is where rules are not checked, except rule 10's, which ends a run that
/// would not end.
#[derive(Debug)]
pub(crate) struct Checkers {
    is_on: bool,
    violation: Option<Violation>,
    pub(crate) election: ElectionChecker,
    admission: AdmissionChecker,
    obedience: ObedienceChecker,
    arming: ArmingChecker,
    failure: FailureChecker,
    bounds: BoundsChecker,
    progress: ProgressChecker,
}

impl Checkers {
    /// For this many drones and relays, each of whose actors may have `waiting_max` messages queued.
    pub(crate) fn new(nodes: u32, waiting_max: usize, is_on: bool) -> Self {
        Self {
            is_on,
            violation: None,
            election: ElectionChecker::new(nodes as usize),
            admission: AdmissionChecker::default(),
            obedience: ObedienceChecker::default(),
            arming: ArmingChecker::new(nodes as usize),
            failure: FailureChecker::default(),
            bounds: BoundsChecker::new(waiting_max),
            progress: ProgressChecker::new(nodes, waiting_max),
        }
    }

    /// Whether rules are checked.
    pub(crate) const fn are_on(&self) -> bool {
        self.is_on
    }

    /// Whether the run is to end because of a violation.
    pub(crate) const fn has_found(&self) -> bool {
        self.violation.is_some()
    }

    /// Keeps a violation, unless there is one or rules are not checked.
    #[inline]
    pub(crate) fn report(&mut self, found: Option<Violation>) {
        if let Some(violation) = found
            && self.is_on
        {
            self.violation.get_or_insert(violation);
        }
    }

    /// The first violation.
    pub(crate) fn finish(self) -> Option<Violation> {
        self.violation
    }

    /// An engine is about to ask for the next task.
    pub(crate) const fn before_task(&mut self) {
        self.obedience.before_task();
    }

    /// An event yields a task: if it is to crash this actor, its failure is planned.
    pub(crate) const fn plan_failure(&mut self, crashes: Option<(NodeId, Address)>) {
        self.failure.plan(crashes);
    }

    /// An actor failed.
    pub(crate) fn failed(&mut self, now: Timestamp, drone: NodeId, address: Address) {
        let found = self.failure.failed(now, drone, address);
        self.report(found);
    }

    /// An actor is about to be built.
    pub(crate) fn starting(&mut self, drone: NodeId, address: Address) {
        self.arming.starting(drone, address);
    }

    /// A drone's process starts again.
    pub(crate) fn boots(&mut self, drone: NodeId) {
        self.arming.boots(drone);
    }

    /// An actor is about to receive a message, which a radio may admit or not. `number` gives the world's number of a
    /// member that the message names.
    pub(crate) fn delivers(
        &mut self,
        drone: NodeId,
        envelope: &Envelope,
        is_genuine: bool,
        number: impl Fn(NodeId) -> NodeId,
    ) {
        self.admission.receives(is_genuine);
        self.arming.receives(drone, envelope);
        let leader = self.election.leader(drone);
        self.obedience.receives(drone, envelope, leader, number);
    }

    /// In a mirror: a drone's process receives a message by other means.
    pub(crate) fn delivers_elsewhere(&mut self, drone: NodeId, envelope: &Envelope) {
        self.arming.receives(drone, envelope);
    }

    /// In a mirror: a drone waits to take off under the ballot of a master that the operator chose.
    pub(crate) fn waits_for_take_off(&mut self, drone: NodeId, ballot: Ballot) {
        self.arming.waits_for_take_off(drone, ballot);
    }

    /// This many messages are queued for an actor.
    pub(crate) fn queued(&mut self, now: Timestamp, drone: NodeId, waiting: usize) {
        let found = self.bounds.queue(now, drone, waiting);
        self.report(found);
    }

    /// A radio admits the frame that it has just received.
    pub(crate) fn admits(&mut self, now: Timestamp, drone: NodeId) {
        if self.is_on {
            let found = self.admission.admits(now, drone);
            self.report(found);
        }
    }

    /// A step yields effects that have yet to be carried out, beside checkpoints that were kept before.
    #[inline]
    pub(crate) fn yields(
        &mut self,
        now: Timestamp,
        drone: NodeId,
        from: Address,
        effects: &[Effect],
        kept: &Checkpoints,
    ) {
        if self.is_on {
            let found = self.obedience.yields(now, drone, from, effects, kept);
            self.report(found);
        }
    }

    /// A step has been carried out.
    #[inline]
    pub(crate) fn stepped(
        &mut self,
        now: Timestamp,
        drone: NodeId,
        from: Address,
        output: &StepOutput,
    ) {
        if self.is_on {
            let found = self.bounds.table(now, drone, from, output.occupancy);
            self.report(found);
            let found = ProgressChecker::stepped(now, drone, from, output.is_overdue);
            self.report(found);
        }
    }

    /// A drone has taken its `nth` step at this instant. Returns whether the run is to end, rules checked or not.
    #[inline]
    pub(crate) fn counts_step(
        &mut self,
        now: Timestamp,
        drone: NodeId,
        from: Address,
        nth: u64,
    ) -> bool {
        let found = self.progress.steps(now, drone, from, nth);
        let ends = found.is_some();
        if let Some(violation) = found {
            self.violation.get_or_insert(violation);
        }
        ends
    }

    /// A run has used up its wall-clock time and is to end, rules checked or not.
    pub(crate) fn overran(&mut self, now: Timestamp, run_limit: Duration) {
        self.violation
            .get_or_insert(ProgressChecker::overran(now, run_limit));
    }

    /// A drone's mission reports an event.
    pub(crate) fn observe(&mut self, now: Timestamp, drone: NodeId, event: &Event) {
        let found = self.election.observe(now, drone, event);
        self.report(found);
        let leader = self.election.leader(drone);
        let found = self.arming.observe(now, drone, event, leader);
        self.report(found);
    }

    /// A drone commands its vehicle.
    pub(crate) fn command(&mut self, now: Timestamp, drone: NodeId, command: FlightCommand) {
        let found = self.arming.commands(now, drone, command);
        self.report(found);
    }

    /// The run ends while these vehicles are armed.
    pub(crate) fn landed(&mut self, now: Timestamp, armed: impl Iterator<Item = NodeId>) {
        if self.violation.is_none() && self.is_on {
            self.violation = landing::check(now, armed.collect());
        }
    }

    /// In a mirror: a process ended without a fault.
    pub(crate) fn process_ended(&mut self, now: Timestamp, drone: NodeId) {
        self.report(Some(failure::unplanned_end(now, drone)));
    }
}
