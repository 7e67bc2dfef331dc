use bytes::Bytes;
use muster_machines::identity::{Ballot, NodeId, NodeSet};
use muster_machines::leader::{BallotDecision, LinkSymmetry};
use muster_machines::routing::{Input, LeaderEpoch, Notice};

/// The common part of both routing policies, around the shipped [`LeaderEpoch`].
#[derive(Debug, Clone, PartialEq, Eq, Hash, Default)]
pub(crate) struct Routing {
    pub(crate) epoch: LeaderEpoch,
    /// As master: sequence of an order and the acknowledgements of it that the mission was notified of.
    reported: (u32, NodeSet),
    /// Whether the mission was notified that the master is silent.
    pub(crate) master_silent: bool,
}

/// The modelled content of a frame.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(crate) struct Frame {
    pub(crate) sender: NodeId,
    pub(crate) ballot: Ballot,
    pub(crate) sequence: u32,
    pub(crate) order: Option<Bytes>,
    /// Whether the sender has carried out that order.
    pub(crate) is_carried_out: bool,
}

/// Violation of a rule by one drone.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum Violation {
    /// It gave an order in the name of another.
    OrderedForAnother,
    /// It acknowledged an order under another leader than the one that gave it.
    AcknowledgedForAnother,
    /// Its leader has an older ballot than before.
    BallotFell,
}

impl Routing {
    /// Starts from a checkpoint, or under a new ballot.
    pub(crate) fn under(epoch: LeaderEpoch) -> Self {
        Self {
            epoch,
            ..Self::default()
        }
    }

    /// Receives a frame; returns the notices to the mission.
    pub(crate) fn receive(
        &mut self,
        own: NodeId,
        frame: &Frame,
        symmetry: LinkSymmetry,
        has_route: bool,
    ) -> Vec<Notice> {
        let mut notices = Vec::new();
        match self.observe_ballot(frame.ballot, symmetry) {
            BallotDecision::Ignored => return notices,
            BallotDecision::Same => {}
            BallotDecision::Adopted => notices.push(Notice::Leader(frame.ballot)),
        }
        if self.master_silent && has_route {
            self.master_silent = false;
            notices.push(Notice::MasterReturned);
        }
        if let Some(order) = frame.order.clone()
            && self.epoch.receive_order(own, frame.sequence, order)
        {
            notices.extend(self.epoch.newest_order());
        }
        notices.extend(self.report(own, frame));
        notices
    }

    fn observe_ballot(&mut self, ballot: Ballot, symmetry: LinkSymmetry) -> BallotDecision {
        let decision = self.epoch.observe(ballot, symmetry);
        if decision == BallotDecision::Adopted {
            *self = Self::under(self.epoch.clone());
        }
        decision
    }

    /// As master: a notice of an acknowledgement that is new to the mission.
    fn report(&mut self, own: NodeId, frame: &Frame) -> Option<Notice> {
        let sequence = self.epoch.sequence();
        if self.reported.0 != sequence {
            self.reported = (sequence, NodeSet::default());
        }
        let is_new = self.epoch.is_led_by(own)
            && frame.is_carried_out
            && frame.sequence == sequence
            && !self.reported.1.contains(frame.sender);
        is_new.then(|| {
            self.reported.1.insert(frame.sender);
            Notice::Progress {
                sequence,
                acknowledged: frame.sender.into(),
                landing: NodeSet::default(),
            }
        })
    }

    /// Handles an input of the mission; returns the notices to it.
    pub(crate) fn handle(&mut self, own: NodeId, input: Input) -> Result<Vec<Notice>, Violation> {
        let under = self.epoch.ballot();
        match input {
            Input::Lead(ballot) => _ = self.observe_ballot(ballot, LinkSymmetry::Symmetric),
            Input::Publish {
                ballot,
                sequence,
                order,
            } => {
                let is_taken = self.epoch.publish(own, ballot, sequence, order);
                if is_taken && (under != Some(ballot) || ballot.master != own) {
                    return Err(Violation::OrderedForAnother);
                }
            }
            Input::Acknowledge { ballot, sequence } => {
                let is_taken = self.epoch.acknowledge(ballot, sequence);
                if is_taken && under != Some(ballot) {
                    return Err(Violation::AcknowledgedForAnother);
                }
            }
            Input::Resync => return Ok(self.repeat_notices()),
            // Routes and positions are left out, and no drone lands.
            _ => {}
        }
        Ok(Vec::new())
    }

    fn repeat_notices(&mut self) -> Vec<Notice> {
        self.reported = (0, NodeSet::default());
        let silent = self.master_silent.then_some(Notice::MasterSilent);
        self.epoch.notices().chain(silent).collect()
    }

    /// As [`Self::handle`], but takes every input as given under the current leader's ballot.
    pub(crate) fn handle_unchecked(&mut self, input: Input) -> Result<Vec<Notice>, Violation> {
        let under = self.epoch.ballot();
        match input {
            Input::Lead(ballot) if under != Some(ballot) => {
                *self = Self::under(LeaderEpoch::of(ballot));
            }
            Input::Publish {
                ballot,
                sequence,
                order,
            } => {
                let no_drone = NodeId(u32::MAX);
                let is_taken = self.epoch.receive_order(no_drone, sequence, order);
                if is_taken && under != Some(ballot) {
                    return Err(Violation::OrderedForAnother);
                }
            }
            Input::Acknowledge { ballot, sequence } => {
                let is_taken = self.epoch.acknowledge(under.unwrap_or(ballot), sequence);
                if is_taken && under != Some(ballot) {
                    return Err(Violation::AcknowledgedForAnother);
                }
            }
            Input::Resync => return Ok(self.repeat_notices()),
            _ => {}
        }
        Ok(Vec::new())
    }
}
