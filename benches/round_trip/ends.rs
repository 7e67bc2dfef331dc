//! Two drones with all actors that exchange the same payload over UDP.

use std::error::Error;
use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, OnceLock};
use std::time::{Duration, Instant};

use bytes::Bytes;
use muster_actors::{Drone, DroneConfig, Environment, Message};
use muster_machines::identity::{Ballot, NodeId, NodeSet, SwarmId};
use muster_machines::machine::Stimulus;
use muster_machines::node::{Address, Blueprint, Checkpoints, Effect, Envelope, StepOutput};
use muster_machines::radio::{self, Budget};
use muster_machines::routing::{Packet, Tree};
use muster_machines::supervision::RestartDecision;
use muster_machines::time::Timestamp;
use muster_machines::{routing, wire};
use muster_runtime::identity::{
    DroneKey, Ed25519Authenticator, Fleet, FleetKey, RevocationList, Roster,
};
use muster_scenarios::scenario;
use muster_transport::sockets::{self, Reach};
use muster_transport::udp::UdpTransport;
use muster_transport::{Destination, Event, Transport};
use tokio::sync::Notify;

/// Payload length, in bytes.
pub(super) const PAYLOAD_LEN: usize = 64;
/// Maximum frame length: header, payload and signature.
pub(super) const FRAME_LEN: usize = wire::HEADER_MAX + PAYLOAD_LEN + wire::AUTHENTICATOR_LEN;

const IDS: [NodeId; 2] = [NodeId(0), NodeId(1)];

/// One of the two drones.
pub(super) struct End {
    pub(super) id: NodeId,
    pub(super) authenticator: Arc<Ed25519Authenticator>,
    world: Arc<World>,
    drone: Drone,
}

/// Environment of a drone's actors.
struct World {
    id: NodeId,
    peer: NodeId,
    started: Instant,
    transport: Mutex<UdpTransport>,
    drone: OnceLock<Drone>,
    payload: Vec<u8>,
    ballot: Ballot,
    /// Whether received payloads are answered.
    answers: bool,
    /// Notified when the routing has processed a frame.
    processed: Notify,
}

impl End {
    /// Two drones; the second answers the first.
    pub(super) async fn pair(folder: &Path) -> Result<[Self; 2], Box<dyn Error>> {
        let fleet_folder = folder.join("fleet");
        let fleet = Fleet::create(&fleet_folder)?;
        let keys = IDS.map(|id| fleet.add_drone(id));
        let held = IDS.map(|_| UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)));
        let mut addresses = Vec::new();
        for socket in held {
            addresses.push(socket?.local_addr()?);
        }
        let mut ends = Vec::new();
        for ((id, key), peer) in IDS.into_iter().zip(keys).zip([1, 0]) {
            let (own, other) = (addresses[id.0 as usize], addresses[peer]);
            let authenticator = authenticator(id, &key?, &fleet_folder)?;
            ends.push(Self::open(id, authenticator, own, other).await?);
        }
        let [near, far] = <[Self; 2]>::try_from(ends).map_err(|_| "not two")?;
        Ok([near, far])
    }

    async fn open(
        id: NodeId,
        authenticator: Arc<Ed25519Authenticator>,
        own: SocketAddr,
        other: SocketAddr,
    ) -> Result<Self, Box<dyn Error>> {
        let config = sockets::Config {
            id,
            bind: own,
            reach: Reach::Peers(vec![other]),
            interface: None,
            datagram_max: wire::DATAGRAM_MAX,
        };
        let started = Instant::now();
        let transport = UdpTransport::open(config, Arc::new(move || timestamp(started)))?;
        let waiting = transport.readiness()?;
        let peer = NodeId(1 - id.0);
        let world = Arc::new(World {
            id,
            peer,
            started,
            transport: Mutex::new(transport),
            drone: OnceLock::new(),
            payload: payload(),
            ballot: Ballot {
                term: 1,
                rank: 0,
                master: IDS[0],
            },
            answers: id == IDS[1],
            processed: Notify::new(),
        });
        let environment = Arc::clone(&world) as _;
        let drone = Drone::start(config_of(id, &authenticator)?, environment).await?;
        let _ = world.drone.set(drone.clone());
        let listener = Arc::clone(&world);
        tokio::spawn(async move {
            // `drain` takes all datagrams each time.
            while waiting.datagrams(|| listener.drain()).await.is_ok() {}
        });
        Ok(Self {
            id,
            authenticator,
            world,
            drone,
        })
    }

    /// Sends a payload and waits until its answer is processed.
    pub(super) async fn round_trip(&mut self) {
        self.world.send_payload();
        self.world.processed.notified().await;
    }

    pub(super) async fn stop(self) {
        self.drone.stop().await;
    }
}

