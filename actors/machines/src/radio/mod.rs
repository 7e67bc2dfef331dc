//! What is let in from the air and what goes out: admission, counters, signatures.

mod admission;
mod authenticator;

use std::convert::Infallible;
use std::hint::black_box;
use std::num::NonZeroU32;

use bytes::{Buf, Bytes};

pub use admission::{Admission, Budget, DropReason, Place};
pub use authenticator::{Authenticator, IdealAuthenticator};

use serde::{Deserialize, Serialize};

use crate::flaw::{self, Flaw};
use crate::identity::{Ballot, NodeId, SwarmId};
use crate::machine::{Machine, Outbox, Output};
use crate::time::Timestamp;
use crate::wire::{self, AUTHENTICATOR_LEN, HEADER_MAX, Header, PAYLOAD_MAX};

/// How many counters are reserved at once, so that a restart never uses one twice and a journal is not worn.
const COUNTER_BLOCK: u64 = 1_024;

/// What a radio is built with.
#[derive(Debug, Clone)]
pub struct Config {
    /// Whose radio this is.
    pub id: NodeId,
    /// The swarm it belongs to.
    pub swarm: SwarmId,
    /// How much of each sender is let in.
    pub budget: Budget,
    /// How many members the swarm has, relays included; ids run from 0 to one below.
    pub members: u32,
}

/// Where a datagram came from: a name that a transport gives to an address of its own, for as long as it says.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Source(pub NonZeroU32);

/// What a radio is told.
#[derive(Debug, Clone, PartialEq)]
pub enum Input {
    /// By the routing: send this.
    Send {
        /// For whom it is; for all in range otherwise.
        to: Option<NodeId>,
        /// Whom this drone obeys.
        ballot: Ballot,
        /// What is to be said; at most [`PAYLOAD_MAX`] bytes.
        payload: Vec<u8>,
        /// Whether it is sent only because its time has come; for whoever counts frames.
        keep_alive: bool,
    },
    /// By the transport: these bytes came in.
    Received {
        /// The bytes.
        datagram: Bytes,
        /// From where, if the transport tells.
        source: Option<Source>,
    },
    /// By the transport: what became of a frame of our own for one drone.
    Outcome {
        /// For whom it was.
        to: NodeId,
        /// The frame.
        frame: Bytes,
        /// Whether it arrived there, as far as is known.
        delivered: bool,
    },
}

/// What a radio sends.
#[derive(Debug, Clone, PartialEq)]
pub enum Transmit {
    /// To the transport: a frame.
    Send {
        /// For whom it is; for all in range otherwise.
        to: Option<NodeId>,
        /// The frame.
        frame: Bytes,
        /// As in [`Input::Send`].
        keep_alive: bool,
    },
    /// To the routing: a frame that was let in.
    Heard {
        /// Who said it.
        sender: NodeId,
        /// Whom the sender obeys.
        ballot: Ballot,
        /// What was said.
        payload: Bytes,
    },
    /// To the transport: a frame that was let in came from there, so its sender is to be found there.
    Locate {
        /// The frame's sender.
        sender: NodeId,
        /// Where it came from.
        source: Source,
    },
    /// To the routing: what became of a frame for one drone.
    Outcome {
        /// For whom it was.
        to: NodeId,
        /// What was said.
        payload: Bytes,
        /// Whether it arrived there, as far as is known.
        delivered: bool,
    },
}

/// What can be seen of a radio.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Event {
    /// A frame was not let in.
    Dropped(DropReason),
    /// A payload of our own was too long to send.
    Oversized {
        /// Its length in bytes.
        len: usize,
    },
    /// What a restarted radio is built from.
    Checkpoint(Checkpoint),
}

/// What outlives a radio: the counters it may already have used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Checkpoint {
    /// The first counter that no frame has used.
    pub counter: u64,
}

/// The radio of one drone.
#[derive(Debug)]
pub struct Radio<A> {
    config: Config,
    boot: u32,
    authenticator: A,
    admission: Admission,
    counter: u64,
    reserved: u64,
    outbox: Outbox<Transmit, Event>,
}

impl<A: Authenticator> Radio<A> {
    /// A radio that starts after the counters which `checkpoint` reserved, with an empty replay window, in the
    /// `boot`th life of the drone's process.
    #[must_use]
    pub fn new(config: Config, authenticator: A, boot: u32, checkpoint: Checkpoint) -> Self {
        let admission = Admission::new(config.budget, config.members);
        Self {
            admission,
            authenticator,
            boot,
            counter: checkpoint.counter,
            reserved: checkpoint.counter,
            outbox: Outbox::new(),
            config,
        }
    }

