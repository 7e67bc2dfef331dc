use super::Intent;
use super::intent::is_vertical;
use crate::formation::{Path, Separation};
use crate::geometry::Ned;

/// Right of way by manoeuvre, highest first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Precedence {
    /// Lands or follows a master.
    Priority,
    /// Stands still.
    Stationary,
    /// Climbs or descends vertically.
    Vertical,
    /// Flies a leg.
    Leg,
}

impl Precedence {
    pub(super) fn of(path: Path) -> Self {
        if path.from == path.to {
            Self::Stationary
        } else if is_vertical(path) {
            Self::Vertical
        } else {
            Self::Leg
        }
    }
}

/// Space that another drone may occupy.
#[derive(Debug, Clone, Copy)]
pub(super) struct OccupiedSpace {
    pub(super) path: Path,
    /// Whether it may descend from the path to the ground.
    pub(super) may_descend: bool,
    pub(super) precedence: Precedence,
}

impl OccupiedSpace {
    /// Space of a drone that is not silent.
    pub(super) fn of(intent: Intent) -> Self {
        Self {
            path: intent.remaining(),
            may_descend: false,
            precedence: if intent.has_priority {
                Precedence::Priority
            } else {
                Precedence::of(intent.path())
            },
        }
    }

    /// Space of a stationary drone.
    pub(super) fn at(place: Ned) -> Self {
        Self {
            path: Path {
                from: place,
                to: place,
            },
            may_descend: false,
            precedence: Precedence::Stationary,
        }
    }

    /// Whether a path comes too near to it.
    pub(super) fn is_near(&self, path: Path, separation: Separation) -> bool {
        if self.may_descend {
            path.violates_below(self.path, separation)
        } else {
            path.violates(self.path, separation)
        }
    }
}
