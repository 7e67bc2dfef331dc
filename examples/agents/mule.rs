//! A data mule: sensors beyond each other's radio range measure, a drone carries the measurements to a base.
//!
//! Drone 0 is the base, the last drone the mule, all others are sensors. Nobody leads all of them: on its way the mule meets
//! one after the other.

use std::error::Error;
use std::time::Duration;

use muster::agent::{
    Agent, Context, Destination, MessageId, Outcome, Reliability, SwarmEvent, Telemetry, TimerId,
};
use muster::{AgentSpec, Ned, NodeId};
use serde::{Deserialize, Serialize};

const MEASURE: TimerId = TimerId(0);
const CALL: TimerId = TimerId(1);
const END: TimerId = TimerId(2);
const PERIOD: Duration = Duration::from_secs(1);
const BASE: NodeId = NodeId(0);

/// The fields of `[agent.parameters]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Parameters {
    /// Places of the base and of the sensors, metres north and east of home.
    places_m: Vec<[f64; 2]>,
    /// Rounds of the mule.
    rounds: u32,
    /// When base and sensors land, in seconds.
    duration_s: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
enum Message {
    /// The mule is here.
    Here,
    /// So many measurements.
    Measurements(u32),
}

/// The agent of one drone.
pub(crate) struct Mule {
    parameters: Parameters,
    /// Measurements that this drone has.
    count: u32,
    /// Measurements under way, until they are confirmed.
    sent: Option<(MessageId, u32)>,
    /// Number of places that the mule has reached.
    reached: usize,
}

impl Mule {
    pub(crate) fn new(spec: &AgentSpec) -> Result<Self, Box<dyn Error + Send + Sync>> {
        let parameters: Parameters = spec.parameters()?;
        let places = spec.drones as usize - 1;
        if parameters.places_m.len() != places {
            return Err(format!(
                "`places_m` has {} places; one for each drone but the mule is needed, {places}",
                parameters.places_m.len()
            )
            .into());
        }
        Ok(Self {
            parameters,
            count: 0,
            sent: None,
            reached: 0,
        })
    }

    fn is_mule(context: &Context<'_>) -> bool {
        context.id().0 + 1 == context.drones()
    }

    /// Above a place, at an altitude of the drone's own.
    fn above(&self, place: usize, context: &Context<'_>) -> Ned {
        let [north_m, east_m] = self.parameters.places_m[place % self.parameters.places_m.len()];
        super::at_own_altitude(Ned::new(north_m, east_m, 0.0), context)
    }

    /// Hands everything over, and forgets it once it has arrived.
    fn hand_over(&mut self, to: NodeId, context: &mut Context<'_>) {
        if self.count == 0 || self.sent.is_some() {
            return;
        }
        let sent = send(
            context,
            Destination::Drone(to),
            Message::Measurements(self.count),
        );
        self.sent = sent.map(|id| (id, self.count));
    }
}

fn send(context: &mut Context<'_>, to: Destination, message: Message) -> Option<MessageId> {
    let reliability = match message {
        Message::Here => Reliability::BestEffort,
        Message::Measurements(_) => Reliability::Acknowledged,
    };
    let payload = postcard::to_allocvec(&message).ok()?;
    context.send(to, &payload, reliability).ok()
}

impl Agent for Mule {
    fn start(&mut self, context: &mut Context<'_>) {
        context.set_telemetry(None);
        // Whom it meets next the mule knows, and nobody leads.
        context.leave();
        if Self::is_mule(context) {
            context.set_timer(CALL, PERIOD);
            context.go_to(self.above(1, context));
        } else {
            context.set_timer(END, Duration::from_secs_f64(self.parameters.duration_s));
            if context.id() != BASE {
                context.set_timer(MEASURE, PERIOD);
            }
            context.go_to(self.above(context.id().0 as usize, context));
        }
    }

    fn telemetry(&mut self, telemetry: &Telemetry, context: &mut Context<'_>) {
        if !telemetry.has_arrived || !Self::is_mule(context) {
            return;
        }
        self.reached += 1;
        let places = self.parameters.places_m.len();
        if self.reached > self.parameters.rounds as usize * places {
            context.land();
        } else {
            context.go_to(self.above(self.reached + 1, context));
        }
    }

    fn message(&mut self, from: NodeId, payload: &[u8], context: &mut Context<'_>) {
        match postcard::from_bytes(payload) {
            Ok(Message::Here) if context.id() == BASE => {
                send(context, Destination::Drone(from), Message::Here);
            }
            Ok(Message::Here) => self.hand_over(from, context),
            Ok(Message::Measurements(count)) => {
                self.count += count;
                context.observe("measurements", f64::from(self.count));
            }
            Err(_) => {}
        }
    }

    fn timer(&mut self, timer: TimerId, context: &mut Context<'_>) {
        match timer {
            MEASURE => {
                self.count += 1;
                context.set_timer(MEASURE, PERIOD);
            }
            CALL => {
                send(context, Destination::Neighbours, Message::Here);
                context.set_timer(CALL, PERIOD);
            }
            _ => context.land(),
        }
    }

    fn swarm(&mut self, event: SwarmEvent, _context: &mut Context<'_>) {
        if let SwarmEvent::MessageSent { id, outcome } = event
            && let Some((_, count)) = self.sent.take_if(|(sent, _)| *sent == id)
            && outcome == Outcome::Delivered
        {
            self.count -= count;
        }
    }
}
