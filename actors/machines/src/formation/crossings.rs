use nalgebra::Vector2;

use crate::geometry::Ned;

/// Horizontal track between a drone's place on the ground and its slot; flown in either direction.
#[derive(Debug, Clone, Copy)]
pub(super) struct GroundTrack {
    pub(super) ground: Vector2<f64>,
    pub(super) slot: Vector2<f64>,
}

/// Two tracks that come too close to be flown at the same height.
#[derive(Debug, Clone, Copy)]
pub(super) struct Crossing {
    /// The two drones.
    pub(super) drones: [usize; 2],
    /// Which end of the other track each track leads over.
    pub(super) overflights: [Overflight; 2],
    /// Whether the place on the ground of each drone is below the other's slot.
    pub(super) below: [bool; 2],
}

impl Crossing {
    fn index_of(&self, drone: usize) -> usize {
        usize::from(self.drones[1] == drone)
    }

    /// The other drone.
    pub(super) fn other(&self, drone: usize) -> usize {
        self.drones[1 - self.index_of(drone)]
    }

    /// Which end of the other track the track of `drone` leads over.
    pub(super) fn overflight_of(&self, drone: usize) -> Overflight {
        self.overflights[self.index_of(drone)]
    }

    /// Whether the place of `drone` on the ground is below the other's slot.
    pub(super) fn is_below(&self, drone: usize) -> bool {
        self.below[self.index_of(drone)]
    }
}

/// Which end of another track, where the other drone climbs and descends, a track leads over.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Overflight {
    /// No end.
    None,
    /// The place on the ground.
    Ground,
    /// The slot, and possibly the place on the ground too.
    Slot,
}

/// Tracks of all drones, drone 0 first.
pub(super) fn ground_tracks(ground: &[Ned], slots: &[Ned]) -> Vec<GroundTrack> {
    let ends = ground.iter().zip(slots);
    ends.map(|(ground, slot)| GroundTrack {
        ground: ground.0.xy(),
        slot: slot.0.xy(),
    })
    .collect()
}

/// All pairs of tracks closer than `min_m`. Compares only pairs that overlap along the axis of the widest spread.
pub(super) fn crossings(tracks: &[GroundTrack], min_m: f64) -> Vec<Crossing> {
    let boxes: Vec<_> = tracks
        .iter()
        .map(|path| (path.ground.inf(&path.slot), path.ground.sup(&path.slot)))
        .collect();
    let mut found = Vec::new();
    sweep(&boxes, min_m, |a, b| {
        let (one, other) = (tracks[a], tracks[b]);
        let overflights = [overflight(one, other, min_m), overflight(other, one, min_m)];
        if overflights != [Overflight::None; 2] || cross(one, other) {
            let is_below =
                |lower: GroundTrack, upper: GroundTrack| (lower.ground - upper.slot).norm() < min_m;
            found.push(Crossing {
                drones: [a, b],
                overflights,
                below: [is_below(one, other), is_below(other, one)],
            });
        }
    });
    found
}

/// All pairs of slots with one passed within `min_m` by the other's drone flying one of these legs alone.
pub(super) fn slot_passes(slots: &[Ned], legs: &[Vector2<f64>], min_m: f64) -> Vec<Crossing> {
    let longest_m = legs.iter().map(Vector2::norm).fold(0.0, f64::max);
    let boxes: Vec<_> = slots
        .iter()
        .map(|slot| (slot.0.xy(), slot.0.xy()))
        .collect();
    let mut found = Vec::new();
    sweep(&boxes, min_m + longest_m, |a, b| {
        let apart = boxes[b].0 - boxes[a].0;
        if apart.norm() < min_m + longest_m
            && legs
                .iter()
                .any(|leg| segment_to_point_m((-leg, *leg), apart) < min_m)
        {
            found.push(Crossing {
                drones: [a, b],
                overflights: [Overflight::None; 2],
                below: [false; 2],
            });
        }
    });
    found
}

/// All pairs of places within `max_m` metres of each other over ground, the smaller index first.
pub(super) fn pairs_within(places: &[Ned], max_m: f64) -> Vec<[usize; 2]> {
    let boxes: Vec<_> = places
        .iter()
        .map(|place| (place.0.xy(), place.0.xy()))
        .collect();
    let mut found = Vec::new();
    sweep(&boxes, max_m, |a, b| {
        if places[a].horizontal_distance_m(places[b]) <= max_m {
            found.push([a, b]);
        }
    });
    found
}

/// Smallest horizontal distance of two places, in metres; `None` for fewer than two.
pub(super) fn nearest_pair_m(places: &[Ned]) -> Option<f64> {
    let boxes: Vec<_> = places
        .iter()
        .map(|place| (place.0.xy(), place.0.xy()))
        .collect();
    // Consecutive places give a first bound, so the sweep has few pairs to compare.
    let bound_m = places
        .windows(2)
        .map(|pair| pair[0].horizontal_distance_m(pair[1]))
        .min_by(f64::total_cmp)?;
    let mut nearest_m = bound_m;
    sweep(&boxes, bound_m, |a, b| {
        nearest_m = nearest_m.min(places[a].horizontal_distance_m(places[b]));
    });
    Some(nearest_m)
}

/// Calls `visit` with each pair, the smaller index first, with boxes within `min_m` along both axes.
fn sweep(boxes: &[(Vector2<f64>, Vector2<f64>)], min_m: f64, mut visit: impl FnMut(usize, usize)) {
    let spread = |axis: usize| {
        let low = boxes.iter().map(|it| it.0[axis]);
        let (low, high) = low.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), at| {
            (low.min(at), high.max(at))
        });
        high - low
    };
    let (along, across) = if spread(0) > spread(1) {
        (0, 1)
    } else {
        (1, 0)
    };
    let mut order: Vec<usize> = (0..boxes.len()).collect();
    order.sort_by(|a, b| {
        boxes[*a].0[along]
            .total_cmp(&boxes[*b].0[along])
            .then(a.cmp(b))
    });
    for (position, a) in order.iter().copied().enumerate() {
        let (low, high) = boxes[a];
        let others = order[position + 1..].iter().copied();
        for b in others.take_while(|b| boxes[*b].0[along] <= high[along] + min_m) {
            let other = boxes[b];
            if other.0[across] <= high[across] + min_m && low[across] <= other.1[across] + min_m {
                visit(a.min(b), a.max(b));
            }
        }
    }
}

fn overflight(path: GroundTrack, other: GroundTrack, min_m: f64) -> Overflight {
    let path = (path.ground, path.slot);
    if segment_to_point_m(path, other.slot) < min_m {
        Overflight::Slot
    } else if segment_to_point_m(path, other.ground) < min_m {
        Overflight::Ground
    } else {
        Overflight::None
    }
}

fn cross(a: GroundTrack, b: GroundTrack) -> bool {
    let side =
        |of: GroundTrack, point: Vector2<f64>| (of.slot - of.ground).perp(&(point - of.ground));
    side(a, b.ground) * side(a, b.slot) < 0.0 && side(b, a.ground) * side(b, a.slot) < 0.0
}

/// Distance of a point from a segment, in metres.
pub(crate) fn segment_to_point_m(
    segment: (Vector2<f64>, Vector2<f64>),
    point: Vector2<f64>,
) -> f64 {
    let along = segment.1 - segment.0;
    let length_squared = along.norm_squared();
    let part = if length_squared > 0.0 {
        ((point - segment.0).dot(&along) / length_squared).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (segment.0 + along * part - point).norm()
}
