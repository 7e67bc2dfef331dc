//! What a cone is expected to measure: the range to the nearest thing in it, from tables.

use std::f32::consts::TAU;

use super::config::Config;
use super::fast::{ROUND, exp, whole};
use super::field::Curve;
use super::particles::Poses;
use crate::frames::{BodyXy, MapXy};
use crate::map::{Map, State};

/// Directions of a table, 5.6° apart.
const DIRECTIONS: usize = 64;
/// Rays for each direction: at 4 m they are 20 cm apart.
const RAYS_PER_DIRECTION: usize = 2;
/// Finest grid of places, metres.
const PITCH_MIN_M: f64 = 0.1;
/// Most ranges of a table, a byte each.
const RANGES_MAX: usize = 32 << 20;
/// A direction in which nothing is in range.
const FREE: u8 = 255;
/// Where no drone can be: outside of the map and in walls.
const NOWHERE: u32 = 0;

/// For each place that is free and for each direction, the range of a cone in 254 steps.
#[derive(Debug, Clone)]
pub(super) struct Cones {
    /// Cells of the map along a place's edge.
    pitch: f32,
    columns: u32,
    rows: u32,
    /// The first of a place's ranges, in units of [`DIRECTIONS`].
    places: Vec<u32>,
    ranges: Vec<u8>,
    step_m: f64,
}

/// A cone's reading: where the sensor is, in cells from the drone's centre; its direction, and the likelihood of what it
/// measured for each range that may be expected.
pub(super) struct Cone {
    pub(super) at: (f32, f32),
    pub(super) bearing: f32,
    pub(super) curve: Curve,
}

impl Cones {
    /// Costs one ray through the map for each place and ray: 0.1 s for a flat.
    pub(super) fn new(map: &Map, config: &Config) -> Self {
        let resolution_m = map.resolution_m();
        let cells = |pitch: f64| map.columns() as f64 * map.rows() as f64 / (pitch * pitch);
        let mut pitch = libm::ceil(PITCH_MIN_M / resolution_m).max(1.0);
        while cells(pitch) * DIRECTIONS as f64 > RANGES_MAX as f64 {
            pitch += 1.0;
        }
        let per_place = pitch as usize;
        let columns = map.columns().div_ceil(per_place);
        let rows = map.rows().div_ceil(per_place);
        let mut cones = Self {
            pitch: pitch as f32,
            columns: columns as u32,
            rows: rows as u32,
            places: vec![NOWHERE; columns * rows],
            ranges: vec![FREE; DIRECTIONS],
            step_m: config.cone_range_max_m / 254.0,
        };
        for place in 0..columns * rows {
            let middle_m = |at: usize, cells: usize| {
                ((at as f64 + 0.5) * pitch).min(cells as f64 - 0.5) * resolution_m
            };
            let at = map.origin().place(BodyXy::new(
                middle_m(place % columns, map.columns()),
                middle_m(place / columns, map.rows()),
            ));
            if map
                .cell(at)
                .is_some_and(|cell| map.state(cell) == State::Free)
            {
                cones.places[place] = (cones.ranges.len() / DIRECTIONS) as u32;
                cones.look_around(map, at, config);
            }
        }
        cones
    }

    /// Appends the ranges of all directions from the middle of a place: tables of another point would shift all poses.
    fn look_around(&mut self, map: &Map, at: MapXy, config: &Config) {
        const RAYS: usize = DIRECTIONS * RAYS_PER_DIRECTION;
        let rays: [u8; RAYS] = std::array::from_fn(|ray| {
            let angle_rad = std::f64::consts::TAU * ray as f64 / RAYS as f64;
            let angle_rad = angle_rad + map.origin().heading_rad;
            let range_m = map.cast(at, angle_rad, config.cone_range_max_m);
            range_m.map_or(FREE, |range_m| libm::round(range_m / self.step_m) as u8)
        });
        let turn = std::f64::consts::TAU / RAYS as f64;
        let to_side = libm::round(config.cone_aperture_rad / 2.0 / turn) as usize;
        for direction in 0..DIRECTIONS {
            let first = direction * RAYS_PER_DIRECTION + RAYS - to_side;
            let cone = (first..=first + 2 * to_side).map(|ray| rays[ray % RAYS]);
            self.ranges.push(cone.min().unwrap_or(FREE));
        }
    }

    /// The likelihood of a range, or of silence, for each range that may be expected; the logarithm, 0 for the best. The sensor
    /// hears nothing from beyond `range_max_m`.
    ///
    /// Source: S. Thrun, W. Burgard, D. Fox, *Probabilistic Robotics*, 2005, section 6.3, with the cone's range in the place
    /// of the ray's. A silent cone is explained by a free way or by a lost echo.
    pub(super) fn curve(&self, range_m: Option<f64>, range_max_m: f64, config: &Config) -> Curve {
        let rand = config.cone_z_rand * self.step_m / config.cone_range_max_m;
        let width = (config.cone_sigma_m / self.step_m) as f32;
        let likelihoods: Curve = std::array::from_fn(|step| {
            let is_free = step == usize::from(FREE);
            let Some(range_m) = range_m else {
                let is_beyond = is_free || step as f64 * self.step_m > range_max_m;
                return if is_beyond { 1.0 } else { config.z_max as f32 };
            };
            let measured = (range_m / self.step_m) as f32;
            let off = (measured - step as f32) / width;
            let hit = if is_free {
                0.0
            } else {
                exp(-0.5 * off * off) / (width * 2.506_628)
            };
            let is_short = measured < step as f32;
            let short = if is_short {
                config.z_short as f32 / step as f32
            } else {
                0.0
            };
            config.cone_z_hit as f32 * hit + short + rand as f32
        });
        let best = likelihoods.iter().copied().fold(0.0, f32::max);
        likelihoods.map(|likelihood| libm::logf(likelihood / best))
    }

