//! When sonars fire: in turns of groups, so that none hears another's ping.

use std::time::Duration;

use super::SOUND_MPS;

/// Pings can be heard from as far as this, there and back, metres. HC-SR04: 4 m.
const HEARD_MAX_M: f64 = 8.0;
/// Times that turns are longer than a ping is heard: so much may they be late.
const MARGIN: f64 = 1.25;
/// Axes of sonars that fire together are at least this far apart, radians: 150°. Sonars at right angles hear each other's pings
/// by way of a corner.
const APART_MIN_RAD: f64 = 2.618;
/// A sonar's echo has ended this long after its ping, and the sonar can be fired again. HC-SR04: its line is high for 38 ms if
/// nothing comes back (*HC-SR04 User Guide*, timing diagram), and the ping starts within 7 ms.
pub const ECHO_MAX: Duration = Duration::from_millis(45);

/// Groups of sonars that fire in turns.
#[derive(Debug, Clone, PartialEq)]
pub struct Schedule {
    groups: Vec<Vec<usize>>,
    slot: Duration,
}

/// Why sonars can't be fired as asked.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum ScheduleError {
    /// No sonar, or a rate of 0.
    #[error("there is no sonar to fire")]
    Empty,
    /// A group would hear the one before, or a sonar be fired before its echo ended.
    #[error(
        "sonars in {groups} groups can't fire {rate_hz} times a second: at most {fastest_hz:.1} times"
    )]
    TooFast {
        /// Groups that fire in turns.
        groups: usize,
        /// Asked for.
        rate_hz: f64,
        /// The highest rate that these groups can fire at.
        fastest_hz: f64,
    },
}

impl Schedule {
    /// A schedule in which each sonar fires `rate_hz` times a second. `axes_rad` are the sonars' directions; `None` is one that
    /// looks up or down. Sonars that look far apart fire together.
    ///
    /// # Errors
    /// If the echoes of one group would be heard by the next, or a sonar would be fired before its echo ended.
    pub fn new(axes_rad: &[Option<f64>], rate_hz: f64) -> Result<Self, ScheduleError> {
        let mut groups: Vec<Vec<usize>> = Vec::new();
        for sonar in 0..axes_rad.len() {
            let fits = |group: &Vec<usize>| {
                group
                    .iter()
                    .all(|it| are_apart(axes_rad[*it], axes_rad[sonar]))
            };
            // Small groups first, so that no turn is louder than needed.
            let group = groups
                .iter_mut()
                .filter(|group| fits(group))
                .min_by_key(|group| group.len());
            match group {
                Some(group) => group.push(sonar),
                None => groups.push(vec![sonar]),
            }
        }
        if groups.is_empty() || rate_hz.is_nan() || rate_hz <= 0.0 {
            return Err(ScheduleError::Empty);
        }
        let slot_s = 1.0 / (rate_hz * groups.len() as f64);
        let least_s = pause_min_s(groups.len()).max(MARGIN * HEARD_MAX_M / SOUND_MPS);
        if slot_s < least_s {
            return Err(ScheduleError::TooFast {
                groups: groups.len(),
                rate_hz,
                fastest_hz: 1.0 / (least_s * groups.len() as f64),
            });
        }
        Ok(Self {
            groups,
            slot: Duration::from_secs_f64(slot_s),
        })
    }

    /// The sonars of a group, by their place in the list that the schedule was made of.
    #[must_use]
    pub fn group(&self, group: usize) -> &[usize] {
        self.groups.get(group).map_or(&[], Vec::as_slice)
    }

    /// From one group's firing to the next one's.
    #[must_use]
    pub fn slot(&self) -> Duration {
        self.slot
    }

    /// Times a second that each sonar fires.
    #[must_use]
    pub fn rate_hz(&self) -> f64 {
        1.0 / (self.slot.as_secs_f64() * self.groups.len() as f64)
    }
}

/// Least time from one group's firing to the next one's, seconds.
fn pause_min_s(groups: usize) -> f64 {
    let heard_s = HEARD_MAX_M / SOUND_MPS;
    heard_s.max(ECHO_MAX.as_secs_f64() / groups as f64)
}

/// The turns of a schedule's groups, as long as someone asks.
#[derive(Debug, Clone, PartialEq)]
pub struct Turns {
    schedule: Schedule,
    /// Group that fires next.
    group: usize,
    /// From when on; `None` before the first question.
    due: Option<Duration>,
}

impl Turns {
    /// The first group is due when it is first asked for.
    #[must_use]
    pub fn new(schedule: Schedule) -> Self {
        Self {
            schedule,
            group: 0,
            due: None,
        }
    }

    /// The schedule.
    #[must_use]
    pub fn schedule(&self) -> &Schedule {
        &self.schedule
    }

    /// The sonars to fire at `now`; `None` if it is no group's turn. A late turn delays the next one only if it would hear the
    /// echoes otherwise. No group is skipped: after a stall the turns go on where they stopped.
    pub fn next(&mut self, now: Duration) -> Option<&[usize]> {
        let due = self.due.unwrap_or(now);
        if now < due {
            return None;
        }
        let groups = self.schedule.groups.len();
        let pause = Duration::from_secs_f64(pause_min_s(groups));
        self.due = Some((due + self.schedule.slot).max(now + pause));
        let group = self.group;
        self.group = (group + 1) % groups;
        Some(&self.schedule.groups[group])
    }
}

fn are_apart(one: Option<f64>, other: Option<f64>) -> bool {
    match (one, other) {
        (Some(one), Some(other)) => crate::frames::wrapped_rad(one - other).abs() >= APART_MIN_RAD,
        (None, None) => false,
        _ => true,
    }
}
