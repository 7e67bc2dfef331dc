use std::hash::{Hash, Hasher};
use std::sync::Arc;

use muster_machines::identity::{Ballot, NodeId};
use muster_machines::leader::LinkSymmetry;
use muster_machines::machine::{Emitted, Stimulus, step};
use muster_machines::mission::{self, Config, Mission};
use muster_machines::node::{Address, Effect, Envelope};
use muster_machines::routing::{self, Notice};
use muster_machines::time::Timestamp;

use super::Flaw;
use super::journal::{Journal, Mission as Kept};
use super::routing::{Frame, Routing, Violation};

/// One drone: the shipped mission, and the part of the routing that determines the leader.
#[derive(Debug, Clone)]
pub(crate) struct Drone {
    pub(crate) id: NodeId,
    /// Whether its process runs.
    pub(crate) is_up: bool,
    /// Unless the actor is down.
    pub(crate) routing: Option<Routing>,
    /// Unless the actor is down.
    pub(crate) mission: Option<Arc<Mission>>,
    /// Messages waiting for either machine, in order for each.
    pub(crate) mailbox: Vec<Message>,
    pub(crate) journal: Journal,
    /// Every frame that it ever sent; each may be received at any time, repeatedly, or never.
    pub(crate) sent: Arc<Vec<Frame>>,
    /// The rule of a single drone that it violated, if any.
    pub(crate) violation: Option<Violation>,
}

/// A message from one machine to the other.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(crate) enum Message {
    ToRouting(routing::Input),
    ToMission(Notice),
}

impl Message {
    const fn address(&self) -> Address {
        match self {
            Self::ToRouting(_) => Address::Routing,
            Self::ToMission(_) => Address::Mission,
        }
    }
}

impl Drone {
    /// On the ground, before any input.
    pub(crate) fn new(config: &Config) -> Self {
        Self {
            id: config.id,
            is_up: true,
            routing: Some(Routing::default()),
            mission: Some(Arc::new(Mission::new(config.clone(), None))),
            mailbox: Vec::new(),
            journal: Journal::default(),
            sent: Arc::default(),
            violation: None,
        }
    }

    /// Ballot of the leader in its routing.
    pub(crate) fn ballot(&self) -> Option<Ballot> {
        self.routing.as_ref()?.epoch.ballot()
    }

    /// Whether its mission leads.
    pub(crate) fn leads(&self) -> bool {
        self.mission.is_some() && self.journal.mission.newest().0.lead.is_some()
    }

    /// Ballot of the leader in its mission.
    pub(crate) fn mission_ballot(&self) -> Option<Ballot> {
        self.mission.as_ref()?;
        self.journal.mission.newest().0.leader.ballot()
    }

    /// The frame that it would send now.
    pub(crate) fn frame(&self) -> Option<Frame> {
        let epoch = &self.routing.as_ref()?.epoch;
        Some(Frame {
            sender: self.id,
            ballot: epoch.ballot()?,
            sequence: epoch.sequence(),
            order: epoch.order().cloned(),
            is_carried_out: epoch.is_carried_out(),
        })
    }

    /// Sends a frame after syncing the journal.
    pub(crate) fn send_frame(&mut self, frame: Frame, flaw: Flaw) {
        if flaw != Flaw::SendsUnsynced {
            self.journal.sync();
        }
        Arc::make_mut(&mut self.sent).push(frame);
    }

    /// Receives a frame; `has_route` is whether the drone has a route to its master.
    pub(crate) fn receive(
        &mut self,
        frame: &Frame,
        symmetry: LinkSymmetry,
        has_route: bool,
        flaw: Flaw,
    ) {
        let own = self.id;
        let Some(routing) = &mut self.routing else {
            return;
        };
        let is_better = |own: Ballot| frame.ballot.beats(&own);
        if flaw == Flaw::IgnoresBetterBallots && routing.epoch.ballot().is_some_and(is_better) {
            return;
        }
        let notices = routing.receive(own, frame, symmetry, has_route);
        self.write_epoch();
        self.notify(notices);
    }

    fn write_epoch(&mut self) {
        if let Some(routing) = &self.routing {
            self.journal.epoch.write(routing.epoch.clone());
        }
    }

    /// The routing detects a silent master.
    pub(crate) fn miss_master(&mut self) {
        if let Some(routing) = &mut self.routing {
            routing.master_silent = true;
            self.notify([Notice::MasterSilent]);
        }
    }

    fn notify(&mut self, notices: impl IntoIterator<Item = Notice>) {
        self.send(notices.into_iter().map(Message::ToMission));
    }

    /// Messages to an actor that is down are lost.
    fn send(&mut self, messages: impl IntoIterator<Item = Message>) {
        let (routing, mission) = (self.routing.is_some(), self.mission.is_some());
        self.mailbox
            .extend(messages.into_iter().filter(|message| match message {
                Message::ToRouting(_) => routing,
                Message::ToMission(_) => mission,
            }));
    }

    /// Whether a message waits for an actor.
    pub(crate) fn has_message_for(&self, address: Address) -> bool {
        self.mailbox
            .iter()
            .any(|message| message.address() == address)
    }

    /// An actor handles its next message.
    pub(crate) fn handle_next(&mut self, address: Address, flaw: Flaw) {
        let next = self
            .mailbox
            .iter()
            .position(|message| message.address() == address);
        if let Some(next) = next {
            match self.mailbox.remove(next) {
                Message::ToRouting(input) => self.route(input, flaw),
                Message::ToMission(notice) => self.handle(mission::Input::Routing(notice)),
            }
        }
        // Only the order per actor matters.
        self.mailbox.sort_by_key(Message::address);
    }