    /// Entries in the table of senders, and the most it takes.
    #[must_use]
    pub fn occupancy(&self) -> (usize, usize) {
        (self.admission.senders(), self.config.members as usize)
    }

    /// As [`Cell::read_ahead`](crate::cell::Cell::read_ahead) says.
    pub(crate) fn read_ahead(&self, sender: Option<NodeId>) {
        black_box((self.config.id, self.config.swarm, self.outbox.is_empty()));
        self.admission.read_ahead(sender);
    }

    /// The next frame of this drone's; nothing for a payload that is too long.
    fn frame(&mut self, ballot: Ballot, payload: &[u8]) -> Option<Bytes> {
        if payload.len() > PAYLOAD_MAX {
            let len = payload.len();
            self.outbox.event(Event::Oversized { len });
            return None;
        }
        if self.counter == self.reserved {
            self.reserved += COUNTER_BLOCK;
            let counter = self.reserved;
            self.outbox.event(Event::Checkpoint(Checkpoint { counter }));
        }
        let header = Header {
            swarm: self.config.swarm,
            sender: self.config.id,
            boot: self.boot,
            counter: self.counter,
            ballot,
        };
        self.counter += 1;
        let capacity = HEADER_MAX + payload.len() + AUTHENTICATOR_LEN;
        let mut frame = wire::encode_covered(&header, payload, Vec::with_capacity(capacity));
        let authenticator = self.authenticator.sign(&frame);
        frame.extend_from_slice(&authenticator);
        Some(frame.into())
    }

    fn receive(
        &mut self,
        now: Timestamp,
        mut datagram: Bytes,
        source: Option<Source>,
    ) -> Result<(), DropReason> {
        let frame = wire::decode_frame(&datagram)?;
        let header = frame.header;
        if header.swarm != self.config.swarm && !flaw::has(Flaw::HeedsOtherSwarms) {
            return Err(DropReason::OtherSwarm);
        }
        if header.sender == self.config.id {
            return Err(DropReason::OwnEcho);
        }
        if !self.authenticator.is_trusted(header.sender) {
            return Err(DropReason::Expelled);
        }
        let place = self.admission.check(now, &header)?;
        let is_genuine =
            self.authenticator
                .verify(header.sender, frame.covered, frame.authenticator);
        if !is_genuine && !flaw::has(Flaw::BelievesAnySender) {
            return Err(DropReason::Forged);
        }
        self.admission.admit(place, &header);
        let end = frame.covered.len();
        let begin = end - frame.payload.len();
        datagram.truncate(end);
        datagram.advance(begin);
        if let Some(source) = source {
            let sender = header.sender;
            self.outbox.transmit(Transmit::Locate { sender, source });
        }
        self.outbox.transmit(Transmit::Heard {
            sender: header.sender,
            ballot: header.ballot,
            payload: datagram,
        });
        Ok(())
    }
}

impl<A: Authenticator> Machine for Radio<A> {
    type Input = Input;
    type Transmit = Transmit;
    type Event = Event;
    type Rejection = Infallible;

    fn handle_input(&mut self, now: Timestamp, input: Input) -> Result<(), Infallible> {
        match input {
            Input::Send {
                to,
                ballot,
                payload,
                keep_alive,
            } => {
                if let Some(frame) = self.frame(ballot, &payload) {
                    self.outbox.transmit(Transmit::Send {
                        to,
                        frame,
                        keep_alive,
                    });
                }
            }
            Input::Outcome {
                to,
                frame,
                delivered,
            } => {
                if let Ok(own) = wire::decode_frame(&frame) {
                    self.outbox.transmit(Transmit::Outcome {
                        to,
                        payload: frame.slice_ref(own.payload),
                        delivered,
                    });
                }
            }
            Input::Received { datagram, source } => {
                if let Err(reason) = self.receive(now, datagram, source) {
                    self.outbox.event(Event::Dropped(reason));
                }
            }
        }
        Ok(())
    }

    fn handle_timeout(&mut self, _now: Timestamp) {}

    fn poll_output(&mut self) -> Output<Transmit, Event> {
        self.outbox.poll(None)
    }
}

#[cfg(test)]
mod tests;
