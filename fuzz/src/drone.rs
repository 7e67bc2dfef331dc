use std::collections::VecDeque;
use std::path::Path;
use std::sync::OnceLock;
use std::time::Duration;

use bytes::Bytes;
use muster_machines::identity::{Ballot, NodeId};
use muster_machines::machine::Stimulus;
use muster_machines::mission::LandingReason;
use muster_machines::node::{
    Address, Blueprint, Checkpoints, Effect, Envelope, NodeMachine, StepOutput,
};
use muster_machines::radio::{Authenticator, IdealAuthenticator, Incarnations};
use muster_machines::routing::{Destination, Outgoing, Reliability};
use muster_machines::time::Timestamp;
use muster_machines::wire::{self, DATAGRAM_MAX, Header, PAYLOAD_MAX};
use muster_machines::{mission, msp, radio, routing};
use muster_runtime::plan::Plan;
use muster_runtime::vehicle::SimulatedVehicle;
use muster_scenarios::scenario::{self, Override, Scenario};

use crate::SCENARIOS;

/// The most messages between a drone's machines that one event may cause.
const MESSAGES_MAX: usize = 10_000;

/// An event that a drone handles.
#[derive(Debug, Clone)]
pub enum Op {
    /// The drone receives these bytes.
    Datagram(Bytes),
    /// The drone receives a frame with a valid signature of a member.
    Frame(Header, Vec<u8>),
    /// Time passes.
    Wait(Duration),
    /// The operator starts the flight.
    Fly,
    /// The operator recalls the drone.
    ComeDown,
    /// The drone's protocol sends a message.
    Send(Outgoing),
}

impl Op {
    /// Encodes a datagram, a wait or a start of flight for [`decode_ops`].
    ///
    /// # Panics
    /// For any other event.
    pub fn write(&self, out: &mut Vec<u8>) {
        match self {
            Self::Datagram(bytes) => {
                out.push(0);
                out.extend_from_slice(
                    &u16::try_from(bytes.len()).unwrap_or(u16::MAX).to_le_bytes(),
                );
                out.extend_from_slice(bytes);
            }
            Self::Wait(time) => {
                out.push(2);
                out.push(u8::try_from(time.as_millis() / 4).unwrap_or(u8::MAX));
            }
            Self::Fly => out.push(3),
            Self::ComeDown | Self::Frame(..) | Self::Send(_) => {
                unreachable!("no corpus is made of {self:?}")
            }
        }
    }
}

/// Decodes events from any bytes.
pub fn decode_ops(mut bytes: &[u8]) -> impl Iterator<Item = Op> {
    let mut counter = 0;
    std::iter::from_fn(move || {
        let (kind, rest) = bytes.split_first()?;
        bytes = rest;
        Some(match kind % 6 {
            0 => Op::Datagram(take_run(&mut bytes)?),
            1 => {
                let (fields, rest) = bytes.split_first_chunk::<7>()?;
                bytes = rest;
                let [sender, incarnation, ahead, term, rank, master, swarm] = fields.map(u32::from);
                counter += u64::from(ahead);
                let header = Header {
                    swarm: muster_machines::identity::SwarmId(1 + swarm / 255),
                    sender: NodeId(sender),
                    incarnation,
                    counter,
                    ballot: Ballot {
                        term,
                        rank,
                        master: NodeId(master),
                    },
                    intent: None,
                };
                Op::Frame(header, take_run(&mut bytes)?.to_vec())
            }
            2 => {
                let (pause, rest) = bytes.split_first()?;
                bytes = rest;
                Op::Wait(Duration::from_millis(u64::from(*pause) * 4))
            }
            3 => Op::Fly,
            4 => Op::ComeDown,
            _ => Op::Send(take_outgoing(&mut bytes)?),
        })
    })
}

/// Takes a message: a byte for its receiver and reliability, and a length of two bytes. `None` without them.
fn take_outgoing(bytes: &mut &[u8]) -> Option<Outgoing> {
    let (how, rest) = bytes.split_first_chunk::<3>()?;
    *bytes = rest;
    let [to, low, high] = *how;
    let to = match to % 4 {
        0 => Destination::Leader,
        1 => Destination::All,
        2 => Destination::Neighbours,
        _ => Destination::Drone(NodeId(u32::from(to / 8))),
    };
    let reliability = if how[0] & 4 == 0 {
        Reliability::BestEffort
    } else {
        Reliability::Acknowledged
    };
    // Up to 1 MiB and a little more.
    let length = usize::from(u16::from_le_bytes([low, high])) * 17;
    Some(Outgoing {
        id: u32::from(low),
        to,
        reliability,
        payload: vec![low; length].into(),
    })
}

/// Takes a length of two bytes, and that many bytes or as many as are left. `None` without a length.
fn take_run(bytes: &mut &[u8]) -> Option<Bytes> {
    let (len, rest) = bytes.split_first_chunk()?;
    let len = usize::from(u16::from_le_bytes(*len)).min(rest.len());
    let (run, rest) = rest.split_at(len);
    *bytes = rest;
    Some(Bytes::copy_from_slice(run))
}

/// Scenarios with each policy and protocol, with and without a relay.
pub fn scenarios() -> &'static [Scenario] {
    static ALL: OnceLock<Vec<Scenario>> = OnceLock::new();
    ALL.get_or_init(|| {
        let load = |file: &str, set: &[&str]| {
            let set: Vec<Override> = set.iter().map(|it| it.parse().expect("a field")).collect();
            let path = Path::new(SCENARIOS).join(file);
            scenario::load(&path, &set).expect("a shipped scenario")
        };
        vec![
            load("hardware/swarm-short.toml", &[]),
            load("thesis-1.toml", &[]),
            load("relay.toml", &[]),
            load("follow.toml", &[]),
            load("shake-up.toml", &[]),
        ]
    })
}

