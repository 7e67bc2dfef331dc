use std::cmp::Ordering;
use std::sync::Arc;

use nalgebra::Vector2;

use super::crossings::passings;
use super::ground::Places;
use super::layers::Stack;
use super::{Formation, Ground, Layers};
use crate::geometry::Ned;
use crate::identity::NodeId;

/// How far apart flying drones must be: far enough over ground or far enough in height.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Separation {
    /// Metres over ground.
    pub horizontal_m: f64,
    /// Metres in height.
    pub vertical_m: f64,
}

/// What is kept beyond either minimum, in metres, so that rounding never matters.
const MARGIN_M: f64 = 0.5;

impl Separation {
    pub(super) fn near_m(self) -> f64 {
        self.horizontal_m + MARGIN_M
    }

    /// From one layer to the next, in metres.
    fn pitch_m(self) -> f64 {
        self.vertical_m + MARGIN_M
    }

    pub(super) fn heights_m(self, stack: &Stack) -> impl Iterator<Item = f64> {
        let pitch_m = self.pitch_m();
        let layers = stack.layers.iter();
        layers.map(move |layer| f64::from(*layer) * pitch_m)
    }
}

/// How many altitude layers there are for drones that are not in lockstep with their swarm.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Layering {
    /// One for each drone: wherever two of them are, and whatever they do, they are out of each other's way. The first
    /// master's is the lowest: whoever is cut off from it misses it before it misses them, so it climbs last, and through
    /// nobody's layer.
    Each,
    /// As few as drones can do with of which one waits at an end of the leg that the other flies.
    Shared,
}

/// A formation with all that follows from it for a drone's flight; shared by the drones of a simulation.
///
/// Ways between ground and slots are compared when they may be flown under the same order, because a swarm goes on
/// only once all its members have arrived. Drones whose ways cross fly them in different layers. Layers only go up:
/// what the mission's author took for a safe height stays the lowest.
#[derive(Debug)]
pub struct Layout {
    formation: Formation,
    room: Room,
    gap_m: f64,
    standing: Ground,
    ground: Option<Paths>,
    landing: Paths,
    layering: Layering,
    /// Who has the lowest layer, if each has its own: the first master.
    lowest: NodeId,
    layers: Layers,
}

/// What keeps drones apart whose ways cross.
#[derive(Debug, Clone, Copy)]
pub(super) struct Room {
    pub(super) separation: Separation,
    /// The highest layer that may be flown, where drones fly in waves rather than higher.
    pub(super) layers_max: Option<u32>,
}

/// Places on the ground, and the layer in which the way between them and the slots is flown.
#[derive(Debug)]
struct Paths {
    arranged: Places,
    layers_m: Arc<[f64]>,
}

impl Paths {
    fn new(ground: Ground, formation: &Formation, gap_m: f64, room: Room) -> Self {
        let Room {
            separation,
            layers_max,
        } = room;
        let arranged = Places::new(ground, formation, gap_m, separation.near_m(), layers_max);
        Self {
            layers_m: separation.heights_m(&arranged.stack).collect(),
            arranged,
        }
    }
}

impl Layout {
    /// The layout of a formation whose drones stand and land `gap_m` metres apart.
    #[must_use]
    pub fn new(formation: Formation, gap_m: f64, separation: Separation) -> Self {
        let room = Room {
            separation,
            layers_max: None,
        };
        Self::within(formation, gap_m, room)
    }

    pub(super) fn within(formation: Formation, gap_m: f64, room: Room) -> Self {
        Self {
            landing: Paths::new(Ground::Gathered, &formation, gap_m, room),
            ground: None,
            standing: Ground::Gathered,
            layering: Layering::Shared,
            lowest: formation.centre(),
            layers: Layers::default(),
            formation,
            room,
            gap_m,
        }
    }

    /// The same with layers up to `layers_max` above the slots: drones take off and land in waves where more would be
    /// needed, and cross in waves in the changes of formation that are made from it.
    #[must_use]
    pub fn in_waves(self, layers_max: u32) -> Self {
        let room = Room {
            layers_max: Some(layers_max),
            ..self.room
        };
        Self::within(self.formation, self.gap_m, room)
            .standing(self.standing)
            .with_layers(self.layering)
    }

    /// The same, but for how the drones stand before take-off.
    #[must_use]
    pub fn standing(mut self, ground: Ground) -> Self {
        self.standing = ground;
        self.ground = (ground != Ground::Gathered)
            .then(|| Paths::new(ground, &self.formation, self.gap_m, self.room));
        self
    }

    /// The same, but for how many layers there are.
    #[must_use]
    pub fn with_layers(mut self, layering: Layering) -> Self {
        self.layering = layering;
        self.layers = Layers::default();
        self
    }

    /// The same, but with layers as `before` has them, so that drones of either layout are out of each other's way.
    pub(super) fn layered_like(mut self, before: &Self) -> Self {
        self.layering = before.layering;
        self.lowest = before.lowest;
        self.layers = Layers::default();
        self
    }

    /// How many layers there are.
    #[must_use]
    pub const fn layering(&self) -> Layering {
        self.layering
    }

    /// How far apart drones must be.
    pub(crate) const fn separation(&self) -> Separation {
        self.room.separation
    }

    pub(super) const fn room(&self) -> Room {
        self.room
    }

    /// How far apart drones stand and land, in metres.
    pub(super) const fn gap_m(&self) -> f64 {
        self.gap_m
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
        waypoint + self.formation.slots()[id.0 as usize]
    }

