//! Logs of CARMEN: a line a message, of its name and values.
//!
//! Source: *CARMEN log file format*, as given in the headers of its logs. `FLASER` and `ROBOTLASER1` are scans with the
//! odometry's pose; `TRUEPOS` is where a simulated robot is. All other messages and comments are skipped.

use std::f64::consts::PI;

use super::tokens::Tokens;
use super::{BEAMS_MAX, RANGE_MAX_M, STEPS_MAX, Scan, Step, returned};
use crate::frames::{MapPose, Motion, OdometryPose};
use crate::refusal::Refusal;

/// Farthest place, metres.
const PLACE_MAX: (f64, f64) = (-1e6, 1e6);
/// Angles, radians.
const ANGLE_MAX: (f64, f64) = (-100.0, 100.0);
/// Old logs give no directions: half a turn to the front.
const VIEW_RAD: f64 = PI;

pub(super) fn parse(text: &str) -> Result<Vec<Step>, Refusal> {
    let mut steps: Vec<Step> = Vec::new();
    let mut before: Option<OdometryPose> = None;
    let mut truth = None;
    for line in text.lines() {
        let mut words = Tokens::new(text, line);
        let (scan, odometry) = match words.next() {
            Some("FLASER") => front_laser(&mut words)?,
            Some("ROBOTLASER1") => robot_laser(&mut words)?,
            Some("TRUEPOS") => {
                let (x_m, y_m, heading_rad) = pose(&mut words, "the true pose")?;
                truth = Some(MapPose::new(x_m, y_m, heading_rad));
                continue;
            }
            Some(name) if !is_message(name) => {
                let accepted = "names of messages like FLASER, ODOM, PARAM, or comments with `#`";
                return Err(words.refuse(name, &format!("{name:?} is no message"), accepted));
            }
            _ => continue,
        };
        if steps.len() == STEPS_MAX {
            let message = format!("the log has more than {STEPS_MAX} scans");
            return Err(words.refuse(line, &message, "cut it into several"));
        }
        let motion = before.map_or(Motion::default(), |before| before.motion_to(odometry));
        before = Some(odometry);
        steps.push(Step {
            motion,
            scan,
            truth,
        });
    }
    Ok(steps)
}

/// Whether a line with this first word is a message, or a comment.
fn is_message(name: &str) -> bool {
    let is_letter = |byte: u8| byte.is_ascii_uppercase() || byte.is_ascii_digit() || byte == b'_';
    name.starts_with('#') || name.bytes().all(is_letter) && name.as_bytes()[0].is_ascii_uppercase()
}

/// Number of readings, readings, the laser's pose, the odometry's pose, and times, which are not read.
fn front_laser(words: &mut Tokens<'_>) -> Result<(Scan, OdometryPose), Refusal> {
    let ranges_m = ranges(words)?;
    pose(words, "the laser's pose")?;
    let (x_m, y_m, heading_rad) = pose(words, "the odometry's pose")?;
    // An even number of beams leaves out the last direction: 180 beams are 1° apart.
    let beams = ranges_m.len();
    let gaps = if beams % 2 == 0 { beams } else { beams - 1 };
    let scan = Scan {
        first_rad: -VIEW_RAD / 2.0,
        between_rad: VIEW_RAD / gaps as f64,
        ranges_m,
    };
    Ok((scan, OdometryPose::new(x_m, y_m, heading_rad)))
}

/// The laser's type, first direction, view, resolution, range and accuracy, the remission's mode, ranges, remissions, the
/// laser's pose, the robot's pose, and more that is not read.
fn robot_laser(words: &mut Tokens<'_>) -> Result<(Scan, OdometryPose), Refusal> {
    words.number("the laser's type", (0.0, 1e3))?;
    let first_rad = words.number("the first direction in radians", ANGLE_MAX)?;
    words.number("the field of view in radians", ANGLE_MAX)?;
    let between_rad = words.number("the angle between beams in radians", ANGLE_MAX)?;
    let range_max_m = words.number("the laser's range in metres", (0.0, f64::MAX))?;
    words.number("the laser's accuracy", (0.0, f64::MAX))?;
    words.number("the remission's mode", (0.0, 1e3))?;
    let mut ranges_m = ranges(words)?;
    for range_m in &mut ranges_m {
        *range_m = range_m.filter(|range_m| f64::from(*range_m) < range_max_m);
    }
    for _ in 0..words.count("the number of remissions", (0, BEAMS_MAX))? {
        words.number("a remission", (f64::MIN, f64::MAX))?;
    }
    pose(words, "the laser's pose")?;
    let (x_m, y_m, heading_rad) = pose(words, "the robot's pose")?;
    let scan = Scan {
        first_rad,
        between_rad,
        ranges_m,
    };
    Ok((scan, OdometryPose::new(x_m, y_m, heading_rad)))
}

fn ranges(words: &mut Tokens<'_>) -> Result<Vec<Option<f32>>, Refusal> {
    let beams = words.count("the number of beams", (2, BEAMS_MAX))?;
    let range = |_| {
        let range_m = words.number("a range in metres", (0.0, RANGE_MAX_M))?;
        Ok(returned(range_m))
    };
    (0..beams).map(range).collect()
}

fn pose(words: &mut Tokens<'_>, what: &str) -> Result<(f64, f64, f64), Refusal> {
    Ok((
        words.number(&format!("{what}, x in metres"), PLACE_MAX)?,
        words.number(&format!("{what}, y in metres"), PLACE_MAX)?,
        words.number(&format!("{what}, heading in radians"), ANGLE_MAX)?,
    ))
}
