use std::borrow::Cow;
use std::cmp::Ordering;

use nalgebra::Vector2;

use super::crossings::slot_passes;
use super::ground::GroundPlaces;
use super::layers::LayerPlan;
use super::{Formation, Ground};
use crate::geometry::Ned;
use crate::identity::NodeId;

/// Minimum separation of flying drones: horizontal or vertical, either is enough.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Separation {
    /// Horizontal separation, in metres.
    pub horizontal_m: f64,
    /// Vertical separation, in metres.
    pub vertical_m: f64,
}

/// Margin added to each minimum, in metres, against rounding.
const MARGIN_M: f64 = 0.5;

impl Separation {
    pub(super) fn horizontal_with_margin_m(self) -> f64 {
        self.horizontal_m + MARGIN_M
    }

    /// Height difference between neighbouring layers, in metres.
    fn layer_spacing_m(self) -> f64 {
        self.vertical_m + MARGIN_M
    }

    pub(super) fn heights_m(self, plan: &LayerPlan) -> impl Iterator<Item = f64> {
        let layer_spacing_m = self.layer_spacing_m();
        let layers = plan.layers.iter();
        layers.map(move |layer| f64::from(*layer) * layer_spacing_m)
    }
}

/// Number of altitude layers for drones that are not in lockstep with their swarm.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Layering {
    /// One layer per drone: any two drones are separated, wherever they are. The first master has the lowest layer. A
    /// drone cut off from the master detects it before the master detects the drone, so the master climbs last and
    /// through no occupied layer.
    PerDrone,
    /// As few layers as possible; drones share a layer if neither flies a leg past an end where the other waits.
    Shared,
}

/// A formation with everything derived from it for the flight of a drone; shared by all drones of a simulation.
///
/// Paths between ground and slots are compared if they may be flown under the same order: a swarm continues only once
/// all members have arrived. Drones with crossing paths fly in different layers. Layers are only added upwards, so the
/// mission's altitude stays the lowest.
#[derive(Debug)]
pub struct Layout {
    formation: Formation,
    limits: Limits,
    gap_m: f64,
    take_off_ground: Ground,
    /// `None` if drones take off from their landing places.
    take_off: Option<GroundPaths>,
    landing: GroundPaths,
    layering: Layering,
    /// The first master, with the lowest layer if there is one layer per drone.
    lowest: NodeId,
    /// Computed beforehand; `None` if there is no mission yet.
    for_mission: Option<MissionLayers>,
}

/// The layers of a mission.
#[derive(Debug)]
struct MissionLayers {
    waypoints: Vec<Ned>,
    layers_m: Vec<f64>,
}

/// Limits for paths that cross.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limits {
    pub(super) separation: Separation,
    /// `None` for one wave with as many layers as needed.
    pub(super) waves: Option<WaveLimits>,
}

/// Limits for drones that fly in waves.
#[derive(Debug, Clone, Copy)]
pub struct WaveLimits {
    /// Highest layer; 0 is the height of the slots.
    pub layers_max: u32,
    /// Distance over ground at which drones in any two layers are in radio range of each other, in metres.
    pub link_m: f64,
    /// Distance over ground at which a drone on the ground is in radio range of one in its slot, in metres.
    pub ground_link_m: f64,
    /// Most hops, over drones of the same wave, by which a wave flies beyond the drones of the waves before.
    pub hops_max: u32,
    /// Whether to try more places on the ground and another order, if drones would be out of reach.
    pub searches_on: bool,
}

/// Places on the ground, and the layers of the paths between them and the slots.
#[derive(Debug)]
struct GroundPaths {
    places: GroundPlaces,
    layers_m: Vec<f64>,
}

impl GroundPaths {
    fn new(ground: Ground, formation: &Formation, gap_m: f64, limits: Limits) -> Self {
        let Limits { separation, waves } = limits;
        let min_m = separation.horizontal_with_margin_m();
        let places = GroundPlaces::new(ground, formation, gap_m, min_m, waves);
        Self {
            layers_m: separation.heights_m(&places.layer_plan).collect(),
            places,
        }
    }
}

impl Layout {
    /// Layout of a formation with places on the ground `gap_m` metres apart.
    #[must_use]
    pub fn new(formation: Formation, gap_m: f64, separation: Separation) -> Self {
        let limits = Limits {
            separation,
            waves: None,
        };
        Self::within(formation, gap_m, limits)
    }

