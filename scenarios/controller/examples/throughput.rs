//! What a simulated second of a controller costs.
//!
//!     cargo run --release -p muster-controller --example throughput
#![expect(
    clippy::print_stdout,
    clippy::disallowed_methods,
    reason = "an example prints how long it took"
)]

use std::time::{Duration, Instant};

use muster_controller::{Config, Controller, Settings};
use muster_machines::time::Timestamp;
use muster_msp::{
    Altitude, Attitude, BatteryState, Channel, RawGps, SetRawRc, Status, Sticks, Version, order,
    request,
};
use muster_runtime::geodetic::Geodetic;

/// Simulated seconds of each run.
const SPAN_S: u64 = 300;

fn main() {
    for (name, throttle_us, is_asked) in [
        ("at rest, no traffic", None, false),
        (
            "on the ground, RC at 50 Hz and telemetry at 50 Hz",
            Some(1_000),
            true,
        ),
        ("airborne, RC at 50 Hz", Some(1_320), false),
        (
            "airborne, RC at 50 Hz and telemetry at 50 Hz",
            Some(1_320),
            true,
        ),
    ] {
        let start = Instant::now();
        let altitude_m = fly(throttle_us, is_asked);
        let micros = start.elapsed().as_secs_f64() * 1e6;
        #[expect(clippy::cast_precision_loss, reason = "small")]
        let a_second = micros / SPAN_S as f64;
        println!("{a_second:8.1} µs a simulated second: {name} (ends at {altitude_m:.0} m)");
    }
}

fn fly(throttle_us: Option<u16>, is_asked: bool) -> f64 {
    let place = Geodetic::new(39.48, -0.34, 20.0).expect("a place on Earth");
    let mut config = Config::new(place, Settings::sole());
    config.airframe.battery.capacity_mah = 1e6;
    let mut controller = Controller::new(config, 1, Timestamp::ZERO);
    let mut now = Timestamp::ZERO;
    let mut bytes = Vec::new();
    for tick in 0..SPAN_S * 50 {
        if let Some(throttle_us) = throttle_us {
            bytes.clear();
            rc(tick, throttle_us, &mut bytes);
            if is_asked {
                ask(tick, &mut bytes);
            }
            controller.receive(now, &bytes);
        }
        now += Duration::from_millis(20);
        let replies = controller.transmit(now);
        assert_eq!(replies.is_empty(), throttle_us.is_none());
    }
    controller.aircraft(now).position.altitude_m()
}

/// Idle for six seconds, then armed, then at a throttle.
fn rc(tick: u64, throttle_us: u16, bytes: &mut Vec<u8>) {
    let channel = |us| Channel::new(us).expect("a valid pulse");
    let arm = channel(if tick < 300 || throttle_us == 1_000 {
        1_000
    } else {
        1_800
    });
    let sticks = Sticks {
        throttle: channel(if tick < 310 { 1_000 } else { throttle_us }),
        ..Sticks::IDLE
    };
    let message = SetRawRc::new(sticks, &[arm, channel(1_800)]).expect("two switches");
    order(Version::V1, &message, bytes).expect("a v1 message");
}

fn ask(tick: u64, bytes: &mut Vec<u8>) {
    match tick % 5 {
        0 => request::<Attitude>(Version::V1, bytes),
        1 => request::<RawGps>(Version::V1, bytes),
        2 => request::<Altitude>(Version::V1, bytes),
        3 => request::<Status>(Version::V1, bytes),
        _ => request::<BatteryState>(Version::V1, bytes),
    }
    .expect("a v1 message");
}
