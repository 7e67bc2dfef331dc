//! Where each drone has its place: slots in the air, places on the ground, altitude layers.

mod assignment;
mod change;
mod circular;
mod clearing;
pub(crate) mod crossings;
mod exposure;
mod ground;
mod layers;
mod layout;
mod linear;
mod matrix;
mod mesh;
mod path;
mod phases;
mod random;
mod shape;
mod split_up;
mod tube;

use std::num::NonZeroU32;

pub use assignment::{Assignment, OPTIMAL_MAX};
pub use change::Change;
pub use clearing::Flown;
pub use exposure::{Approach, Exposed, Exposure, Nearness};
pub use ground::Ground;
pub use layers::Layers;
pub use layout::{Layering, Layout, Separation};
pub use path::Path;
pub use phases::{Act, Paths, Phase};
pub use tube::{Clearance, Tube};

use crate::geometry::Ned;
use crate::identity::NodeId;
use shape::Shape;

/// The shape that a swarm flies in (thesis, figure 6).
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    /// Side by side on a line across the heading.
    Linear,
    /// The master amid a circle.
    Circular,
    /// Scattered around the master.
    Random {
        /// What the places are drawn from.
        seed: u64,
    },
    /// Clusters around the master that only it joins.
    SplitUp {
        /// How many clusters.
        clusters: NonZeroU32,
        /// How far drones of different clusters are apart at least, in metres.
        distance_m: f64,
    },
    /// Hexagonal rings around the master.
    CompactMesh,
    /// Rows as long as there are rows, or nearly.
    RegularMatrix,
    /// Square rings around the master.
    CompactMatrix,
}

impl Kind {
    /// Its name in files and reports.
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

/// The slots of a swarm, as displacements from the centre of its formation.
///
/// Drone `i` has slot `i`, in a formation that a swarm takes off in. All slots are distinct and at least the spacing apart; the centre slot is at the origin.
#[derive(Debug, Clone, PartialEq)]
pub struct Formation {
    kind: Kind,
    slots: Vec<Ned>,
    centre: NodeId,
    ranks: Vec<u32>,
    heading_rad: f64,
    nearest_m: f64,
}

impl Formation {
    /// The slots of `drones` drones, `spacing_m` metres apart, facing `heading_rad` clockwise from north.
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
            nearest_m: crossings::nearest_pair_m(&shape.slots).unwrap_or(spacing_m),
            slots: shape
                .slots
                .into_iter()
                .map(|slot| slot.turned(heading_rad))
                .collect(),
        }
    }

    /// The same slots for a swarm that comes from another formation: its master keeps the centre slot, and the others
    /// get those that they reach with the least sum of squared ways.
    ///
    /// # Panics
    /// When the two have not the same number of slots.
    #[must_use]
    fn taken_from(mut self, other: &Self) -> Self {
        assert_eq!(self.drones(), other.drones(), "a change keeps all drones");
        let assignment = Assignment::for_drones(self.drones());
        let led = |formation: &Self| -> Vec<Ned> {
            let slots = formation.slots.iter().zip(0..);
            let led = slots.filter(|(_, id)| NodeId(*id) != formation.centre);
            led.map(|(slot, _)| *slot).collect()
        };
        let mut given = assignment.assign(&led(&self), &led(other)).into_iter();
        let centre = self.slots[self.centre.0 as usize];
        let slots: Vec<Ned> = (0..other.drones())
            .map(|id| {
                let next = (NodeId(id) != other.centre).then(|| given.next());
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

    /// Its shape.
    #[must_use]
    pub const fn kind(&self) -> Kind {
        self.kind
    }

    /// How many slots there are.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "made from a u32")]
    pub fn drones(&self) -> u32 {
        self.slots.len() as u32
    }

    /// Each drone's displacement from the centre of the formation.
    #[must_use]
    pub fn slots(&self) -> &[Ned] {
        &self.slots
    }

    /// The drone at the centre slot: the first master.
    #[must_use]
    pub const fn centre(&self) -> NodeId {
        self.centre
    }

    /// The order of succession: each drone's rank, the centre's 0, then by distance from it (in split-up: the heads of
    /// the clusters, then by distance from the own head), drones as far out as each other by their numbers.
    ///
    /// Distances are compared as whole numbers, before the formation is turned: rounding never decides.
    #[must_use]
    pub fn ranks(&self) -> &[u32] {
        &self.ranks
    }

    /// The drones from the centre outwards.
    fn by_rank(&self) -> Vec<usize> {
        let mut order: Vec<usize> = (0..self.slots.len()).collect();
        order.sort_by_key(|drone| self.ranks[*drone]);
        order
    }

    /// How far apart the nearest two slots are, in metres; the spacing where there is one slot only.
    #[must_use]
    pub const fn nearest_m(&self) -> f64 {
        self.nearest_m
    }

    /// The formation drawn together until its nearest two are `gap_m` metres apart, and turned by `turn_rad`.
    fn drawn_together(&self, gap_m: f64, turn_rad: f64) -> Vec<Ned> {
        let scale = gap_m / self.nearest_m;
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
