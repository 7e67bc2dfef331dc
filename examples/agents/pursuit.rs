//! Pursuit of a moving target: a drone that sees it tells the others, and all take their places around it.

use std::error::Error;
use std::f64::consts::TAU;
use std::time::Duration;

use muster::agent::{Agent, Context, Destination, Reliability, Telemetry, TimerId};
use muster::{AgentSpec, Ned, NodeId, Timestamp, Velocity};
use serde::{Deserialize, Serialize};

const END: TimerId = TimerId(0);
const REPORT_PERIOD: Duration = Duration::from_millis(500);

/// The fields of `[agent.parameters]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Parameters {
    /// Corners of the target's path, metres north and east of home. It runs through them again and again.
    path_m: Vec<[f64; 2]>,
    /// Its speed, in m/s.
    speed_mps: f64,
    /// Distance at which a drone sees it, over ground, in metres.
    sight_m: f64,
    /// Radius of the ring around it, in metres.
    ring_m: f64,
    /// How long the pursuit takes, in seconds.
    duration_s: f64,
}

impl Parameters {
    /// Where the target is. It stands for a camera: an agent may look only at what is within its sight.
    fn target(&self, now: Timestamp) -> Sighting {
        let corner = |index: usize| {
            let [north_m, east_m] = self.path_m[index % self.path_m.len()];
            Ned::new(north_m, east_m, 0.0)
        };
        let legs = |index: usize| corner(index).horizontal_distance_m(corner(index + 1));
        let round_m: f64 = (0..self.path_m.len()).map(legs).sum();
        let mut left_m = (now.as_secs_f64() * self.speed_mps) % round_m.max(1.0);
        let mut leg = 0;
        while left_m > legs(leg) && leg < self.path_m.len() {
            left_m -= legs(leg);
            leg += 1;
        }
        let direction = (corner(leg + 1) - corner(leg)).0 / legs(leg).max(1e-9);
        Sighting {
            at: Ned(corner(leg).0 + direction * left_m),
            velocity: Velocity(direction * self.speed_mps),
            seen_at: now,
        }
    }
}

/// Where the target was, over ground.
#[derive(Debug, Clone, Copy)]
struct Sighting {
    at: Ned,
    velocity: Velocity,
    seen_at: Timestamp,
}

#[derive(Serialize, Deserialize)]
struct Message {
    place_m: [f32; 2],
    velocity_mps: [f32; 2],
    seen_at_s: f64,
}

/// The agent of one drone.
pub(crate) struct Pursuit {
    parameters: Parameters,
    newest: Option<Sighting>,
    reported: Option<Timestamp>,
    is_ending: bool,
}

impl Pursuit {
    pub(crate) fn new(spec: &AgentSpec) -> Result<Self, Box<dyn Error + Send + Sync>> {
        let parameters: Parameters = spec.parameters()?;
        if parameters.path_m.len() < 2 {
            return Err("`path_m` needs at least two corners".into());
        }
        Ok(Self {
            parameters,
            newest: None,
            reported: None,
            is_ending: false,
        })
    }

    /// The drone's place in the ring around `at`, at an altitude of its own.
    fn place(context: &Context<'_>, at: Ned, ring_m: f64) -> Ned {
        let angle = TAU * f64::from(context.id().0) / f64::from(context.drones());
        let offset = Ned::new(ring_m * angle.cos(), ring_m * angle.sin(), 0.0);
        super::at_own_altitude(at + offset, context)
    }

    /// Tells the others what this drone sees, unless they have just been told.
    fn report(&mut self, seen: Sighting, context: &mut Context<'_>) {
        let is_due = |last: Timestamp| context.now().since(last) >= REPORT_PERIOD;
        if self.reported.is_some_and(|last| !is_due(last)) {
            return;
        }
        self.reported = Some(context.now());
        let message = Message {
            place_m: [seen.at.north_m() as f32, seen.at.east_m() as f32],
            velocity_mps: [seen.velocity.0.x as f32, seen.velocity.0.y as f32],
            seen_at_s: seen.seen_at.as_secs_f64(),
        };
        if let Ok(payload) = postcard::to_allocvec(&message) {
            let _ = context.send(Destination::All, &payload, Reliability::BestEffort);
        }
    }
}

impl Agent for Pursuit {
    fn start(&mut self, context: &mut Context<'_>) {
        context.set_timer(END, Duration::from_secs_f64(self.parameters.duration_s));
        let start = context.slot();
        context.go_to(Self::place(context, start, 0.0));
    }

    fn telemetry(&mut self, telemetry: &Telemetry, context: &mut Context<'_>) {
        if self.is_ending {
            return;
        }
        let target = self.parameters.target(context.now());
        let distance_m = telemetry.position.horizontal_distance_m(target.at);
        if distance_m <= self.parameters.sight_m {
            self.newest = Some(target);
            self.report(target, context);
        }
        context.observe("distance_m", distance_m);
        if let Some(seen) = self.newest {
            let since_s = context.now().since(seen.seen_at).as_secs_f64();
            let at = Ned(seen.at.0 + seen.velocity.0 * since_s);
            let place = Self::place(context, at, self.parameters.ring_m);
            context.track(place, seen.velocity);
        }
    }

    fn message(&mut self, _from: NodeId, payload: &[u8], _context: &mut Context<'_>) {
        let Ok(message) = postcard::from_bytes::<Message>(payload) else {
            return;
        };
        let [north_m, east_m] = message.place_m.map(f64::from);
        let [north_mps, east_mps] = message.velocity_mps.map(f64::from);
        let seen_at = Timestamp::from_secs_f64(message.seen_at_s);
        if self.newest.is_none_or(|known| known.seen_at < seen_at) {
            self.newest = Some(Sighting {
                at: Ned::new(north_m, east_m, 0.0),
                velocity: Velocity::new(north_mps, east_mps, 0.0),
                seen_at,
            });
        }
    }

    fn timer(&mut self, _timer: TimerId, context: &mut Context<'_>) {
        // The ring keeps the drones apart on the way down.
        self.is_ending = true;
        context.land();
    }
}
