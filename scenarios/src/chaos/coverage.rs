//! Which faults befell, and what they met.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::grammar;
use crate::scenario::Fault;
use crate::world::{Injection, Phase};

/// How often each kind of fault befell, and what it met.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Coverage(BTreeMap<String, Row>);

/// How often one kind of fault befell.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Row {
    /// A drone that waited on the ground.
    pub ground: u64,
    /// One that took off, or was learning who is near.
    pub taking_off: u64,
    /// One that waited at a waypoint.
    pub waiting: u64,
    /// One on its way to a waypoint.
    pub flying: u64,
    /// One that changed its place in the formation.
    pub changing: u64,
    /// One that kept its place around a master that it follows.
    pub following: u64,
    /// One that came down.
    pub landing: u64,
    /// One that was done, or dead.
    pub down: u64,
    /// Of all of these, a master.
    pub master: u64,
    /// Of all, while some of the swarm had no master, or several.
    pub electing: u64,
    /// Of all, while the swarm was in several parts.
    pub apart: u64,
}

impl Row {
    /// What the columns of a table are called, in the order of [`Self::cells`].
    pub(super) const COLUMNS: [&'static str; 11] = [
        "ground",
        "taking off",
        "waiting",
        "flying",
        "changing",
        "following",
        "landing",
        "down",
        "a master",
        "electing",
        "apart",
    ];

    /// Each number.
    pub(super) const fn cells(&self) -> [u64; 11] {
        [
            self.ground,
            self.taking_off,
            self.waiting,
            self.flying,
            self.changing,
            self.following,
            self.landing,
            self.down,
            self.master,
            self.electing,
            self.apart,
        ]
    }

    /// How often it befell anything.
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
            landing,
            down,
            master,
            electing,
            apart,
        } = self;
        let own = [
            ground, taking_off, waiting, flying, changing, following, landing, down, master,
            electing, apart,
        ];
        for (own, others) in own.into_iter().zip(other.cells()) {
            *own += others;
        }
    }
}

impl Coverage {
    /// Every kind of fault that the grammar has, by name.
    pub fn rows(&self) -> impl Iterator<Item = (&'static str, Row)> + '_ {
        grammar::names().map(|name| (name, self.0.get(name).copied().unwrap_or_default()))
    }

    /// Counts what the faults of a plan met that were drawn; the first `own` of them are the scenario's own.
    pub(super) fn count(&mut self, own: usize, faults: &[Fault], struck: &[Injection]) {
        for injection in struck.iter().filter(|injection| injection.fault >= own) {
            let fault = &faults[injection.fault];
            let row = self.0.entry(fault.kind.name()).or_default();
            *row.phase(injection.phase) += 1;
            row.master += u64::from(injection.leads);
            row.electing += u64::from(injection.electing);
            row.apart += u64::from(injection.apart);
        }
    }

    pub(super) fn add(&mut self, other: &Self) {
        for (name, row) in &other.0 {
            self.0.entry(name.clone()).or_default().add(row);
        }
    }
}