    /// Both actors handle all waiting messages, in the order sent.
    pub(crate) fn handle_all(&mut self, flaw: Flaw) {
        while !self.mailbox.is_empty() {
            match self.mailbox.remove(0) {
                Message::ToRouting(input) => self.route(input, flaw),
                Message::ToMission(notice) => self.handle(mission::Input::Routing(notice)),
            }
        }
    }

    fn route(&mut self, input: routing::Input, flaw: Flaw) {
        let own = self.id;
        let Some(routing) = &mut self.routing else {
            return;
        };
        let taken = if flaw == Flaw::SkipsBallotCheck {
            routing.handle_unchecked(input)
        } else {
            routing.handle(own, input)
        };
        match taken {
            Ok(notices) => self.notify(notices),
            Err(broken) => self.violation = Some(broken),
        }
        self.write_epoch();
    }

    /// Steps the mission.
    pub(crate) fn handle(&mut self, input: mission::Input) {
        self.step_mission(Stimulus::Input(input));
    }

    fn step_mission(&mut self, stimulus: Stimulus<mission::Input>) {
        let Some(mission) = &mut self.mission else {
            return;
        };
        let (mut messages, mut checkpoint) = (Vec::new(), None);
        let mission = Arc::make_mut(mission);
        step(mission, Timestamp::ZERO, stimulus, |output| match output {
            Emitted::Transmit(transmit) => messages.extend(to_routing(transmit)),
            Emitted::Event(mission::Event::Checkpoint(it)) => checkpoint = Some(*it),
            Emitted::Event(_) => {}
        });
        if let Some(checkpoint) = checkpoint {
            self.journal.mission.write(Kept::new(checkpoint));
        }
        self.send(messages);
    }

    /// An actor panics: it and its waiting messages are lost.
    pub(crate) fn fail(&mut self, address: Address) {
        match address {
            Address::Routing => self.routing = None,
            _ => self.mission = None,
        }
        self.mailbox.retain(|message| message.address() != address);
    }

    /// An actor is restarted from its newest checkpoint.
    pub(crate) fn restart_actor(&mut self, address: Address, config: &Config) {
        match address {
            Address::Routing => {
                self.routing = Some(Routing::under(self.journal.epoch.newest().clone()));
                self.notify([Notice::Resync]);
            }
            _ => {
                let checkpoint = (*self.journal.mission.newest().0).clone();
                let mission = Mission::new(config.clone(), Some(checkpoint));
                self.mission = Some(Arc::new(mission));
                self.step_mission(Stimulus::Timeout);
            }
        }
    }

    /// The process crashes; these numbers of unsynced checkpoints remain.
    pub(crate) fn crash(&mut self, epochs: usize, missions: usize) {
        self.is_up = false;
        self.routing = None;
        self.mission = None;
        self.mailbox.clear();
        self.journal.epoch.crash(epochs);
        self.journal.mission.crash(missions);
    }

    /// The process restarts from its journal.
    pub(crate) fn restart(&mut self, config: &Config) {
        self.is_up = true;
        let mut checkpoint = (*self.journal.mission.newest().0).clone();
        checkpoint.restarted = true;
        self.journal.mission.write(Kept::new(checkpoint));
        self.journal.sync();
        // The second actor must run when the first one gets its answer.
        self.mission = Some(Arc::new(Mission::new(config.clone(), None)));
        self.restart_actor(Address::Routing, config);
        self.restart_actor(Address::Mission, config);
    }

    /// Records a violation if its leader's ballot is older than in `before` or in any frame it ever sent.
    pub(crate) fn compare(&mut self, before: &Self) {
        let is_older = |now: Option<Ballot>, was: Ballot| now.is_some_and(|now| was.beats(&now));
        let mut ballots_sent = self.sent.iter().map(|frame| frame.ballot);
        let mut ballot_fell = ballots_sent.any(|was| is_older(self.ballot(), was));
        if before.is_up && self.is_up {
            let Journal { epoch, mission } = &before.journal;
            let was = (epoch.newest().ballot(), mission.newest().0.leader.ballot());
            ballot_fell |= was.0.is_some_and(|was| is_older(self.ballot(), was))
                || was
                    .1
                    .is_some_and(|was| is_older(self.mission_ballot(), was));
        }
        if ballot_fell {
            self.violation = Some(Violation::BallotFell);
        }
    }
}

/// Message to the modelled part of the routing, if any.
fn to_routing(transmit: mission::Transmit) -> Option<Message> {
    use routing::Input;
    let Effect::Post(Envelope::Routing(input)) = transmit.into() else {
        return None;
    };
    matches!(
        input,
        Input::Lead(_) | Input::Publish { .. } | Input::Acknowledge { .. } | Input::Resync
    )
    .then_some(Message::ToRouting(input))
}

impl PartialEq for Drone {
    fn eq(&self, other: &Self) -> bool {
        self.identity() == other.identity()
    }
}

impl Hash for Drone {
    fn hash<H: Hasher>(&self, hasher: &mut H) {
        self.identity().hash(hasher);
    }
}

impl Drone {
    /// Everything that distinguishes two drones. A running mission is represented by its checkpoint in the journal and
    /// this flag.
    #[expect(clippy::type_complexity, reason = "only compared and hashed")]
    fn identity(
        &self,
    ) -> (
        bool,
        &Option<Routing>,
        Option<bool>,
        &[Message],
        &Journal,
        &[Frame],
        Option<Violation>,
    ) {
        let mission = self.mission.as_ref().map(|it| it.is_master_silent());
        let Self {
            id: _,
            is_up,
            routing,
            mission: _,
            mailbox,
            journal,
            sent,
            violation,
        } = self;
        (*is_up, routing, mission, mailbox, journal, sent, *violation)
    }
}
