use std::time::Duration;

use muster_machines::geometry::Ned;
use muster_machines::time::Timestamp;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// Standard gravity, in m/s².
const GRAVITY_MPS2: f64 = 9.806_65;

/// How a vector is written down: its three numbers.
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

/// A motion under constant acceleration.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Piece {
    /// When it begins.
    pub start: Timestamp,
    /// When it ends.
    pub end: Timestamp,
    #[serde(with = "vector")]
    from: Vector3<f64>,
    /// At the start, in m/s.
    #[serde(with = "vector")]
    velocity: Vector3<f64>,
    /// In m/s².
    #[serde(with = "vector")]
    acceleration: Vector3<f64>,
}

impl Piece {
    fn seconds(&self, at: Timestamp) -> f64 {
        at.min(self.end).since(self.start).as_secs_f64()
    }

    /// Where it is, in metres, at `at` within the piece.
    /// Where it is then.
    #[must_use]
    pub fn position(&self, at: Timestamp) -> Vector3<f64> {
        let t = self.seconds(at);
        self.from + self.velocity * t + self.acceleration * (t * t / 2.0)
    }

    /// Three places, in metres, between which it stays: as a parabola does between the control points of its curve.
    pub fn corners(&self) -> [Vector3<f64>; 3] {
        let t = self.seconds(self.end);
        let middle = self.from + self.velocity * (t / 2.0);
        [self.from, middle, self.position(self.end)]
    }

    /// In m/s, at `at` within the piece.
    pub fn velocity(&self, at: Timestamp) -> Vector3<f64> {
        self.velocity + self.acceleration * self.seconds(at)
    }

    /// In m/s².
    pub const fn acceleration(&self) -> Vector3<f64> {
        self.acceleration
    }
}

/// Where a vehicle was and will be: pieces one after the other, at rest before, between and after.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Motion {
    #[serde(with = "vector")]
    start: Vector3<f64>,
    /// The acceleration of the leg that is flown, in m/s², with which it can brake.
    pub(super) braking_mps2: f64,
    pieces: Vec<Piece>,
}

impl Motion {
    /// Standing still at a place.
    #[must_use]
    pub const fn at_rest(place: Ned) -> Self {
        Self {
            start: place.0,
            braking_mps2: 1.0,
            pieces: Vec::new(),
        }
    }

    /// All pieces, the first one first.
    pub fn pieces(&self) -> &[Piece] {
        &self.pieces
    }

    /// The pieces, and the rests between and after them, within a span of time: when each begins and ends, where it
    /// begins, how fast, how accelerated.
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

    /// The piece that it is in at `at`, or that it came to rest with, and when the next one begins; nothing before the
    /// first.
    pub fn piece(&self, at: Timestamp) -> Option<(&Piece, Option<Timestamp>)> {
        let begun = self.pieces.partition_point(|piece| piece.start <= at);
        let piece = &self.pieces[begun.checked_sub(1)?];
        Some((piece, self.pieces.get(begun).map(|next| next.start)))
    }

    /// Where it is then.
    #[must_use]
    pub fn position(&self, at: Timestamp) -> Ned {
        Ned(match self.piece(at) {
            Some((piece, _)) => piece.position(at),
            None => self.start,
        })
    }

    /// Where it is once all its pieces are flown.
    pub fn end(&self) -> Ned {
        let end = self.pieces.last().map(|piece| piece.position(piece.end));
        Ned(end.unwrap_or(self.start))
    }

    /// When all its pieces are flown.
    pub fn end_time(&self) -> Option<Timestamp> {
        self.pieces.last().map(|piece| piece.end)
    }

    /// Whether it stands still then.
    #[must_use]
    pub fn is_at_rest(&self, at: Timestamp) -> bool {
        self.end_time().is_none_or(|end| end <= at)
    }

    /// Where it would come to rest if it braked at `at`.
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

    /// In m/s; nothing at rest.
    pub fn velocity(&self, at: Timestamp) -> Option<Vector3<f64>> {
        let piece = self
            .pieces
            .iter()
            .rev()
            .find(|piece| piece.start <= at && at < piece.end)?;
        Some(piece.velocity(at)).filter(|velocity| velocity.norm() > 0.0)
    }

    /// Drops all that is planned after `at`.
    pub(super) fn cut(&mut self, at: Timestamp) {
        self.pieces.retain(|piece| piece.start < at);
        if let Some(last) = self.pieces.last_mut() {
            last.end = last.end.min(at);
        }
    }

    /// Drops all that is planned after `at` and comes to rest as fast as the leg allows.
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
            // The next leg begins now, not when the last one ended.
            None => self.push(at, position, Vector3::zeros(), Vector3::zeros(), 0.0),
        };
    }

    /// Flies straight on from the end of what is planned: speeds up, holds, slows down; a triangle where the leg is
    /// too short for the full speed.
    pub fn fly(&mut self, to: Ned, speed_mps: f64, acceleration_mps2: f64) {
        let from = self.end().0;
        let way = to.0 - from;
        let length_m = way.norm();
        if length_m <= 0.0 {
            return;
        }
        self.braking_mps2 = acceleration_mps2;
        let ahead = way / length_m;
        let speed = speed_mps.min((length_m * acceleration_mps2).sqrt());
        let ramp_s = speed / acceleration_mps2;
        let ramp_m = speed * ramp_s / 2.0;
        let cruise_m = (length_m - 2.0 * ramp_m).max(0.0);
        let start = self.end_time().unwrap_or(Timestamp::ZERO);
        let push = ahead * acceleration_mps2;
        let start = self.push(start, from, Vector3::zeros(), push, ramp_s);
        let after_ramp = from + ahead * ramp_m;
        let start = self.push(
            start,
            after_ramp,
            ahead * speed,
            Vector3::zeros(),
            cruise_m / speed,
        );
        let before_ramp = to.0 - ahead * ramp_m;
        let end = self.push(start, before_ramp, ahead * speed, -push, ramp_s);
        // A rest exactly at the end of the leg, free of rounding.
        self.push(end, to.0, Vector3::zeros(), Vector3::zeros(), 0.0);
    }

    /// Drops all that is planned after `at` and falls to the ground.
    pub(super) fn fall(&mut self, at: Timestamp) {
        let velocity = self.velocity(at).unwrap_or_default();
        let position = self.position(at).0;
        self.cut(at);
        // Down is positive: 0 = z + v t + g t² / 2, the height being -z.
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

    /// Stays for `time` where all that is planned ends.
    pub(super) fn hover(&mut self, time: Duration) {
        let (start, from) = (self.end_time().unwrap_or(Timestamp::ZERO), self.end().0);
        let still = Vector3::zeros();
        self.push(start, from, still, still, time.as_secs_f64());
    }

    pub(super) fn push(
        &mut self,
        start: Timestamp,
        from: Vector3<f64>,
        velocity: Vector3<f64>,
        acceleration: Vector3<f64>,
        seconds: f64,
    ) -> Timestamp {
        let end = start + Duration::from_secs_f64(seconds);
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
