//! A sonar: the nearest thing in its cone answers, and often enough it doesn't.

use std::f64::consts::{FRAC_PI_2, PI};

use rand_chacha::ChaCha8Rng;

use super::SOUND_MPS;
use crate::frames::{MapPose, MapXy, wrapped_rad};
use crate::map::Map;
use crate::random::{normal, uniform};
use crate::reading::{Echo, Mounting};

/// Rays that stand for a cone: 4 cm apart at 1 m for 30°.
const RAYS: usize = 13;
/// A smooth wall reflects away what meets it at more than this from its normal, radians: 25°. A corner sends it back.
const SPECULAR_MAX_RAD: f64 = 0.44;
/// Half the distance between the places that tell a wall's direction, metres.
const NORMAL_M: f64 = 0.15;

/// What a surface does to sound.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reflector {
    /// It sends sound back in all directions: furniture, plaster.
    Rough,
    /// A mirror: glass, tiles.
    Specular,
    /// It swallows most: curtains, sofas. It answers from a third of the range.
    Absorbing,
}

/// What the surface at a place of the map is.
pub type Surfaces<'a> = &'a dyn Fn(MapXy) -> Reflector;

/// Something round that is not on the map and answers from all sides: a person.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Disc {
    /// Its middle.
    pub at: MapXy,
    /// Metres.
    pub radius_m: f64,
}

/// What sonars are in.
#[derive(Clone, Copy)]
pub struct Room<'a> {
    /// Walls and furniture.
    pub map: &'a Map,
    /// What these do to sound.
    pub surfaces: Surfaces<'a>,
    /// People. They answer, but cast no echo of another sonar's ping.
    pub discs: &'a [Disc],
}

/// A sonar's faults.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SonarModel {
    /// Standard deviation of a range, metres. The indoor thesis: ±1 cm.
    pub sigma_m: f64,
    /// Share of echoes that are lost.
    pub lost: f64,
}

impl Default for SonarModel {
    fn default() -> Self {
        Self {
            sigma_m: 0.01,
            lost: 0.02,
        }
    }
}

/// A ping that is in the air.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ping {
    /// Where the sonar that sent it is on the map.
    pub from: MapPose,
    /// Its mounting, of which the axis is in `from` already.
    pub mounting: Mounting,
    /// When it was sent before the listener began to listen, seconds; negative for later.
    pub earlier_s: f64,
}

impl SonarModel {
    /// What a sonar hears that listens since it fired itself, among others' pings.
    pub fn measure(
        &self,
        room: Room<'_>,
        drone: MapPose,
        mounting: &Mounting,
        others: &[Ping],
        rng: &mut ChaCha8Rng,
    ) -> Echo {
        let listener = on_map(drone, mounting);
        let discs = room.discs.iter();
        let discs = discs.filter_map(|disc| disc_m(room.map, listener, mounting, disc));
        let wall = nearest(room.map, room.surfaces, listener, mounting);
        let own_m = discs.chain(wall).min_by(f64::total_cmp);
        let own_m = own_m.filter(|_| uniform(rng) >= self.lost);
        let noise_m = self.sigma_m * normal(rng);
        let heard = others
            .iter()
            .filter_map(|ping| stray(room.map, room.surfaces, listener, mounting, ping));
        let first_m = heard.chain(own_m).min_by(f64::total_cmp);
        match first_m.map(|range_m| range_m + noise_m) {
            Some(range_m) if range_m <= mounting.range_max_m => {
                Echo::At(range_m.max(mounting.range_min_m))
            }
            _ => Echo::Silence,
        }
    }
}

/// A sensor's place and axis on the map.
fn on_map(drone: MapPose, mounting: &Mounting) -> MapPose {
    let at = drone.place(mounting.at);
    MapPose::new(at.x_m, at.y_m, drone.heading_rad + mounting.bearing_rad)
}

/// The range of the nearest thing in a cone that answers.
fn nearest(map: &Map, surfaces: Surfaces<'_>, sonar: MapPose, mounting: &Mounting) -> Option<f64> {
    let ranges = rays(sonar, mounting.aperture_rad).filter_map(|angle_rad| {
        let range_m = map.cast(sonar.at, angle_rad, mounting.range_max_m)?;
        let hit = sonar.at.towards(angle_rad, range_m);
        let answers = match surfaces(hit) {
            Reflector::Rough => true,
            Reflector::Absorbing => range_m <= mounting.range_max_m / 3.0,
            Reflector::Specular => incidence_rad(map, hit, angle_rad) <= SPECULAR_MAX_RAD,
        };
        answers.then_some(range_m)
    });
    ranges.min_by(f64::total_cmp)
}

