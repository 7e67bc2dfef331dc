use std::sync::{Arc, Mutex, PoisonError};

use nalgebra::Vector2;

use super::{Formation, Separation};
use crate::geometry::Ned;

/// What two layers are apart beyond the vertical minimum, in metres, so that rounding never matters.
const MARGIN_M: f64 = 0.5;

/// Altitude layers: slots whose swept paths come closer than the horizontal minimum get different ones.
///
/// Paths are compared when they may be flown under the same order, because a swarm goes on only once all its
/// members have arrived: the way from the ground to the slots, each leg, and the way from the slots to the landing
/// places. A slot in nobody's way stays in lockstep's own altitude; others get a layer above it, the lowest free.
/// Layers only go up: what the mission's author took for a safe height stays the lowest.
#[derive(Debug)]
pub struct Layers {
    separation: Separation,
    last: Mutex<Option<Answer>>,
}

/// The last mission that was asked for, and its layers.
#[derive(Debug)]
struct Answer {
    waypoints: Vec<Ned>,
    layers_m: Arc<[f64]>,
}

type Segment = (Vector2<f64>, Vector2<f64>);

impl Layers {
    pub(super) const fn new(separation: Separation) -> Self {
        Self {
            separation,
            last: Mutex::new(None),
        }
    }

    /// Each slot's layer, in metres above the mission. Costs a comparison for each pair of slots and each leg, once
    /// for a mission, however many drones ask.
    pub(super) fn of(
        &self,
        formation: &Formation,
        gathered: &[Ned],
        waypoints: &[Ned],
    ) -> Arc<[f64]> {
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(answer) = &*last
            && answer.waypoints == waypoints
        {
            return Arc::clone(&answer.layers_m);
        }
        let layers_m = self.work_out(formation, gathered, waypoints);
        *last = Some(Answer {
            waypoints: waypoints.to_vec(),
            layers_m: Arc::clone(&layers_m),
        });
        layers_m
    }

    fn work_out(&self, formation: &Formation, gathered: &[Ned], waypoints: &[Ned]) -> Arc<[f64]> {
        let slots = formation.slots();
        let (Some(first), Some(last)) = (waypoints.first(), waypoints.last()) else {
            return slots.iter().map(|_| 0.0).collect();
        };
        let legs: Vec<Vector2<f64>> = waypoints
            .windows(2)
            .map(|pair| flat(pair[1]) - flat(pair[0]))
            .collect();
        let meet = |a: usize, b: usize| {
            let take_off = |slot: usize| (flat(gathered[slot]), flat(*first + slots[slot]));
            let landing = |slot: usize| (flat(*last + slots[slot]), flat(*last + gathered[slot]));
            let on_leg =
                |slot: usize, leg: &Vector2<f64>| (flat(slots[slot]), flat(slots[slot]) + leg);
            self.are_close(take_off(a), take_off(b))
                || self.are_close(landing(a), landing(b))
                || legs
                    .iter()
                    .any(|leg| self.are_close(on_leg(a, leg), on_leg(b, leg)))
        };
        let mut layers: Vec<u32> = vec![0; slots.len()];
        for slot in 0..slots.len() {
            let in_the_way: Vec<usize> = (0..slots.len())
                .filter(|other| *other != slot && meet(slot, *other))
                .collect();
            if in_the_way.is_empty() {
                continue;
            }
            let is_taken = |layer: u32| in_the_way.iter().any(|other| layers[*other] == layer);
            layers[slot] = (1..)
                .find(|layer| !is_taken(*layer))
                .expect("there are fewer slots than numbers");
        }
        let pitch_m = self.separation.vertical_m + MARGIN_M;
        layers
            .into_iter()
            .map(|layer| f64::from(layer) * pitch_m)
            .collect()
    }

    fn are_close(&self, a: Segment, b: Segment) -> bool {
        distance_m(a, b) < self.separation.horizontal_m + MARGIN_M
    }
}

fn flat(place: Ned) -> Vector2<f64> {
    place.0.xy()
}

/// The smallest distance between two straight segments in the plane.
fn distance_m(a: Segment, b: Segment) -> f64 {
    if cross(a, b) {
        return 0.0;
    }
    to_point_m(a, b.0)
        .min(to_point_m(a, b.1))
        .min(to_point_m(b, a.0))
        .min(to_point_m(b, a.1))
}

fn cross(a: Segment, b: Segment) -> bool {
    let side = |of: Segment, point: Vector2<f64>| (of.1 - of.0).perp(&(point - of.0));
    side(a, b.0) * side(a, b.1) < 0.0 && side(b, a.0) * side(b, a.1) < 0.0
}

fn to_point_m(segment: Segment, point: Vector2<f64>) -> f64 {
    let along = segment.1 - segment.0;
    let length_squared = along.norm_squared();
    let part = if length_squared > 0.0 {
        ((point - segment.0).dot(&along) / length_squared).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (segment.0 + along * part - point).norm()
}
