use std::sync::Arc;
use std::time::Duration;

use crate::avoidance::{Limits, Method};
use crate::coverage::{Places, View};
use crate::filter::{NowhereFree, Tables};
use crate::frames::{BodyXy, MapPose, MapXy};
use crate::map::Map;
use crate::path::Floor;
use crate::reading::Mounting;

/// Time between two decisions.
pub const PERIOD: Duration = Duration::from_millis(100);

/// Axes of the five horizontal sonars of the indoor thesis, in degrees from the right: 0, 53, 90, 127, 180.
pub const THESIS_SONARS: [f64; 5] = [0.0, 53.0, 90.0, 127.0, 180.0];
/// Opening angle, nearest and farthest echo of an HC-SR04 (indoor thesis): degrees, metres.
const HC_SR04: (f64, f64, f64) = (30.0, 0.05, 4.0);

/// The indoor thesis's sonars, in the middle of the drone.
#[must_use]
pub fn thesis_sonars() -> Vec<Mounting> {
    let (aperture, range_min_m, range_max_m) = HC_SR04;
    let mounting = |degrees: &f64| Mounting {
        at: BodyXy::new(0.0, 0.0),
        bearing_rad: (degrees - 90.0).to_radians(),
        aperture_rad: aperture.to_radians(),
        range_min_m,
        range_max_m,
    };
    THESIS_SONARS.iter().map(mounting).collect()
}

/// What a patrol is given.
#[derive(Debug, Clone)]
pub struct Config {
    /// The floor, for a drone that keeps [`Limits::radius_m`] from walls.
    pub floor: Floor,
    /// What can be seen, and from where.
    pub places: Arc<Places>,
    /// Where to look round, in this order.
    pub stops: Vec<MapXy>,
    /// What the camera sees for sure, see [`View::cautious`]. It looks forward.
    pub view: View,
    /// The map as the particle filter needs it, from [`Config::tables_of`].
    pub tables: Arc<Tables>,
    /// Where the drone starts.
    pub start: MapPose,
    /// The sonars.
    pub sonars: Vec<Mounting>,
    /// How obstacles are avoided.
    pub method: Method,
    /// What the drone needs and can do.
    pub limits: Limits,
    /// Highest acceleration, in m/s².
    pub acceleration_mps2: f64,
    /// Longest time of a patrol. A drone that has not ended it by then lands where it is.
    pub lasts_max: Duration,
}

impl Config {
    /// A map as the particle filter needs it. It takes a moment; patrols of the same map share it.
    ///
    /// # Errors
    /// If no cell of the map is free.
    pub fn tables_of(map: &Map) -> Result<Arc<Tables>, NowhereFree> {
        Tables::new(map, &super::place::filter_config()).map(Arc::new)
    }
}