/// A drone's five machines and its vehicle, with a clock that advances only with [`Op::Wait`].
pub struct Drone {
    id: NodeId,
    machines: Vec<NodeMachine>,
    deadlines: [Option<Timestamp>; 5],
    vehicle: Option<SimulatedVehicle>,
    checkpoints: Checkpoints,
    output: StepOutput,
    now: Timestamp,
    queue: VecDeque<Envelope>,
    /// The frames that the drone has sent.
    pub sent: Vec<Bytes>,
}

impl Drone {
    /// A drone of a scenario, on the ground. With `draws_incarnation` it trusts only senders that have signed its nonce.
    pub fn new(scenario: &Scenario, id: NodeId, draws_incarnation: bool) -> Self {
        let mut blueprint: Blueprint = scenario.plan.blueprint(Plan::FIRST_SWARM, id);
        if draws_incarnation {
            blueprint.radio.incarnations = Incarnations::Drawn(1);
        }
        let now = Timestamp::ZERO;
        let checkpoints = Checkpoints::default();
        let build = |address| blueprint.build(address, 1, now, &checkpoints);
        let mut drone = Self {
            id,
            machines: Address::ALL.map(build).into(),
            deadlines: [None; 5],
            vehicle: scenario.plan.simulated_vehicle(id, 1),
            checkpoints,
            output: StepOutput::default(),
            now,
            queue: VecDeque::new(),
            sent: Vec::new(),
        };
        for address in Address::ALL {
            drone.step(address, Stimulus::Timeout);
        }
        drone.run();
        drone
    }

    /// Handles an event and all messages that follow from it.
    pub fn apply(&mut self, op: Op) {
        let received = |datagram| {
            Envelope::Radio(radio::Input::Received {
                datagram,
                source: None,
                peer: None,
            })
        };
        let envelope = match op {
            Op::Datagram(datagram) => received(datagram),
            Op::Frame(header, mut payload) => {
                payload.truncate(PAYLOAD_MAX);
                let mut frame = wire::encode_covered(&header, &payload);
                let authenticator = IdealAuthenticator.sign(&frame);
                frame.extend_from_slice(&authenticator);
                received(frame.into())
            }
            Op::Wait(time) => return self.wait(time),
            Op::Fly => Envelope::Mission(mission::Input::Fly),
            Op::Send(outgoing) => Envelope::Routing(routing::Input::Messages(vec![outgoing])),
            Op::ComeDown => Envelope::Mission(mission::Input::Abort(LandingReason::Recalled)),
        };
        self.queue.push_back(envelope);
        self.run();
    }

    fn wait(&mut self, time: Duration) {
        let end = self.now + time;
        for _ in 0..MESSAGES_MAX {
            let vehicle = self
                .vehicle
                .as_ref()
                .and_then(SimulatedVehicle::next_timeout);
            let next = self
                .deadlines
                .iter()
                .flatten()
                .copied()
                .chain(vehicle)
                .min();
            let Some(next) = next.filter(|next| *next <= end) else {
                self.now = end;
                return;
            };
            self.now = self.now.max(next);
            for address in Address::ALL {
                let deadline = &mut self.deadlines[address as usize];
                if deadline.take_if(|it| *it <= self.now).is_some() {
                    self.step(address, Stimulus::Timeout);
                }
            }
            let telemetry = self
                .vehicle
                .as_mut()
                .and_then(|it| it.handle_timeout(self.now));
            self.queue_telemetry(telemetry);
            self.run();
        }
        panic!("drone {} has timeouts without end within {time:?}", self.id);
    }

    fn run(&mut self) {
        for _ in 0..MESSAGES_MAX {
            let Some(envelope) = self.queue.pop_front() else {
                return;
            };
            self.step(envelope.address(), Stimulus::Input(envelope));
        }
        panic!(
            "the machines of drone {} exchange messages without end",
            self.id
        );
    }

    fn step(&mut self, address: Address, stimulus: Stimulus<Envelope>) {
        let machine = &mut self.machines[address as usize];
        machine.step(self.now, stimulus, &mut self.output);
        self.deadlines[address as usize] = self.output.deadline;
        let occupancy = self.output.occupancy;
        assert!(occupancy.len <= occupancy.max, "{address}: {occupancy:?}");
        for effect in std::mem::take(&mut self.output.effects) {
            match effect {
                Effect::Post(envelope) => self.queue.push_back(envelope),
                Effect::Send { frame, .. } => {
                    assert!(frame.len() <= DATAGRAM_MAX);
                    self.sent.push(frame);
                }
                Effect::Command(command) => {
                    let telemetry = self
                        .vehicle
                        .as_mut()
                        .and_then(|it| it.execute(self.now, command));
                    self.queue_telemetry(telemetry);
                }
                Effect::StoreCheckpoint(checkpoint) => {
                    self.checkpoints.keep(checkpoint);
                }
                Effect::LearnAddress { .. }
                | Effect::KeepList(_)
                | Effect::Rc(_)
                | Effect::Order(_)
                | Effect::Observe(_) => {}
            }
        }
    }

    fn queue_telemetry(&mut self, telemetry: Option<msp::Telemetry>) {
        if let Some(telemetry) = telemetry {
            let input = Box::new(msp::Input::Telemetry(telemetry));
            self.queue.push_back(Envelope::Msp(input));
        }
    }
}
