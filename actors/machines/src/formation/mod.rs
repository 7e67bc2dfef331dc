//! Formations: slots in the air, places on the ground, altitude layers and sectors, and the phases of a flight.

mod assignment;
mod change;
mod circular;
pub(crate) mod crossings;
mod exposure;
mod flight_plan;
mod ground;
mod landing_place;
mod layers;
mod layout;
mod linear;
mod matrix;
mod mesh;
mod path;
mod phases;
mod planned;
mod random;
mod reach;
mod shape;
mod split_up;
mod tube;

use std::num::NonZeroU32;

pub use assignment::{Assignment, OPTIMAL_MAX};
pub use change::Change;
pub use exposure::{ClosestApproach, Exposure, PhaseSeparation, Proximity};
pub use flight_plan::FlightPlan;
pub use ground::Ground;
pub use layout::{Layering, Layout, Separation, WaveLimits};
pub use path::Path;
pub use phases::{Paths, Phase, PhaseKind};
pub use planned::{PlannedFlight, Unreached};
pub use reach::SEARCHED_MAX;
pub use tube::{Clearance, Tube};

use crate::geometry::Ned;
use crate::identity::NodeId;
use shape::Shape;

/// Shape of a formation (thesis, figure 6).
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    /// A line across the heading.
    Linear,
    /// A circle around the master.
    Circular,
    /// Random places around the master.
    Random {
        /// Seed of the random places.
        seed: u64,
    },
    /// Clusters around the master; only the master connects them.
    SplitUp {
        /// Number of clusters.
        clusters: NonZeroU32,
        /// Minimum distance between drones of different clusters, in metres.
        distance_m: f64,
    },
    /// Hexagonal rings around the master.
    CompactMesh,
    /// A matrix with about as many rows as columns.
    RegularMatrix,
    /// Square rings around the master.
    CompactMatrix,
}

impl Kind {
    /// Name in files and reports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Linear => "linear",
            Self::Circular => "circular",
            Self::Random { .. } => "random",
            Self::SplitUp { .. } => "split-up",
            Self::CompactMesh => "compact-mesh",
            Self::RegularMatrix => "regular-matrix",
            Self::CompactMatrix => "compact-matrix",
        }
    }
}

/// Slots of a swarm: displacements from the centre of the formation.
///
/// Drone `i` takes slot `i` at take-off. All slots are distinct and at least the spacing apart. The centre slot is at
/// the origin.
#[derive(Debug, Clone, PartialEq)]
pub struct Formation {
    kind: Kind,
    slots: Vec<Ned>,
    centre: NodeId,
    ranks: Vec<u32>,
    heading_rad: f64,
    slot_distance_min_m: f64,
}

impl Formation {
    /// Slots of `drones` drones, `spacing_m` metres apart, facing `heading_rad` clockwise from north.
    #[must_use]
    pub fn new(kind: Kind, drones: NonZeroU32, spacing_m: f64, heading_rad: f64) -> Self {
        let drones = drones.get();
        let shape = match kind {
            Kind::Linear => linear::linear(drones, spacing_m),
            Kind::Circular => circular::circular(drones, spacing_m),
            Kind::Random { seed } => random::random(drones, spacing_m, seed),
            Kind::SplitUp {
                clusters,
                distance_m,
            } => split_up::split_up(drones, spacing_m, clusters, distance_m),
            Kind::CompactMesh => mesh::compact(drones, spacing_m),
            Kind::RegularMatrix => matrix::regular(drones, spacing_m),
            Kind::CompactMatrix => matrix::compact(drones, spacing_m),
        };
        assert_eq!(shape.slots.len(), drones as usize, "a slot for each drone");
        Self {
            kind,
            centre: NodeId(shape.centre),
            ranks: ranks(&shape),
            heading_rad,
            slot_distance_min_m: crossings::nearest_pair_m(&shape.slots).unwrap_or(spacing_m),
            slots: shape
                .slots
                .into_iter()
                .map(|slot| slot.turned(heading_rad))
                .collect(),
        }
    }

    /// The same slots, reassigned for a swarm that comes from another formation. The master keeps the centre slot. The
    /// others get the slots with the least sum of squared distances.
    ///
    /// # Panics
    /// If the two formations have different numbers of slots.
    #[must_use]
    fn reassigned_from(mut self, other: &Self) -> Self {
        assert_eq!(self.drones(), other.drones(), "a change keeps all drones");
        let assignment = Assignment::for_drones(self.drones());
        let members = |formation: &Self| -> Vec<Ned> {
            let slots = formation.slots.iter().zip(0..);
            let slots = slots.filter(|(_, id)| NodeId(*id) != formation.centre);
            slots.map(|(slot, _)| *slot).collect()
        };
        let mut assigned = assignment
            .assign(&members(&self), &members(other))
            .into_iter();
        let centre = self.slots[self.centre.0 as usize];
        let slots: Vec<Ned> = (0..other.drones())
            .map(|id| {
                let next = (NodeId(id) != other.centre).then(|| assigned.next());
                next.flatten().unwrap_or(centre)
            })
            .collect();
        let rank_of = |slot: &Ned| {
            let index = self.slots.iter().position(|other| other == slot);
            index.map_or(0, |index| self.ranks[index])
        };
        self.ranks = slots.iter().map(rank_of).collect();
        self.slots = slots;
        self.centre = other.centre;
        self
    }

    /// Shape of the formation.
    #[must_use]
    pub const fn kind(&self) -> Kind {
        self.kind
    }

    /// Number of slots.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "made from a u32")]
    pub fn drones(&self) -> u32 {
        self.slots.len() as u32
    }

    /// Displacement of each drone from the centre of the formation.
    #[must_use]
    pub fn slots(&self) -> &[Ned] {
        &self.slots
    }

    /// Drone at the centre slot: the first master.
    #[must_use]
    pub const fn centre(&self) -> NodeId {
        self.centre
    }

    /// Order of succession: the rank of each drone. The centre has rank 0, then ranks rise with the distance from it.
    /// In split-up the heads of the clusters come first, then ranks rise with the distance from the own head. Ties are
    /// broken by drone number.
    ///
    /// Distances are compared as whole numbers, before the formation is rotated, so rounding never decides.
    #[must_use]
    pub fn ranks(&self) -> &[u32] {
        &self.ranks
    }

    /// Smallest distance between two slots, in metres; the spacing if there is only one slot.
    #[must_use]
    pub const fn slot_distance_min_m(&self) -> f64 {
        self.slot_distance_min_m
    }

    /// Slots scaled to a smallest distance of `gap_m` metres and rotated by `turn_rad`.
    fn scaled_to_gap(&self, gap_m: f64, turn_rad: f64) -> Vec<Ned> {
        let scale = gap_m / self.slot_distance_min_m;
        self.slots
            .iter()
            .map(|slot| Ned(slot.turned(turn_rad).0 * scale))
            .collect()
    }
}

fn ranks(shape: &Shape) -> Vec<u32> {
    let mut order: Vec<(u64, u32)> = shape.reach.iter().copied().zip(0..).collect();
    order.sort_unstable();
    let mut ranks = vec![0; shape.slots.len()];
    for (rank, (_, id)) in (0..).zip(order) {
        ranks[id as usize] = rank;
    }
    ranks
}

#[cfg(test)]
mod tests;
