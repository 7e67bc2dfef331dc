use std::fmt;

use super::rules::{NAMED, NEVER_FALLS, ONE_MASTER};

/// Number of faults of each kind that may affect a swarm.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct Faults {
    /// Crashed processes. Each may restart from the rest of its journal.
    pub(crate) crashes: u8,
    /// Actors that panic and are restarted.
    pub(crate) failures: u8,
    /// Partitions: any segment of the swarm is cut off; all links may heal at any time.
    pub(crate) splits: u8,
    /// One-way links.
    pub(crate) one_way: u8,
    /// False suspicions of a master.
    pub(crate) suspicions: u8,
}

impl Faults {
    /// No faults; frames are still lost, repeated, late and out of order.
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

/// Interleaving of a drone's actors.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Pace {
    /// Messages within a drone are handled before anything else, as in a simulation.
    Prompt,
    /// Each actor handles its messages at any time.
    Mailboxes,
}

/// A deliberate flaw, to check that the model detects it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Flaw {
    /// No flaw.
    None,
    /// Drones ignore better ballots.
    IgnoresBetterBallots,
    /// A restarting process has lost its journal.
    ForgetsItsJournal,
    /// Frames don't wait for the journal.
    SendsUnsynced,
    /// A routing accepts inputs of its mission under any ballot.
    SkipsBallotCheck,
}

impl Flaw {
    /// Each flaw with the faults that expose it and the rule that it violates.
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
            Self::SendsUnsynced,
            Faults {
                crashes: 1,
                suspicions: 1,
                ..Faults::NONE
            },
            Pace::Prompt,
            NEVER_FALLS,
        ),
        (
            Self::SkipsBallotCheck,
            Faults {
                suspicions: 1,
                ..Faults::NONE
            },
            Pace::Mailboxes,
            NAMED,
        ),
    ];
}
