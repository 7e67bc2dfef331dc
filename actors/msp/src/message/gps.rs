//! GPS.

use super::message;

message! {
    /// Position of the GPS receiver, WGS 84.
    RawGps = 106 as "MSP_RAW_GPS" {
        /// Not 0 if there is a fix.
        fix: u8,
        /// Satellites.
        satellites: u8,
        /// Latitude, in 1e-7°.
        latitude_e7: i32,
        /// Longitude, in 1e-7°.
        longitude_e7: i32,
        /// Above mean sea level, in m.
        altitude_m: u16,
        /// Speed over ground, in cm/s.
        speed_cmps: u16,
        /// Course over ground, in 0.1°.
        course_ddeg: u16,
        /// Position dilution of precision, in 0.01; from API 1.44 on.
        pdop_e2: Option<u16>,
    }
}

message! {
    /// Where home is.
    CompGps = 107 as "MSP_COMP_GPS" {
        /// Distance, in m.
        home_m: u16,
        /// Direction, in °.
        home_deg: u16,
        /// Changes with every new position.
        update: u8,
    }
}
