//! A search in lanes that reports what it finds.
//!
//! The drones on task share the lanes. All are told which lanes are done, so others fly those of a lost drone. Finds go to
//! the leader, and again to the next one if it is lost.

use std::collections::BTreeSet;

use muster::agent::{Agent, Context, Destination, Outcome, Reliability, SwarmEvent, Telemetry};
use muster::{AgentSpec, Ned, NodeId, ParametersError};
use serde::{Deserialize, Serialize};

/// The fields of `[agent.parameters]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Parameters {
    /// Corner of the area, metres north and east of home.
    corner_m: [f64; 2],
    /// Length of a lane to the north, in metres.
    length_m: f64,
    /// Number of lanes, from west to east.
    lanes: u32,
    /// Distance between lanes, in metres.
    lane_m: f64,
    /// Distance over ground at which a drone sees a target, in metres.
    sight_m: f64,
    /// What there is to find, metres north and east of home.
    targets_m: Vec<[f64; 2]>,
}

#[derive(Debug, Serialize, Deserialize)]
enum Message {
    /// This lane is flown.
    Done(u32),
    /// This target was seen.
    Found(u32),
}

/// What outlives a restart.
#[derive(Debug, Default, Serialize, Deserialize)]
struct State {
    done: BTreeSet<u32>,
    /// Targets that this drone has seen.
    seen: BTreeSet<u32>,
    /// Targets that this drone knows of as leader.
    reported: BTreeSet<u32>,
}

/// The agent of one drone.
pub(crate) struct Lanes {
    parameters: Parameters,
    state: State,
    lane: Option<u32>,
    /// Where the drone flies next. Empty once it may land.
    route: Vec<Ned>,
}

impl Lanes {
    pub(crate) fn new(spec: &AgentSpec) -> Result<Self, ParametersError> {
        Ok(Self {
            parameters: spec.parameters()?,
            state: State::default(),
            lane: None,
            route: Vec::new(),
        })
    }

    /// After the end of a route: the next lane, or home and down.
    fn choose(&mut self, context: &mut Context<'_>) {
        let had_lane = self.lane.take().map(|lane| self.finish(lane, context));
        let on_task: Vec<_> = context.drones_on_task().iter().collect();
        let place = on_task.iter().position(|id| *id == context.id());
        let left = (0..self.parameters.lanes).filter(|lane| !self.state.done.contains(lane));
        let left: Vec<_> = left.collect();
        self.lane = left
            .get(place.unwrap_or(0) * left.len() / on_task.len())
            .copied();
        let above = |place: Ned| super::at_own_altitude(place, context);
        self.route = match self.lane {
            Some(lane) => {
                let [north_m, west_m] = self.parameters.corner_m;
                let east_m = west_m + f64::from(lane) * self.parameters.lane_m;
                let ends = [north_m + self.parameters.length_m, north_m];
                ends.map(|north_m| above(Ned::new(north_m, east_m, 0.0)))
                    .into()
            }
            None if had_lane.is_some() => vec![above(context.slot())],
            None => return context.land(),
        };
        context.go_to(self.route[self.route.len() - 1]);
    }

    fn finish(&mut self, lane: u32, context: &mut Context<'_>) {
        self.state.done.insert(lane);
        self.keep(context);
        send(context, Destination::All, &Message::Done(lane));
    }

    fn report(&mut self, target: u32, context: &mut Context<'_>) {
        if !context.is_leader() {
            send(context, Destination::Leader, &Message::Found(target));
        } else if self.state.reported.insert(target) {
            self.keep(context);
            context.observe("finds", self.state.reported.len() as f64);
        }
    }

    fn keep(&self, context: &mut Context<'_>) {
        if let Ok(state) = postcard::to_allocvec(&self.state) {
            let _ = context.keep(&state);
        }
    }
}

fn send(context: &mut Context<'_>, to: Destination, message: &Message) {
    let reliability = match to {
        Destination::All => Reliability::BestEffort,
        _ => Reliability::Acknowledged,
    };
    if let Ok(payload) = postcard::to_allocvec(message) {
        let _ = context.send(to, &payload, reliability);
    }
}

impl Agent for Lanes {
    fn start(&mut self, context: &mut Context<'_>) {
        let kept = context.kept().map(postcard::from_bytes);
        self.state = kept.and_then(Result::ok).unwrap_or_default();
        self.route = vec![super::at_own_altitude(context.slot(), context)];
        context.go_to(self.route[0]);
    }

    fn telemetry(&mut self, telemetry: &Telemetry, context: &mut Context<'_>) {
        for (id, target_m) in (0_u32..).zip(self.parameters.targets_m.clone()) {
            let target = Ned::new(target_m[0], target_m[1], 0.0);
            let distance_m = telemetry.position.horizontal_distance_m(target);
            if distance_m <= self.parameters.sight_m && self.state.seen.insert(id) {
                self.keep(context);
                self.report(id, context);
            }
        }
        if telemetry.has_arrived {
            self.route.pop();
            match self.route.last() {
                Some(next) => context.go_to(*next),
                None => self.choose(context),
            }
        }
    }

    fn message(&mut self, _from: NodeId, payload: &[u8], context: &mut Context<'_>) {
        match postcard::from_bytes(payload) {
            Ok(Message::Done(lane)) if self.state.done.insert(lane) => self.keep(context),
            Ok(Message::Found(target)) => self.report(target, context),
            _ => {}
        }
    }

    fn swarm(&mut self, event: SwarmEvent, context: &mut Context<'_>) {
        let is_lost = |outcome| outcome == Outcome::Expired;
        if matches!(event, SwarmEvent::LeaderChanged(_))
            || matches!(event, SwarmEvent::MessageSent { outcome, .. } if is_lost(outcome))
        {
            for target in self.state.seen.clone() {
                self.report(target, context);
            }
        }
    }
}
