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
/// Signs of one fault without an echo between that make a sonar fail: 0.75 s at 8 Hz.
const SIGNS_MAX: u32 = 6;
/// Echoes after the last sign of a fault that make a failed sonar be believed again: 3 s at 8 Hz.
const ECHOES_MIN: u32 = 24;
/// After so long without an echo, silence of a sonar is no free way: the drone turns. The turn to a wall and [`SIGNS_MAX`] readings
/// take the rest of the 2 s within which a fault must be found.
const ECHO_HOLDS: Duration = Duration::from_millis(1_200);
/// Echoes from nearer than this are stuck if the map has nothing there, in metres.
const TOUCHING_M: f64 = 0.1;
/// Share of the cone, about its axis, in which a wall must echo: at its edges the pose decides.
const MUST_ECHO_CONE: f64 = 0.5;
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
    /// When it last gave an echo from anything but right before it.
    echoed: Option<Timestamp>,
    /// The fault that readings show, and their number since the last echo.
    suspect: (Option<Fault>, u32),
    /// Echoes since the last sign of a fault.
    echoes: u32,
    fault: Option<Fault>,
}

impl Sonars {
    pub(super) fn new(config: &Config) -> Self {
        let sonar = |mounting: &Mounting| Sonar {
            mounting: *mounting,
            last: None,
            heard: Timestamp::ZERO,
            suspect: (None, 0),
            echoes: 0,
            echoed: None,
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
                sonar.die();
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
        of.is_some_and(|sonar| sonar.fault.is_none() && sonar.suspect.1 < SIGNS_MAX / 2)
    }

    /// Whether a sonar fails.
    pub(super) fn has_fault(&self) -> bool {
        self.all.iter().any(|sonar| sonar.fault.is_some())
    }

    /// Latest valid readings of the working sonars.
    pub(super) fn watches(&self, now: Timestamp) -> Vec<Watch> {
        let working = self.all.iter().filter(|sonar| sonar.works(now));
        let now = Duration::from_nanos(now.as_nanos());
        let readings = working.filter_map(|sonar| sonar.last.filter(|it| now < it.expires));
        let watch = |reading: Reading| Watch {
            mounting: reading.mounting,
            echo: reading.echo,
        };
        readings.map(watch).collect()
    }

    /// The axis of the working sonar that looks most nearly forward, in radians from forward: it is turned to the course.
    /// `None` if none works.
    pub(super) fn leading_rad(&self, now: Timestamp) -> Option<f64> {
        let working = self.all.iter().filter(|sonar| sonar.works(now));
        let axes = working.map(|sonar| wrapped_rad(sonar.mounting.bearing_rad));
        axes.min_by(|a, b| a.abs().total_cmp(&b.abs()))
    }
}

impl Sonar {
    /// Whether it has no fault and showed lately that it hears. Where the map has no wall, a deaf sonar can't be told from one
    /// before a free way; no drone flies by either.
    fn works(&self, now: Timestamp) -> bool {
        let has_echoed = self.echoed.is_some_and(|at| now.since(at) < ECHO_HOLDS);
        self.fault.is_none() && has_echoed
    }

    /// Echoes from before its death don't count for it.
    fn die(&mut self) {
        self.fault = Some(Fault::Dead);
        self.suspect = (None, 0);
        self.echoes = 0;
    }

    /// Whether a reading came after one that was taken later and still holds.
    fn is_overtaken(&self, now: Timestamp, reading: &Reading) -> bool {
        let now = Duration::from_nanos(now.as_nanos());
        let last = self.last.filter(|it| now < it.expires);
        last.is_some_and(|last| reading.taken < last.taken)
    }

