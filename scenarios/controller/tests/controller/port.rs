use muster_controller::{Config, Settings};
use muster_msp::{
    Altitude, Analog, ApiVersion, Attitude, BatteryState, BoardInfo, BoxIds, BoxNames, FcVariant,
    FcVersion, FeatureConfig, ModeRanges, ModeRangesExtra, RawGps, RawImu, Rc as Channels, Sonar,
};

use crate::companion::{Companion, Rc, exact, origin};

fn silent() -> Companion {
    Companion::new(exact(Settings::sole()))
}

/// Bytes that come back within a tenth of a second.
fn reply(companion: &mut Companion, hex: &str) -> String {
    let digits: Vec<_> = hex.split_whitespace().collect();
    let bytes: Vec<_> = digits
        .iter()
        .map(|it| u8::from_str_radix(it, 16).unwrap())
        .collect();
    companion.send(&bytes);
    companion.now += std::time::Duration::from_millis(100);
    let bytes = companion.controller.transmit(companion.now);
    let hex: Vec<_> = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
    hex.join(" ")
}

#[test]
fn replies_are_the_firmwares_bytes() {
    let mut companion = silent();
    // Recorded from Betaflight's simulation build.
    let golden = [
        ("24 4d 3c 00 02 02", "24 4d 3e 04 02 42 54 46 4c 1a"),
        ("24 4d 3c 00 6c 6c", "24 4d 3e 06 6c 00 00 00 00 00 00 6a"),
        ("24 4d 3c 00 79 79", "24 4d 21 00 79 79"),
        (
            "24 58 3c 00 6c 00 00 00 d8",
            "24 58 3e 00 6c 00 06 00 00 00 00 00 00 00 72",
        ),
    ];
    for (request, expected) in golden {
        assert_eq!(reply(&mut companion, request), expected);
    }
}

#[test]
fn bad_checksum_gets_no_reply_and_costs_no_later_frame() {
    let mut companion = silent();
    assert_eq!(reply(&mut companion, "24 4d 3c 00 02 03"), "");
    let both = "24 4d 3c 00 02 03 24 4d 3c 00 02 02";
    assert_eq!(reply(&mut companion, both), "24 4d 3e 04 02 42 54 46 4c 1a");
}

#[test]
fn payload_over_192_bytes_is_dropped() {
    let mut companion = silent();
    for (length, is_answered) in [(192_u16, true), (193, false)] {
        let mut bytes = Vec::new();
        let payload = vec![0; length.into()];
        let frame = muster_msp::Frame {
            version: muster_msp::Version::V2,
            // No request that long is written: its direction is altered below, which no checksum covers.
            direction: muster_msp::Direction::Reply,
            command: 2,
            flag: 0,
            payload: &payload,
        };
        muster_msp::encode(&frame, &mut bytes).unwrap();
        bytes[2] = b'<';
        companion.send(&bytes);
        companion.now += std::time::Duration::from_millis(50);
        let reply = companion.controller.transmit(companion.now);
        assert_eq!(!reply.is_empty(), is_answered);
    }
    assert_eq!(companion.controller.dropped().too_long, 1);
}

#[test]
fn one_request_is_answered_a_tick() {
    let mut companion = silent();
    companion.now += std::time::Duration::from_millis(1_001);
    let request = [0x24, 0x4d, 0x3c, 0x00, 0x02, 0x02];
    companion.send(&request.repeat(10));
    for _ in 0..10 {
        let due = companion.controller.next_event().unwrap();
        assert!(companion.controller.transmit(companion.now).is_empty());
        assert!(due > companion.now && due.as_nanos().is_multiple_of(10_000_000));
        companion.now = due;
        assert_eq!(companion.controller.transmit(companion.now).len(), 10);
    }
    assert_eq!(companion.controller.next_event(), None);
}

#[test]
fn requests_beyond_the_buffer_are_dropped_and_counted() {
    let mut companion = silent();
    let request = [0x24, 0x4d, 0x3c, 0x00, 0x02, 0x02];
    companion.send(&request.repeat(50));
    companion.now += std::time::Duration::from_millis(1_000);
    assert_eq!(companion.controller.transmit(companion.now).len(), 42 * 10);
    assert_eq!(companion.controller.dropped().too_many, 8);
}

#[test]
fn identity_is_that_of_the_configured_version() {
    for (major, minor, api) in [(4, 5, 46), (4, 6, 47), (25, 12, 47), (26, 6, 48)] {
        let mut settings = Settings::sole();
        settings.version.major = major;
        settings.version.minor = minor;
        let mut companion = Companion::new(exact(settings));
        let version = companion.ask::<FcVersion>();
        assert_eq!(version.release(), (major, minor));
        assert_eq!(companion.ask::<ApiVersion>().minor, api);
        assert_eq!(companion.ask::<FcVariant>().variant.to_string(), "BTFL");
        assert!(companion.ask::<BoardInfo>().is_simulation());
    }
}

