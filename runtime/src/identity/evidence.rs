//! What must have been shown before a drone may do more.

use std::collections::BTreeMap;
use std::fmt;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::GrantedStage;

/// What a file of evidence shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum EvidenceKind {
    /// A search for faults that broke no rule.
    Chaos,
    /// A flight with the simulated flight controller.
    Simulated,
    /// A flight with Betaflight itself.
    Betaflight,
    /// A check of the drone's own flight controller.
    Bench,
    /// A flight of the drone itself on a tether.
    Tether,
}

impl EvidenceKind {
    /// All kinds, in the order in which they are earned.
    pub const ALL: [Self; 5] = [
        Self::Chaos,
        Self::Simulated,
        Self::Betaflight,
        Self::Bench,
        Self::Tether,
    ];

    /// Name in a grant.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Chaos => "chaos",
            Self::Simulated => "simulated",
            Self::Betaflight => "betaflight",
            Self::Bench => "bench",
            Self::Tether => "tether",
        }
    }

    /// The lowest stage that needs it.
    #[must_use]
    pub const fn stage(self) -> GrantedStage {
        match self {
            Self::Chaos | Self::Simulated | Self::Betaflight => GrantedStage::Bench,
            Self::Bench => GrantedStage::Tethered,
            Self::Tether => GrantedStage::Flight,
        }
    }

    /// Whether it was seen of one flight controller, and says nothing about another or other settings.
    #[must_use]
    pub const fn is_of_controller(self) -> bool {
        matches!(self, Self::Bench | Self::Tether)
    }
}

impl fmt::Display for EvidenceKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// SHA-256 of each file of evidence that a grant was signed for.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Evidence(BTreeMap<EvidenceKind, [u8; 32]>);

impl Evidence {
    /// Adds a file's content; it replaces the last one of its kind.
    pub fn add(&mut self, kind: EvidenceKind, content: &[u8]) {
        self.0.insert(kind, Sha256::digest(content).into());
    }

    /// Keeps the kinds that fit.
    pub fn retain(&mut self, fits: impl Fn(EvidenceKind) -> bool) {
        self.0.retain(|kind, _| fits(*kind));
    }

    /// The hashes by kind.
    pub fn hashes(&self) -> impl Iterator<Item = (EvidenceKind, &[u8; 32])> {
        self.0.iter().map(|(kind, hash)| (*kind, hash))
    }

    /// What a stage needs and is not there.
    #[must_use]
    pub fn missing_for(&self, stage: GrantedStage) -> Vec<EvidenceKind> {
        let needed = EvidenceKind::ALL.iter().filter(|it| it.stage() <= stage);
        needed
            .filter(|kind| !self.0.contains_key(kind))
            .copied()
            .collect()
    }
}

impl FromIterator<(EvidenceKind, [u8; 32])> for Evidence {
    fn from_iter<I: IntoIterator<Item = (EvidenceKind, [u8; 32])>>(hashes: I) -> Self {
        Self(hashes.into_iter().collect())
    }
}
