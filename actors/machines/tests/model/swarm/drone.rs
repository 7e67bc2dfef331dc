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
use super::routing::{Broken, Frame, Routing};

/// One drone: its mission, which is the one that flies, and of its routing that which decides whom it obeys.
#[derive(Debug, Clone)]
pub(crate) struct Drone {
    pub(crate) id: NodeId,
    /// Whether its process runs.
    pub(crate) is_up: bool,
    /// Unless the actor is down.
    pub(crate) routing: Option<Routing>,
    /// Unless the actor is down.
    pub(crate) mission: Option<Arc<Mission>>,
    /// What waits for either, in order for each.
    pub(crate) post: Vec<Post>,
    pub(crate) journal: Journal,
    /// Every frame that it ever sent; any of them may be heard at any time, again and again, or never.
    pub(crate) said: Arc<Vec<Frame>>,
    /// Whether it obeyed a ballot, restarted, and obeyed an older one; or gave an order in the name of another.
    pub(crate) broke: Option<Broken>,
}

/// A message from one machine to the other.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(crate) enum Post {
    ToRouting(routing::Input),
    ToMission(Notice),
}

impl Post {
    const fn address(&self) -> Address {
        match self {
            Self::ToRouting(_) => Address::Routing,
            Self::ToMission(_) => Address::Mission,
        }
    }
}

impl Drone {
    /// On the ground, told nothing yet.
    pub(crate) fn new(config: &Config) -> Self {
        Self {
            id: config.id,
            is_up: true,
            routing: Some(Routing::default()),
            mission: Some(Arc::new(Mission::new(config.clone(), None))),
            post: Vec::new(),
            journal: Journal::default(),
            said: Arc::default(),
            broke: None,
        }
    }

    /// Whom its routing obeys.
    pub(crate) fn ballot(&self) -> Option<Ballot> {
        self.routing.as_ref()?.epoch.ballot()
    }

    /// Whether its mission leads.
    pub(crate) fn leads(&self) -> bool {
        self.mission.is_some() && self.journal.mission.newest().0.lead.is_some()
    }

    /// Whom its mission obeys.
    pub(crate) fn mission_ballot(&self) -> Option<Ballot> {
        self.mission.as_ref()?;
        self.journal.mission.newest().0.leader.ballot()
    }

    /// What it would say now.
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

    /// Sends a frame, once all that was written before is on the disk.
    pub(crate) fn say(&mut self, frame: Frame, flaw: Flaw) {
        if flaw != Flaw::SpeaksUnsynced {
            self.journal.sync();
        }
        Arc::make_mut(&mut self.said).push(frame);
    }

    /// Hears a frame; `has_way` is whether the drone has a way to its master.
    pub(crate) fn hear(
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
        let notices = routing.hear(own, frame, symmetry, has_route);
        self.keep_epoch();
        self.inform(notices);
    }

    fn keep_epoch(&mut self) {
        if let Some(routing) = &self.routing {
            self.journal.epoch.write(routing.epoch.clone());
        }
    }

    /// The routing misses the master.
    pub(crate) fn miss_master(&mut self) {
        if let Some(routing) = &mut self.routing {
            routing.master_silent = true;
            self.inform([Notice::MasterSilent]);
        }
    }

    fn inform(&mut self, notices: impl IntoIterator<Item = Notice>) {
        self.send(notices.into_iter().map(Post::ToMission));
    }

    /// What is sent to an actor that is down is lost.
    fn send(&mut self, posts: impl IntoIterator<Item = Post>) {
        let (routing, mission) = (self.routing.is_some(), self.mission.is_some());
        self.post
            .extend(posts.into_iter().filter(|post| match post {
                Post::ToRouting(_) => routing,
                Post::ToMission(_) => mission,
            }));
    }

    /// Whether something waits for an actor.
    pub(crate) fn has_post_for(&self, address: Address) -> bool {
        self.post.iter().any(|post| post.address() == address)
    }

    /// An actor takes the next message that waits for it.
    pub(crate) fn handle_next(&mut self, address: Address, flaw: Flaw) {
        let next = self.post.iter().position(|post| post.address() == address);
        if let Some(next) = next {
            match self.post.remove(next) {
                Post::ToRouting(input) => self.route(input, flaw),
                Post::ToMission(notice) => self.stimulate(mission::Input::Routing(notice)),
            }
        }
        // Order matters to each actor only.
        self.post.sort_by_key(Post::address);
    }

    /// Both actors take all that waits for them, in the order in which it was sent.
    pub(crate) fn handle_all(&mut self, flaw: Flaw) {
        while !self.post.is_empty() {
            match self.post.remove(0) {
                Post::ToRouting(input) => self.route(input, flaw),
                Post::ToMission(notice) => self.stimulate(mission::Input::Routing(notice)),
            }
        }
    }

    fn route(&mut self, input: routing::Input, flaw: Flaw) {
        let own = self.id;
        let Some(routing) = &mut self.routing else {
            return;
        };
        let taken = if flaw == Flaw::BelievesItsMission {
            routing.believe(input)
        } else {
            routing.take(own, input)
        };
        match taken {
            Ok(notices) => self.inform(notices),
            Err(broken) => self.broke = Some(broken),
        }
        self.keep_epoch();
    }

