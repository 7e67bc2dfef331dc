//! The reference that the vehicle is to follow, and whether it does.

use std::collections::VecDeque;
use std::time::Duration;

use muster_msp::RC_PERIOD;
use nalgebra::Vector3;

use super::control::Reference;
use super::estimator::Estimate;
use crate::geometry::{Ned, Velocity};
use crate::motion::{Landing, Motion};
use crate::msp::Setpoint;
use crate::time::Timestamp;

/// Largest distance from the end of a leg of a vehicle at rest, in metres.
const REST_M: f64 = 0.6;
/// Largest speed of a vehicle at rest, in m/s.
const REST_MPS: f64 = 0.4;
/// Growth of the acceleration that presses a vehicle onto the ground, in m/s³.
const PRESS_MPS3: f64 = 4.0;
/// How long a vehicle must be still before it is pressed: one that sinks slowly isn't.
const STILL_FOR: Duration = Duration::from_secs(1);
/// References that are averaged, so that acceleration doesn't jump: at most 5 m/s³ of jerk for each m/s² by which a leg's
/// acceleration changes. PX4 limits it to 4 m/s³ where a leg accelerates with 3 m/s² (`MPC_JERK_AUTO`, `MPC_ACC_HOR`), which
/// would delay a leg by 0.4 s.
const AVERAGED: u32 = 10;
/// From the first of them to now.
const AVERAGED_FOR: Duration = RC_PERIOD.saturating_mul(AVERAGED);
/// From one reference to the next, in seconds.
const PERIOD_S: f64 = RC_PERIOD.as_secs_f64();
/// How far the mean is behind, in seconds.
const DELAY_S: f64 = (AVERAGED - 1) as f64 * PERIOD_S / 2.0;
/// Distance from the reference beyond which it starts anew where the vehicle is, in metres: it could not follow.
const LEFT_BEHIND_M: f64 = 8.0;

/// The mean of the last references: a motion whose acceleration doesn't jump.
///
/// Invariant: it begins as if the vehicle had flown straight on until then.
#[derive(Debug, Default)]
struct Smooth(VecDeque<(Timestamp, Reference)>);

impl Smooth {
    /// The mean with another reference.
    fn with(&mut self, now: Timestamp, reference: Reference) -> Reference {
        let (position, velocity) = (reference.position, reference.velocity);
        while self.0.len() >= AVERAGED as usize
            || (self.0.front()).is_some_and(|(at, _)| now.since(*at) >= AVERAGED_FOR)
        {
            self.0.pop_front();
        }
        if self.0.is_empty() {
            let before = (1..AVERAGED).rev().map(|number| Reference {
                position: Ned(position.0 - velocity.0 * (f64::from(number) * PERIOD_S)),
                velocity,
                acceleration: Vector3::zeros(),
            });
            self.0.extend(before.map(|it| (now, it)));
        }
        self.0.push_back((now, reference));
        Reference {
            position: Ned(self.mean(|it| it.position.0)),
            velocity: Velocity(self.mean(|it| it.velocity.0)),
            acceleration: self.mean(|it| it.acceleration),
        }
    }

    fn mean(&self, of: fn(&Reference) -> Vector3<f64>) -> Vector3<f64> {
        let all = self.0.iter().map(|(_, reference)| of(reference));
        all.sum::<Vector3<f64>>() / self.0.len() as f64
    }

    /// Where the mean is. `None` before the first reference.
    fn position(&self) -> Option<Ned> {
        (!self.0.is_empty()).then(|| Ned(self.mean(|it| it.position.0)))
    }

    /// Forgets past references.
    fn forget(&mut self) {
        self.0.clear();
    }
}

/// The reference motion.
#[derive(Debug)]
pub(super) struct Guidance {
    landing: Landing,
    /// `None` on the ground, before the first setpoint.
    motion: Option<Motion>,
    smooth: Smooth,
    setpoint: Option<Setpoint>,
    /// Where it began to fly to the setpoint. `None` also once a pilot flew it elsewhere.
    from: Option<Ned>,
    is_landing: bool,
    /// Whether it lands slowly, since it does not know how high it is.
    is_blind: bool,
}

impl Guidance {
    pub(super) fn new(landing: Landing) -> Self {
        Self {
            landing,
            motion: None,
            smooth: Smooth::default(),
            setpoint: None,
            from: None,
            is_landing: false,
            is_blind: false,
        }
    }

