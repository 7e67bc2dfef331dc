//! Motions in closed form, without time steps: what a simulated vehicle flies, and what a real one is to follow.

mod leg;
mod tracking;

use std::time::Duration;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

pub use self::leg::Leg;
use self::tracking::Limits;
use crate::geometry::{Ned, Velocity};
use crate::msp::Setpoint;
use crate::time::Timestamp;

/// Parameters of a vehicle's landing mode.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Landing {
    /// Descent speed down to `final_altitude_m`, in m/s.
    pub descent_mps: f64,
    /// Descent speed from `final_altitude_m` to the ground, in m/s.
    pub final_mps: f64,
    /// Height above home from which the vehicle descends at `final_mps`, in metres.
    pub final_altitude_m: f64,
    /// Acceleration, in m/s².
    pub acceleration_mps2: f64,
}

/// Standard gravity, in m/s².
const GRAVITY_MPS2: f64 = 9.806_65;

/// Serialises a vector as an array of three numbers.
mod vector {
    use nalgebra::Vector3;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(super) fn serialize<S: Serializer>(it: &Vector3<f64>, to: S) -> Result<S::Ok, S::Error> {
        <[f64; 3]>::from(*it).serialize(to)
    }

    pub(super) fn deserialize<'a, D: Deserializer<'a>>(from: D) -> Result<Vector3<f64>, D::Error> {
        <[f64; 3]>::deserialize(from).map(Vector3::from)
    }
}

/// A motion with constant acceleration.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Piece {
    /// Start of the piece.
    pub start: Timestamp,
    /// End of the piece.
    pub end: Timestamp,
    #[serde(with = "vector")]
    from: Vector3<f64>,
    /// Velocity at the start, in m/s.
    #[serde(with = "vector")]
    velocity: Vector3<f64>,
    /// Acceleration, in m/s².
    #[serde(with = "vector")]
    acceleration: Vector3<f64>,
}

impl Piece {
    fn seconds(&self, at: Timestamp) -> f64 {
        at.min(self.end).since(self.start).as_secs_f64()
    }

    /// Position at `at`, in metres; the end position after the piece.
    #[must_use]
    pub fn position(&self, at: Timestamp) -> Vector3<f64> {
        let t = self.seconds(at);
        self.from + self.velocity * t + self.acceleration * (t * t / 2.0)
    }

    /// The control points of the piece's parabola, in metres. The piece stays within their triangle.
    pub fn corners(&self) -> [Vector3<f64>; 3] {
        let t = self.seconds(self.end);
        let middle = self.from + self.velocity * (t / 2.0);
        [self.from, middle, self.position(self.end)]
    }

    /// Velocity at `at` within the piece, in m/s.
    pub fn velocity(&self, at: Timestamp) -> Vector3<f64> {
        self.velocity + self.acceleration * self.seconds(at)
    }

    /// Acceleration, in m/s².
    pub const fn acceleration(&self) -> Vector3<f64> {
        self.acceleration
    }
}

/// A vehicle's past and planned motion: consecutive pieces, with rest before, between and after them.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Motion {
    #[serde(with = "vector")]
    start: Vector3<f64>,
    /// The current leg's acceleration, in m/s², used to brake.
    braking_mps2: f64,
    pieces: Vec<Piece>,
}

impl Motion {
    /// At rest at a place.
    #[must_use]
    pub const fn at_rest(place: Ned) -> Self {
        Self {
            start: place.0,
            braking_mps2: 1.0,
            pieces: Vec::new(),
        }
    }

    /// Forgets the pieces that have ended by `now`, but for the last one.
    pub fn forget(&mut self, now: Timestamp) {
        let past = self.pieces.partition_point(|piece| piece.end <= now);
        self.pieces.drain(..past.saturating_sub(1));
    }

    /// All pieces, in order of time.
    pub fn pieces(&self) -> &[Piece] {
        &self.pieces
    }