    pub(super) fn within(formation: Formation, gap_m: f64, limits: Limits) -> Self {
        Self {
            landing: GroundPaths::new(Ground::Gathered, &formation, gap_m, limits),
            take_off: None,
            take_off_ground: Ground::Gathered,
            layering: Layering::Shared,
            lowest: formation.centre(),
            for_mission: None,
            formation,
            limits,
            gap_m,
        }
    }

    /// Sets the highest layer above the slots. Drones take off, land and cross in waves if they would need more layers.
    #[must_use]
    pub fn in_waves(self, waves: WaveLimits) -> Self {
        let limits = Limits {
            waves: Some(waves),
            ..self.limits
        };
        Self::within(self.formation, self.gap_m, limits)
            .with_ground(self.take_off_ground)
            .with_layers(self.layering)
    }

    /// Sets the arrangement on the ground before take-off; default [`Ground::Gathered`].
    #[must_use]
    pub fn with_ground(mut self, ground: Ground) -> Self {
        self.take_off_ground = ground;
        self.take_off = (ground != Ground::Gathered)
            .then(|| GroundPaths::new(ground, &self.formation, self.gap_m, self.limits));
        self
    }

    /// Sets the number of layers; default [`Layering::Shared`].
    #[must_use]
    pub fn with_layers(mut self, layering: Layering) -> Self {
        self.layering = layering;
        self.for_mission = None;
        self
    }

    /// Computes the layers of a mission beforehand: a swarm asks for them again and again. Must come last.
    #[must_use]
    pub fn for_mission(mut self, waypoints: &[Ned]) -> Self {
        self.for_mission = Some(MissionLayers {
            layers_m: self.computed_layers_m(waypoints),
            waypoints: waypoints.to_vec(),
        });
        self
    }

    /// Takes the layers of `before`, so that drones of either layout are separated, and its mission.
    pub(super) fn layered_like(mut self, before: &Self) -> Self {
        self.layering = before.layering;
        self.lowest = before.lowest;
        self.for_mission = None;
        match &before.for_mission {
            Some(it) => self.for_mission(&it.waypoints),
            None => self,
        }
    }

    /// Number of layers.
    #[must_use]
    pub const fn layering(&self) -> Layering {
        self.layering
    }

    /// Minimum separation of flying drones.
    pub(crate) const fn separation(&self) -> Separation {
        self.limits.separation
    }

    pub(super) const fn limits(&self) -> Limits {
        self.limits
    }

    /// Distance of places on the ground, in metres.
    pub(super) const fn gap_m(&self) -> f64 {
        self.gap_m
    }

    /// Slots in the air.
    #[must_use]
    pub const fn formation(&self) -> &Formation {
        &self.formation
    }

    /// Slot of a drone with the formation's centre at `waypoint`.
    ///
    /// # Panics
    /// If the formation has no such drone.
    #[must_use]
    pub fn slot(&self, id: NodeId, waypoint: Ned) -> Ned {
        waypoint + self.formation.slots()[id.0 as usize]
    }

    /// Place of a drone before take-off, with the swarm starting from `home`; at the height of `home`.
    ///
    /// # Panics
    /// If the formation has no such drone.
    #[must_use]
    pub fn take_off_place(&self, id: NodeId, home: Ned) -> Ned {
        home + self.take_off_paths().places.positions[id.0 as usize]
    }

    /// Landing place of a drone, with the formation's centre landing at `centre`; at the height of `centre`.
    ///
    /// # Panics
    /// If the formation has no such drone.
    #[must_use]
    pub fn landing_place(&self, id: NodeId, centre: Ned) -> Ned {
        centre + self.landing.places.positions[id.0 as usize]
    }

    fn take_off_paths(&self) -> &GroundPaths {
        self.take_off.as_ref().unwrap_or(&self.landing)
    }

    /// Altitude layer of each drone between its place on the ground and its slot, in metres above the slot.
    #[must_use]
    pub fn take_off_layers_m(&self) -> &[f64] {
        &self.take_off_paths().layers_m
    }

    /// Wave in which a drone takes off, from 0. The first master is in wave 0.
    ///
    /// # Panics
    /// If the formation has no such drone.
    #[must_use]
    pub fn take_off_wave(&self, id: NodeId) -> u16 {
        self.take_off_paths().places.layer_plan.waves[id.0 as usize]
    }

    /// Number of take-off waves.
    #[must_use]
    pub fn take_off_waves(&self) -> u16 {
        self.take_off_paths().places.layer_plan.wave_count
    }