    pub(super) const fn setpoint(&self) -> Option<Setpoint> {
        self.setpoint
    }

    /// Where it began to fly to the setpoint. `None` also once a pilot flew it elsewhere.
    pub(super) const fn from(&self) -> Option<Ned> {
        self.from
    }

    pub(super) const fn is_landing(&self) -> bool {
        self.is_landing
    }

    /// Whether the reference of a landing has come to the ground.
    pub(super) fn expects_ground(&self, now: Timestamp) -> bool {
        self.is_landing && self.motion.as_ref().is_some_and(|it| it.is_at_rest(now))
    }

    /// End of the current leg.
    pub(super) const fn target(&self) -> Option<Ned> {
        match self.setpoint {
            Some(Setpoint::Leg { to, .. }) if !self.is_landing => Some(to),
            _ => None,
        }
    }

    /// Flies to a setpoint; a landing is not aborted.
    pub(super) fn fly(&mut self, now: Timestamp, setpoint: Setpoint, estimate: &Estimate) {
        self.setpoint = Some(setpoint);
        if self.is_landing {
            return;
        }
        let motion = self.motion(estimate);
        let from = motion.stop(now);
        motion.follow(now, setpoint, Ned::HOME);
        self.from = Some(from);
    }

    /// Goes on with a setpoint that was begun at `from` before a restart.
    pub(super) fn take_up(
        &mut self,
        now: Timestamp,
        (setpoint, from): (Setpoint, Option<Ned>),
        estimate: &Estimate,
    ) {
        self.setpoint = Some(setpoint);
        self.from = from;
        if !self.is_landing {
            self.motion(estimate);
            self.resume(now, estimate);
        }
    }

    /// Lands on the spot.
    pub(super) fn land(&mut self, now: Timestamp, estimate: &Estimate) {
        if !self.is_landing {
            let landing = self.landing;
            self.motion(estimate).land(now, landing);
            self.is_landing = true;
        }
    }

    fn motion(&mut self, estimate: &Estimate) -> &mut Motion {
        self.motion
            .get_or_insert_with(|| Motion::at_rest(estimate.position))
    }

    /// Where the vehicle should be. `None` on the ground, before the first setpoint. `still_for`: how long it has been still in
    /// a landing. `is_blind`: its height has not been measured for so long that it may be anywhere near the ground; a landing
    /// goes on as slowly as at its end.
    pub(super) fn reference(
        &mut self,
        now: Timestamp,
        estimate: &Estimate,
        still_for: Duration,
        is_blind: bool,
    ) -> Option<Reference> {
        let was_blind = std::mem::replace(&mut self.is_blind, self.is_landing && is_blind);
        if was_blind && !self.is_blind {
            self.begin_anew(now, estimate);
        }
        let motion = self.motion.as_mut()?;
        motion.forget(now);
        let is_left_behind = motion.position(now).distance_m(estimate.position) > LEFT_BEHIND_M;
        if is_left_behind {
            self.resume(now, estimate);
        }
        let motion = self.motion.as_ref()?;
        let position = motion.position(now);
        if self.is_blind {
            return Some(self.ground(position, estimate, Duration::ZERO));
        }
        if self.is_landing && motion.is_at_rest(now) {
            return Some(self.ground(position, estimate, still_for));
        }
        let piece = motion.piece(now).map(|(piece, _)| piece);
        let flown = piece.filter(|piece| now < piece.end);
        let reference = Reference {
            position,
            velocity: Velocity(motion.velocity(now).unwrap_or_default()),
            acceleration: flown.map_or(Vector3::zeros(), |piece| piece.acceleration()),
        };
        Some(self.smooth.with(now, reference))
    }

    /// The reference where the ground should be. It may be lower than where the vehicle took off, and the barometer drifts: so
    /// the vehicle goes on downwards, and is pressed down the more the longer it is still.
    fn ground(&self, position: Ned, estimate: &Estimate, still_for: Duration) -> Reference {
        let pressed_s = still_for.saturating_sub(STILL_FOR).as_secs_f64();
        Reference {
            position: position.at_altitude(estimate.position.altitude_m()),
            velocity: Velocity::new(0.0, 0.0, self.landing.final_mps),
            acceleration: Vector3::new(0.0, 0.0, PRESS_MPS3 * pressed_s),
        }
    }

