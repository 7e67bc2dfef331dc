//! An auction of tasks: the leader offers each task, the drones bid with their distance, the nearest flies there.
//!
//! Everybody knows which tasks are done. The tasks of a lost drone are offered again, and a new leader offers all that are
//! not done; a drone that has one already bids 0 for it, and keeps it.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::time::Duration;

use muster::agent::{Agent, Context, Destination, Reliability, SwarmEvent, Telemetry, TimerId};
use muster::{AgentSpec, Ned, NodeId, ParametersError};
use serde::{Deserialize, Serialize};

const AUCTION: TimerId = TimerId(0);
const WORK: TimerId = TimerId(1);
/// How long the leader waits for bids.
const BIDDING: Duration = Duration::from_secs(1);

/// The fields of `[agent.parameters]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Parameters {
    /// Places of the tasks, metres north and east of home.
    tasks_m: Vec<[f64; 2]>,
    /// How long a task takes, in seconds.
    work_s: f64,
}

#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
enum Message {
    /// Who does this task?
    Offer(u32),
    /// This drone would, at this cost: metres that it has to fly.
    Bid(u32, u32),
    /// Do this task.
    Award(u32),
    /// This task is done.
    Done(u32),
}

/// The agent of one drone.
pub(crate) struct Auction {
    parameters: Parameters,
    done: BTreeSet<u32>,
    /// The tasks that this drone does, one after the other.
    own: VecDeque<u32>,
    /// As leader: who does which task.
    awarded: BTreeMap<u32, NodeId>,
    /// As leader: the task on offer, and the lowest bid.
    offer: Option<(u32, Option<(u32, NodeId)>)>,
}

impl Auction {
    pub(crate) fn new(spec: &AgentSpec) -> Result<Self, ParametersError> {
        Ok(Self {
            parameters: spec.parameters()?,
            done: BTreeSet::new(),
            own: VecDeque::new(),
            awarded: BTreeMap::new(),
            offer: None,
        })
    }

    /// Above a task, at an altitude of the drone's own.
    fn above(&self, task: u32, context: &Context<'_>) -> Option<Ned> {
        let [north_m, east_m] = *self.parameters.tasks_m.get(task as usize)?;
        let place = Ned::new(north_m, east_m, 0.0);
        Some(super::at_own_altitude(place, context))
    }

    /// What a task costs this drone: the way from its last one, in metres.
    fn cost(&self, task: u32, context: &Context<'_>) -> Option<u32> {
        if self.own.contains(&task) {
            return Some(0);
        }
        let last = self.own.back().and_then(|last| self.above(*last, context));
        let from = last.unwrap_or(context.position());
        Some(from.horizontal_distance_m(self.above(task, context)?) as u32)
    }

    /// As leader: awards the task on offer, then offers the next.
    fn auction(&mut self, context: &mut Context<'_>) {
        if let Some((task, Some((_, winner)))) = self.offer.take() {
            self.awarded.insert(task, winner);
            send(context, Destination::Drone(winner), Message::Award(task));
        }
        let mut tasks = 0..self.parameters.tasks_m.len() as u32;
        let is_open = |task: &u32| !self.done.contains(task) && !self.awarded.contains_key(task);
        if let Some(task) = tasks.find(is_open) {
            self.offer = Some((task, None));
            send(context, Destination::All, Message::Offer(task));
            self.handle(context.id(), Message::Offer(task), context);
        }
        context.set_timer(AUCTION, BIDDING);
    }

    fn handle(&mut self, from: NodeId, message: Message, context: &mut Context<'_>) {
        match message {
            Message::Offer(task) => {
                if let Some(cost) = self.cost(task, context) {
                    send(context, Destination::Leader, Message::Bid(task, cost));
                }
            }
            Message::Bid(task, cost) => {
                if let Some((offered, lowest)) = &mut self.offer
                    && *offered == task
                    && lowest.is_none_or(|lowest| (cost, from) < lowest)
                {
                    *lowest = Some((cost, from));
                }
            }
            Message::Award(task) if !self.done.contains(&task) && !self.own.contains(&task) => {
                self.own.push_back(task);
                if self.own.len() == 1 {
                    self.fly(context);
                }
            }
            Message::Award(_) => {}
            Message::Done(task) => self.finish(task, context),
        }
    }

    /// Flies to its next task.
    fn fly(&self, context: &mut Context<'_>) {
        if let Some(place) = self.own.front().and_then(|task| self.above(*task, context)) {
            context.go_to(place);
        }
    }

    fn finish(&mut self, task: u32, context: &mut Context<'_>) {
        self.done.insert(task);
        context.observe("done", self.done.len() as f64);
        if self.done.len() == self.parameters.tasks_m.len() {
            context.go_to(super::at_own_altitude(context.slot(), context));
        }
    }
}

fn send(context: &mut Context<'_>, to: Destination, message: Message) {
    if let Ok(payload) = postcard::to_allocvec(&message) {
        let _ = context.send(to, &payload, Reliability::Acknowledged);
    }
}

impl Agent for Auction {
    fn start(&mut self, context: &mut Context<'_>) {
        context.set_timer(AUCTION, BIDDING);
        context.hold();
    }

    fn telemetry(&mut self, telemetry: &Telemetry, context: &mut Context<'_>) {
        if telemetry.has_arrived && !self.own.is_empty() {
            context.set_timer(WORK, Duration::from_secs_f64(self.parameters.work_s));
        } else if telemetry.has_arrived && self.done.len() == self.parameters.tasks_m.len() {
            context.land();
        }
    }

    fn message(&mut self, from: NodeId, payload: &[u8], context: &mut Context<'_>) {
        if let Ok(message) = postcard::from_bytes(payload) {
            self.handle(from, message, context);
        }
    }

    fn timer(&mut self, timer: TimerId, context: &mut Context<'_>) {
        match timer {
            WORK => {
                if let Some(task) = self.own.pop_front() {
                    send(context, Destination::All, Message::Done(task));
                    self.finish(task, context);
                    self.fly(context);
                }
            }
            _ if context.is_leader() => self.auction(context),
            _ => context.set_timer(AUCTION, BIDDING),
        }
    }

    fn swarm(&mut self, event: SwarmEvent, _context: &mut Context<'_>) {
        match event {
            SwarmEvent::MembersLost(lost) => self.awarded.retain(|_, drone| !lost.contains(*drone)),
            SwarmEvent::LeaderChanged(_) => {
                self.awarded.clear();
                self.offer = None;
            }
            _ => {}
        }
    }
}