    fn hear(&mut self, now: Timestamp, map: &Map, pose: MapPose, reading: &Reading) {
        // A failed measurement says nothing: what was heard before holds until it expires.
        if reading.echo == Echo::Failed || self.is_overtaken(now, reading) {
            return;
        }
        self.last = Some(*reading);
        self.heard = now;
        match sign(map, pose, reading) {
            Sign::Works => {
                self.echoed = Some(now);
                self.echoes += 1;
                self.suspect = (None, 0);
            }
            Sign::Fails(fault) => {
                self.echoes = 0;
                let before = (self.suspect.0 == Some(fault)).then_some(self.suspect.1);
                self.suspect = (Some(fault), before.unwrap_or(0) + 1);
            }
            Sign::Nothing => {}
        }
        if self.suspect.1 >= SIGNS_MAX {
            self.fault = self.suspect.0;
        } else if self.echoes >= ECHOES_MIN {
            self.fault = None;
        }
    }
}

/// What a reading says of its sonar.
enum Sign {
    /// It hears what is there.
    Works,
    Fails(Fault),
    /// A sonar that works may say this, and one that fails too: silence where the map has no wall near.
    Nothing,
}

fn sign(map: &Map, pose: MapPose, reading: &Reading) -> Sign {
    let mounting = &reading.mounting;
    match reading.echo {
        Echo::At(range_m) if range_m < TOUCHING_M => {
            let expected = expected_m(map, pose, mounting);
            if expected.is_some_and(|it| it < range_m + TOLERANCE_M) {
                Sign::Nothing
            } else {
                Sign::Fails(Fault::Stuck)
            }
        }
        Echo::At(_) => Sign::Works,
        Echo::Silence => {
            // A wall that is in range also if map and pose err must echo.
            let middle = Mounting {
                aperture_rad: MUST_ECHO_CONE * mounting.aperture_rad,
                range_max_m: mounting.range_max_m - TOLERANCE_M,
                ..*mounting
            };
            match expected_m(map, pose, &middle) {
                Some(_) => Sign::Fails(Fault::Deaf),
                None => Sign::Nothing,
            }
        }
        Echo::Failed => Sign::Nothing,
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::patrol::tests::room;

    #[test]
    fn dead_sonar_is_believed_after_as_many_echoes_as_another_and_no_silence() {
        // In the middle of a hall silence is no fault.
        let pose = MapPose::new(6.5, 6.5, 0.0);
        let config = room((260, 260), pose, 1.0);
        let mut sonars = Sonars::new(&config);
        let mounting = config.sonars[2];
        let mut now = Timestamp::ZERO;
        let mut judge = |echo: Option<Echo>| {
            now += Duration::from_millis(100);
            let taken = Duration::from_nanos(now.as_nanos());
            let reading = echo.map(|echo| Reading {
                mounting,
                echo,
                taken,
                expires: taken + Duration::from_millis(300),
            });
            let readings: Vec<Reading> = reading.into_iter().collect();
            sonars.judge(now, &config, pose, &readings);
            sonars.all[2].fault
        };
        for _ in 0..2 * ECHOES_MIN {
            assert_eq!(judge(Some(Echo::At(1.0))), None);
        }
        for _ in 0..10 {
            judge(None);
        }
        for _ in 1..ECHOES_MIN {
            assert_eq!(judge(Some(Echo::At(1.0))), Some(Fault::Dead));
            assert_eq!(judge(Some(Echo::Silence)), Some(Fault::Dead));
        }
        assert_eq!(judge(Some(Echo::At(1.0))), None);
    }

    #[test]
    fn reading_that_comes_after_a_later_one_is_ignored() {
        let pose = MapPose::new(1.0, 1.5, 0.0);
        let config = room((80, 60), pose, 1.0);
        let mut sonars = Sonars::new(&config);
        let mounting = config.sonars[2];
        let now = Timestamp::ZERO + Duration::from_secs(1);
        let reading = |echo, taken_ms: u64| Reading {
            mounting,
            echo,
            taken: Duration::from_millis(taken_ms),
            expires: Duration::from_millis(taken_ms + 300),
        };
        let readings = [reading(Echo::At(0.25), 1_000), reading(Echo::Silence, 800)];
        sonars.judge(now, &config, pose, &readings);
        let heard: Vec<Echo> = sonars.watches(now).into_iter().map(|it| it.echo).collect();
        assert_eq!(heard, [Echo::At(0.25)]);
        // What no longer holds overtakes nothing.
        let late = Timestamp::ZERO + Duration::from_secs(2);
        sonars.judge(late, &config, pose, &[reading(Echo::At(3.0), 1_900)]);
        assert_eq!(sonars.watches(late)[0].echo, Echo::At(3.0));
    }
}