    /// Continues from where the vehicle is, once it has a setpoint: it was flown there by another.
    pub(super) fn begin_anew(&mut self, now: Timestamp, estimate: &Estimate) {
        self.from = None;
        self.begin(now, estimate);
    }

    /// Continues where the vehicle's course is next to it, so that what it was off is not kept; from where it is if that is far.
    /// A landing that is about to come to the ground only continues there.
    fn resume(&mut self, now: Timestamp, estimate: &Estimate) {
        let ground = self.motion.as_ref().filter(|_| self.expects_ground(now));
        let ground = ground.map(|it| estimate.position.at_altitude(it.position(now).altitude_m()));
        if let Some(there) = ground.filter(|it| it.distance_m(estimate.position) <= LEFT_BEHIND_M) {
            self.motion = Some(Motion::at_rest(there));
            self.smooth.forget();
            return;
        }
        let on_course = self.on_course(estimate);
        self.begin(now, &on_course.unwrap_or(*estimate));
    }

    fn begin(&mut self, now: Timestamp, from: &Estimate) {
        if self.motion.is_none() {
            return;
        }
        self.smooth.forget();
        let position = Ned(from.position.0 + from.velocity.0 * DELAY_S);
        let mut motion = Motion::at_rest(position);
        let later = now + Duration::from_secs(1);
        motion.observe(now, position, from.velocity, later);
        if self.is_landing {
            motion.land(now, self.landing);
        } else if let Some(setpoint) = self.setpoint {
            motion.follow(now, setpoint, Ned::HOME);
        }
        self.motion = Some(motion);
    }

    /// The place nearest to a vehicle on its straight course, and its velocity along it. `None` without one that is near.
    fn on_course(&self, estimate: &Estimate) -> Option<Estimate> {
        let from = self.from.filter(|_| !self.is_landing)?;
        let to = match self.setpoint? {
            Setpoint::Leg { to, .. } => to,
            Setpoint::Hold { altitude_m, .. } => from.at_altitude(altitude_m),
            Setpoint::Track { .. } => return None,
        };
        let ahead = (to - from).0.try_normalize(0.0).unwrap_or_default();
        let flown_m = (estimate.position - from).0.dot(&ahead);
        let flown_m = flown_m.clamp(0.0, from.distance_m(to));
        let position = Ned(from.0 + ahead * flown_m);
        let is_near = position.distance_m(estimate.position) <= LEFT_BEHIND_M;
        is_near.then(|| Estimate {
            position,
            velocity: Velocity(ahead * estimate.velocity.0.dot(&ahead)),
        })
    }

    /// Whether the reference has come to rest, and the vehicle with it.
    pub(super) fn is_at_rest(&self, now: Timestamp, estimate: &Estimate) -> bool {
        self.motion.as_ref().is_none_or(|motion| {
            motion.is_at_rest(now)
                && motion.position(now).distance_m(estimate.position) < REST_M
                && estimate.velocity.0.norm() < REST_MPS
        })
    }

    /// Where the vehicle would come to rest if it braked now.
    pub(super) fn stop(&self, now: Timestamp, estimate: &Estimate) -> Ned {
        let Some(motion) = &self.motion else {
            return estimate.position;
        };
        let reference = self.smooth.position();
        let braking = motion.stop(now) - reference.unwrap_or(motion.position(now));
        estimate.position + braking
    }
}

#[cfg(test)]
mod tests {
    use std::ops::Range;

    use super::*;

    fn at(milliseconds: u64) -> Timestamp {
        Timestamp::from_nanos(milliseconds * 1_000_000)
    }

    fn guidance() -> Guidance {
        Guidance::new(Landing {
            descent_mps: 1.0,
            final_mps: 0.5,
            final_altitude_m: 2.0,
            acceleration_mps2: 1.0,
        })
    }

    fn leg(north_m: f64) -> Setpoint {
        Setpoint::Leg {
            to: Ned::new(north_m, 0.0, -20.0),
            speed_mps: 3.0,
            acceleration_mps2: 2.0,
        }
    }

