//! Sonars of the world: what they hear, and how they fail.

use muster_indoor::frames::{MapPose, MapXy, wrapped_rad};
use muster_indoor::map::Map;
use muster_indoor::reading::{Echo, Mounting};

use crate::noise::Noise;
use crate::people::{Person, RADIUS_M};

/// Rays that stand for a cone of 30°: 5 cm apart at 1 m.
const RAYS: i32 = 11;
/// Standard deviation of an echo, in metres (indoor thesis: ±1 cm).
const SPREAD_M: f64 = 0.01;
/// Share of echoes that get lost.
const LOST: f64 = 0.01;
/// What a stuck sonar reports, in metres.
const STUCK_M: f64 = 0.05;

/// How a sonar fails.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Failing {
    /// It doesn't answer.
    Dead,
    /// It reports 5 cm.
    Stuck,
    /// It looks at glass: nothing comes back.
    Glass,
}

impl Failing {
    /// All kinds.
    pub const ALL: [Self; 3] = [Self::Dead, Self::Stuck, Self::Glass];
}

/// What a sonar hears; `None` if it doesn't answer. `noise` is `None` in a world without noise.
pub(crate) fn heard(
    map: &Map,
    people: &[Person],
    pose: MapPose,
    mounting: &Mounting,
    failing: Option<Failing>,
    noise: Option<&mut Noise>,
) -> Option<Echo> {
    match failing {
        Some(Failing::Dead) => return None,
        Some(Failing::Stuck) => return Some(Echo::At(STUCK_M)),
        Some(Failing::Glass) => return Some(Echo::Silence),
        None => {}
    }
    let at = pose.place(mounting.at);
    let axis_rad = pose.heading_rad + mounting.bearing_rad;
    let wall_m = (0..RAYS)
        .filter_map(|ray| {
            let share = f64::from(ray) / f64::from(RAYS - 1) - 0.5;
            map.cast(
                at,
                axis_rad + share * mounting.aperture_rad,
                mounting.range_max_m,
            )
        })
        .fold(f64::INFINITY, f64::min);
    let nearest_m = people
        .iter()
        .filter_map(|person| person_m(map, at, axis_rad, mounting, person))
        .fold(wall_m, f64::min);
    let Some(noise) = noise else {
        return Some(echo(nearest_m, mounting));
    };
    let (is_lost, error_m) = (noise.uniform() < LOST, SPREAD_M * noise.normal());
    Some(if is_lost {
        Echo::Silence
    } else {
        echo(nearest_m + error_m, mounting)
    })
}

fn echo(range_m: f64, mounting: &Mounting) -> Echo {
    if range_m > mounting.range_max_m {
        Echo::Silence
    } else {
        Echo::At(range_m.max(mounting.range_min_m))
    }
}

/// Distance of a person in a cone, in metres; `None` if no part is in the cone, or a wall is between.
fn person_m(
    map: &Map,
    at: MapXy,
    axis_rad: f64,
    mounting: &Mounting,
    person: &Person,
) -> Option<f64> {
    let centre_m = at.distance_m(person.at);
    let bearing_rad = at.bearing_rad(person.at);
    let half_rad = mounting.aperture_rad / 2.0;
    let off_rad = wrapped_rad(bearing_rad - axis_rad);
    // The direction in the cone that is nearest to the person's middle.
    let ray_rad = off_rad.clamp(-half_rad, half_rad);
    let miss_rad = off_rad - ray_rad;
    let across_m = centre_m * libm::sin(miss_rad.abs().min(std::f64::consts::FRAC_PI_2));
    if across_m >= RADIUS_M || miss_rad.abs() >= std::f64::consts::FRAC_PI_2 {
        return None;
    }
    let range_m =
        centre_m * libm::cos(miss_rad) - libm::sqrt(RADIUS_M * RADIUS_M - across_m * across_m);
    let range_m = range_m.max(0.0);
    let free = map.cast(at, axis_rad + ray_rad, range_m);
    (range_m <= mounting.range_max_m && free.is_none()).then_some(range_m)
}