    /// Wave in which a drone lands, from 0. Drones land from the outside in, so the remaining ones stay within radio
    /// range. The first master lands in the last wave.
    ///
    /// # Panics
    /// If the formation has no such drone.
    #[must_use]
    pub fn landing_wave(&self, id: NodeId) -> u16 {
        let outwards = &self.landing.places.layer_plan;
        outwards.wave_count - 1 - outwards.waves[id.0 as usize]
    }

    /// Number of landing waves.
    #[must_use]
    pub fn landing_waves(&self) -> u16 {
        self.landing.places.layer_plan.wave_count
    }

    /// Altitude layer of each drone between its slot at the last waypoint and its landing place, in metres above the
    /// slot.
    #[must_use]
    pub fn landing_layers_m(&self) -> &[f64] {
        &self.landing.layers_m
    }

    /// Altitude layer of each drone for a mission: metres above the mission's altitude while it is not in lockstep.
    ///
    /// With shared layers, two drones differ if one, flying a leg alone, passes the slot of the other. They also differ
    /// if their paths to the landing places cross, unless they land below their slots. The layer is 0 for a drone
    /// without such a pair.
    #[must_use]
    pub fn layers_m(&self, waypoints: &[Ned]) -> Cow<'_, [f64]> {
        match &self.for_mission {
            Some(known) if known.waypoints == waypoints => Cow::Borrowed(&known.layers_m),
            _ => Cow::Owned(self.computed_layers_m(waypoints)),
        }
    }

    fn computed_layers_m(&self, waypoints: &[Ned]) -> Vec<f64> {
        let slots = self.formation.slots();
        if self.layering == Layering::PerDrone {
            let layers = (0..self.formation.drones()).map(|id| self.own_layer(NodeId(id)));
            return layers
                .map(|layer| f64::from(layer) * self.layer_spacing_m())
                .collect();
        }
        let legs: Vec<Vector2<f64>> = waypoints
            .windows(2)
            .map(|pair| (pair[1] - pair[0]).0.xy())
            .collect();
        let mut crossings = slot_passes(slots, &legs, self.separation().horizontal_with_margin_m());
        if !self.lands_below_slot() {
            crossings.extend_from_slice(&self.landing.places.crossings);
        }
        let plan = LayerPlan::of(slots.len(), &crossings, 1);
        self.separation().heights_m(&plan).collect()
    }

    /// Whether drones out of lockstep land below their slots, because their layers don't separate the paths to the
    /// landing places.
    #[must_use]
    pub fn lands_below_slot(&self) -> bool {
        self.layering == Layering::PerDrone || self.limits.waves.is_some()
    }

    /// Layer of a drone with one layer per drone, from 1: by number, but the first master has layer 1.
    fn own_layer(&self, id: NodeId) -> u32 {
        match id.cmp(&self.lowest) {
            Ordering::Less => id.0 + 2,
            Ordering::Equal => 1,
            Ordering::Greater => id.0 + 1,
        }
    }

    /// Height above its slot at which a drone out of lockstep flies above all in lockstep, in metres: its own layer, or
    /// the lowest layer if it has none.
    ///
    /// # Panics
    /// If the formation has no such drone.
    pub(super) fn layer_alone_m(&self, id: NodeId, waypoints: &[Ned]) -> f64 {
        let own_m = self.layers_m(waypoints)[id.0 as usize];
        own_m.max(self.layer_spacing_m())
    }

    /// Height difference between neighbouring altitude layers, in metres.
    #[must_use]
    pub fn layer_spacing_m(&self) -> f64 {
        self.separation().layer_spacing_m()
    }

    /// Highest layer, in metres above the mission's altitude.
    #[must_use]
    pub fn highest_layer_m(&self, waypoints: &[Ned]) -> f64 {
        let layers_m = self.layers_m(waypoints);
        let all = self.take_off_layers_m().iter();
        let all = all.chain(self.landing_layers_m()).chain(layers_m.iter());
        all.copied().fold(0.0, f64::max)
    }

    /// Number of path ends, on the ground or at a slot, that others must pass below. A drone that takes off or lands
    /// there relies on the others starting at the same time.
    #[must_use]
    pub fn exposed_ends(&self) -> usize {
        let take_off = self.take_off.iter();
        self.landing.places.layer_plan.exposed
            + take_off
                .map(|it| it.places.layer_plan.exposed)
                .sum::<usize>()
    }
}

#[cfg(test)]
mod tests;
