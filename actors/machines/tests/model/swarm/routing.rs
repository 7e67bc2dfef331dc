use bytes::Bytes;
use muster_machines::identity::{Ballot, NodeId, NodeSet};
use muster_machines::leader::{BallotDecision, LinkSymmetry};
use muster_machines::routing::{Input, LeaderEpoch, Notice};

/// What both policies of the routing have in common, around the shipped [`LeaderEpoch`].
#[derive(Debug, Clone, PartialEq, Eq, Hash, Default)]
pub(crate) struct Routing {
    pub(crate) epoch: LeaderEpoch,
    /// As master: whose acknowledgements of which order the mission has been told of.
    told: (u32, NodeSet),
    /// Whether the mission has been told that the master is silent.
    pub(crate) master_silent: bool,
}

/// What a drone says, of that which matters here.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(crate) struct Frame {
    pub(crate) sender: NodeId,
    pub(crate) ballot: Ballot,
    pub(crate) sequence: u32,
    pub(crate) order: Option<Bytes>,
    /// Whether the sender has carried that order out.
    pub(crate) is_carried_out: bool,
}

/// What a drone did that no drone may do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum Broken {
    /// It ordered something in the name of another.
    OrderedForAnother,
    /// It said that it had carried out what another had ordered.
    AcknowledgedForAnother,
    /// It obeys an older ballot than before.
    BallotFell,
}

impl Routing {
    /// As it starts from a checkpoint, or under another ballot than before.
    pub(crate) fn under(epoch: LeaderEpoch) -> Self {
        Self {
            epoch,
            ..Self::default()
        }
    }

    /// Hears a frame; what the mission is told of it.
    pub(crate) fn hear(
        &mut self,
        own: NodeId,
        frame: &Frame,
        symmetry: LinkSymmetry,
        has_route: bool,
    ) -> Vec<Notice> {
        let mut notices = Vec::new();
        match self.hear_ballot(frame.ballot, symmetry) {
            BallotDecision::Ignored => return notices,
            BallotDecision::Same => {}
            BallotDecision::Turned => notices.push(Notice::Leader(frame.ballot)),
        }
        if self.master_silent && has_route {
            self.master_silent = false;
            notices.push(Notice::MasterReturned);
        }
        if let Some(order) = frame.order.clone()
            && self.epoch.hear_order(own, frame.sequence, order)
        {
            notices.extend(self.epoch.newest_order());
        }
        notices.extend(self.report(own, frame));
        notices
    }

    fn hear_ballot(&mut self, ballot: Ballot, symmetry: LinkSymmetry) -> BallotDecision {
        let verdict = self.epoch.hear(ballot, symmetry);
        if verdict == BallotDecision::Turned {
            *self = Self::under(self.epoch.clone());
        }
        verdict
    }

    /// As master: tells the mission of an acknowledgement that it has not been told of.
    fn report(&mut self, own: NodeId, frame: &Frame) -> Option<Notice> {
        let sequence = self.epoch.sequence();
        if self.told.0 != sequence {
            self.told = (sequence, NodeSet::default());
        }
        let is_news = self.epoch.is_led_by(own)
            && frame.is_carried_out
            && frame.sequence == sequence
            && !self.told.1.contains(frame.sender);
        is_news.then(|| {
            self.told.1.insert(frame.sender);
            Notice::Progress {
                sequence,
                acknowledged: frame.sender.into(),
                landing: NodeSet::default(),
            }
        })
    }

    /// Takes what the mission says; what the mission is told in answer.
    pub(crate) fn take(&mut self, own: NodeId, input: Input) -> Result<Vec<Notice>, Broken> {
        let under = self.epoch.ballot();
        match input {
            Input::Lead(ballot) => _ = self.hear_ballot(ballot, LinkSymmetry::Mutual),
            Input::Publish {
                ballot,
                sequence,
                order,
            } => {
                let is_taken = self.epoch.publish(own, ballot, sequence, order);
                if is_taken && (under != Some(ballot) || ballot.master != own) {
                    return Err(Broken::OrderedForAnother);
                }
            }
            Input::Acknowledge { ballot, sequence } => {
                let is_taken = self.epoch.acknowledge(ballot, sequence);
                if is_taken && under != Some(ballot) {
                    return Err(Broken::AcknowledgedForAnother);
                }
            }
            Input::Resync => return Ok(self.tell_again()),
            // Ways and places are left out, and nobody comes down.
            _ => {}
        }
        Ok(Vec::new())
    }

    fn tell_again(&mut self) -> Vec<Notice> {
        self.told = (0, NodeSet::default());
        let silent = self.master_silent.then_some(Notice::MasterSilent);
        self.epoch.notices().chain(silent).collect()
    }

    /// As [`Self::take`], as if whatever the mission says were said under the ballot that is obeyed here.
    pub(crate) fn believe(&mut self, input: Input) -> Result<Vec<Notice>, Broken> {
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
                let nobody = NodeId(u32::MAX);
                let is_taken = self.epoch.hear_order(nobody, sequence, order);
                if is_taken && under != Some(ballot) {
                    return Err(Broken::OrderedForAnother);
                }
            }
            Input::Acknowledge { ballot, sequence } => {
                let is_taken = self.epoch.acknowledge(under.unwrap_or(ballot), sequence);
                if is_taken && under != Some(ballot) {
                    return Err(Broken::AcknowledgedForAnother);
                }
            }
            Input::Resync => return Ok(self.tell_again()),
            _ => {}
        }
        Ok(Vec::new())
    }
}
