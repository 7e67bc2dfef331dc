//! Which sonars are to be believed.

use std::time::Duration;

use muster_machines::indoor::{Fault, SonarChange};
use muster_machines::time::Timestamp;

use super::config::Config;
use super::guard::Watch;
use crate::frames::{MapPose, wrapped_rad};
use crate::map::Map;
use crate::reading::{Echo, Mounting, Reading};

/// A sonar that says nothing for so long is dead.
const DEAD_AFTER: Duration = Duration::from_millis(800);
/// Implausible readings in a row that make a sonar fail: 1.2 s at 8 Hz.
const IMPLAUSIBLE_MAX: u32 = 10;
/// Plausible readings in a row after which a failed sonar is believed again: 3 s at 8 Hz.
const PLAUSIBLE_MIN: u32 = 24;
/// Echoes from nearer than this are stuck if the map has nothing there, in metres.
const TOUCHING_M: f64 = 0.1;
/// Walls up to so far must echo, in metres: half of an HC-SR04's range.
const MUST_ECHO_M: f64 = 2.0;
/// Distance by which the map's walls may be off, in metres: walls and pose.
const TOLERANCE_M: f64 = 0.3;
/// Rays that stand for a cone.
const RAYS: i32 = 7;

/// All sonars of a drone.
#[derive(Debug)]
pub(super) struct Sonars {
    all: Vec<Sonar>,
}

#[derive(Debug)]
struct Sonar {
    mounting: Mounting,
    last: Option<Reading>,
    heard: Timestamp,
    /// The fault that readings in a row show, and their number.
    suspect: (Option<Fault>, u32),
    plausible: u32,
    fault: Option<Fault>,
}

impl Sonars {
    pub(super) fn new(config: &Config) -> Self {
        let sonar = |mounting: &Mounting| Sonar {
            mounting: *mounting,
            last: None,
            heard: Timestamp::ZERO,
            suspect: (None, 0),
            plausible: 0,
            fault: None,
        };
        Self {
            all: config.sonars.iter().map(sonar).collect(),
        }
    }

    /// Compares readings with the map, seen from `pose`; the changes.
    pub(super) fn judge(
        &mut self,
        now: Timestamp,
        config: &Config,
        pose: MapPose,
        readings: &[Reading],
    ) -> Vec<SonarChange> {
        let map = config.floor.map();
        let mut changes = Vec::new();
        for (place, sonar) in self.all.iter_mut().enumerate() {
            let before = sonar.fault;
            if sonar.heard == Timestamp::ZERO {
                sonar.heard = now;
            }
            for reading in readings {
                if reading.mounting == sonar.mounting {
                    sonar.hear(now, map, pose, reading);
                }
            }
            if now.since(sonar.heard) >= DEAD_AFTER {
                sonar.fault = Some(Fault::Dead);
            }
            if sonar.fault != before {
                changes.push(SonarChange {
                    sonar: place,
                    fault: sonar.fault,
                });
            }
        }
        changes
    }

    /// Whether a reading is of a sonar that works.
    pub(super) fn is_trusted(&self, reading: &Reading) -> bool {
        let of = self.all.iter().find(|it| it.mounting == reading.mounting);
        of.is_some_and(|sonar| sonar.fault.is_none() && sonar.suspect.1 < IMPLAUSIBLE_MAX / 2)
    }

    /// The last words of the sonars that work, as far as they are valid.
    pub(super) fn watches(&self, now: Timestamp) -> Vec<Watch> {
        let now = Duration::from_nanos(now.as_nanos());
        let working = self.all.iter().filter(|sonar| sonar.fault.is_none());
        let words = working.filter_map(|sonar| sonar.last.filter(|it| now < it.expires));
        let heard = words.filter(|reading| reading.echo != Echo::Failed);
        let watch = |reading: Reading| Watch {
            mounting: reading.mounting,
            echo: reading.echo,
        };
        heard.map(watch).collect()
    }

    /// The axis of the working sonar that looks most nearly forward, in radians from forward: it is turned to the course.
    /// `None` if none works.
    pub(super) fn leading_rad(&self) -> Option<f64> {
        let working = self.all.iter().filter(|sonar| sonar.fault.is_none());
        let axes = working.map(|sonar| wrapped_rad(sonar.mounting.bearing_rad));
        axes.min_by(|a, b| a.abs().total_cmp(&b.abs()))
    }
}

impl Sonar {
    fn hear(&mut self, now: Timestamp, map: &Map, pose: MapPose, reading: &Reading) {
        self.last = Some(*reading);
        if reading.echo != Echo::Failed {
            self.heard = now;
        }
        let fault = implausible(map, pose, reading);
        if fault.is_none() {
            self.plausible += 1;
            self.suspect = (None, 0);
        } else {
            self.plausible = 0;
            let count = if self.suspect.0 == fault {
                self.suspect.1
            } else {
                0
            };
            self.suspect = (fault, count + 1);
        }
        if self.suspect.1 >= IMPLAUSIBLE_MAX {
            self.fault = self.suspect.0;
        } else if self.plausible >= PLAUSIBLE_MIN {
            self.fault = None;
        }
    }
}

/// The fault that a reading shows by itself.
fn implausible(map: &Map, pose: MapPose, reading: &Reading) -> Option<Fault> {
    let expected = expected_m(map, pose, &reading.mounting);
    match reading.echo {
        Echo::At(range_m) if range_m < TOUCHING_M => {
            let is_wall_near = expected.is_some_and(|it| it < range_m + TOLERANCE_M);
            (!is_wall_near).then_some(Fault::Stuck)
        }
        Echo::Silence => expected.filter(|it| *it < MUST_ECHO_M).map(|_| Fault::Deaf),
        Echo::At(_) | Echo::Failed => None,
    }
}

/// Distance of the nearest wall in a sonar's cone by the map, in metres; `None` if there is none in its range.
pub(super) fn expected_m(map: &Map, pose: MapPose, mounting: &Mounting) -> Option<f64> {
    let at = pose.place(mounting.at);
    let axis_rad = pose.heading_rad + mounting.bearing_rad;
    let rays = (0..RAYS).map(|ray| {
        let share = f64::from(ray) / f64::from(RAYS - 1) - 0.5;
        map.cast(
            at,
            axis_rad + share * mounting.aperture_rad,
            mounting.range_max_m,
        )
    });
    rays.flatten().min_by(f64::total_cmp)
}
