//! Coverage: how often each kind of fault was injected, and in which states.

use std::collections::BTreeMap;

use muster_scenarios::engine::{Injection, Phase};
use muster_scenarios::scenario::Fault;
use serde::{Deserialize, Serialize};

use super::grammar;

/// Number of injections by kind of fault and state of the target.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Coverage(BTreeMap<String, Row>);

/// Number of injections of one kind of fault, by state of the target.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Row {
    /// Waiting on the ground.
    pub ground: u64,
    /// Taking off, or in neighbour discovery.
    pub taking_off: u64,
    /// Waiting at a waypoint.
    pub waiting: u64,
    /// Flying to a waypoint.
    pub flying: u64,
    /// Changing formation.
    pub changing: u64,
    /// Following the master.
    pub following: u64,
    /// On task.
    pub on_task: u64,
    /// Landing.
    pub landing: u64,
    /// Landed or dead.
    pub down: u64,
    /// Of all injections: on the master.
    pub master: u64,
    /// Of all injections: while there was no agreed master.
    pub electing: u64,
    /// Of all injections: while the network was partitioned.
    pub partitioned: u64,
}

impl Row {
    /// Column names, in the order of [`Self::cells`].
    pub(super) const COLUMNS: [&'static str; 12] = [
        "ground",
        "taking off",
        "waiting",
        "flying",
        "changing",
        "following",
        "on task",
        "landing",
        "down",
        "master",
        "electing",
        "partitioned",
    ];

    /// All counts.
    pub(super) const fn cells(&self) -> [u64; 12] {
        [
            self.ground,
            self.taking_off,
            self.waiting,
            self.flying,
            self.changing,
            self.following,
            self.on_task,
            self.landing,
            self.down,
            self.master,
            self.electing,
            self.partitioned,
        ]
    }

    /// Total number of injections.
    #[must_use]
    pub fn times(&self) -> u64 {
        self.cells()[..Phase::ALL.len()].iter().sum()
    }

    fn phase(&mut self, phase: Phase) -> &mut u64 {
        match phase {
            Phase::Ground => &mut self.ground,
            Phase::TakingOff => &mut self.taking_off,
            Phase::Waiting => &mut self.waiting,
            Phase::Flying => &mut self.flying,
            Phase::Changing => &mut self.changing,
            Phase::Following => &mut self.following,
            Phase::OnTask => &mut self.on_task,
            Phase::Landing => &mut self.landing,
            Phase::Down => &mut self.down,
        }
    }

    fn add(&mut self, other: &Self) {
        let Self {
            ground,
            taking_off,
            waiting,
            flying,
            changing,
            following,
            on_task,
            landing,
            down,
            master,
            electing,
            partitioned,
        } = self;
        let own = [
            ground,
            taking_off,
            waiting,
            flying,
            changing,
            following,
            on_task,
            landing,
            down,
            master,
            electing,
            partitioned,
        ];
        for (own, others) in own.into_iter().zip(other.cells()) {
            *own += others;
        }
    }
}

impl Coverage {
    /// All kinds of faults of the grammar, with their counts.
    pub fn rows(&self) -> impl Iterator<Item = (&'static str, Row)> + '_ {
        grammar::names().map(|name| (name, self.0.get(name).copied().unwrap_or_default()))
    }

    /// Counts the injections of a plan's drawn faults. The first `own` faults are the scenario's own and don't count.
    pub(super) fn count(&mut self, own: usize, faults: &[Fault], injections: &[Injection]) {
        for injection in injections.iter().filter(|injection| injection.fault >= own) {
            let fault = &faults[injection.fault];
            let row = self.0.entry(fault.kind.name()).or_default();
            *row.phase(injection.phase) += 1;
            row.master += u64::from(injection.leads);
            row.electing += u64::from(injection.electing);
            row.partitioned += u64::from(injection.apart);
        }
    }

    pub(super) fn add(&mut self, other: &Self) {
        for (name, row) in &other.0 {
            self.0.entry(name.clone()).or_default().add(row);
        }
    }
}
