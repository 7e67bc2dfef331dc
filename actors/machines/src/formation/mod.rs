//! Where each drone has its place: slots in the air, places on the ground, altitude layers.

mod layers;

use std::f64::consts::FRAC_PI_2;
use std::num::NonZeroU32;
use std::sync::Arc;

pub use layers::Layers;

use crate::geometry::Ned;
use crate::identity::NodeId;

/// The shape that a swarm flies in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Side by side on a line across the heading (thesis, figure 6).
    Linear,
}

/// The slots of a swarm, as displacements from the centre of its formation.
///
/// Drone `i` has slot `i`. All slots are distinct and at least the spacing apart.
#[derive(Debug, Clone, PartialEq)]
pub struct Formation {
    slots: Vec<Ned>,
    centre: NodeId,
    spacing_m: f64,
}

impl Formation {
    /// The slots of `drones` drones, `spacing_m` metres apart, facing `heading_rad` clockwise from north.
    #[must_use]
    pub fn new(kind: Kind, drones: NonZeroU32, spacing_m: f64, heading_rad: f64) -> Self {
        let (slots, centre) = match kind {
            Kind::Linear => linear(drones.get(), spacing_m),
        };
        Self {
            slots: slots
                .into_iter()
                .map(|slot| slot.turned(heading_rad))
                .collect(),
            centre: NodeId(centre),
            spacing_m,
        }
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

    /// The order of succession: each drone's rank, the centre's 0, then by distance from it.
    #[must_use]
    pub fn ranks(&self) -> Vec<u32> {
        let centre = self.slots[self.centre.0 as usize];
        let mut order: Vec<u32> = (0..self.drones()).collect();
        order.sort_by(|a, b| {
            let distance = |id: u32| self.slots[id as usize].distance_m(centre);
            distance(*a).total_cmp(&distance(*b)).then(a.cmp(b))
        });
        let mut ranks = vec![0; self.slots.len()];
        for (rank, id) in (0..).zip(order) {
            ranks[id as usize] = rank;
        }
        ranks
    }

    /// The formation drawn together to `gap_m` metres and turned by a right angle: where the drones stand before
    /// take-off and where they land, as displacements from the centre.
    ///
    /// The turn keeps drones that stand one behind the other, as seen from the centre, out of each other's way:
    /// each goes past the slots and places of those nearer to the centre at least `gap_m` aside.
    #[must_use]
    pub fn gathered(&self, gap_m: f64) -> Vec<Ned> {
        let scale = gap_m / self.spacing_m;
        self.slots
            .iter()
            .map(|slot| Ned(slot.turned(FRAC_PI_2).0 * scale))
            .collect()
    }
}

fn linear(drones: u32, spacing_m: f64) -> (Vec<Ned>, u32) {
    let centre = drones / 2;
    let slots = (0..drones)
        .map(|index| Ned::new(0.0, (f64::from(index) - f64::from(centre)) * spacing_m, 0.0))
        .collect();
    (slots, centre)
}

/// How far apart flying drones must be: far enough over ground or far enough in height.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Separation {
    /// Metres over ground.
    pub horizontal_m: f64,
    /// Metres in height.
    pub vertical_m: f64,
}

/// A formation with all that follows from it for a drone's flight; shared by the drones of a simulation.
#[derive(Debug)]
pub struct Layout {
    formation: Formation,
    gathered: Vec<Ned>,
    layers: Layers,
}

impl Layout {
    /// The layout of a formation whose drones stand and land `gap_m` metres apart.
    #[must_use]
    pub fn new(formation: Formation, gap_m: f64, separation: Separation) -> Self {
        Self {
            gathered: formation.gathered(gap_m),
            layers: Layers::new(separation),
            formation,
        }
    }

    /// The slots in the air.
    #[must_use]
    pub const fn formation(&self) -> &Formation {
        &self.formation
    }

    /// Where a drone flies when the formation's centre is at `waypoint`.
    ///
    /// # Panics
    /// When the formation has no such drone.
    #[must_use]
    pub fn slot(&self, id: NodeId, waypoint: Ned) -> Ned {
        waypoint + self.formation.slots[id.0 as usize]
    }

    /// Where a drone lands when the formation's centre lands at `centre`, and where it stands before take-off when
    /// that is home; at the height of `centre`.
    ///
    /// # Panics
    /// When the formation has no such drone.
    #[must_use]
    pub fn place(&self, id: NodeId, centre: Ned) -> Ned {
        centre + self.gathered[id.0 as usize]
    }

    /// Each drone's altitude layer for a mission: how many metres above the mission's altitude it flies whenever it
    /// is not in lockstep with its swarm.
    #[must_use]
    pub fn layers_m(&self, waypoints: &[Ned]) -> Arc<[f64]> {
        self.layers.of(&self.formation, &self.gathered, waypoints)
    }
}

#[cfg(test)]
mod tests;
