mod nearby;

use muster_machines::formation::Separation;
use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;
use nalgebra::Vector3;

use self::nearby::Nearby;
use super::Violation;
use muster_machines::motion::Piece;
use muster_runtime::text::rounded_down;
use muster_runtime::vehicle::Vehicle;

/// Rule 4: any two drones, of which at least one flies, keep the minimum separation over ground or in height. It is checked
/// by the closest approach along their paths, a drone in its landing place included. Left out are an aircraft that fell, and
/// one on the ground elsewhere: before take-off, or after a landing outside its landing place.
///
/// A pair is checked whenever the path of one of the two changes, over the time since its last check. Pairs are left out
/// whose bounding boxes show that they come neither too near nor nearer than any before.
#[derive(Debug)]
pub(crate) struct SeparationChecker {
    separation: Separation,
    /// Up to when each drone's path has been checked.
    checked: Vec<Timestamp>,
    /// Drones on the ground outside their landing places.
    strayed: Vec<bool>,
    nearby: Nearby,
    /// Memory for the drones near one, used again.
    others: Vec<u32>,
    closest_m: Option<f64>,
}

impl SeparationChecker {
    /// Vehicles at the start of a run.
    pub(crate) fn new(separation: Separation, vehicles: &[Vehicle]) -> Self {
        let mut nearby = Nearby::new(vehicles.len());
        for (drone, vehicle) in vehicles.iter().enumerate() {
            nearby.place(drone, vehicle.motion(), Timestamp::ZERO);
        }
        Self {
            separation,
            checked: vec![Timestamp::ZERO; vehicles.len()],
            // A relay may stand on a mast.
            strayed: (vehicles.iter())
                .map(|it| it.motion().position(Timestamp::ZERO).altitude_m() <= 0.0)
                .collect(),
            nearby,
            others: Vec::new(),
            closest_m: None,
        }
    }

    /// The closest approach of two drones so far, in metres.
    pub(crate) const fn closest_m(&self) -> Option<f64> {
        self.closest_m
    }

    /// A drone takes off.
    pub(crate) fn takes_off(&mut self, drone: NodeId) {
        self.strayed[drone.0 as usize] = false;
    }

    /// A drone has landed outside its landing place.
    pub(crate) fn strays(&mut self, drone: NodeId) {
        self.strayed[drone.0 as usize] = true;
    }

    /// A drone's path has changed to that of its vehicle.
    pub(crate) fn path_begins(&mut self, now: Timestamp, drone: NodeId, vehicle: &Vehicle) {
        self.nearby.place(drone.0 as usize, vehicle.motion(), now);
    }

    /// Checks all pairs with `drone` up to `now`, as its path is about to change or end.
    pub(crate) fn path_ends(
        &mut self,
        now: Timestamp,
        drone: NodeId,
        vehicles: &[Vehicle],
    ) -> Option<Violation> {
        let index = drone.0 as usize;
        if self.checked[index] >= now {
            return None;
        }
        let mut violation = None;
        let too_near_m = self.separation.horizontal_m.max(self.separation.vertical_m);
        let near_m = self.closest_m.unwrap_or(f64::INFINITY).max(too_near_m);
        let mut others = std::mem::take(&mut self.others);
        self.nearby.of(index, near_m, &mut others);
        for other in others.iter().map(|other| *other as usize) {
            let since = self.checked[index].max(self.checked[other]);
            let pair = (&vehicles[index], &vehicles[other]);
            let flies = pair.0.is_armed() || pair.1.is_armed();
            let strayed = self.strayed[index] || self.strayed[other];
            if since < now && flies && !strayed && !pair.0.is_wreck() && !pair.1.is_wreck() {
                let found = self.check_pair(pair, since..now);
                violation = violation.or(found.map(|(at, horizontal_m, vertical_m)| Violation {
                    rule: 4,
                    at,
                    drones: vec![drone, NodeId(u32::try_from(other).unwrap_or(u32::MAX))],
                    what: format!(
                        "drones {drone} and {other} are {} m apart horizontally and {} m vertically; {} m or {} m are needed",
                        rounded_down(horizontal_m, 2),
                        rounded_down(vertical_m, 2),
                        self.separation.horizontal_m,
                        self.separation.vertical_m
                    ),
                }));
            }
        }
        self.others = others;
        self.checked[index] = now;
        violation
    }

    /// Checks a pair over a span of time. Returns the first violation: its time, and the horizontal and vertical distance
    /// in metres.
    fn check_pair(
        &mut self,
        (a, b): (&Vehicle, &Vehicle),
        span: std::ops::Range<Timestamp>,
    ) -> Option<(Timestamp, f64, f64)> {
        let mut violation = None;
        for piece_a in a.motion().within(span.clone()) {
            for piece_b in b.motion().within(piece_a.start..piece_a.end) {
                let approach = Approach::between(&piece_a, &piece_b);
                let closest_m = self.closest_m.unwrap_or(f64::INFINITY);
                if let Some(distance_m) = approach.closest_below(closest_m) {
                    self.closest_m = Some(distance_m);
                }
                if violation.is_none() {
                    violation = approach.violates(self.separation).map(|t| {
                        let apart = approach.at(t);
                        let at = piece_b.start + std::time::Duration::from_secs_f64(t);
                        (at, apart.xy().norm(), apart.z.abs())
                    });
                }
            }
        }
        violation
    }
}

/// The relative motion of two drones, both under constant acceleration.
#[derive(Debug, Clone, Copy)]
struct Approach {
    from: Vector3<f64>,
    velocity: Vector3<f64>,
    acceleration: Vector3<f64>,
    duration_s: f64,
}

