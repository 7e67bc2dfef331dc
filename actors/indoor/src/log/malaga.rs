//! The form in which scans of the Málaga data set come: a line a scan, of index, odometry since the line before (metres
//! forward, metres left, radians), field of view (radians), the number of beams, and as many ranges from right to left, `-`,
//! -1 or 0 where nothing came back.

use super::tokens::Tokens;
use super::{BEAMS_MAX, MOTION_MAX, RANGE_MAX_M, STEPS_MAX, Scan, Step, returned};
use crate::frames::Motion;
use crate::refusal::Refusal;

pub(super) fn parse(text: &str) -> Result<Vec<Step>, Refusal> {
    let mut steps = Vec::new();
    for line in text.lines().filter(|line| !line.trim().is_empty()) {
        let mut words = Tokens::new(text, line);
        if steps.len() == STEPS_MAX {
            let message = format!("the log has more than {STEPS_MAX} scans");
            return Err(words.refuse(line, &message, "cut it into several"));
        }
        words.number("the index", (0.0, 1e9))?;
        let motion = Motion {
            forward_m: words.number("the distance forward in metres", MOTION_MAX)?,
            left_m: words.number("the distance to the left in metres", MOTION_MAX)?,
            turn_rad: words.number("the turn in radians", MOTION_MAX)?,
        };
        let view_rad = words.number("the field of view in radians", (0.0, 6.3))?;
        let beams = words.count("the number of beams", (2, BEAMS_MAX))?;
        let mut ranges_m = Vec::with_capacity(beams);
        for _ in 0..beams {
            ranges_m.push(match words.take(&["-", "-1", "-1.000"]) {
                true => None,
                false => returned(words.number("a range in metres", (0.0, RANGE_MAX_M))?),
            });
        }
        if let Some(word) = words.next() {
            let message = format!("there are more than the {beams} ranges that the line promises");
            return Err(words.refuse(word, &message, "as many ranges as beams"));
        }
        steps.push(Step {
            motion,
            scan: Scan {
                first_rad: -view_rad / 2.0,
                between_rad: view_rad / (beams - 1) as f64,
                ranges_m,
            },
            truth: None,
        });
    }
    Ok(steps)
}