    /// Where a drone stands before take-off when the swarm starts from `home`; at the height of `home`.
    ///
    /// # Panics
    /// When the formation has no such drone.
    #[must_use]
    pub fn stand(&self, id: NodeId, home: Ned) -> Ned {
        home + self.take_off().arranged.places[id.0 as usize]
    }

    /// Where a drone lands when the formation's centre lands at `centre`; at the height of `centre`.
    ///
    /// # Panics
    /// When the formation has no such drone.
    #[must_use]
    pub fn place(&self, id: NodeId, centre: Ned) -> Ned {
        centre + self.landing.arranged.places[id.0 as usize]
    }

    fn take_off(&self) -> &Paths {
        self.ground.as_ref().unwrap_or(&self.landing)
    }

    /// Each drone's altitude layer on its way from where it stands to its slot, in metres above the slot.
    #[must_use]
    pub fn take_off_layers_m(&self) -> &[f64] {
        &self.take_off().layers_m
    }

    /// In which wave a drone takes off, the first being 0, in which the first master does.
    ///
    /// # Panics
    /// When the formation has no such drone.
    #[must_use]
    pub fn take_off_wave(&self, id: NodeId) -> u16 {
        self.take_off().arranged.stack.waves[id.0 as usize]
    }

    /// How many waves take off.
    #[must_use]
    pub fn take_off_waves(&self) -> u16 {
        self.take_off().arranged.stack.wave_count()
    }

    /// In which wave a drone lands, the first being 0: from the outside in, so that those that are left are within reach
    /// of each other. The first master lands in the last.
    ///
    /// # Panics
    /// When the formation has no such drone.
    #[must_use]
    pub fn landing_wave(&self, id: NodeId) -> u16 {
        let outwards = &self.landing.arranged.stack;
        outwards.wave_count() - 1 - outwards.waves[id.0 as usize]
    }

    /// How many waves land.
    #[must_use]
    pub fn landing_waves(&self) -> u16 {
        self.landing.arranged.stack.wave_count()
    }

    /// Each drone's altitude layer on its way from its slot at the mission's last waypoint to where it lands, in
    /// metres above the slot.
    #[must_use]
    pub fn landing_layers_m(&self) -> &[f64] {
        &self.landing.layers_m
    }

    /// Each drone's altitude layer for a mission: how many metres above the mission's altitude it flies whenever it
    /// is not in lockstep with its swarm. If layers are shared, it differs for drones of which one, flying a leg alone,
    /// passes the slot of the other, and, unless they land apart, for those whose ways to the landing places cross; 0 for
    /// those in nobody's way.
    #[must_use]
    pub fn layers_m(&self, waypoints: &[Ned]) -> Arc<[f64]> {
        self.layers.of(waypoints, || {
            let slots = self.formation.slots();
            if self.layering == Layering::Each {
                let layers = (0..self.formation.drones()).map(|id| self.own_layer(NodeId(id)));
                return layers
                    .map(|layer| f64::from(layer) * self.pitch_m())
                    .collect();
            }
            let legs: Vec<Vector2<f64>> = waypoints
                .windows(2)
                .map(|pair| (pair[1] - pair[0]).0.xy())
                .collect();
            let mut crossings = passings(slots, &legs, self.separation().near_m());
            if !self.lands_apart() {
                crossings.extend_from_slice(&self.landing.arranged.crossings);
            }
            let stack = Stack::of(slots.len(), &crossings, 1);
            self.separation().heights_m(&stack).collect()
        })
    }

    /// Whether drones that are out of lockstep land below their slots, for their layers do not keep apart the ways to the
    /// landing places.
    #[must_use]
    pub fn lands_apart(&self) -> bool {
        self.layering == Layering::Each || self.room.layers_max.is_some()
    }

    /// The layer of a drone where each has its own, counted from 1: by number, but for the first master.
    fn own_layer(&self, id: NodeId) -> u32 {
        match id.cmp(&self.lowest) {
            Ordering::Less => id.0 + 2,
            Ordering::Equal => 1,
            Ordering::Greater => id.0 + 1,
        }
    }

    /// How far above its slot a drone flies that is to be above all that fly in lockstep, in metres: in its own layer or,
    /// if it has none, in the lowest one.
    ///
    /// # Panics
    /// When the formation has no such drone.
    pub(super) fn layer_alone_m(&self, id: NodeId, waypoints: &[Ned]) -> f64 {
        let own_m = self.layers_m(waypoints)[id.0 as usize];
        own_m.max(self.pitch_m())
    }

    /// From one altitude layer to the next, in metres.
    #[must_use]
    pub fn pitch_m(&self) -> f64 {
        self.separation().pitch_m()
    }

    /// The highest layer of all, in metres above the mission's altitude.
    #[must_use]
    pub fn highest_layer_m(&self, waypoints: &[Ned]) -> f64 {
        let layers_m = self.layers_m(waypoints);
        let all = self.take_off_layers_m().iter();
        let all = all.chain(self.landing_layers_m()).chain(layers_m.iter());
        all.copied().fold(0.0, f64::max)
    }

    /// How many ends of drones' ways to and from the ground others must fly over below them: whoever takes off or
    /// lands there relies on the others' having been told at the same time.
    #[must_use]
    pub fn exposed(&self) -> usize {
        let ground = self.ground.iter();
        self.landing.arranged.stack.exposed
            + ground.map(|it| it.arranged.stack.exposed).sum::<usize>()
    }
}

#[cfg(test)]
mod tests;
