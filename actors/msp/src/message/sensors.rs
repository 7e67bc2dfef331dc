//! What the controller measures, and what sensors tell it.

use super::message;

message! {
    /// Accelerometer, gyroscope and magnetometer as measured, body frame, x forward.
    RawImu = 102 as "MSP_RAW_IMU" {
        /// Accelerometer, in counts of the sensor (Betaflight's simulation: 256 per g).
        acceleration: [i16; 3],
        /// Gyroscope, in °/s.
        rate_dps: [i16; 3],
        /// Magnetometer, in counts of the sensor.
        magnetic: [i16; 3],
    }
}

message! {
    /// Attitude.
    Attitude = 108 as "MSP_ATTITUDE" {
        /// Right side down is positive, in 0.1°.
        roll_ddeg: i16,
        /// Nose down is positive, in 0.1°.
        pitch_ddeg: i16,
        /// Clockwise from north, 0 to 359°.
        yaw_deg: i16,
    }
}

message! {
    /// Altitude as estimated, above where it was armed.
    Altitude = 109 as "MSP_ALTITUDE" {
        /// cm.
        altitude_cm: i32,
        /// Upward speed, in cm/s.
        climb_cmps: i16,
    }
}

message! {
    /// Rangefinder of the controller.
    Sonar = 58 as "MSP_SONAR_ALTITUDE" {
        /// Height above ground, corrected for tilt, in cm; negative if out of range.
        height_cm: i32,
    }
}

message! {
    /// From a rangefinder that sends MSP by itself, to a controller or to us.
    RangefinderSample = 0x1f01 as "MSP2_SENSOR_RANGEFINDER_LIDARMT" {
        /// 0 to 255.
        quality: u8,
        /// Distance, in mm; negative if out of range.
        distance_mm: i32,
    }
}

message! {
    /// From an optical flow module that sends MSP by itself, to a controller or to us: how the ground turns beneath it. A turn of
    /// the module about +x shows as positive x, about +y as positive y; motion to the right (+y) as negative x, forward (+x) as
    /// positive y (as MAVLink's `OPTICAL_FLOW_RAD`).
    OpticalFlow = 0x1f02 as "MSP2_SENSOR_OPTICALFLOW_MT" {
        /// 0 to 255.
        quality: u8,
        /// Rate about x, in 0.001 rad/s.
        x_mradps: i32,
        /// Rate about y, in 0.001 rad/s.
        y_mradps: i32,
    }
}
