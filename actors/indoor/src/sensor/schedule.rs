//! When sonars fire: in turns of groups, so that none hears another's ping.

use std::time::Duration;

use super::SOUND_MPS;

/// Pings can be heard from as far as this, there and back, metres. HC-SR04: 4 m, and a margin of a quarter.
const HEARD_MAX_M: f64 = 10.0;
/// Axes of sonars that fire together are at least this far apart, radians: 150°. Sonars at right angles hear each other's pings
/// by way of a corner.
const APART_MIN_RAD: f64 = 2.618;

/// Which sonars fire, and when.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Firing {
    /// When, since the schedule's start.
    pub at: Duration,
    /// The group's number.
    pub group: usize,
}

/// Groups of sonars that fire in turns.
#[derive(Debug, Clone, PartialEq)]
pub struct Schedule {
    groups: Vec<Vec<usize>>,
    slot: Duration,
}

/// Why sonars can't be fired as asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum ScheduleError {
    /// No sonar, or a rate of 0.
    #[error("there is no sonar to fire")]
    Empty,
    /// Turns would be shorter than the echoes of the turn before last.
    #[error(
        "{groups} groups can't fire {rate_mhz} times in 1,000 s: an echo can take {heard_ms} ms"
    )]
    TooFast {
        /// Groups that fire in turns.
        groups: usize,
        /// Asked for, thousandths of a hertz.
        rate_mhz: u32,
        /// How long an echo can take.
        heard_ms: u32,
    },
}

impl Schedule {
    /// A schedule in which each sonar fires `rate_hz` times a second. `axes_rad` are the sonars' directions; `None` is one that
    /// looks up or down. Sonars that look far apart fire together.
    ///
    /// # Errors
    /// If the echoes of one group would be heard by the next.
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
        let heard_s = HEARD_MAX_M / SOUND_MPS;
        if slot_s < heard_s {
            return Err(ScheduleError::TooFast {
                groups: groups.len(),
                rate_mhz: (rate_hz * 1e3) as u32,
                heard_ms: libm::ceil(heard_s * 1e3) as u32,
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

    /// The first firing at or after `time`, since the schedule's start.
    #[must_use]
    pub fn next(&self, time: Duration) -> Firing {
        let slot = self.slot.as_nanos().max(1);
        let number = time.as_nanos().div_ceil(slot);
        Firing {
            at: Duration::from_nanos((number * slot) as u64),
            group: (number % self.groups.len() as u128) as usize,
        }
    }
}

fn are_apart(one: Option<f64>, other: Option<f64>) -> bool {
    match (one, other) {
        (Some(one), Some(other)) => crate::frames::wrapped_rad(one - other).abs() >= APART_MIN_RAD,
        (None, None) => false,
        _ => true,
    }
}
