mod nearby;

use muster_machines::formation::Separation;
use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;
use nalgebra::Vector3;

use self::nearby::Nearby;
use super::Violation;
use muster_runtime::text::rounded_down;
use muster_runtime::vehicle::{Piece, Vehicle};

/// Rule 4: any two drones of which one flies are far enough apart over ground or in height, by closest approach along
/// their paths; nobody lands on one that is in its landing place already. An aircraft that fell is left out from then on,
/// and one on the ground anywhere else: one that has not taken off, and one that came down nobody knows where.
///
/// A pair is looked at whenever the path of one of the two changes, over the time since one of theirs last did; pairs that
/// come neither too near nor nearer than any before, by the boxes that their paths fit into, are left out.
#[derive(Debug)]
pub(crate) struct SeparationChecker {
    separation: Separation,
    /// Until when each drone's path has been looked at.
    checked: Vec<Timestamp>,
    /// Who is on the ground, and not in its landing place.
    strayed: Vec<bool>,
    nearby: Nearby,
    others: Vec<u32>,
    closest_m: Option<f64>,
}

impl SeparationChecker {
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

    /// The closest that two flying drones came so far, in metres.
    pub(crate) const fn closest_m(&self) -> Option<f64> {
        self.closest_m
    }

    /// A drone takes off.
    pub(crate) fn takes_off(&mut self, drone: NodeId) {
        self.strayed[drone.0 as usize] = false;
    }

    /// A drone has come down elsewhere than in its landing place.
    pub(crate) fn strays(&mut self, drone: NodeId) {
        self.strayed[drone.0 as usize] = true;
    }

    /// A drone's path is from now on as its vehicle has it.
    pub(crate) fn path_begins(&mut self, now: Timestamp, drone: NodeId, vehicle: &Vehicle) {
        self.nearby.place(drone.0 as usize, vehicle.motion(), now);
    }

    /// Looks at all pairs with `drone`, whose path is about to change or end, up to `now`.
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
                let found = self.look_at(pair, since..now);
                violation = violation.or(found.map(|(at, horizontal_m, vertical_m)| Violation {
                    rule: 4,
                    at,
                    drones: vec![drone, NodeId(u32::try_from(other).unwrap_or(u32::MAX))],
                    what: format!(
                        "drones {drone} and {other} are {} m apart over ground and {} m in height",
                        rounded_down(horizontal_m, 2),
                        rounded_down(vertical_m, 2)
                    ),
                }));
            }
        }
        self.others = others;
        self.checked[index] = now;
        violation
    }

    fn look_at(
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

/// How two drones move relative to each other, both under constant acceleration.
#[derive(Debug, Clone, Copy)]
struct Approach {
    from: Vector3<f64>,
    velocity: Vector3<f64>,
    acceleration: Vector3<f64>,
    duration_s: f64,
}

/// How finely the instant of a closest approach is found, in halvings of the time looked at: a run of a day to a
/// hundredth of a microsecond.
const HALVINGS: usize = 44;

impl Approach {
    /// Of two pieces, the second of which lies within the first.
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

    /// How near they can come at most, cheaply: never more than they do.
    fn lower_bound_m(&self) -> f64 {
        let travelled = self.velocity.norm() * self.duration_s
            + self.acceleration.norm() * self.duration_s * self.duration_s / 2.0;
        self.from.norm() - travelled
    }

    /// The closest that they come, if that is less than `limit_m`.
    fn closest_below(&self, limit_m: f64) -> Option<f64> {
        if self.lower_bound_m() >= limit_m {
            return None;
        }
        let whole = (0.0, self.duration_s);
        let t = self.closest_within(whole, Vector3::new(1.0, 1.0, 1.0));
        Some(self.at(t).norm()).filter(|distance_m| *distance_m < limit_m)
    }

    /// When both distances are too small at once, if they ever are.
    fn violates(&self, separation: Separation) -> Option<f64> {
        let too_near_m = separation.horizontal_m + separation.vertical_m;
        if self.lower_bound_m() >= too_near_m {
            return None;
        }
        let vertical_m = separation.vertical_m;
        // Between these the difference in height does not cross the minimum.
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
            (self.at(t).xy().norm() < separation.horizontal_m).then_some(t)
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

    /// The instant of the smallest distance, counting the axes that `axes` has ones for.
    ///
    /// The squared distance is a polynomial of degree four; where its slope, of degree three, turns is known in
    /// closed form, so that between those instants each of its zeros is found by halving.
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

/// The real roots; NaN for one that is not there.
fn quadratic_roots(a: f64, b: f64, c: f64) -> [f64; 2] {
    if a == 0.0 {
        return [-c / b, f64::NAN];
    }
    let root = (b * b - 4.0 * a * c).sqrt();
    [-1.0, 1.0].map(|sign| (-b + sign * root) / (2.0 * a))
}

#[cfg(test)]
mod tests;