#[test]
fn settings_can_be_read() {
    let mut companion = silent();
    let ids = companion.ask::<BoxIds>();
    let names = companion.ask::<BoxNames>();
    assert_eq!(ids.modes.len(), names.iter().count());
    assert_eq!(names.iter().next(), Some("ARM"));
    let ranges = companion.ask::<ModeRanges>();
    let arm: Vec<_> = ranges.of(muster_msp::Mode::Arm).collect();
    assert_eq!(
        (arm[0].aux, arm[0].first_us(), arm[0].end_us()),
        (0, 1_700, 2_100)
    );
    let extras = companion.ask::<ModeRangesExtra>().extras.0;
    let of_ranges: Vec<_> = ranges.ranges.iter().map(|it| it.mode).collect();
    let of_extras: Vec<_> = extras.iter().map(|it| it.mode).collect();
    assert_eq!(of_extras, of_ranges);
    assert!(extras.iter().all(|it| it.is_plain()));
    assert!(companion.ask::<FeatureConfig>().has(FeatureConfig::RX_MSP));
}

#[test]
fn telemetry_at_rest_is_what_physics_says() {
    let mut companion = Companion::ready(exact(Settings::sole()));
    let attitude = companion.ask::<Attitude>();
    assert_eq!(
        (attitude.roll_ddeg, attitude.pitch_ddeg, attitude.yaw_deg),
        (0, 0, 0)
    );
    assert_eq!(companion.ask::<RawImu>().acceleration, [0, 0, 256]);
    let gps = companion.ask::<RawGps>();
    assert_eq!(
        (gps.latitude_e7, gps.longitude_e7),
        (394_800_000, -3_400_000)
    );
    assert_eq!((gps.altitude_m, gps.speed_cmps), (20, 0));
    // Betaflight shows the altitude above sea level while disarmed.
    assert_eq!(companion.ask::<Altitude>().altitude_cm, 2_000);
    assert_eq!(companion.ask::<Sonar>().height_cm, -1);
    let battery = companion.ask::<BatteryState>();
    assert_eq!((battery.cells, battery.voltage_dv), (4, 168));
    assert_eq!(companion.ask::<Analog>().current_ca, 40);
    let channels = companion.ask::<Channels>();
    assert_eq!((channels.throttle_us, channels.yaw_us), (1_000, 1_500));
}

#[test]
fn attitude_has_the_firmwares_signs() {
    let mut companion = Companion::armed(exact(Settings::sole()));
    companion.rc = Some(Rc::throttle(1_400));
    companion.run_ms(1_500);
    companion.rc = Some(Rc {
        roll: 1_700,
        pitch: 1_700,
        yaw: 1_600,
        ..Rc::throttle(1_330)
    });
    companion.run_ms(1_000);
    let attitude = companion.ask::<Attitude>();
    assert!(attitude.roll_ddeg > 50, "right");
    assert!(attitude.pitch_ddeg > 50, "nose down");
    assert!((1..180).contains(&attitude.yaw_deg), "clockwise");
    let velocity = companion.truth().velocity.0;
    assert!(
        velocity.x > 0.5 && velocity.y > 0.5,
        "forward and right: {velocity}"
    );
}

#[test]
fn position_errors_have_the_stated_size() {
    let config = Config::new(origin(), Settings::sole());
    let mut companion = Companion::new(config);
    let (mut squares, mut count) = (0.0, 0.0);
    for _ in 0..400 {
        companion.now += std::time::Duration::from_secs(37);
        let gps = companion.ask::<RawGps>();
        let north_m = f64::from(gps.latitude_e7 - 394_800_000) * 1.11e-2;
        squares += north_m * north_m;
        count += 1.0;
    }
    let deviation_m = f64::sqrt(squares / count);
    assert!((1.1..1.5).contains(&deviation_m), "{deviation_m}");
}

#[test]
fn reboot_disarms_and_starts_the_grace_time_again() {
    let mut companion = Companion::armed(exact(Settings::sole()));
    assert_eq!(
        reply(&mut companion, "24 4d 3c 00 44 44").split(' ').nth(4),
        Some("44")
    );
    companion.rc = Some(Rc::IDLE);
    companion.run_ms(2_000);
    assert!(!companion.truth().is_armed);
    assert_eq!(companion.refusals(), ["BOOTGRACE"]);
}
