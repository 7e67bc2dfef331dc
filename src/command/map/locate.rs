use std::io;
use std::path::{Path, PathBuf};

use clap::Args;
use muster_experiments::localisation::{self, Question, Start, Track};
use muster_experiments::output;
use muster_indoor::filter::Config;
use muster_indoor::frames::{BodyXy, MapPose, MapXy};
use muster_indoor::log;
use muster_indoor::reading::Mounting;
use muster_runtime::diagnostic::{BadInput, read_text};
use muster_runtime::map_file;

use super::place;
use crate::command::{Failure, Outcome, folder, numbers, terminal};

/// Find the place of a drive on a map: a particle filter over a log of laser scans.
///
/// Prints the track as a table. Writes located.html, with the map, the track and the particles at some moments, and
/// located.json. The log is of CARMEN (FLASER and ROBOTLASER1 messages), or has a line for each scan as the Málaga data set
/// has: index, odometry since the line before (m, m, rad), field of view (rad), number of beams, ranges (m) from right to
/// left. Without --start or --within, the drive may start anywhere.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  muster map locate floor.yaml drive.log
  muster map locate malaga_map.yaml malaga_scans.txt --laser 0.7,0,0 --end 15.91,-10.01,4.9")]
pub(super) struct Arguments {
    /// A map's YAML file, a flat's TOML file, or the name of a shipped flat.
    #[arg(value_name = "MAP")]
    map: PathBuf,
    /// The log of scans and odometry.
    #[arg(value_name = "LOG")]
    log: PathBuf,
    /// Random seed of the filter.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = numbers::whole::<u64>(0..=u64::MAX), allow_negative_numbers = true)]
    seed: u64,
    /// Pose at the start on the map: metres, metres, degrees.
    #[arg(long, value_name = "X,Y,DEG", value_parser = numbers::<3>, allow_hyphen_values = true, conflicts_with = "within")]
    start: Option<[f64; 3]>,
    /// Two corners of the area in which the drive starts, metres.
    #[arg(long, value_name = "X,Y,X,Y", value_parser = numbers::<4>, allow_hyphen_values = true)]
    within: Option<[f64; 4]>,
    /// Pose of the laser on the drone: metres forward, metres left, degrees.
    #[arg(long, value_name = "X,Y,DEG", value_parser = numbers::<3>, allow_hyphen_values = true, default_value = "0,0,0")]
    laser: [f64; 3],
    /// Range of the laser, metres, 0.1 to 1,000; longer ranges are no return.
    #[arg(long, value_name = "M", value_parser = range, allow_negative_numbers = true, default_value_t = 80.0)]
    range: f64,
    /// Most particles.
    #[arg(long, value_name = "N", default_value_t = Config::default().max_particles as u32, value_parser = numbers::whole::<u32>(1_000..=1_000_000), allow_negative_numbers = true)]
    particles: u32,
    /// Pose at the last scan, if it is known, to print the error: metres, metres, degrees.
    #[arg(long, value_name = "X,Y,DEG", value_parser = numbers::<3>, allow_hyphen_values = true)]
    end: Option<[f64; 3]>,
    /// Print the track as one JSON object instead of the table.
    #[arg(long)]
    json: bool,
    /// Output folder [default: runs/LOG-seed-N, with -2, -3, … appended if other tracks have the folder]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let (_, map) = place::map(&arguments.map)?;
    if let Some(start) = arguments.start.map(pose)
        && map.cell(start.at).is_none()
    {
        let message = format!("--start {:?} is off the map", start.at);
        let help = "--start takes a place on the map, in metres of its frame, and degrees";
        return Err(BadInput::without_excerpt(&arguments.map, message, help).into());
    }
    let text = read_text(&arguments.log)?;
    let refused = |refusal| map_file::refused(&arguments.log, &text, refusal);
    let log = log::parse(&text).map_err(refused)?;
    let default = folder::default_for(&arguments.log, format_args!("seed-{}", arguments.seed));
    folder::check_writable(arguments.out.as_deref().unwrap_or(&default))?;
    let bar = terminal::progress_bar("{msg} {bar:40.cyan/dim} {pos}/{len} scans");
    bar.set_length(log.len() as u64);
    let question = arguments.question();
    let located = localisation::locate(&question, &map, &log, |done| bar.set_position(done as u64));
    bar.finish_and_clear();
    let track = located.map_err(|error| {
        let help = "check the map with `muster map check`, and that --within is on it";
        BadInput::without_excerpt(&arguments.map, error, help)
    })?;
    let out = arguments.out.clone();
    let out = out.unwrap_or_else(|| output::numbered(&default, |it| track.is_in(it)));
    let written = localisation::write(&out, &track, &map)?;
    if arguments.json {
        let json = serde_json::to_string(&track).map_err(io::Error::from)?;
        terminal::print(&format!("{json}\n"))?;
    } else {
        print(&track, &written)?;
    }
    Ok(Outcome::Success)
}

impl Arguments {
    fn question(&self) -> Question {
        let [forward_m, left_m, bearing_deg] = self.laser;
        let start = match (self.start, self.within) {
            (Some(start), _) => Start::At(pose(start)),
            (None, Some([x1, y1, x2, y2])) => Start::Within(MapXy::new(x1, y1), MapXy::new(x2, y2)),
            (None, None) => Start::Anywhere,
        };
        Question {
            map_name: name(&self.map),
            log_name: name(&self.log),
            config: Config {
                max_particles: self.particles as usize,
                cone_range_max_m: 0.0,
                ..Config::default()
            },
            seed: self.seed,
            start,
            laser: Mounting::laser(
                BodyXy::new(forward_m, left_m),
                bearing_deg.to_radians(),
                self.range,
            ),
            end: self.end.map(pose),
        }
    }
}

fn range(text: &str) -> Result<f64, String> {
    place::within(text, 0.1, 1_000.0)
}

fn pose([x_m, y_m, heading_deg]: [f64; 3]) -> MapPose {
    MapPose::new(x_m, y_m, heading_deg.to_radians())
}

fn name(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default();
    name.to_string_lossy().into_owned()
}

/// Numbers between commas.
fn numbers<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let accepted = || format!("{N} numbers between commas are accepted");
    let number = |word: &str| word.trim().parse().ok().filter(|it: &f64| it.is_finite());
    let numbers: Option<Vec<f64>> = text.split(',').map(number).collect();
    numbers
        .ok_or_else(accepted)?
        .try_into()
        .map_err(|_| accepted())
}

fn print(track: &Track, written: &[PathBuf]) -> io::Result<()> {
    let mut text = localisation::table(track, terminal::colour(&io::stdout()));
    for path in written {
        text.push_str(&format!("\n wrote {}", path.display()));
    }
    text.push('\n');
    terminal::print(&text)
}
