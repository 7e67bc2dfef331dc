//! The filter's parameters. A parameter that means what AMCL's of the same name means has its name.

use std::f64::consts::PI;

/// Parameters of the filter. The deviations from AMCL's defaults are noted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Config {
    /// Fewest particles.
    pub min_particles: usize,
    /// Most particles; as many start if the pose is not known. AMCL's default: 5,000.
    pub max_particles: usize,
    /// Greatest error between the true distribution and the particles', for their number.
    pub kld_err: f64,
    /// Quantile of the standard normal distribution for that error. AMCL's default, 0.99, is a probability and no quantile; this
    /// is the quantile of 99 %.
    pub kld_z: f64,
    /// How what the odometry counts moves. AMCL's `odom_model_type`.
    pub odom_model: OdomModel,
    /// Variance of the turn, rad² for each rad² turned.
    pub alpha1: f64,
    /// Variance of the turn, rad² for each m² moved. AMCL's default, 0.2, is that of poor wheels.
    pub alpha2: f64,
    /// Variance of the distance, m² for each m² moved.
    pub alpha3: f64,
    /// Variance of the distance, m² for each rad² turned.
    pub alpha4: f64,
    /// Variance across the motion, m² for each m² moved; for [`OdomModel::Omni`].
    pub alpha5: f64,
    /// Random walk without odometry, m² a second.
    pub walk_m2: f64,
    /// Random walk of the heading without odometry, rad² a second.
    pub walk_rad2: f64,
    /// Most rays that are used of a scan.
    pub max_beams: usize,
    /// Most comparisons of a reading with the map in a step. Many particles use fewer rays, but no fewer than
    /// [`Config::BEAMS_MIN`].
    pub lookups_max: usize,
    /// All rays of a step count as at most this many independent readings: neighbours see the same things.
    pub observations: f64,
    /// Share of readings that fit what is on the map.
    pub z_hit: f64,
    /// Share of readings of anything else.
    pub z_rand: f64,
    /// Deviation of a ray's end from the map, metres.
    pub sigma_hit: f64,
    /// The same while the pose is not known, metres: particles stand far apart, and those nearby are to be found.
    pub sigma_search: f64,
    /// Farther from an obstacle, all points are equally unlikely, metres.
    pub laser_likelihood_max_dist: f64,
    /// Full angle of cones, radians; HC-SR04: 30°.
    pub cone_aperture_rad: f64,
    /// Cones are not looked at farther away, metres; HC-SR04: 4 m.
    pub cone_range_max_m: f64,
    /// Deviation of a cone's range from the nearest thing on the map, metres.
    pub cone_sigma_m: f64,
    /// Share of cones that answer from the nearest thing on the map.
    pub cone_z_hit: f64,
    /// Share of cones that answer from something nearer, not on the map.
    pub z_short: f64,
    /// Share of cones whose echo is lost.
    pub z_max: f64,
    /// Share of cones that answer from anywhere.
    pub cone_z_rand: f64,
    /// The share of readings that fit the map at a true pose is at least this; with less, the drone is lost. In the Málaga data
    /// 99.9 % of scans have 0.847 and more near the true pose.
    pub fit_found: f64,
    /// Once lost, the drone is lost until the share is at least this. In the Málaga data 99 % of wrong poses that hold half of
    /// the weight are below, and 80 % of true ones above.
    pub fit_regained: f64,
    /// How a drone that was carried away is looked for; `None` if it never is.
    pub recovery_alpha: Option<RecoveryAlpha>,
}

/// The rates of two averages of the fit. Particles start anywhere while the short one is below the long one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RecoveryAlpha {
    /// Rate at which the long average follows. AMCL's `recovery_alpha_slow`.
    pub slow: f64,
    /// Rate at which the short average follows. AMCL's `recovery_alpha_fast`; its default is 0.1, for ten scans a second.
    pub fast: f64,
}

/// How what the odometry counts moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OdomModel {
    /// It turns, goes ahead and turns again, as a robot with two wheels. It can't go sideways but by turns.
    Diff,
    /// It moves in any direction while it turns, as a drone.
    Omni,
}

impl Config {
    /// Fewest rays, whatever the number of particles.
    pub const BEAMS_MIN: usize = 8;
    /// Share of the particles that weighting leaves effective.
    pub(super) const SURVIVORS: f32 = 0.1;
}

impl Default for Config {
    fn default() -> Self {
        Self {
            min_particles: 100,
            max_particles: 10_000,
            kld_err: 0.05,
            kld_z: 2.33,
            odom_model: OdomModel::Diff,
            alpha1: 0.1,
            alpha2: 0.01,
            alpha3: 0.1,
            alpha4: 0.05,
            alpha5: 0.1,
            walk_m2: 0.1,
            walk_rad2: 0.1,
            max_beams: 60,
            lookups_max: 300_000,
            observations: 30.0,
            z_hit: 0.5,
            z_rand: 0.5,
            sigma_hit: 0.2,
            sigma_search: 0.4,
            laser_likelihood_max_dist: 2.0,
            cone_aperture_rad: PI / 6.0,
            cone_range_max_m: 4.0,
            cone_sigma_m: 0.15,
            cone_z_hit: 0.7,
            z_short: 0.1,
            z_max: 0.1,
            cone_z_rand: 0.1,
            fit_found: 0.84,
            fit_regained: 0.93,
            recovery_alpha: Some(RecoveryAlpha {
                slow: 0.01,
                fast: 0.5,
            }),
        }
    }
}