    /// It begins to fly a leg where it stands still.
    fn begun(leg: Setpoint) -> (Guidance, Estimate) {
        let mut guidance = guidance();
        let estimate = Estimate {
            position: Ned::new(0.0, 0.0, -20.0),
            velocity: Velocity::ZERO,
        };
        guidance.fly(at(0), leg, &estimate);
        (guidance, estimate)
    }

    /// The references of a second to another, every 20 ms, of a vehicle that follows them.
    fn references(
        guidance: &mut Guidance,
        seconds: Range<u64>,
        estimate: &mut Estimate,
    ) -> Vec<Reference> {
        let times = (50 * seconds.start..50 * seconds.end).map(|it| at(20 * it));
        let references = times.map(|now| {
            let reference = guidance.reference(now, estimate, Duration::ZERO, false);
            let reference = reference.expect("it has a setpoint");
            (estimate.position, estimate.velocity) = (reference.position, reference.velocity);
            reference
        });
        references.collect()
    }

    /// The acceleration changes by at most 20 m/s³, as from 2 m/s² to -2 m/s², and positions move as velocities say.
    fn assert_smooth(references: &[Reference]) {
        for pair in references.windows(2) {
            let jerk_mps3 = (pair[1].acceleration - pair[0].acceleration).norm() / 0.02;
            assert!(jerk_mps3 <= 20.0 + 1e-9, "{pair:?}");
            let moved = pair[1].position.0 - pair[0].position.0;
            let meant = (pair[0].velocity.0 + pair[1].velocity.0) * 0.01;
            assert!((moved - meant).norm() < 0.005, "{pair:?}");
        }
    }

    #[test]
    fn acceleration_of_the_reference_never_jumps() {
        let (mut guidance, mut estimate) = begun(leg(20.0));
        let mut flown = references(&mut guidance, 0..3, &mut estimate);
        assert!(flown[0].acceleration.norm() < 0.3, "{:?}", flown[0]);
        // In mid-flight it is sent back.
        guidance.fly(at(3_000), leg(0.0), &estimate);
        flown.extend(references(&mut guidance, 3..15, &mut estimate));
        assert_smooth(&flown);
        let end = flown.last().unwrap().position;
        assert!(end.distance_m(Ned::new(0.0, 0.0, -20.0)) < 1e-9, "{end:?}");
    }

    #[test]
    fn reference_begins_anew_as_the_vehicle_moves() {
        let mut guidance = guidance();
        let mut estimate = Estimate {
            position: Ned::new(5.0, 0.0, -20.0),
            velocity: Velocity::new(3.0, 0.0, 0.0),
        };
        guidance.take_up(at(0), (leg(20.0), None), &estimate);
        let first = references(&mut guidance, 0..2, &mut estimate);
        let Reference {
            position, velocity, ..
        } = first[0];
        assert!(
            position.distance_m(Ned::new(5.0, 0.0, -20.0)) < 1e-9,
            "{position:?}"
        );
        assert!((velocity.0.x - 3.0).abs() < 1e-9, "{velocity:?}");
        assert_smooth(&first);
    }

    #[test]
    fn reference_that_was_not_asked_for_continues_as_if_it_had_been() {
        let [asked, paused] = [4..5, 4..4].map(|meanwhile| {
            let (mut guidance, mut estimate) = begun(leg(50.0));
            references(&mut guidance, 0..4, &mut estimate);
            references(&mut guidance, meanwhile, &mut estimate);
            references(&mut guidance, 5..6, &mut estimate)
        });
        for (asked, paused) in asked.iter().zip(&paused) {
            let apart_m = asked.position.distance_m(paused.position);
            assert!(apart_m < 1e-9, "{asked:?} {paused:?}");
        }
    }

    #[test]
    fn vehicle_with_a_command_to_stop_comes_to_rest_where_it_said() {
        let (mut guidance, mut estimate) = begun(leg(50.0));
        references(&mut guidance, 0..4, &mut estimate);
        let said = guidance.stop(at(4_000), &estimate);
        let hold = Setpoint::Hold {
            altitude_m: 20.0,
            vertical_mps: 1.0,
            acceleration_mps2: 2.0,
        };
        guidance.fly(at(4_000), hold, &estimate);
        references(&mut guidance, 4..10, &mut estimate);
        assert!(
            estimate.position.distance_m(said) < 0.1,
            "{said:?} {estimate:?}"
        );
    }
}