    /// The pieces within a span of time, clipped to it, with the rests between and after them as pieces.
    pub fn within(&self, span: std::ops::Range<Timestamp>) -> impl Iterator<Item = Piece> + '_ {
        let first = self.pieces.partition_point(|piece| piece.end <= span.start);
        let mut next = first;
        let mut now = span.start;
        std::iter::from_fn(move || {
            if now >= span.end {
                return None;
            }
            let ahead = self.pieces.get(next);
            let piece = match ahead {
                Some(piece) if piece.start <= now => {
                    next += 1;
                    Piece {
                        start: now,
                        end: piece.end.min(span.end),
                        from: piece.position(now),
                        velocity: piece.velocity(now),
                        acceleration: piece.acceleration,
                    }
                }
                ahead => Piece {
                    start: now,
                    end: ahead.map_or(span.end, |piece| piece.start.min(span.end)),
                    from: self.position(now).0,
                    velocity: Vector3::zeros(),
                    acceleration: Vector3::zeros(),
                },
            };
            now = piece.end;
            Some(piece)
        })
    }

    /// The last piece that began by `at`, and the start of the next one. `None` before the first piece.
    pub fn piece(&self, at: Timestamp) -> Option<(&Piece, Option<Timestamp>)> {
        let next = self.pieces.partition_point(|piece| piece.start <= at);
        let piece = &self.pieces[next.checked_sub(1)?];
        Some((piece, self.pieces.get(next).map(|next| next.start)))
    }

    /// Position at `at`.
    #[must_use]
    pub fn position(&self, at: Timestamp) -> Ned {
        Ned(match self.piece(at) {
            Some((piece, _)) => piece.position(at),
            None => self.start,
        })
    }

    /// Position after the last piece.
    pub fn end(&self) -> Ned {
        let end = self.pieces.last().map(|piece| piece.position(piece.end));
        Ned(end.unwrap_or(self.start))
    }

    /// End of the last piece. `None` if there is no piece.
    pub fn end_time(&self) -> Option<Timestamp> {
        self.pieces.last().map(|piece| piece.end)
    }

    /// Whether all pieces have ended by `at`.
    #[must_use]
    pub fn is_at_rest(&self, at: Timestamp) -> bool {
        self.end_time().is_none_or(|end| end <= at)
    }

    /// Where the vehicle would come to rest if it braked at `at`.
    pub fn stop(&self, at: Timestamp) -> Ned {
        let position = self.position(at);
        match self.velocity(at) {
            Some(velocity) => {
                let braking = velocity * (velocity.norm() / (2.0 * self.braking_mps2));
                Ned(position.0 + braking)
            }
            None => position,
        }
    }

    /// Velocity at `at`, in m/s. `None` at rest.
    pub fn velocity(&self, at: Timestamp) -> Option<Vector3<f64>> {
        let piece = self
            .pieces
            .iter()
            .rev()
            .find(|piece| piece.start <= at && at < piece.end)?;
        Some(piece.velocity(at)).filter(|velocity| velocity.norm() > 0.0)
    }

    /// Drops the plan after `at`.
    fn cut(&mut self, at: Timestamp) {
        self.pieces.retain(|piece| piece.start < at);
        if let Some(last) = self.pieces.last_mut() {
            last.end = last.end.min(at);
        }
    }

    /// Drops the plan after `at` and brakes to rest with the leg's acceleration.
    pub fn brake(&mut self, at: Timestamp) {
        let velocity = self.velocity(at);
        let position = self.position(at).0;
        self.cut(at);
        match velocity {
            Some(velocity) => {
                let speed = velocity.norm();
                let acceleration = velocity * (-self.braking_mps2 / speed);
                self.push(
                    at,
                    position,
                    velocity,
                    acceleration,
                    speed / self.braking_mps2,
                )
            }
            // An empty piece, so that the next leg begins at `at` and not at the end of the last one.
            None => self.push(at, position, Vector3::zeros(), Vector3::zeros(), 0.0),
        };
    }

    /// Flies to a setpoint from `at` on, in a frame with its origin at `home`.
    pub fn follow(&mut self, at: Timestamp, setpoint: Setpoint, home: Ned) {
        match setpoint {
            Setpoint::Leg {
                to,
                speed_mps,
                acceleration_mps2,
            } => {
                self.brake(at);
                self.fly(to + home, speed_mps, acceleration_mps2);
            }
            Setpoint::Track {
                to,
                velocity,
                speed_mps,
                acceleration_mps2,
                hold,
            } => {
                let limits = Limits {
                    speed_mps,
                    acceleration_mps2,
                };
                self.track(at, (to + home, velocity), limits, hold);
            }
            Setpoint::Hold {
                altitude_m,
                vertical_mps,
                acceleration_mps2,
            } => self.hold(at, altitude_m, vertical_mps, acceleration_mps2),
        }
    }

    /// Brakes at `at` and descends to the ground on the spot. From below the ground it only brakes: a landing never climbs.
    pub fn land(&mut self, at: Timestamp, landing: Landing) {
        let Landing {
            descent_mps,
            final_mps,
            final_altitude_m,
            acceleration_mps2,
        } = landing;
        self.brake(at);
        let from = self.end();
        if from.altitude_m() > final_altitude_m {
            let low = from.at_altitude(final_altitude_m);
            self.fly(low, descent_mps, acceleration_mps2);
        }
        if from.altitude_m() > 0.0 {
            self.fly(from.at_altitude(0.0), final_mps, acceleration_mps2);
        }
    }

    /// Appends a straight leg to `to`, from rest to rest: a trapezoid of speed, or a triangle if the leg is too short for
    /// `speed_mps`.
    pub fn fly(&mut self, to: Ned, speed_mps: f64, acceleration_mps2: f64) {
        let from = self.end().0;
        let leg = to.0 - from;
        let length_m = leg.norm();
        if length_m <= 0.0 {
            return;
        }
        self.braking_mps2 = acceleration_mps2;
        let ahead = leg / length_m;
        let profile = Leg::new(length_m, speed_mps, acceleration_mps2);
        let (speed, ramp_s, ramp_m) = (profile.peak_mps(), profile.ramp_s(), profile.ramp_m());
        let start = self.end_time().unwrap_or(Timestamp::ZERO);
        let push = ahead * acceleration_mps2;
        let start = self.push(start, from, Vector3::zeros(), push, ramp_s);
        let after_ramp = from + ahead * ramp_m;
        let start = self.push(
            start,
            after_ramp,
            ahead * speed,
            Vector3::zeros(),
            profile.cruise_s(),
        );
        let before_ramp = to.0 - ahead * ramp_m;
        let end = self.push(start, before_ramp, ahead * speed, -push, ramp_s);
        // A rest at exactly the end of the leg, without rounding error.
        self.push(end, to.0, Vector3::zeros(), Vector3::zeros(), 0.0);
    }

    /// Drops the plan after `at` and falls to the ground.
    pub fn fall(&mut self, at: Timestamp) {
        let velocity = self.velocity(at).unwrap_or_default();
        let position = self.position(at).0;
        self.cut(at);
        // 0 = z + v t + g t² / 2; z is positive downwards.
        let seconds = (-velocity.z
            + (velocity.z * velocity.z - 2.0 * GRAVITY_MPS2 * position.z).sqrt())
            / GRAVITY_MPS2;
        let gravity = Vector3::new(0.0, 0.0, GRAVITY_MPS2);
        let end = self.push(at, position, velocity, gravity, seconds);
        let ground = Vector3::new(
            position.x + velocity.x * seconds,
            position.y + velocity.y * seconds,
            0.0,
        );
        self.push(end, ground, Vector3::zeros(), Vector3::zeros(), 0.0);
    }

    /// Drops the plan after `at`, and continues from a place with a constant velocity until `until`.
    pub fn observe(&mut self, at: Timestamp, place: Ned, velocity: Velocity, until: Timestamp) {
        self.cut(at);
        let seconds = until.since(at).as_secs_f64();
        self.push(at, place.0, velocity.0, Vector3::zeros(), seconds);
    }

    /// Appends a rest of `time` at the end of the plan.
    pub fn hover(&mut self, time: Duration) {
        let (start, from) = (self.end_time().unwrap_or(Timestamp::ZERO), self.end().0);
        let still = Vector3::zeros();
        self.push(start, from, still, still, time.as_secs_f64());
    }

    fn push(
        &mut self,
        start: Timestamp,
        from: Vector3<f64>,
        velocity: Vector3<f64>,
        acceleration: Vector3<f64>,
        seconds: f64,
    ) -> Timestamp {
        let end = start + Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX);
        self.pieces.push(Piece {
            start,
            end,
            from,
            velocity,
            acceleration,
        });
        end
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_landing_never_climbs_and_ends_on_the_ground_or_below() {
        let landing = Landing {
            descent_mps: 1.5,
            final_mps: 0.5,
            final_altitude_m: 3.0,
            acceleration_mps2: 1.0,
        };
        let at = |seconds: f64| Timestamp::ZERO + Duration::from_secs_f64(seconds);
        for altitude_m in [-2.0, -0.1, 0.0, 0.1, 1.0, 3.1, 40.0] {
            for sinks_mps in [0.0, 0.3, 2.0] {
                let place = Ned::HOME.at_altitude(altitude_m);
                let mut motion = Motion::at_rest(place);
                motion.observe(at(0.0), place, Velocity::new(0.0, 0.0, sinks_mps), at(1.0));
                motion.land(at(0.0), landing);
                let altitudes_m = (0..1_000).map(|tenth| {
                    let now = at(f64::from(tenth) / 10.0);
                    motion.position(now).altitude_m()
                });
                let altitudes_m: Vec<_> = altitudes_m.collect();
                let climbs = altitudes_m.windows(2).any(|it| it[1] > it[0] + 1e-9);
                assert!(!climbs, "{altitude_m} {sinks_mps} {altitudes_m:?}");
                let end_m = motion.end().altitude_m();
                assert!(end_m <= 0.0, "{altitude_m} {sinks_mps} {end_m}");
            }
        }
    }
}
