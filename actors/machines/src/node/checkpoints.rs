//! The newest checkpoint of each of a drone's machines.

use serde::{Deserialize, Serialize};

use crate::identity::Ballot;
use crate::{agent, indoor, mission, msp, navigation, radio, routing};

/// State from which one of the machines is rebuilt.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Checkpoint {
    /// Of the radio.
    Radio(radio::Checkpoint),
    /// Of the routing.
    Routing(Box<routing::Checkpoint>),
    /// Of the mission.
    Mission(Box<mission::Checkpoint>),
    /// Of the navigation.
    Navigation(Box<navigation::Checkpoint>),
    /// Of the flight controller's link.
    Msp(Box<msp::Checkpoint>),
    /// Of the agent in the mission's actor.
    Agent(Box<agent::Checkpoint>),
    /// Of the indoor machine in the navigation's actor.
    Indoor(Box<indoor::Checkpoint>),
}

/// The newest checkpoint of each machine of a drone, the revocation list in force, and the incarnation of its process.
#[derive(Debug, Clone)]
pub struct Checkpoints {
    pub(super) boot: u32,
    pub(super) revoked: radio::Revoked,
    pub(super) radio: radio::Checkpoint,
    pub(super) routing: Option<Box<routing::Checkpoint>>,
    pub(super) mission: Option<Box<mission::Checkpoint>>,
    pub(super) navigation: Option<Box<navigation::Checkpoint>>,
    pub(super) msp: Option<Box<msp::Checkpoint>>,
    pub(super) agent: Option<Box<agent::Checkpoint>>,
    pub(super) indoor: Option<Box<indoor::Checkpoint>>,
}

impl Default for Checkpoints {
    /// The checkpoints of a drone's first incarnation.
    fn default() -> Self {
        Self {
            boot: 1,
            revoked: radio::Revoked::default(),
            radio: radio::Checkpoint::default(),
            routing: None,
            mission: None,
            navigation: None,
            msp: None,
            agent: None,
            indoor: None,
        }
    }
}

impl Checkpoints {
    /// Replaces a machine's checkpoint. Returns whether it must be durable before any effect of the same step: the
    /// current leader, the state and used sequence numbers must never fall back.
    pub fn keep(&mut self, checkpoint: Checkpoint) -> bool {
        match checkpoint {
            Checkpoint::Radio(checkpoint) => {
                self.radio = checkpoint;
                true
            }
            Checkpoint::Routing(checkpoint) => {
                let before = self.routing.replace(checkpoint);
                before.is_none_or(|before| {
                    self.routing
                        .as_ref()
                        .is_some_and(|it| it.has_advanced_since(&before))
                })
            }
            Checkpoint::Mission(checkpoint) => {
                let before = self.mission.replace(checkpoint);
                before.is_none_or(|before| {
                    self.mission
                        .as_ref()
                        .is_some_and(|it| it.has_advanced_since(&before))
                })
            }
            Checkpoint::Navigation(checkpoint) => {
                // After a restart the mission repeats the goal.
                self.navigation = Some(checkpoint);
                false
            }
            Checkpoint::Msp(checkpoint) => {
                let before = self.msp.replace(checkpoint);
                before != self.msp
            }
            Checkpoint::Agent(checkpoint) => {
                let before = self.agent.replace(checkpoint);
                let kept = |it: &Option<Box<agent::Checkpoint>>| {
                    it.as_ref().and_then(|it| it.kept.clone())
                };
                kept(&before) != kept(&self.agent)
            }
            Checkpoint::Indoor(checkpoint) => {
                // The next one comes within a period.
                self.indoor = Some(checkpoint);
                false
            }
        }
    }

    /// Sets the revocation list that the next radio starts with. It is not part of the journal.
    pub fn set_revoked(&mut self, list: radio::Revoked) {
        self.revoked = list;
    }

    /// The current leader's ballot: the mission's, or on a relay, whose mission has none, the routing's.
    #[must_use]
    pub fn ballot(&self) -> Option<Ballot> {
        let leader = self.mission.as_ref().and_then(|it| it.leader.ballot());
        leader.or_else(|| self.routing.as_ref()?.ballot())
    }

    /// State of the mission.
    #[must_use]
    pub fn state(&self) -> mission::State {
        (self.mission.as_ref()).map_or(mission::State::default(), |it| it.state)
    }

    /// Whether the drone takes part in a flight that is not over. Begins on the ground, with the first heard master.
    #[must_use]
    pub fn is_flight_ongoing(&self) -> bool {
        match self.state() {
            mission::State::Start => self.ballot().is_some(),
            state => state != mission::State::Finished,
        }
    }

    /// Incarnation of the drone's process, from 1.
    #[must_use]
    pub const fn boot(&self) -> u32 {
        self.boot
    }

    /// The checkpoints of all machines that have one.
    pub fn iter(&self) -> impl Iterator<Item = Checkpoint> + '_ {
        let radio = std::iter::once(Checkpoint::Radio(self.radio));
        let routing = self.routing.clone().map(Checkpoint::Routing);
        let mission = self.mission.clone().map(Checkpoint::Mission);
        let navigation = self.navigation.clone().map(Checkpoint::Navigation);
        let msp = self.msp.clone().map(Checkpoint::Msp);
        let agent = self.agent.clone().map(Checkpoint::Agent);
        let indoor = self.indoor.clone().map(Checkpoint::Indoor);
        radio
            .chain(routing)
            .chain(mission)
            .chain(navigation)
            .chain(msp)
            .chain(agent)
            .chain(indoor)
    }

    /// Begins incarnation `boot`, from 1. From the second on, the drone does not arm any more.
    pub fn begin_incarnation(&mut self, boot: u32) {
        self.boot = boot;
        if boot > 1 {
            // Outdated: the vehicle has moved on. The navigation requests a new goal.
            self.navigation = None;
            if let Some(mission) = &mut self.mission {
                mission.begin_incarnation();
            }
        }
    }

    /// Whether `checkpoint` equals the newest one of its machine.
    #[must_use]
    pub fn holds(&self, checkpoint: &Checkpoint) -> bool {
        match checkpoint {
            Checkpoint::Radio(checkpoint) => self.radio == *checkpoint,
            Checkpoint::Routing(checkpoint) => self.routing.as_ref() == Some(checkpoint),
            Checkpoint::Mission(checkpoint) => self.mission.as_ref() == Some(checkpoint),
            Checkpoint::Navigation(checkpoint) => self.navigation.as_ref() == Some(checkpoint),
            Checkpoint::Msp(checkpoint) => self.msp.as_ref() == Some(checkpoint),
            Checkpoint::Agent(checkpoint) => self.agent.as_ref() == Some(checkpoint),
            Checkpoint::Indoor(checkpoint) => self.indoor.as_ref() == Some(checkpoint),
        }
    }
}
