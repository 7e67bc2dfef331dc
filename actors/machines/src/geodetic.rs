//! Conversion of geodetic coordinates to local coordinates about the mission's home.
//!
//! Implemented here over `libm`, for all drones must compute identical waypoints on every processor. Geodesy libraries call
//! the platform's sine, which differs in the last digit.

use libm::{atan2, cos, hypot, round, sin, sqrt};
use nalgebra::Vector3;

use crate::geometry::Ned;

/// The highest latitude, north or south, in degrees. Beyond it the direction of east changes too fast for a formation.
pub const LATITUDE_MAX_DEG: f64 = 89.0;

/// The lowest altitude above sea level, in metres: the shore of the Dead Sea is at -430.
pub const ALTITUDE_MIN_M: f64 = -500.0;

/// The highest altitude above sea level, in metres: the summit of Everest is at 8,849.
pub const ALTITUDE_MAX_M: f64 = 10_000.0;

/// The largest distance from home in the swarm's local frame, in metres.
pub const HOME_DISTANCE_MAX_M: f64 = 100_000.0;

/// The equatorial radius of WGS84, in metres (NIMA TR8350.2, table 3.1).
const SEMI_MAJOR_AXIS_M: f64 = 6_378_137.0;

/// The flattening of WGS84 (NIMA TR8350.2, table 3.1).
const FLATTENING: f64 = 1.0 / 298.257_223_563;

/// A place on the Earth: WGS84 latitude and longitude in degrees, and altitude in metres above sea level.
///
/// Always within [`LATITUDE_MAX_DEG`], 180 degrees of longitude, and altitudes from [`ALTITUDE_MIN_M`] to
/// [`ALTITUDE_MAX_M`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Geodetic {
    latitude_deg: f64,
    longitude_deg: f64,
    altitude_m: f64,
}

/// Coordinates out of range: the caller's fault.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum GeodeticError {
    /// Out of range or not a number.
    #[error(
        "the latitude {latitude_deg} is not between -{LATITUDE_MAX_DEG} and {LATITUDE_MAX_DEG} degrees"
    )]
    Latitude {
        /// The given value.
        latitude_deg: f64,
    },
    /// Out of range or not a number.
    #[error("the longitude {longitude_deg} is not between -180 and 180 degrees")]
    Longitude {
        /// The given value.
        longitude_deg: f64,
    },
    /// Out of range or not a number.
    #[error(
        "the altitude {altitude_m} is not between {ALTITUDE_MIN_M} and {ALTITUDE_MAX_M} metres above sea level"
    )]
    Altitude {
        /// The given value.
        altitude_m: f64,
    },
}

impl Geodetic {
    /// Creates a place. Latitude and longitude in degrees, north and east positive; altitude in metres above sea level.
    ///
    /// # Errors
    ///
    /// The first of the three values that is out of range or not a number.
    pub fn new(
        latitude_deg: f64,
        longitude_deg: f64,
        altitude_m: f64,
    ) -> Result<Self, GeodeticError> {
        if !(-LATITUDE_MAX_DEG..=LATITUDE_MAX_DEG).contains(&latitude_deg) {
            return Err(GeodeticError::Latitude { latitude_deg });
        }
        if !(-180.0..=180.0).contains(&longitude_deg) {
            return Err(GeodeticError::Longitude { longitude_deg });
        }
        if !(ALTITUDE_MIN_M..=ALTITUDE_MAX_M).contains(&altitude_m) {
            return Err(GeodeticError::Altitude { altitude_m });
        }
        Ok(Self {
            latitude_deg,
            longitude_deg,
            altitude_m,
        })
    }

    /// Degrees north of the equator.
    #[must_use]
    pub fn latitude_deg(self) -> f64 {
        self.latitude_deg
    }

    /// Degrees east of Greenwich.
    #[must_use]
    pub fn longitude_deg(self) -> f64 {
        self.longitude_deg
    }

    /// Metres above sea level.
    #[must_use]
    pub fn altitude_m(self) -> f64 {
        self.altitude_m
    }

    /// Earth-centred, Earth-fixed coordinates in metres, at `height_m` above the ellipsoid.
    ///
    /// Source: EPSG coordinate operation method 9602, forward case.
    fn earth_centred_m(self, height_m: f64) -> Vector3<f64> {
        let (latitude, longitude) = self.radians();
        let eccentricity_squared = FLATTENING * (2.0 - FLATTENING);
        let sin_latitude = sin(latitude);
        let normal_m =
            SEMI_MAJOR_AXIS_M / sqrt(1.0 - eccentricity_squared * sin_latitude * sin_latitude);
        let from_axis_m = (normal_m + height_m) * cos(latitude);
        Vector3::new(
            from_axis_m * cos(longitude),
            from_axis_m * sin(longitude),
            (normal_m * (1.0 - eccentricity_squared) + height_m) * sin_latitude,
        )
    }

