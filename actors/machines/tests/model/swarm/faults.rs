use std::fmt;

use super::rules::{NAMED, NEVER_FALLS, ONE_MASTER};

/// What may befall a swarm, and how often.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct Faults {
    /// Processes that die. Each may start again, from what its journal still has.
    pub(crate) crashes: u8,
    /// Actors that panic and are started again.
    pub(crate) failures: u8,
    /// Partitions: any part of the swarm is cut off from the rest; all links may heal at any time.
    pub(crate) splits: u8,
    /// Links that carry one way.
    pub(crate) one_way: u8,
    /// Drones that miss a master which is there.
    pub(crate) suspicions: u8,
}

impl Faults {
    /// Frames are lost, repeated, late and out of order all the same.
    pub(crate) const NONE: Self = Self {
        crashes: 0,
        failures: 0,
        splits: 0,
        one_way: 0,
        suspicions: 0,
    };
}

impl fmt::Display for Faults {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let all = [
            (self.crashes, "crash"),
            (self.failures, "actor"),
            (self.splits, "split"),
            (self.one_way, "one-way"),
            (self.suspicions, "suspicion"),
        ];
        let named = all.into_iter().filter(|(times, _)| *times > 0);
        let named: Vec<_> = named
            .map(|(times, name)| format!("{times} {name}"))
            .collect();
        f.write_str(&if named.is_empty() {
            "none".to_owned()
        } else {
            named.join(", ")
        })
    }
}

/// How a drone's actors are interleaved.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Pace {
    /// What is sent within a drone has been handled before anything else happens, as in a simulation.
    Prompt,
    /// Each actor takes its messages when it comes to it.
    Mailboxes,
}

/// What is broken on purpose, to see that the model finds it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Flaw {
    /// Nothing.
    None,
    /// Nobody turns to a better ballot.
    IgnoresBetterBallots,
    /// A process that restarts has lost its journal.
    ForgetsItsJournal,
    /// Frames don't wait for the journal.
    SpeaksUnsynced,
    /// A routing takes whatever its mission says, under whichever ballot.
    BelievesItsMission,
}

impl Flaw {
    /// What else is broken, what must happen for that to matter, and the rule that is then found not to hold.
    pub(crate) const ALL: [(Self, Faults, Pace, &'static str); 4] = [
        (
            Self::IgnoresBetterBallots,
            Faults {
                splits: 1,
                ..Faults::NONE
            },
            Pace::Prompt,
            ONE_MASTER,
        ),
        (
            Self::ForgetsItsJournal,
            Faults {
                crashes: 1,
                suspicions: 1,
                ..Faults::NONE
            },
            Pace::Prompt,
            NEVER_FALLS,
        ),
        (
            Self::SpeaksUnsynced,
            Faults {
                crashes: 1,
                suspicions: 1,
                ..Faults::NONE
            },
            Pace::Prompt,
            NEVER_FALLS,
        ),
        (
            Self::BelievesItsMission,
            Faults {
                suspicions: 1,
                ..Faults::NONE
            },
            Pace::Mailboxes,
            NAMED,
        ),
    ];
}
