//! A lidar behind a pseudo-terminal.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::fs::File;
use std::io::Write;
use std::os::fd::OwnedFd;
use std::path::Path;
use std::time::Duration;

use muster_indoor::frames::BodyXy;
use muster_indoor::reading::Mounting;
use muster_indoor::sensor::Source;
use muster_sensors::ld19::Ld19;

/// The example of the LD19's manual.
const PACKET: [u8; 47] = [
    0x54, 0x2c, 0x68, 0x08, 0xab, 0x7e, 0xe0, 0x00, 0xe4, 0xdc, 0x00, 0xe2, 0xd9, 0x00, 0xe5, 0xd5,
    0x00, 0xe3, 0xd3, 0x00, 0xe4, 0xd0, 0x00, 0xe9, 0xcd, 0x00, 0xe4, 0xca, 0x00, 0xe2, 0xc7, 0x00,
    0xe9, 0xc5, 0x00, 0xe5, 0xc2, 0x00, 0xe5, 0xc0, 0x00, 0xe5, 0xbe, 0x82, 0x3a, 0x1a, 0x50,
];

#[test]
fn packets_on_a_serial_port_become_readings_to_the_left_of_clockwise_angles() {
    let flags = rustix::pty::OpenptFlags::RDWR | rustix::pty::OpenptFlags::NOCTTY;
    let far: OwnedFd = rustix::pty::openpt(flags).unwrap();
    rustix::pty::grantpt(&far).unwrap();
    rustix::pty::unlockpt(&far).unwrap();
    let name = rustix::pty::ptsname(&far, Vec::new()).unwrap();
    let mounting = Mounting::laser(BodyXy::new(0.1, 0.0), 0.0, 12.0);
    let mut lidar = Ld19::open(Path::new(name.to_str().unwrap()), mounting).unwrap();
    let mut readings = Vec::new();
    let now = Duration::from_secs(5);
    lidar.read(now, &mut readings).unwrap();
    assert!(
        readings.is_empty(),
        "nothing was sent, and nothing was waited for"
    );
    File::from(far.try_clone().unwrap())
        .write_all(&PACKET)
        .unwrap();
    for _ in 0..1_000 {
        lidar.read(now, &mut readings).unwrap();
        if !readings.is_empty() {
            break;
        }
    }
    assert_eq!(readings.len(), 12);
    // 324.27° clockwise are 35.73° to the left.
    let turn = muster_indoor::frames::wrapped_rad(readings[0].mounting.bearing_rad);
    assert!((turn.to_degrees() - 35.73).abs() < 1e-6, "{turn}");
    assert!((readings[0].range_m(now).unwrap() - 0.224).abs() < 1e-9);
    assert_eq!(lidar.counts().packets, 1);
}

#[test]
fn a_chip_that_is_not_there_is_an_error() {
    use muster_sensors::hc_sr04::{Hcsr04, OpenError, Wiring};
    let wiring = Wiring {
        trigger: 1,
        echo: 2,
        mounting: Mounting::laser(BodyXy::new(0.0, 0.0), 0.0, 4.0),
        is_vertical: false,
    };
    let opened = Hcsr04::open(Path::new("/dev/no-gpiochip"), &[wiring], 8.0);
    assert!(matches!(opened, Err(OpenError::Lines(_))));
}