/// Range of a disc in a cone; `None` if no part of it is in the cone and in range, or a wall is between.
fn disc_m(map: &Map, sonar: MapPose, mounting: &Mounting, disc: &Disc) -> Option<f64> {
    let centre_m = sonar.at.distance_m(disc.at);
    let half_rad = mounting.aperture_rad / 2.0;
    let off_rad = wrapped_rad(sonar.at.bearing_rad(disc.at) - sonar.heading_rad);
    // The direction in the cone that is nearest to the middle of the disc.
    let ray_rad = off_rad.clamp(-half_rad, half_rad);
    let miss_rad = (off_rad - ray_rad).abs();
    let across_m = centre_m * libm::sin(miss_rad.min(FRAC_PI_2));
    if across_m >= disc.radius_m || miss_rad >= FRAC_PI_2 {
        return None;
    }
    let chord_m = libm::sqrt(disc.radius_m * disc.radius_m - across_m * across_m);
    let range_m = (centre_m * libm::cos(miss_rad) - chord_m).max(0.0);
    let wall = map.cast(sonar.at, sonar.heading_rad + ray_rad, range_m);
    (range_m <= mounting.range_max_m && wall.is_none()).then_some(range_m)
}

/// Half of the way of another sonar's ping that a wall, or two, send into this one's cone, as this one would take it for a
/// range; `None` if it isn't heard while this one listens.
fn stray(
    map: &Map,
    surfaces: Surfaces<'_>,
    listener: MapPose,
    mounting: &Mounting,
    ping: &Ping,
) -> Option<f64> {
    let reach_m = mounting.range_max_m;
    let heard = rays(ping.from, ping.mounting.aperture_rad).filter_map(|angle_rad| {
        let first_m = map.cast(ping.from.at, angle_rad, reach_m)?;
        // A bit before the wall, so that the next ray starts in the open.
        let hit = ping.from.at.towards(angle_rad, first_m - 0.01);
        if surfaces(hit) == Reflector::Absorbing {
            return None;
        }
        let direct = back(map, hit, first_m, listener, mounting);
        let mirrored_rad = mirrored(map, hit, angle_rad);
        let twice = map.cast(hit, mirrored_rad, reach_m).and_then(|second_m| {
            let second = hit.towards(mirrored_rad, second_m - 0.01);
            back(map, second, first_m + second_m, listener, mounting)
        });
        let distance_m = direct.into_iter().chain(twice).min_by(f64::total_cmp)?;
        // Sound that is weaker than its own farthest echo is not heard.
        if distance_m > 2.0 * reach_m {
            return None;
        }
        let range_m = (distance_m - ping.earlier_s * SOUND_MPS) / 2.0;
        (range_m >= mounting.range_min_m).then_some(range_m)
    });
    heard.min_by(f64::total_cmp)
}

/// Length of the path of sound to a listener that sees its last reflection; `None` if it is out of its cone or behind a wall.
fn back(
    map: &Map,
    hit: MapXy,
    so_far_m: f64,
    listener: MapPose,
    mounting: &Mounting,
) -> Option<f64> {
    let bearing_rad = listener.at.bearing_rad(hit);
    let distance_m = listener.at.distance_m(hit);
    let off_rad = wrapped_rad(bearing_rad - listener.heading_rad).abs();
    let is_seen = off_rad <= mounting.aperture_rad / 2.0
        && map
            .cast(listener.at, bearing_rad, distance_m - 0.02)
            .is_none();
    is_seen.then_some(so_far_m + distance_m)
}

fn rays(sonar: MapPose, aperture_rad: f64) -> impl Iterator<Item = f64> {
    (0..RAYS).map(move |ray| {
        let share = ray as f64 / (RAYS - 1) as f64 - 0.5;
        sonar.heading_rad + share * aperture_rad
    })
}

/// The direction from which a wall looks at the room, by the growth of the distance to it.
fn normal_rad(map: &Map, hit: MapXy) -> f64 {
    let at = |x_m: f64, y_m: f64| {
        let distance_m = map.distance_m(MapXy::new(hit.x_m + x_m, hit.y_m + y_m));
        if distance_m.is_finite() {
            distance_m
        } else {
            0.0
        }
    };
    let dx = at(NORMAL_M, 0.0) - at(-NORMAL_M, 0.0);
    let dy = at(0.0, NORMAL_M) - at(0.0, -NORMAL_M);
    libm::atan2(dy, dx)
}

/// The angle between a ray and the normal of what it hits.
fn incidence_rad(map: &Map, hit: MapXy, angle_rad: f64) -> f64 {
    wrapped_rad(normal_rad(map, hit) - angle_rad - PI).abs()
}

/// Where a mirror sends a ray.
fn mirrored(map: &Map, hit: MapXy, angle_rad: f64) -> f64 {
    wrapped_rad(2.0 * normal_rad(map, hit) - angle_rad - PI)
}
