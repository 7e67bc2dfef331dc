//! Simulated flight controllers of a scenario's drones, in a world or beside processes.

use muster_controller::{Config, PoseErrors, Settings};
use muster_machines::geometry::Ned;
use muster_machines::msp::controller::Receiver;
use muster_runtime::plan::{Plan, PoseSensor};

pub use crate::world::{FaultyController, LOOK_EVERY};

/// Capacity of a battery that is not to run empty, in mAh: the most that MSP can say.
const CAPACITY_MAX_MAH: f64 = 60_000.0;

/// The controller and the aircraft of a plan's drone that stands at `place`.
#[must_use]
pub fn config(plan: &Plan, place: Ned) -> Config {
    let settings = match plan.receiver {
        Receiver::Sole => Settings::fit(),
        Receiver::Override => Settings::fit_overriding(),
    };
    let mut config = Config::new(plan.home, settings);
    config.place = place;
    let hover_a = config.airframe.hover_a();
    let endurance = plan.endurance.map_or(f64::INFINITY, |it| it.as_secs_f64());
    let capacity_mah = (hover_a * endurance / 3.6).min(CAPACITY_MAX_MAH);
    config.airframe.battery.capacity_mah = capacity_mah;
    config
}

/// The errors of a plan's pose sensor.
#[must_use]
pub const fn pose_errors(sensor: PoseSensor) -> PoseErrors {
    PoseErrors {
        sigma_m: sensor.sigma_m,
        period: sensor.period,
        delay: sensor.delay,
    }
}