    /// Adds to each score the logarithm of the likelihood of a reading.
    pub(super) fn add_scores(
        &self,
        poses: Poses<'_>,
        cone: &Cone,
        indices: &mut [u32],
        scores: &mut [f32],
    ) {
        let indices = &mut indices[..scores.len()];
        poses.place(cone.at, indices, |x, y| self.place(x, y));
        let per_turn = DIRECTIONS as f32 / TAU;
        let readings = scores.iter_mut().zip(indices).zip(poses.heading);
        for ((score, place), heading) in readings {
            let direction = whole((heading + cone.bearing) * per_turn + ROUND);
            let direction = direction as usize % DIRECTIONS;
            let range = self.ranges[self.places[*place as usize] as usize * DIRECTIONS + direction];
            *score += cone.curve[usize::from(range)];
        }
    }

    /// Whether a reading is within two standard deviations of what is expected from the first of some poses.
    pub(super) fn fits(&self, poses: Poses<'_>, cone: &Cone) -> bool {
        let mut score = [0.0];
        self.add_scores(poses, cone, &mut [0], &mut score);
        score[0] >= -2.0
    }

    #[inline]
    fn place(&self, x: f32, y: f32) -> u32 {
        let within = |at: f32, places: u32| {
            // Rounding to the nearest whole number is to round down.
            let at = at / self.pitch - 0.5;
            let at = if at > 0.0 { at } else { 0.0 };
            let last = (places - 1) as f32;
            whole(if at < last { at } else { last } + ROUND)
        };
        within(y, self.rows) * self.columns + within(x, self.columns)
    }

    /// The expected range from a place in cells, metres; `None` if nothing is in range.
    #[cfg(test)]
    fn range_m(&self, x: f32, y: f32, heading: f32) -> Option<f64> {
        let direction = whole(heading * DIRECTIONS as f32 / TAU + ROUND) as usize % DIRECTIONS;
        let first = self.places[self.place(x, y) as usize] as usize * DIRECTIONS;
        let range = self.ranges[first + direction];
        (range != FREE).then(|| f64::from(range) * self.step_m)
    }
}

#[cfg(test)]
mod tests {
    use std::f32::consts::PI;

    use super::*;

    const HALL: &str = "
##############################
#............................#
#............................#
#............................#
#...............#............#
#............................#
#............................#
#............................#
##############################";

    fn cones() -> Cones {
        Cones::new(&Map::from_text(HALL, 0.1).unwrap(), &Config::default())
    }

    #[test]
    fn a_cone_measures_the_nearest_thing_in_it_not_the_range_on_its_axis() {
        let cones = cones();
        // The pillar is 0.3 m ahead and 0.05 m beside the axis of a drone one row above it.
        let range_m = cones.range_m(12.5, 4.9, 0.0).unwrap();
        assert!((range_m - 0.35).abs() < 0.06, "{range_m}");
        let lateral = cones.range_m(12.5, 4.9, PI / 2.0).unwrap();
        assert!((lateral - 0.35).abs() < 0.06, "{lateral}");
    }

    /// From another point of a place, all poses were off by half a cell.
    #[test]
    fn ranges_are_those_from_the_middle_of_a_place() {
        let line = |cell: &str| format!("#{}#", cell.repeat(40));
        let rows = [vec![line("#")], vec![line("."); 40], vec![line("#")]].concat();
        let map = Map::from_text(&rows.join("\n"), 0.05).unwrap();
        let cones = Cones::new(&map, &Config::default());
        for (cell, metres) in [(10.5_f32, 0.5), (21.5, 1.0), (30.5, 1.5)] {
            // The place has cells 10 and 11: its middle is 10 cells from the wall, which is one cell thick.
            let left_m = cones.range_m(cell, 21.0, PI).unwrap();
            let below_m = cones.range_m(21.0, cell, 1.5 * PI).unwrap();
            for range_m in [left_m, below_m] {
                assert!((range_m - metres).abs() < 0.01, "{range_m}, {metres}");
            }
        }
    }

    #[test]
    fn ranges_beyond_the_sensor_are_none() {
        let long = format!("{0}\n#{1}#\n{0}", "#".repeat(70), ".".repeat(68));
        let config = Config {
            cone_aperture_rad: 0.0,
            ..Config::default()
        };
        let cones = Cones::new(&Map::from_text(&long, 0.1).unwrap(), &config);
        assert_eq!(cones.range_m(10.5, 1.5, 0.0), None);
        assert!(cones.range_m(10.5, 1.5, PI).is_some());
    }

    #[test]
    fn likelihood_is_greatest_at_the_measured_range_and_short_readings_are_likelier_than_long_ones()
    {
        let cones = cones();
        let curve = cones.curve(Some(2.0), 4.0, &Config::default());
        let at = |range_m: f64| curve[(range_m / cones.step_m) as usize];
        assert!(at(2.0) > -0.05);
        assert!(at(3.5) > at(0.5) + 0.5);
        let silent = cones.curve(None, 4.0, &Config::default());
        assert!(silent[255] > silent[100]);
    }

    #[test]
    fn silence_is_expected_of_walls_beyond_the_sensors_own_range() {
        let cones = cones();
        let silent = cones.curve(None, 2.0, &Config::default());
        let at = |range_m: f64| silent[(range_m / cones.step_m) as usize];
        assert!((at(3.0) - silent[255]).abs() < 1e-6);
        assert!(at(1.0) < silent[255] - 1.0);
    }
}
