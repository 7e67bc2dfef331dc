//! A search in lanes that reports what it finds.
//!
//! The area is cut into lanes, which the drones of the roster share. Everybody is told which lanes are done, so the lanes
//! of a lost drone are flown by others. Finds go to the leader, and again to the next one if it is lost.

use std::collections::BTreeSet;

use muster::agent::{Agent, Context, Destination, MessageId, Reliability, SwarmEvent, Telemetry};
use muster::{AgentSpec, Ned, NodeId};
use serde::{Deserialize, Serialize};

/// The fields of `[agent.parameters]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Parameters {
    /// Corner of the area, metres north and east of home.
    corner_m: [f64; 2],
    /// Length of a lane to the north, in metres.
    length_m: f64,
    /// Number of lanes, from west to east.
    lanes: u32,
    /// Distance between lanes, in metres.
    lane_m: f64,
    /// Distance at which a drone sees a target, over ground, in metres.
    sight_m: f64,
    /// What there is to find, metres north and east of home.
    targets_m: Vec<[f64; 2]>,
}

#[derive(Debug, Serialize, Deserialize)]
enum Message {
    /// This lane is flown.
    Done(u32),
    /// This target is here.
    Found(u32),
}

#[derive(Debug, Default, Serialize, Deserialize)]
struct State {
    done: BTreeSet<u32>,
    /// Targets that this drone has seen.
    seen: BTreeSet<u32>,
    /// Targets that this drone knows of, as leader.
    reported: BTreeSet<u32>,
}

/// The agent of one drone.
pub(crate) struct Lanes {
    parameters: Parameters,
    state: State,
    /// The lane that it flies, and the ends that it has yet to reach.
    lane: Option<(u32, Vec<Ned>)>,
    unconfirmed: BTreeSet<(MessageId, u32)>,
    is_going_home: bool,
}

impl Lanes {
    pub(crate) fn new(spec: &AgentSpec) -> Result<Box<dyn Agent>, toml::de::Error> {
        Ok(Box::new(Self {
            parameters: spec.parameters()?,
            state: State::default(),
            lane: None,
            unconfirmed: BTreeSet::new(),
            is_going_home: false,
        }))
    }

    /// Each drone searches at an altitude of its own, so that paths may cross.
    fn altitude_m(context: &Context<'_>) -> f64 {
        context.slot().altitude_m() + 6.0 * f64::from(context.id().0)
    }

    fn ends(&self, lane: u32, altitude_m: f64) -> Vec<Ned> {
        let [north_m, east_m] = self.parameters.corner_m;
        let east_m = east_m + f64::from(lane) * self.parameters.lane_m;
        let end = |north_m| Ned::new(north_m, east_m, -altitude_m);
        vec![end(north_m + self.parameters.length_m), end(north_m)]
    }

    /// Flies to the next end, to the next lane, or home and down if all are done.
    fn advance(&mut self, context: &mut Context<'_>) {
        let altitude_m = Self::altitude_m(context);
        if let Some((lane, mut ends)) = self.lane.take() {
            if ends.pop().is_some() && !ends.is_empty() {
                context.go_to(ends[ends.len() - 1]);
                self.lane = Some((lane, ends));
                return;
            }
            self.finish(lane, context);
        }
        let own: Vec<_> = context.roster().iter().collect();
        let place = own.iter().position(|id| *id == context.id()).unwrap_or(0);
        let left = (0..self.parameters.lanes).filter(|lane| !self.state.done.contains(lane));
        let left: Vec<_> = left.collect();
        let next = left.get(place * left.len() / own.len()).copied();
        if let Some(lane) = next {
            let ends = self.ends(lane, altitude_m);
            context.go_to(ends[ends.len() - 1]);
            self.lane = Some((lane, ends));
            self.is_going_home = false;
        } else if self.is_going_home {
            context.land();
        } else {
            self.is_going_home = true;
            context.go_to(context.slot().at_altitude(altitude_m));
        }
    }

    fn finish(&mut self, lane: u32, context: &mut Context<'_>) {
        self.state.done.insert(lane);
        send(context, Destination::All, &Message::Done(lane));
        self.keep(context);
    }

    fn report(&mut self, target: u32, context: &mut Context<'_>) {
        if context.is_leader() {
            self.record(target, context);
        } else if let Some(id) = send(context, Destination::Leader, &Message::Found(target)) {
            self.unconfirmed.insert((id, target));
        }
    }

    /// As leader: knows of a target from now on.
    fn record(&mut self, target: u32, context: &mut Context<'_>) {
        if self.state.reported.insert(target) {
            let count = u32::try_from(self.state.reported.len()).unwrap_or(u32::MAX);
            context.observe("finds", f64::from(count));
            self.keep(context);
        }
    }

    fn keep(&self, context: &mut Context<'_>) {
        if let Ok(state) = postcard::to_allocvec(&self.state) {
            let _ = context.keep(&state);
        }
    }
}

fn send(context: &mut Context<'_>, to: Destination, message: &Message) -> Option<MessageId> {
    let payload = postcard::to_allocvec(message).ok()?;
    context.send(to, &payload, Reliability::Acknowledged).ok()
}

impl Agent for Lanes {
    fn start(&mut self, context: &mut Context<'_>) {
        if let Some(state) = context
            .kept()
            .and_then(|kept| postcard::from_bytes(kept).ok())
        {
            self.state = state;
        }
        context.go_to(context.slot().at_altitude(Self::altitude_m(context)));
    }

    fn telemetry(&mut self, telemetry: &Telemetry, context: &mut Context<'_>) {
        let sees = |target: &[f64; 2]| {
            let place = Ned::new(target[0], target[1], 0.0);
            telemetry.position.horizontal_distance_m(place) <= self.parameters.sight_m
        };
        let seen: Vec<u32> = (0_u32..)
            .zip(&self.parameters.targets_m)
            .filter(|(id, target)| sees(target) && !self.state.seen.contains(id))
            .map(|(id, _)| id)
            .collect();
        for target in seen {
            self.state.seen.insert(target);
            self.keep(context);
            self.report(target, context);
        }
        if telemetry.has_arrived {
            self.advance(context);
        }
    }

    fn message(&mut self, _from: NodeId, payload: &[u8], context: &mut Context<'_>) {
        match postcard::from_bytes(payload) {
            Ok(Message::Done(lane)) if self.state.done.insert(lane) => self.keep(context),
            Ok(Message::Found(target)) => self.record(target, context),
            _ => {}
        }
    }

    fn swarm(&mut self, event: SwarmEvent, context: &mut Context<'_>) {
        match event {
            SwarmEvent::MessageSent { id, outcome } => {
                let sent = self
                    .unconfirmed
                    .iter()
                    .find(|(sent, _)| *sent == id)
                    .copied();
                if let Some(entry) = sent {
                    self.unconfirmed.remove(&entry);
                    if outcome != muster::agent::Outcome::Delivered {
                        self.report(entry.1, context);
                    }
                }
            }
            SwarmEvent::LeaderChanged(_) => {
                self.unconfirmed.clear();
                for target in self.state.seen.clone() {
                    self.report(target, context);
                }
            }
            _ => {}
        }
    }
}