    fn radians(self) -> (f64, f64) {
        (
            self.latitude_deg.to_radians(),
            self.longitude_deg.to_radians(),
        )
    }
}

/// A place too far from home for the swarm's local frame: the caller's fault.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error(
    "the place is {:.1} km from home, further than {:.0} km",
    .distance_m / 1_000.0,
    HOME_DISTANCE_MAX_M / 1_000.0
)]
pub struct TooFarFromHome {
    /// The straight distance, in metres.
    pub distance_m: f64,
}

/// Converts `place` to the swarm's local NED frame about `home`, rounded to whole millimetres.
///
/// North and east are measured in the plane tangent to the WGS84 ellipsoid at home, at home's altitude.
/// The height is the place's altitude minus home's, not the height above that plane. (At a distance d the plane is d²/2R
/// above the ground: 8 cm at 1 km, 8 m at 10 km.)
///
/// Source: EPSG coordinate operation method 9837 (geographic to topocentric), but for the height.
///
/// # Accuracy
///
/// Within 100 km of home, north and east are within half a millimetre of PROJ's `topocentric` (see the tests); all but 1 µm
/// is rounding. Rounding and `libm` make the result equal on every processor. The frame has three approximations:
///
/// - The plane shortens distances from home by d³/6R²: 4 µm at 1 km, 4 mm at 10 km, 4 m at 100 km.
/// - Altitudes above sea level are treated as heights above the ellipsoid. This stretches distances by the geoid's height
///   over R, under 17 mm per kilometre.
/// - A place above home is put vertically above its coordinates.
///
/// # Errors
///
/// If the place is further than [`HOME_DISTANCE_MAX_M`] from home.
pub fn local_ned(home: Geodetic, place: Geodetic) -> Result<Ned, TooFarFromHome> {
    let offset_m = place.earth_centred_m(home.altitude_m) - home.earth_centred_m(home.altitude_m);
    let distance_m = offset_m.norm();
    if distance_m > HOME_DISTANCE_MAX_M {
        return Err(TooFarFromHome { distance_m });
    }
    let (latitude, longitude) = home.radians();
    let north = Vector3::new(
        -sin(latitude) * cos(longitude),
        -sin(latitude) * sin(longitude),
        cos(latitude),
    );
    let east = Vector3::new(-sin(longitude), cos(longitude), 0.0);
    Ok(Ned::new(
        whole_millimetres(north.dot(&offset_m)),
        whole_millimetres(east.dot(&offset_m)),
        whole_millimetres(home.altitude_m - place.altitude_m),
    ))
}

/// Converts a place in the swarm's local frame about `home` to latitude and longitude in degrees, and altitude in metres above
/// sea level: the inverse of [`local_ned`], within a millimetre up to [`HOME_DISTANCE_MAX_M`].
///
/// Source: EPSG coordinate operation method 9837, reverse case; method 9602 by iteration, for heights near the ground.
#[must_use]
pub fn latitude_longitude_altitude(home: Geodetic, place: Ned) -> [f64; 3] {
    let (latitude, longitude) = home.radians();
    let (sin_latitude, cos_latitude) = (sin(latitude), cos(latitude));
    let (sin_longitude, cos_longitude) = (sin(longitude), cos(longitude));
    let north = Vector3::new(
        -sin_latitude * cos_longitude,
        -sin_latitude * sin_longitude,
        cos_latitude,
    );
    let east = Vector3::new(-sin_longitude, cos_longitude, 0.0);
    let up = Vector3::new(
        cos_latitude * cos_longitude,
        cos_latitude * sin_longitude,
        sin_latitude,
    );
    let on_plane =
        home.earth_centred_m(home.altitude_m) + north * place.north_m() + east * place.east_m();
    // `local_ned` projects a place at home's altitude on the plane, which is above it: the way back goes straight down.
    let mut down_m = 0.0;
    let mut found = (latitude, longitude);
    for _ in 0..DESCENTS {
        let (latitude, longitude, height_m) = ellipsoidal(on_plane - up * down_m);
        down_m += height_m - home.altitude_m;
        found = (latitude, longitude);
    }
    [
        found.0.to_degrees(),
        found.1.to_degrees(),
        home.altitude_m + place.altitude_m(),
    ]
}

/// Steps down from the tangent plane; each reduces the error by the square of distance over the Earth's radius.
const DESCENTS: usize = 4;