impl World {
    fn transport(&self) -> MutexGuard<'_, UdpTransport> {
        self.transport
            .lock()
            .expect("no thread panics with the lock")
    }

    /// Sends the payload through the radio.
    fn send_payload(&self) {
        self.cast(Envelope::Radio(radio::Input::Send {
            to: Some(self.peer),
            ballot: self.ballot,
            payload: self.payload.clone(),
            keep_alive: false,
        }));
    }

    fn cast(&self, envelope: Envelope) {
        if let Some(drone) = self.drone.get() {
            let address = envelope.address();
            let message = Message::Step(Stimulus::Input(envelope));
            let cast = drone.book().cast(address, message);
            cast.expect("its actors run and have empty mailboxes");
        }
    }

    /// Passes all received datagrams to the radio. Returns whether none is left.
    fn drain(&self) -> bool {
        loop {
            let event = self.transport().poll_event();
            match event {
                Some(Event::Arrival(arrival)) => {
                    self.cast(Envelope::Radio(radio::Input::Received {
                        datagram: arrival.datagram,
                        source: arrival.source,
                        peer: arrival.peer,
                    }));
                }
                Some(Event::Outcome(_)) => {}
                None => return true,
            }
        }
    }
}

impl Environment for World {
    fn now(&self) -> Timestamp {
        timestamp(self.started)
    }

    fn seed(&self) -> u64 {
        1
    }

    fn checkpoints(&self) -> Checkpoints {
        Checkpoints::default()
    }

    /// Ignores the routing's own frames, which would distort the measurement.
    fn carry_out(&self, from: Address, output: &mut StepOutput) {
        for effect in output.effects.drain(..) {
            match effect {
                Effect::Send { to, frame, .. } => {
                    let to = to.map_or(Destination::Broadcast, Destination::To);
                    let sent = self.transport().send(Timestamp::ZERO, self.id, to, &frame);
                    sent.expect("the frame is valid");
                }
                Effect::LearnAddress { sender, source } => self.transport().learn(sender, source),
                Effect::Post(envelope @ Envelope::Routing(routing::Input::Received { .. })) => {
                    self.cast(envelope);
                }
                _ => {}
            }
        }
        if from == Address::Routing && self.drone.get().is_some() {
            if self.answers {
                self.send_payload();
            } else {
                self.processed.notify_one();
            }
        }
    }

    fn failed(&self, address: Address, _decision: RestartDecision) {
        unreachable!("the {address} actor failed without a fault");
    }

    fn starting(&self, _address: Address) {}
}

/// Configuration of a drone's actors, with a send budget that does not limit the measurement.
fn config_of(
    id: NodeId,
    authenticator: &Arc<Ed25519Authenticator>,
) -> Result<DroneConfig, Box<dyn Error>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let path = root.join("scenarios/hardware/swarm-short.toml");
    let scenario = scenario::load(&path, &[])?;
    let blueprint = scenario.plan.blueprint(SwarmId(1), id);
    Ok(DroneConfig {
        blueprint: Blueprint {
            authenticator: Arc::clone(authenticator) as _,
            radio: radio::Config {
                budget: Budget {
                    interval: Duration::from_nanos(1),
                    burst: 1_000,
                },
                ..blueprint.radio.clone()
            },
            ..blueprint
        },
        restarts: scenario.plan.limits.restarts,
        waiting_max: 1_000,
    })
}

fn timestamp(started: Instant) -> Timestamp {
    Timestamp::ZERO + started.elapsed()
}

/// A payload of policy `tree` with an order that fills it to [`PAYLOAD_LEN`].
fn payload() -> Vec<u8> {
    let with_order = |len: usize| {
        let own = NodeSet::from(0..1);
        wire::encode_packet(&Packet::Tree(Tree {
            alive: own.clone(),
            acknowledged: own,
            order: Some(Bytes::from(vec![0; len])),
            ..Tree::default()
        }))
    };
    let mut lengths = (1..PAYLOAD_LEN).map(with_order);
    let payload = lengths.find(|payload| payload.len() == PAYLOAD_LEN);
    payload.expect("each byte of the order adds one byte")
}

fn authenticator(
    id: NodeId,
    key: &Path,
    folder: &Path,
) -> Result<Arc<Ed25519Authenticator>, Box<dyn Error>> {
    let fleet = FleetKey::load(&folder.join("fleet.pub"))?;
    let roster = Roster::load(&folder.join("roster.toml"), &fleet)?;
    let revoked = RevocationList::load(&folder.join("revoked.toml"), &fleet)?;
    let authenticator =
        Ed25519Authenticator::new(id, DroneKey::load(key)?, fleet, roster, &revoked)?;
    Ok(Arc::new(authenticator))
}
