use std::path::PathBuf;
use std::sync::Arc;

use clap::Args;
use muster_indoor::frames::MapXy;
use muster_indoor::path::Floor;
use muster_indoor_world::page;
use muster_indoor_world::world::LIMITS;
use muster_runtime::diagnostic::BadInput;
use muster_runtime::text::{figure, plural};

use super::place::{self, PageFile};
use crate::command::{Failure, Outcome, terminal};

/// Find the path between two places of a map, and draw it.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  muster map path flat 1,3.9 9,7
  muster map path flat 1,3.9 9,7 --radius 0.3 --out runs/path.html

Exit code 2 if there is no path.")]
pub(super) struct Arguments {
    /// A map's YAML file, a flat's TOML file, or the name of a shipped flat.
    #[arg(value_name = "MAP")]
    map: PathBuf,
    /// Where the path begins, in metres of the map's frame.
    #[arg(value_name = "X,Y", value_parser = place::place, allow_hyphen_values = true)]
    from: MapXy,
    /// Where it ends.
    #[arg(value_name = "X,Y", value_parser = place::place, allow_hyphen_values = true)]
    to: MapXy,
    /// Distance to keep from walls, in metres
    #[arg(long, value_name = "METRES", value_parser = radius, allow_negative_numbers = true, default_value_t = LIMITS.radius_m)]
    radius: f64,
    /// Page to write [default: runs/MAP-path.html, with -2, -3, … appended if another page has the name]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

pub(super) fn radius(text: &str) -> Result<f64, String> {
    place::within(text, 0.0, 5.0)
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let (name, map) = place::map(&arguments.map)?;
    let file = PageFile::new(arguments.out.as_deref(), &name, "path")?;
    let floor = place::floor(&map, arguments.radius);
    let path = find(arguments, &floor)?;
    let length_m: f64 = path.windows(2).map(|leg| leg[0].distance_m(leg[1])).sum();
    let page = page::path(&name, &map, arguments.radius, &path);
    let file = file.write(&page)?;
    let legs = plural(path.len().saturating_sub(1), "straight leg");
    let mut text = format!(" {} m in {legs}\n", figure(length_m, 1));
    for corner in &path {
        text.push_str(&format!("   {:.2}, {:.2}\n", corner.x_m, corner.y_m));
    }
    text.push_str(&format!("\n wrote {}\n", file.display()));
    terminal::print(&text)?;
    Ok(Outcome::Success)
}

/// The path; an error says whether walls or zones are in the way.
fn find(arguments: &Arguments, floor: &Floor) -> Result<Vec<MapXy>, BadInput> {
    let (from, to) = (arguments.from, arguments.to);
    let refuse =
        |message: String, help: &str| Err(BadInput::without_excerpt(&arguments.map, message, help));
    // Only a refusal costs a second floor.
    let without_zones = || {
        let map = floor.map().without_zones();
        Floor::new(Arc::new(map), arguments.radius)
    };
    for end in [from, to] {
        if !floor.is_free(end) {
            let message = format!("a drone can't be at {end:?}");
            let radius = arguments.radius;
            if without_zones().is_free(end) {
                let message = format!("{message}: a keep-out zone is there, or too near");
                let help =
                    format!("a place on the map, {radius} m from zones that are not to be entered");
                return refuse(message, &help);
            }
            let help =
                format!("a place on the map, {radius} m from walls and from what is unknown");
            return refuse(message, &help);
        }
    }
    if let Some(path) = floor.path(from, to) {
        return Ok(path);
    }
    let message = format!("there is no path from {from:?} to {to:?}");
    if without_zones().path(from, to).is_some() {
        let message = format!("{message}: keep-out zones close the way");
        return refuse(
            message,
            "a smaller --radius, or other zones (`keep_out`, or `x` in a plan)",
        );
    }
    refuse(message, "a smaller --radius fits through narrower doors")
}
