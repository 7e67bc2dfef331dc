//! Range sensors of a drone: HC-SR04 sonars on GPIO lines, and LDROBOT's lidars LD06 and LD19 on a serial port.
//!
//! Each driver is a [`Source`](muster_indoor::sensor::Source) of readings. What bytes and edges mean is decided in modules that
//! open nothing. What a sensor sends wrong is counted and goes no further.

pub mod hc_sr04;
pub mod ld19;
