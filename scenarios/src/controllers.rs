//! Simulated flight controllers of a scenario's drones, in a world or beside processes.

use muster_controller::{Config, FlowErrors, PoseErrors, Settings, Wind};
use muster_machines::geometry::Ned;
use muster_machines::msp::controller::Receiver;
use muster_runtime::plan::{FlowSensor, PoseSensor, raw};
use nalgebra::Vector3;

use crate::scenario::Scenario;
pub use crate::world::{Controllers, FaultyController, LOOK_EVERY, Pilot, PortState};

/// Capacity of a battery that is not to run empty, in mAh: the most that MSP can say.
const CAPACITY_MAX_MAH: f64 = 60_000.0;

/// The aircraft of simulated flight controllers, and the air that they fly in.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Aircraft {
    /// Mass in addition to that of [`Airframe::agilicious`](muster_controller::Airframe::agilicious), in kg.
    pub payload_kg: f64,
    /// Share of a new battery's capacity that is lost; its internal resistance rises as much.
    pub battery_wear: f64,
    /// The air.
    pub wind: Wind,
}

impl From<&raw::Aircraft> for Aircraft {
    fn from(aircraft: &raw::Aircraft) -> Self {
        Self {
            payload_kg: aircraft.payload_kg.0,
            battery_wear: aircraft.battery_wear.0,
            wind: Wind {
                mean_mps: Vector3::new(aircraft.wind_north_mps.0, aircraft.wind_east_mps.0, 0.0),
                gusts_mps: aircraft.gusts_mps.0,
            },
        }
    }
}

/// The controller and the aircraft of a scenario's drone that stands at `place`.
#[must_use]
pub fn config(scenario: &Scenario, place: Ned) -> Config {
    let (plan, aircraft) = (&scenario.plan, &scenario.aircraft);
    let settings = match plan.receiver {
        Receiver::Sole => Settings::fit(),
        Receiver::Override => Settings::fit_overriding(),
    };
    let mut config = Config::new(plan.home, settings);
    config.place = place;
    let hover_a = config.airframe.hover_a();
    let endurance = plan.endurance.map_or(f64::INFINITY, |it| it.as_secs_f64());
    let capacity_mah = (hover_a * endurance / 3.6).min(CAPACITY_MAX_MAH);
    let left = 1.0 - aircraft.battery_wear;
    let battery = &mut config.airframe.battery;
    battery.capacity_mah = capacity_mah * left;
    battery.resistance_ohm /= left;
    config.airframe.mass_kg += aircraft.payload_kg;
    config.wind = aircraft.wind;
    config
}

/// The errors of a plan's pose sensor.
#[must_use]
pub const fn pose_errors(sensor: PoseSensor) -> PoseErrors {
    PoseErrors {
        sigma_m: sensor.sigma_m,
        period: sensor.period,
        delay: sensor.delay,
        outliers: sensor.outliers,
    }
}

/// The errors of a plan's optical flow module.
#[must_use]
pub const fn flow_errors(sensor: FlowSensor) -> FlowErrors {
    FlowErrors {
        sigma_radps: sensor.sigma_radps,
        range_max_m: sensor.range_max_m,
        period: sensor.period,
    }
}