/// Latitude and longitude in radians, and height above the ellipsoid in metres, of Earth-centred coordinates.
fn ellipsoidal(point_m: Vector3<f64>) -> (f64, f64, f64) {
    let eccentricity_squared = FLATTENING * (2.0 - FLATTENING);
    let from_axis_m = hypot(point_m.x, point_m.y);
    let mut latitude = atan2(point_m.z, from_axis_m * (1.0 - eccentricity_squared));
    let mut height_m = 0.0;
    // Each turn reduces the error by about 150.
    for _ in 0..8 {
        let sin_latitude = sin(latitude);
        let normal_m =
            SEMI_MAJOR_AXIS_M / sqrt(1.0 - eccentricity_squared * sin_latitude * sin_latitude);
        height_m = from_axis_m / cos(latitude) - normal_m;
        let share = eccentricity_squared * normal_m / (normal_m + height_m);
        latitude = atan2(point_m.z, from_axis_m * (1.0 - share));
    }
    (latitude, atan2(point_m.y, point_m.x), height_m)
}

/// Rounds to whole millimetres, so that all drones agree. Adding zero turns a negative zero into a positive one.
#[must_use]
pub fn whole_millimetres(metres: f64) -> f64 {
    round(metres * 1_000.0) / 1_000.0 + 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug)]
    struct Golden {
        home: Geodetic,
        place: Geodetic,
        north_m: f64,
        east_m: f64,
    }

    fn golden() -> Vec<Golden> {
        let mut reader = csv::ReaderBuilder::new()
            .comment(Some(b'#'))
            .from_path(concat!(
                env!("CARGO_MANIFEST_DIR"),
                "/tests/data/topocentric.csv"
            ))
            .unwrap();
        reader
            .records()
            .map(|record| {
                let record = record.unwrap();
                let column = |index: usize| record[index].parse::<f64>().unwrap();
                Golden {
                    home: Geodetic::new(column(0), column(1), column(2)).unwrap(),
                    place: Geodetic::new(column(3), column(4), column(2)).unwrap(),
                    north_m: column(5),
                    east_m: column(6),
                }
            })
            .collect()
    }

    #[test]
    fn north_and_east_are_within_a_millimetre_of_proj() {
        for case in golden() {
            let placed = local_ned(case.home, case.place).unwrap();
            let error_m = (placed.north_m() - case.north_m)
                .abs()
                .max((placed.east_m() - case.east_m).abs());
            assert!(error_m < 0.000_51, "{error_m} m in {case:?}, at {placed:?}");
        }
    }

    #[test]
    fn height_is_the_difference_of_altitudes_at_any_distance() {
        let home = Geodetic::new(39.33, -0.3085, 2.0).unwrap();
        let far = Geodetic::new(40.0, -0.3085, 27.0).unwrap();
        let placed = local_ned(home, far).unwrap();
        assert!(placed.north_m() > 70_000.0);
        assert!((placed.altitude_m() - 25.0).abs() < 1e-9);
    }

    #[test]
    fn home_is_the_origin() {
        let home = Geodetic::new(39.33, -0.3085, 2.0).unwrap();
        assert_eq!(local_ned(home, home), Ok(Ned::HOME));
    }

    #[test]
    fn coordinates_are_continuous_across_the_date_line() {
        let home = Geodetic::new(-17.0, 179.999, 10.0).unwrap();
        let place = Geodetic::new(-17.0, -179.999, 10.0).unwrap();
        let east_m = local_ned(home, place).unwrap().east_m();
        assert!((212.0..214.0).contains(&east_m), "{east_m}");
    }

    #[test]
    fn place_in_the_local_frame_is_found_again_within_a_millimetre() {
        for case in golden() {
            let local = local_ned(case.home, case.place).unwrap();
            let [latitude, longitude, altitude_m] = latitude_longitude_altitude(case.home, local);
            let found = Geodetic::new(latitude, longitude, altitude_m).unwrap();
            let again = local_ned(case.home, found).unwrap();
            let error_m = again.distance_m(local);
            assert!(error_m < 0.002, "{error_m} m in {case:?}");
            assert!(
                (latitude - case.place.latitude_deg()).abs() < 2e-8,
                "{case:?}"
            );
        }
    }

    #[test]
    fn antipode_is_refused_as_too_far() {
        let home = Geodetic::new(39.33, -0.3085, 2.0).unwrap();
        let antipode = Geodetic::new(-39.33, 179.6915, 2.0).unwrap();
        let refused = local_ned(home, antipode).unwrap_err();
        assert!(refused.distance_m > 12_000_000.0);
    }

    #[test]
    fn coordinates_out_of_range_are_refused() {
        let refused = |latitude, longitude, altitude| {
            Geodetic::new(latitude, longitude, altitude)
                .unwrap_err()
                .to_string()
        };
        assert!(refused(89.1, 0.0, 0.0).contains("latitude"));
        assert!(refused(f64::NAN, 0.0, 0.0).contains("latitude"));
        assert!(refused(0.0, 180.1, 0.0).contains("longitude"));
        assert!(refused(0.0, f64::INFINITY, 0.0).contains("longitude"));
        assert!(refused(0.0, 0.0, 10_001.0).contains("altitude"));
        assert!(refused(0.0, 0.0, f64::NAN).contains("altitude"));
    }
}