    /// Steps the mission.
    pub(crate) fn stimulate(&mut self, input: mission::Input) {
        self.step_mission(Stimulus::Input(input));
    }

    fn step_mission(&mut self, stimulus: Stimulus<mission::Input>) {
        let Some(mission) = &mut self.mission else {
            return;
        };
        let (mut posts, mut checkpoint) = (Vec::new(), None);
        let mission = Arc::make_mut(mission);
        let Ok(_) = step(mission, Timestamp::ZERO, stimulus, |said| match said {
            Emitted::Transmit(transmit) => posts.extend(to_routing(transmit)),
            Emitted::Event(mission::Event::Checkpoint(it)) => checkpoint = Some(*it),
            Emitted::Event(_) => {}
        });
        if let Some(checkpoint) = checkpoint {
            self.journal.mission.write(Kept::new(checkpoint));
        }
        self.send(posts);
    }

    /// An actor panics: it and all that waits for it are gone.
    pub(crate) fn fail(&mut self, address: Address) {
        match address {
            Address::Routing => self.routing = None,
            _ => self.mission = None,
        }
        self.post.retain(|post| post.address() != address);
    }

    /// An actor is started again from its newest checkpoint.
    pub(crate) fn revive(&mut self, address: Address, config: &Config) {
        match address {
            Address::Routing => {
                self.routing = Some(Routing::under(self.journal.epoch.newest().clone()));
                self.inform([Notice::Resync]);
            }
            _ => {
                let checkpoint = (*self.journal.mission.newest().0).clone();
                let mission = Mission::new(config.clone(), Some(checkpoint));
                self.mission = Some(Arc::new(mission));
                self.step_mission(Stimulus::Timeout);
            }
        }
    }

    /// The process dies; of each machine's checkpoints that were not synced the first so many are found again.
    pub(crate) fn crash(&mut self, epochs: usize, missions: usize) {
        self.is_up = false;
        self.routing = None;
        self.mission = None;
        self.post.clear();
        self.journal.epoch.lose_all_but(epochs);
        self.journal.mission.lose_all_but(missions);
    }

    /// The process starts again from its journal.
    pub(crate) fn restart(&mut self, config: &Config) {
        self.is_up = true;
        let mut checkpoint = (*self.journal.mission.newest().0).clone();
        checkpoint.restarted = true;
        self.journal.mission.write(Kept::new(checkpoint));
        self.journal.sync();
        // The one that starts second is there when the first is answered.
        self.mission = Some(Arc::new(Mission::new(config.clone(), None)));
        self.revive(Address::Routing, config);
        self.revive(Address::Mission, config);
    }

    /// Notes if it obeys an older ballot than `before`, or than it ever spoke under.
    pub(crate) fn compare(&mut self, before: &Self) {
        let fell = |now: Option<Ballot>, was: Ballot| now.is_some_and(|now| was.beats(&now));
        let mut ever_said = self.said.iter().map(|frame| frame.ballot);
        let mut has_fallen = ever_said.any(|was| fell(self.ballot(), was));
        if before.is_up && self.is_up {
            let Journal { epoch, mission } = &before.journal;
            let was = (epoch.newest().ballot(), mission.newest().0.leader.ballot());
            has_fallen |= was.0.is_some_and(|was| fell(self.ballot(), was))
                || was.1.is_some_and(|was| fell(self.mission_ballot(), was));
        }
        if has_fallen {
            self.broke = Some(Broken::BallotFell);
        }
    }
}

/// What of a mission's words is for that part of the routing which is in the model.
fn to_routing(transmit: mission::Transmit) -> Option<Post> {
    use routing::Input;
    let Effect::Post(Envelope::Routing(input)) = transmit.into() else {
        return None;
    };
    matches!(
        input,
        Input::Lead(_) | Input::Publish { .. } | Input::Acknowledge { .. } | Input::Resync
    )
    .then_some(Post::ToRouting(input))
}

impl PartialEq for Drone {
    fn eq(&self, other: &Self) -> bool {
        self.told_apart() == other.told_apart()
    }
}

impl Hash for Drone {
    fn hash<H: Hasher>(&self, hasher: &mut H) {
        self.told_apart().hash(hasher);
    }
}

impl Drone {
    /// All that tells two drones apart: of a mission that runs, its checkpoint, which is in the journal, and this.
    #[expect(
        clippy::type_complexity,
        reason = "it is compared and hashed, nothing else"
    )]
    fn told_apart(
        &self,
    ) -> (
        bool,
        &Option<Routing>,
        Option<bool>,
        &[Post],
        &Journal,
        &[Frame],
        Option<Broken>,
    ) {
        let mission = self.mission.as_ref().map(|it| it.misses_master());
        let Self {
            id: _,
            is_up,
            routing,
            mission: _,
            post,
            journal,
            said,
            broke,
        } = self;
        (*is_up, routing, mission, post, journal, said, *broke)
    }
}