/// Halvings of the time span to find the instant of a closest approach: 0.01 µs for a run of a day.
const HALVINGS: usize = 44;

impl Approach {
    /// For two pieces of motion, the second of which lies within the first.
    fn between(a: &Piece, b: &Piece) -> Self {
        let start = b.start;
        Self {
            from: b.position(start) - a.position(start),
            velocity: b.velocity(start) - a.velocity(start),
            acceleration: b.acceleration() - a.acceleration(),
            duration_s: b.end.since(start).as_secs_f64(),
        }
    }

    fn at(&self, t: f64) -> Vector3<f64> {
        self.from + self.velocity * t + self.acceleration * (t * t / 2.0)
    }

    /// A cheap lower bound of their distance, in metres.
    fn lower_bound_m(&self) -> f64 {
        let travelled = self.velocity.norm() * self.duration_s
            + self.acceleration.norm() * self.duration_s * self.duration_s / 2.0;
        self.from.norm() - travelled
    }

    /// Their closest distance, if it is less than `limit_m`.
    fn closest_below(&self, limit_m: f64) -> Option<f64> {
        if self.lower_bound_m() >= limit_m {
            return None;
        }
        let whole = (0.0, self.duration_s);
        let t = self.closest_within(whole, Vector3::new(1.0, 1.0, 1.0));
        Some(self.at(t).norm()).filter(|distance_m| *distance_m < limit_m)
    }

    /// When both distances are below the minimum, in seconds from the start.
    fn violates(&self, separation: Separation) -> Option<f64> {
        let too_near_m = separation.horizontal_m + separation.vertical_m;
        if self.lower_bound_m() >= too_near_m {
            return None;
        }
        let vertical_m = separation.vertical_m;
        // Between these instants the vertical distance does not cross the minimum.
        let mut cuts = vec![0.0, self.duration_s];
        for level in [vertical_m, -vertical_m] {
            cuts.extend(self.when_height_is(level));
        }
        cuts.retain(|t| (0.0..=self.duration_s).contains(t));
        cuts.sort_by(f64::total_cmp);
        cuts.windows(2).find_map(|cut| {
            let middle = f64::midpoint(cut[0], cut[1]);
            if self.at(middle).z.abs() >= vertical_m {
                return None;
            }
            let t = self.closest_within((cut[0], cut[1]), Vector3::new(1.0, 1.0, 0.0));
            if self.at(t).xy().norm() >= separation.horizontal_m {
                return None;
            }
            // At a cut the vertical distance is the minimum. The next instant with both below is the one to show.
            let later = (0..=20)
                .rev()
                .map(|halvings| t + (middle - t) / f64::from(1 << halvings));
            let is_violated = |t: &f64| {
                let apart = self.at(*t);
                apart.z.abs() < vertical_m && apart.xy().norm() < separation.horizontal_m
            };
            std::iter::once(t)
                .chain(later)
                .find(is_violated)
                .or(Some(t))
        })
    }

    fn when_height_is(&self, level: f64) -> impl Iterator<Item = f64> {
        let roots = quadratic_roots(
            self.acceleration.z / 2.0,
            self.velocity.z,
            self.from.z - level,
        );
        roots.into_iter().filter(|t| t.is_finite())
    }

    /// The instant of the smallest distance along the axes that are 1 in `axes`.
    ///
    /// The squared distance is a polynomial of degree 4. The extrema of its slope, of degree 3, are known in closed form.
    /// Between them each zero of the slope is found by bisection.
    fn closest_within(&self, (start, end): (f64, f64), axes: Vector3<f64>) -> f64 {
        let [p, v, a] =
            [self.from, self.velocity, self.acceleration].map(|it| it.component_mul(&axes));
        // Half the slope: a²/2 t³ + 3/2 a·v t² + (v² + a·p) t + p·v.
        let cubic = [
            a.norm_squared() / 2.0,
            a.dot(&v) * 1.5,
            v.norm_squared() + a.dot(&p),
            p.dot(&v),
        ];
        let slope = |t: f64| ((cubic[0] * t + cubic[1]) * t + cubic[2]) * t + cubic[3];
        let turns = quadratic_roots(3.0 * cubic[0], 2.0 * cubic[1], cubic[2]);
        let [first, second] = turns.map(|t| if t > start && t < end { t } else { end });
        let bounds = [start, first.min(second), first.max(second), end];
        let distance = |t: f64| (p + v * t + a * (t * t / 2.0)).norm_squared();
        let mut closest = if distance(end) < distance(start) {
            end
        } else {
            start
        };
        for pair in bounds.windows(2) {
            let (mut low, mut high) = (pair[0], pair[1]);
            if slope(low) < 0.0 && slope(high) > 0.0 {
                for _ in 0..HALVINGS {
                    let middle = f64::midpoint(low, high);
                    if slope(middle) < 0.0 {
                        low = middle;
                    } else {
                        high = middle;
                    }
                }
                if distance(low) < distance(closest) {
                    closest = low;
                }
            }
        }
        closest
    }
}

/// The real roots; NaN for each that does not exist.
fn quadratic_roots(a: f64, b: f64, c: f64) -> [f64; 2] {
    if a == 0.0 {
        return [-c / b, f64::NAN];
    }
    let root = (b * b - 4.0 * a * c).sqrt();
    [-1.0, 1.0].map(|sign| (-b + sign * root) / (2.0 * a))
}

#[cfg(test)]
mod tests;
