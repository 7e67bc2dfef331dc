//! What came of a patrol.

use std::time::Duration;

use muster_indoor::frames::{MapPose, MapXy, wrapped_rad};
use muster_indoor::patrol::{Config, EarlyLanding, Event, SonarChange, Velocity};
use muster_indoor::reading::Mounting;
use muster_machines::time::Timestamp;

use super::{CLEARANCE_M, Setup, Touch, Touched};

/// Speed below which a drone hovers, in m/s.
const HOVERS_MPS: f64 = 1e-6;
/// Time within which a failing sonar must be found.
pub(super) const FOUND_WITHIN: Duration = Duration::from_secs(2);

/// A moment of a patrol.
#[derive(Debug, Clone, PartialEq)]
pub struct Sample {
    /// Time since the patrol began.
    pub at: Timestamp,
    /// Where the drone was.
    pub pose: MapPose,
    /// Where it took itself to be.
    pub believed: MapPose,
    /// Where the people were.
    pub people: Vec<MapXy>,
}

/// Where the drone was, and where it took itself to be.
#[derive(Debug, Clone, PartialEq)]
pub struct Track {
    /// Where it takes itself to be at present.
    believed: MapPose,
    samples: Vec<Sample>,
    /// Errors of the believed position, one a step, in metres.
    errors_m: Vec<f64>,
}

impl Track {
    const fn new(start: MapPose) -> Self {
        Self {
            believed: start,
            samples: Vec::new(),
            errors_m: Vec::new(),
        }
    }

    /// Two samples a second, oldest first.
    #[must_use]
    pub fn samples(&self) -> &[Sample] {
        &self.samples
    }

    /// The error of the believed position that a share of the steps stays below, in metres; 0 without steps.
    #[must_use]
    pub fn error_m(&self, share: f64) -> f64 {
        let mut sorted = self.errors_m.clone();
        sorted.sort_by(f64::total_cmp);
        let at = (sorted.len() as f64 * share).ceil() as usize;
        sorted.get(at.saturating_sub(1)).copied().unwrap_or(0.0)
    }

    /// The drone takes itself to be at `believed` while it is at `pose`.
    fn believes(&mut self, believed: MapPose, pose: MapPose) {
        self.believed = believed;
        self.errors_m.push(believed.at.distance_m(pose.at));
    }

    pub(super) fn sample(&mut self, at: Timestamp, pose: MapPose, people: Vec<MapXy>) {
        let believed = self.believed;
        self.samples.push(Sample {
            at,
            pose,
            believed,
            people,
        });
    }
}

/// How far the drone stayed from walls and people.
///
/// Invariant: each time that the clearance became less than [`CLEARANCE_M`] is one touch, however long it lasted. A fault of the
/// drone while a person touches it is another.
#[derive(Debug, Clone, PartialEq)]
pub struct Clearance {
    least_m: f64,
    touches: Vec<Touch>,
    /// What the last touch was of, while it goes on.
    touching: Option<Touched>,
}

impl Clearance {
    const fn unmeasured() -> Self {
        Self {
            least_m: f64::INFINITY,
            touches: Vec::new(),
            touching: None,
        }
    }

    /// Least distance from walls and people, in metres; at most 1 m is measured. Infinite before the first measurement.
    #[must_use]
    pub const fn least_m(&self) -> f64 {
        self.least_m
    }

    /// Each time that the clearance became too small.
    #[must_use]
    pub fn touches(&self) -> &[Touch] {
        &self.touches
    }

    /// Whether the drone caused a touch.
    #[must_use]
    pub fn is_at_fault(&self) -> bool {
        self.touches.iter().any(Touch::is_fault)
    }

    /// Records the clearances from what is near the drone at a place.
    pub(super) fn measure(&mut self, at: Timestamp, place: MapXy, near: &[(f64, Touched)]) {
        for (clearance_m, _) in near {
            self.least_m = self.least_m.min(*clearance_m);
        }
        let touches = near.iter().filter(|(it, _)| *it < CLEARANCE_M);
        let touches = touches.map(|(clearance_m, what)| Touch {
            what: *what,
            at,
            place,
            clearance_m: *clearance_m,
        });
        // A fault of the drone counts before a nearer person who came to it.
        let worst = touches.min_by(|a, b| {
            let faults = b.is_fault().cmp(&a.is_fault());
            faults.then(a.clearance_m.total_cmp(&b.clearance_m))
        });
        let Some(touch) = worst else {
            self.touching = None;
            return;
        };
        let is_new = match self.touching {
            None => true,
            Some(before) => before == Touched::ByPerson && touch.is_fault(),
        };
        if is_new {
            self.touching = Some(touch.what);
            self.touches.push(touch);
        }
    }
}

