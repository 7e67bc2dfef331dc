//! The drone's network, with the frame losses that a starter injects.

use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;
use muster_machines::{radio, wire};
use muster_transport::{Destination, Event, Fate};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::durable::Frame;
use super::network::Network;
use crate::control::Losses;

/// The network. For each sender it drops a configured share of the received frames, as if the sender were out of range.
pub(super) struct RadioLink {
    pub(super) network: Network,
    pub(super) losses: Losses,
    rng: ChaCha8Rng,
    /// Datagrams taken from the network, modulo 2⁶⁴.
    pub(super) taken: u64,
    /// Frames that were dropped because of `losses`.
    pub(super) out_of_range: u64,
}

/// One event of the network.
pub(super) enum Polled {
    /// For the radio.
    Input(radio::Input),
    /// A frame that was dropped because of the injected losses.
    Lost,
    /// No event for now. `is_drained` says whether the network has none left.
    Idle { is_drained: bool },
}

impl RadioLink {
    pub(super) fn new(network: Network, seed: u64) -> Self {
        Self {
            network,
            losses: Losses::default(),
            rng: ChaCha8Rng::seed_from_u64(seed),
            taken: 0,
            out_of_range: 0,
        }
    }

    pub(super) fn send(&mut self, now: Timestamp, from: NodeId, frame: &Frame) {
        let to = frame.to.map_or(Destination::Broadcast, Destination::To);
        self.network
            .transport()
            .send(now, from, to, &frame.bytes)
            .expect("the radio sends datagrams of legal size, from its own drone");
    }

    /// Takes one event from the network.
    pub(super) fn poll(&mut self) -> Polled {
        let Some(event) = self.network.transport().poll_event() else {
            return Polled::Idle {
                is_drained: self.network.is_drained(),
            };
        };
        self.taken = self.taken.wrapping_add(1);
        match event {
            Event::Arrival(arrival) if self.is_lost(&arrival.datagram) => {
                self.out_of_range += 1;
                Polled::Lost
            }
            Event::Arrival(arrival) => Polled::Input(radio::Input::Received {
                datagram: arrival.datagram,
                source: arrival.source,
                peer: arrival.peer,
            }),
            Event::Outcome(outcome) => Polled::Input(radio::Input::Delivery {
                to: outcome.to,
                delivered: outcome.fate == Fate::Delivered,
                frame: outcome.datagram,
            }),
        }
    }

    fn is_lost(&mut self, datagram: &[u8]) -> bool {
        let sender = wire::decode_frame(datagram).map(|frame| frame.header.sender);
        let loss = sender.map_or(0.0, |sender| self.losses.from(sender));
        loss > 0.0 && self.rng.random_bool(loss.min(1.0))
    }
}
