//! Flocking without a leader, after Reynolds, "Flocks, Herds, and Schools", SIGGRAPH 1987: each drone keeps away from
//! neighbours that are too near, flies as fast as its neighbours, and stays with them. All are drawn to one place.

use std::collections::BTreeMap;
use std::time::Duration;

use muster::agent::{Agent, Context, Destination, Reliability, Telemetry, TimerId};
use muster::{AgentSpec, Ned, NodeId, ParametersError, Timestamp, Velocity};
use serde::Deserialize;

const END: TimerId = TimerId(0);
/// Neighbours that were silent for longer are forgotten.
const FORGOTTEN_AFTER: Duration = Duration::from_secs(2);

/// The fields of `[agent.parameters]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Parameters {
    /// Where the flock is drawn to, metres north and east of home.
    place_m: [f64; 2],
    /// Highest speed, in m/s. The place alone draws a drone at 0.4 times that.
    speed_mps: f64,
    /// Distance below which neighbours keep away from each other, in metres.
    apart_m: f64,
    /// How long the flight takes, in seconds.
    duration_s: f64,
}

struct Neighbour {
    at: Ned,
    velocity: Velocity,
    heard: Timestamp,
}

/// The agent of one drone.
pub(crate) struct Flocking {
    parameters: Parameters,
    neighbours: BTreeMap<NodeId, Neighbour>,
}

impl Flocking {
    pub(crate) fn new(spec: &AgentSpec) -> Result<Self, ParametersError> {
        Ok(Self {
            parameters: spec.parameters()?,
            neighbours: BTreeMap::new(),
        })
    }

    /// The velocity that the three rules and the place ask for.
    fn velocity(&self, telemetry: &Telemetry) -> Velocity {
        let Parameters {
            place_m: [north_m, east_m],
            speed_mps,
            apart_m,
            ..
        } = self.parameters;
        let here = telemetry.position.at_altitude(0.0);
        let to_place = (Ned::new(north_m, east_m, 0.0) - here).0;
        let mut sum = to_place.cap_magnitude(speed_mps) * 0.4;
        if self.neighbours.is_empty() {
            return Velocity(sum);
        }
        let share = 1.0 / self.neighbours.len() as f64;
        for neighbour in self.neighbours.values() {
            let to_it = (neighbour.at.at_altitude(0.0) - here).0;
            let distance_m = to_it.norm().max(0.1);
            // Separation grows with the inverse of the distance; cohesion acts beyond it.
            if distance_m < apart_m {
                sum -= to_it / distance_m * (apart_m / distance_m - 1.0) * speed_mps;
            } else {
                sum +=
                    (to_it / distance_m * (distance_m / apart_m - 1.0)).cap_magnitude(1.0) * share;
            }
            sum += (neighbour.velocity.0 - telemetry.velocity.0) * 0.3 * share;
        }
        Velocity(sum.cap_magnitude(speed_mps))
    }
}

impl Agent for Flocking {
    fn start(&mut self, context: &mut Context<'_>) {
        context.set_timer(END, Duration::from_secs_f64(self.parameters.duration_s));
    }

    fn telemetry(&mut self, telemetry: &Telemetry, context: &mut Context<'_>) {
        let now = context.now();
        self.neighbours
            .retain(|_, neighbour| now.since(neighbour.heard) < FORGOTTEN_AFTER);
        let mut payload = Vec::with_capacity(24);
        for value in telemetry.position.0.iter().chain(&telemetry.velocity.0) {
            payload.extend((*value as f32).to_le_bytes());
        }
        let _ = context.send(Destination::Neighbours, &payload, Reliability::BestEffort);
        let velocity = self.velocity(telemetry);
        let here = telemetry.position.at_altitude(context.slot().altitude_m());
        context.track(here, velocity);
        context.observe("speed_mps", telemetry.velocity.0.norm());
    }

    fn message(&mut self, from: NodeId, payload: &[u8], context: &mut Context<'_>) {
        let mut values = payload.chunks_exact(4).map(|bytes| {
            let bytes = bytes.try_into().unwrap_or_default();
            f64::from(f32::from_le_bytes(bytes))
        });
        let mut next = || values.next().filter(|value| value.is_finite());
        let (Some(n), Some(e), Some(d), Some(vn), Some(ve), Some(vd)) =
            (next(), next(), next(), next(), next(), next())
        else {
            return;
        };
        let neighbour = Neighbour {
            at: Ned::new(n, e, d),
            velocity: Velocity::new(vn, ve, vd),
            heard: context.now(),
        };
        self.neighbours.insert(from, neighbour);
    }

    fn timer(&mut self, _timer: TimerId, context: &mut Context<'_>) {
        context.land();
    }
}
