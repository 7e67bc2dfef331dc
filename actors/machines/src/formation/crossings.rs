use nalgebra::Vector2;

use crate::geometry::Ned;

/// The way between a drone's place on the ground and its slot, as seen from above; it is flown either way.
#[derive(Debug, Clone, Copy)]
pub(super) struct Path {
    pub(super) ground: Vector2<f64>,
    pub(super) slot: Vector2<f64>,
}

/// Two ways that come too close to be flown at one height.
#[derive(Debug, Clone, Copy)]
pub(super) struct Crossing {
    /// Whose they are.
    pub(super) drones: [usize; 2],
    /// What of the other's each leads over.
    pub(super) over: [Over; 2],
    /// Whether the place on the ground of each is below the other's slot.
    pub(super) below: [bool; 2],
}

impl Crossing {
    fn index_of(&self, drone: usize) -> usize {
        usize::from(self.drones[1] == drone)
    }

    /// The other one of the two.
    pub(super) fn other(&self, drone: usize) -> usize {
        self.drones[1 - self.index_of(drone)]
    }

    /// What of the other's the way of `drone` leads over.
    pub(super) fn over_of(&self, drone: usize) -> Over {
        self.over[self.index_of(drone)]
    }

    /// Whether the place of `drone` on the ground is below the other's slot.
    pub(super) fn is_below(&self, drone: usize) -> bool {
        self.below[self.index_of(drone)]
    }
}

/// Whether a way leads over an end of another, where that other's drone climbs and descends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Over {
    /// Over neither.
    Neither,
    /// Over its place on the ground.
    Ground,
    /// Over its slot, and perhaps its place as well.
    Slot,
}

/// The ways of all drones, drone 0 first.
pub(super) fn paths(ground: &[Ned], slots: &[Ned]) -> Vec<Path> {
    let ends = ground.iter().zip(slots);
    ends.map(|(ground, slot)| Path {
        ground: ground.0.xy(),
        slot: slot.0.xy(),
    })
    .collect()
}

/// All pairs of ways that come closer than `near_m`. Looks at pairs only that overlap along the axis on which they
/// are spread the most.
pub(super) fn crossings(paths: &[Path], near_m: f64) -> Vec<Crossing> {
    let boxes: Vec<_> = paths
        .iter()
        .map(|path| (path.ground.inf(&path.slot), path.ground.sup(&path.slot)))
        .collect();
    let mut found = Vec::new();
    sweep(&boxes, near_m, |a, b| {
        let (one, other) = (paths[a], paths[b]);
        let over = [over(one, other, near_m), over(other, one, near_m)];
        if over != [Over::Neither; 2] || cross(one, other) {
            let is_below = |lower: Path, upper: Path| (lower.ground - upper.slot).norm() < near_m;
            found.push(Crossing {
                drones: [a, b],
                over,
                below: [is_below(one, other), is_below(other, one)],
            });
        }
    });
    found
}

/// All pairs of slots of which one is passed within `near_m` by the other on one of these legs, flown alone.
pub(super) fn passings(slots: &[Ned], legs: &[Vector2<f64>], near_m: f64) -> Vec<Crossing> {
    let longest_m = legs.iter().map(Vector2::norm).fold(0.0, f64::max);
    let boxes: Vec<_> = slots
        .iter()
        .map(|slot| (slot.0.xy(), slot.0.xy()))
        .collect();
    let mut found = Vec::new();
    sweep(&boxes, near_m + longest_m, |a, b| {
        let apart = boxes[b].0 - boxes[a].0;
        if apart.norm() < near_m + longest_m
            && legs
                .iter()
                .any(|leg| to_point_m((-leg, *leg), apart) < near_m)
        {
            found.push(Crossing {
                drones: [a, b],
                over: [Over::Neither; 2],
                below: [false; 2],
            });
        }
    });
    found
}

/// How far apart the nearest two places are over ground, in metres; nothing for fewer than two.
pub(super) fn nearest_pair_m(places: &[Ned]) -> Option<f64> {
    let boxes: Vec<_> = places
        .iter()
        .map(|place| (place.0.xy(), place.0.xy()))
        .collect();
    // Consecutive places of any order give a first bound, so that the sweep has little to look at.
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

/// Calls `look` with each pair, the smaller index first, whose boxes are within `near_m` along both axes.
fn sweep(boxes: &[(Vector2<f64>, Vector2<f64>)], near_m: f64, mut look: impl FnMut(usize, usize)) {
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
        for b in others.take_while(|b| boxes[*b].0[along] <= high[along] + near_m) {
            let other = boxes[b];
            if other.0[across] <= high[across] + near_m && low[across] <= other.1[across] + near_m {
                look(a.min(b), a.max(b));
            }
        }
    }
}

fn over(path: Path, other: Path, near_m: f64) -> Over {
    let path = (path.ground, path.slot);
    if to_point_m(path, other.slot) < near_m {
        Over::Slot
    } else if to_point_m(path, other.ground) < near_m {
        Over::Ground
    } else {
        Over::Neither
    }
}

fn cross(a: Path, b: Path) -> bool {
    let side = |of: Path, point: Vector2<f64>| (of.slot - of.ground).perp(&(point - of.ground));
    side(a, b.ground) * side(a, b.slot) < 0.0 && side(b, a.ground) * side(b, a.slot) < 0.0
}

/// How far a point is from a segment at the closest, in metres.
pub(crate) fn to_point_m(segment: (Vector2<f64>, Vector2<f64>), point: Vector2<f64>) -> f64 {
    let along = segment.1 - segment.0;
    let length_squared = along.norm_squared();
    let part = if length_squared > 0.0 {
        ((point - segment.0).dot(&along) / length_squared).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (segment.0 + along * part - point).norm()
}
