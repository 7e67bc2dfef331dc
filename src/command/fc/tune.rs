use std::path::PathBuf;

use clap::Args;
use muster_experiments::tuning::{Tuned, tune};
use muster_machines::msp::controller::Gains;
use muster_runtime::diagnostic::BadInput;
use muster_runtime::vehicle::VehicleKind;
use muster_scenarios::scenario;

use super::{Failure, Outcome};
use crate::command::overrides::Overrides;
use crate::command::terminal;

/// Find gains for a scenario's aircraft in a short hover test, in simulation.
///
/// The simulated aircraft takes off, hovers 3 m high, steps 2 m aside and 1 m up, and lands. Printed are how it responds and a
/// table `[vehicle.gains]` for the scenario. It learns of the flight what a drone is told: attitude, and GPS or poses.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  muster fc tune betaflight-hover
  muster fc tune flight-controllers --set aircraft.payload_kg=0.4")]
pub(super) struct Arguments {
    /// A scenario file, or the name of a shipped scenario, with `vehicle.kind` = "msp".
    #[arg(value_name = "SCENARIO")]
    scenario: PathBuf,
    #[command(flatten)]
    overrides: Overrides,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let path = &arguments.scenario;
    let scenario = scenario::load(path, &arguments.overrides.all(path)?)?;
    if scenario.plan.vehicle_kind != VehicleKind::Msp {
        let message = "has no flight controllers, and so no gains";
        let help = "set `vehicle.kind` = \"msp\"".to_owned();
        return Err(BadInput::without_excerpt(path, message.to_owned(), help).into());
    }
    let tuned = tune(&scenario)?;
    terminal::print(&text(&tuned))?;
    Ok(Outcome::Success)
}

/// A table of a scenario file, and what it follows from as comments.
fn text(tuned: &Tuned) -> String {
    let Tuned {
        response,
        gains,
        before,
        after,
    } = tuned;
    let mut text = format!(
        "# attitude lag {:.2} s, thrust lag {:.2} s, thrust gain {:.2}\n\
         # horizontal loop: {} (with the scenario's gains: {})\n\
         # vertical loop: {} (with the scenario's gains: {})\n\
         [vehicle.gains]\n",
        response.attitude_lag_s,
        response.thrust_lag_s,
        response.thrust_gain,
        after.level,
        before.level,
        after.vertical,
        before.vertical,
    );
    for (name, value, unit) in rows(gains) {
        let line = format!("{name} = {value:?}");
        text.push_str(&format!("{line:<32}# {unit}\n"));
    }
    text
}

fn rows(gains: &Gains) -> [(&'static str, f64, &'static str); 9] {
    let Gains {
        position_per_s,
        velocity_per_s,
        integral_per_s2,
        height_per_s,
        climb_per_s,
        climb_integral_per_s2,
        tilt_max_rad,
        drag_per_s,
        hover_throttle,
    } = *gains;
    [
        ("position_per_s", position_per_s, "1/s"),
        ("velocity_per_s", velocity_per_s, "1/s"),
        ("integral_per_s2", integral_per_s2, "1/s²"),
        ("height_per_s", height_per_s, "1/s"),
        ("climb_per_s", climb_per_s, "1/s"),
        ("climb_integral_per_s2", climb_integral_per_s2, "1/s²"),
        ("tilt_max_rad", tilt_max_rad, "radians"),
        ("drag_per_s", drag_per_s, "1/s"),
        ("hover_throttle", hover_throttle, "0 to 1"),
    ]
}