/// What came of a patrol.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// Whether the drone ended it.
    pub is_done: bool,
    /// Its time.
    pub time: Duration,
    /// Targets that can be seen.
    pub visible: usize,
    /// Targets of those that were not seen.
    pub unseen: usize,
    /// Which these are.
    pub unseen_targets: Vec<usize>,
    /// How far the drone stayed from walls and people.
    pub clearance: Clearance,
    /// Why it ended the patrol early and landed, if it did.
    pub landed: Option<EarlyLanding>,
    /// Stops that were given up.
    pub given_up: Vec<MapXy>,
    /// Sonars that were found to fail or to work again.
    pub sonars: Vec<(Timestamp, SonarChange)>,
    /// Motions into a direction that no working sonar looked along, later than `FOUND_WITHIN` after a sonar failed.
    pub blind_motions: u64,
    /// Where the drone was.
    pub track: Track,
    timed_out: bool,
}

impl Outcome {
    pub(super) fn new(config: &Config) -> Self {
        let visible = config.places.visible().len();
        Self {
            is_done: false,
            time: Duration::ZERO,
            visible,
            unseen: visible,
            unseen_targets: Vec::new(),
            clearance: Clearance::unmeasured(),
            landed: None,
            given_up: Vec::new(),
            sonars: Vec::new(),
            blind_motions: 0,
            track: Track::new(config.start),
            timed_out: false,
        }
    }

    /// Share of what can be seen that was seen.
    #[must_use]
    pub fn seen(&self) -> f64 {
        1.0 - self.unseen as f64 / self.visible.max(1) as f64
    }

    pub(super) const fn is_over(&self) -> bool {
        self.is_done || self.timed_out
    }

    pub(super) fn observe(&mut self, now: Timestamp, event: Event, pose: MapPose) {
        match event {
            Event::Checkpoint(checkpoint) => self.track.believes(checkpoint.pose, pose),
            Event::Remaining(remaining) => self.is_done |= remaining.is_done,
            Event::Sonar(change) => self.sonars.push((now, change)),
            Event::GivenUp(stop) => self.given_up.push(stop),
            Event::Landing(cause) => self.landed = Some(cause),
        }
    }

    pub(super) fn progress(&mut self, now: Timestamp, unseen: usize, duration_max: Duration) {
        self.unseen = unseen;
        self.time = now.since(Timestamp::ZERO);
        self.timed_out = self.time >= duration_max;
    }

    /// Counts a motion into a direction along which no sonar that works looks.
    pub(super) fn check_blind(
        &mut self,
        now: Timestamp,
        velocity: Velocity,
        setup: &Setup,
        sonars: &[Mounting],
    ) {
        if velocity.speed_mps() <= HOVERS_MPS {
            return;
        }
        let direction_rad = libm::atan2(velocity.left_mps, velocity.forward_mps);
        let is_known_to_fail = |place: usize| {
            let mut failing = setup.failing.iter();
            failing.any(|(sonar, _, from)| {
                *sonar == place && now.since(Timestamp::ZERO) > *from + FOUND_WITHIN
            })
        };
        let looks = |(place, mounting): (usize, &Mounting)| {
            let off_rad = wrapped_rad(direction_rad - mounting.bearing_rad).abs();
            off_rad <= mounting.aperture_rad / 2.0 + 1e-9 && !is_known_to_fail(place)
        };
        self.blind_motions += u64::from(!sonars.iter().enumerate().any(looks));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn touch_that_lasts_counts_once() {
        let mut clearance = Clearance::unmeasured();
        for clearance_m in [0.5, 0.1, 0.05, 0.2, 0.1] {
            let place = MapXy::new(1.0, 2.0);
            clearance.measure(Timestamp::ZERO, place, &[(clearance_m, Touched::Wall)]);
        }
        let touches = clearance.touches().len();
        assert_eq!((touches, clearance.least_m()), (2, 0.05));
    }

    #[test]
    fn fault_while_a_person_touches_the_drone_counts() {
        use Touched::{ByPerson, Person, Wall};
        let faults = |ticks: &[&[(f64, Touched)]]| {
            let mut clearance = Clearance::unmeasured();
            for near in ticks {
                clearance.measure(Timestamp::ZERO, MapXy::new(1.0, 2.0), near);
            }
            let is_fault: Vec<bool> = clearance.touches().iter().map(Touch::is_fault).collect();
            (clearance.is_at_fault(), is_fault)
        };
        let then = faults(&[&[(0.14, ByPerson)], &[(0.05, Wall)], &[(0.05, Person)]]);
        assert_eq!(then, (true, vec![false, true]));
        let behind = faults(&[&[(0.14, Wall), (0.05, ByPerson)], &[(0.1, ByPerson)]]);
        assert_eq!(behind, (true, vec![true]));
        let only = faults(&[&[(0.14, ByPerson)], &[(0.3, Wall), (0.05, ByPerson)]]);
        assert_eq!(only, (false, vec![false]));
    }
}
