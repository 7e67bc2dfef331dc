//! What is let in from the air and what goes out: admission, counters, signatures, and what radios say to each other.

mod admission;
mod authenticator;
mod budget;
mod config;
mod freshness;
mod lists;
mod packet;

use std::collections::BTreeMap;
use std::convert::Infallible;
use std::hint::black_box;
use std::num::NonZeroU16;
use std::time::Duration;

use bytes::{Buf, Bytes};

pub use admission::{Admission, Asked, DropReason, Place};
pub use authenticator::{Authenticator, IdealAuthenticator, Offer};
pub use budget::Budget;
pub use config::{Config, Incarnations};
pub use packet::Packet;

use serde::{Deserialize, Serialize};

use self::freshness::{Challenger, Responder};
use self::lists::{Gossip, Saying};
use crate::flaw::{self, Flaw};
use crate::identity::{Ballot, NodeId, NodeSet};
use crate::machine::{Machine, Outbox, Output};
use crate::time::Timestamp;
use crate::traffic::Intent;
use crate::wire::{self, Header, PAYLOAD_MAX};

/// How many counters are reserved at once, so that a restart never uses one twice and a journal is not worn.
const COUNTER_BLOCK: u64 = 1_024;

/// How many runs of ids a challenge names, so that it fits a datagram; where there are more, it names all.
const CHALLENGED_RUNS_MAX: usize = 64;

/// The most bytes that a frame takes to say where its sender is and goes.
const INTENT_MAX: usize = 6 * 5 + 1;
/// How often it is passed on that a drone still is and goes where it said.
const INTENT_REPEATED_AFTER: Duration = Duration::from_secs(1);

/// What stands for a ballot in frames that a radio sends by itself: it does not know whom its drone obeys.
const NOBODY: Ballot = Ballot {
    term: 0,
    rank: 0,
    master: NodeId(0),
};

/// Where a datagram came from: a name that a transport gives to an address of its own, for as long as it says. What comes
/// from an address at which a drone was found has the same name as long as it is to be found there.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Source {
    /// The machine, or whatever else can send from many ports.
    pub host: NonZeroU16,
    /// Which of its ports.
    pub port: u16,
}

/// Whether a frame with this payload says where its sender is and goes, if that can be said.
const fn has_room_for_intent(payload: &[u8]) -> bool {
    payload.len() <= PAYLOAD_MAX - INTENT_MAX
}

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
    /// By the navigation: all frames are to say where the drone is and goes.
    Intend {
        /// Where, if that can be said.
        intent: Option<Intent>,
        /// Whether others are to know at once, in a frame of its own.
        at_once: bool,
    },
    /// By the transport: these bytes came in.
    Received {
        /// The bytes.
        datagram: Bytes,
        /// From where, if the transport tells.
        source: Option<Source>,
        /// Which drone has proved to be at the other end, where they came by a connection: it says nothing in the name of
        /// another, and nobody else can have said it, so its signature is not looked at.
        peer: Option<NodeId>,
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
    /// To the navigation: where another is and goes.
    Traffic {
        /// Who.
        sender: NodeId,
        /// Where; nothing if it does not say so any more.
        intent: Option<Intent>,
    },
    /// To the navigation: this radio restarted, tell it again where the drone is and goes.
    Resync,
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
    /// A newer list of the expelled came in, and was taken.
    RevocationList {
        /// The list's number.
        list: u64,
    },
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
    /// As its frames have it.
    incarnation: u32,
    authenticator: A,
    admission: Admission,
    counter: u64,
    reserved: u64,
    outbox: Outbox<Transmit, Event>,
    /// Memory in which frames are written.
    written: Vec<u8>,
    /// Where senders must prove themselves.
    challenger: Option<Box<Challenger>>,
    /// Once somebody has asked.
    responder: Option<Box<Responder>>,
    /// Where there are lists of the expelled.
    gossip: Option<Box<Gossip>>,
    /// What the navigation has said of where the drone is and goes.
    intent: Option<Intent>,
    /// What others have said of themselves, and when that was last passed on.
    intents: BTreeMap<NodeId, (Intent, Timestamp)>,
}

impl<A: Authenticator> Radio<A> {
    /// A radio that starts after the counters which `checkpoint` reserved, with an empty replay window, in the `boot`th life
    /// of the drone's journal. One that has lived before can't know what it has heard: it believes a sender only once that
    /// has signed `nonce`, which must never have been used before. So does any one where lives are [`Incarnations::Drawn`].
    #[must_use]
    pub fn new(
        config: Config,
        authenticator: A,
        boot: u32,
        checkpoint: Checkpoint,
        nonce: u64,
    ) -> Self {
        let has_lived = boot > 1 || checkpoint != Checkpoint::default();
        let (incarnation, asked) = match config.incarnations {
            Incarnations::Drawn(incarnation) => (incarnation, Asked::EachIncarnation),
            Incarnations::Counted if has_lived => (boot, Asked::TheUnknown),
            Incarnations::Counted => (boot, Asked::Nobody),
        };
        let list = authenticator.list_number();
        let mut outbox = Outbox::new();
        if has_lived {
            outbox.transmit(Transmit::Resync);
        }
        Self {
            admission: Admission::new(config.budget, config.members, asked),
            authenticator,
            incarnation,
            counter: checkpoint.counter,
            reserved: checkpoint.counter,
            outbox,
            written: Vec::new(),
            challenger: (asked != Asked::Nobody).then(|| Box::new(Challenger::new(nonce))),
            responder: None,
            gossip: (list > 0).then(|| Box::new(Gossip::new(list))),
            intent: None,
            intents: BTreeMap::new(),
            config,
        }
    }

    /// Entries in the table of senders, and the most it takes.
    #[must_use]
    pub fn occupancy(&self) -> (usize, usize) {
        (self.admission.senders(), self.config.members as usize)
    }

    /// As [`NodeMachine::read_ahead`](crate::node::NodeMachine::read_ahead) says.
    pub(crate) fn read_ahead(&self) {
        black_box((self.config.id, self.config.swarm, self.outbox.is_empty()));
        black_box((
            self.written.len(),
            self.counter,
            self.incarnation,
            self.challenger.is_some(),
        ));
        self.admission.read_ahead();
    }

    /// As [`NodeMachine::read_further_ahead`](crate::node::NodeMachine::read_further_ahead) says.
    pub(crate) fn read_further_ahead(&self, sender: Option<NodeId>) {
        self.admission.read_further_ahead(sender);
    }

    /// The next frame of this drone's; nothing for a payload that is too long.
    fn frame(&mut self, ballot: Ballot, payload: &[u8]) -> Option<Bytes> {
        if payload.len() > PAYLOAD_MAX {
            let len = payload.len();
            self.outbox.event(Event::Oversized { len });
            return None;
        }
        self.reserve();
        let header = Header {
            swarm: self.config.swarm,
            sender: self.config.id,
            incarnation: self.incarnation,
            counter: self.counter,
            ballot,
            intent: self.intent.filter(|_| has_room_for_intent(payload)),
        };
        self.counter += 1;
        let mut memory = std::mem::take(&mut self.written);
        memory.clear();
        let mut frame = wire::encode_covered(&header, payload, memory);
        let authenticator = self.authenticator.sign(&frame);
        frame.extend_from_slice(&authenticator);
        self.written = frame;
        Some(Bytes::copy_from_slice(&self.written))
    }

    /// Has a counter that may be used.
    fn reserve(&mut self) {
        if self.counter == self.reserved {
            self.reserved += COUNTER_BLOCK;
            let counter = self.reserved;
            self.outbox.event(Event::Checkpoint(Checkpoint { counter }));
        }
    }

    fn receive(
        &mut self,
        now: Timestamp,
        mut datagram: Bytes,
        source: Option<Source>,
        peer: Option<NodeId>,
    ) -> Result<(), DropReason> {
        let frame = wire::decode_frame(&datagram)?;
        let header = frame.header;
        if header.swarm != self.config.swarm && !flaw::has(Flaw::HeedsOtherSwarms) {
            return Err(DropReason::OtherSwarm);
        }
        if header.sender == self.config.id {
            return Err(DropReason::OwnEcho);
        }
        let sender = header.sender;
        if peer.is_some_and(|peer| peer != sender) {
            return Err(DropReason::Relayed);
        }
        if !self.authenticator.is_trusted(sender) {
            self.hears_revoked(now);
            return Err(DropReason::Revoked);
        }
        let place = self.admission.find(&header, source)?;
        if !place.is_proven() && !self.proves_or_asks(sender, frame.payload) {
            self.hears_unproven(now, place, sender);
            return Err(DropReason::Unproven);
        }
        self.admission.check(now, place, source)?;
        let is_genuine = peer.is_some()
            || (self.authenticator).verify(sender, frame.covered, frame.authenticator);
        if !is_genuine && !flaw::has(Flaw::BelievesAnySender) {
            self.admission.refuse(now, place, source);
            return Err(DropReason::Forged);
        }
        let packet = wire::decode_radio_packet(frame.payload);
        if let (false, Some(Packet::Challenge { nonce, of })) = (place.is_proven(), &packet) {
            // It may be an old one, sent again: to answer it does no harm, and the sender is to prove itself.
            self.admission.refuse(now, place, source);
            self.is_asked(now, sender, *nonce, of);
            self.hears_unproven(now, place, sender);
            return Ok(());
        }
        self.admission.admit(now, place, &header, source);
        if let (false, Some(challenger)) = (place.is_proven(), &mut self.challenger) {
            challenger.is_answered(sender);
        }
        if let Some(source) = source {
            self.outbox.transmit(Transmit::Locate { sender, source });
        }
        if has_room_for_intent(frame.payload) {
            self.hears_intent(now, sender, header.intent);
        }
        if let Some(packet) = packet {
            return self.take(now, sender, packet);
        }
        let end = frame.covered.len();
        let begin = end - frame.payload.len();
        datagram.truncate(end);
        datagram.advance(begin);
        self.outbox.transmit(Transmit::Heard {
            sender,
            ballot: header.ballot,
            payload: datagram,
        });
        Ok(())
    }

    /// Whether it is worth looking at the signature of this payload of an unproven sender: it is what proves the sender, or
    /// asks for the same.
    fn proves_or_asks(&self, sender: NodeId, payload: &[u8]) -> bool {
        match wire::decode_radio_packet(payload) {
            Some(Packet::Response(answered)) => {
                let nonce = self.challenger.as_ref().and_then(|it| it.nonce_for(sender));
                nonce.is_some_and(|nonce| answered.contains(&(self.config.id, nonce)))
            }
            Some(Packet::Challenge { of, .. }) => of.contains(self.config.id),
            _ => false,
        }
    }

    /// Takes in what another radio says to this one.
    fn take(&mut self, now: Timestamp, sender: NodeId, packet: Packet) -> Result<(), DropReason> {
        match packet {
            Packet::Challenge { nonce, of } => self.is_asked(now, sender, nonce, &of),
            // What it was to prove is proved; where it is and goes has been heard.
            Packet::Response(_) | Packet::Intent => {}
            Packet::ListNumber(theirs) => {
                let own = self.authenticator.list_number();
                if let Some(gossip) = &mut self.gossip {
                    gossip.hears_number(theirs, own);
                }
                self.pass_on_lists(now);
            }
            Packet::List(list) => match self.authenticator.take_list(&list) {
                Offer::Unsigned => return Err(DropReason::UnsignedList),
                Offer::Older => {}
                Offer::Same => {
                    if let Some(gossip) = &mut self.gossip {
                        gossip.hears_list(now);
                    }
                }
                Offer::Newer => {
                    let list = self.authenticator.list_number();
                    self.outbox.event(Event::RevocationList { list });
                    self.pass_on_lists(now);
                }
            },
        }
        Ok(())
    }

    /// Passes on where another is and goes, if that is news or has not been said for a while.
    fn hears_intent(&mut self, now: Timestamp, sender: NodeId, intent: Option<Intent>) {
        let before = self.intents.get(&sender);
        let is_news = match (intent, before) {
            (None, before) => before.is_some(),
            (Some(_), None) => true,
            (Some(intent), Some((before, at))) => {
                *before != intent || now.since(*at) >= INTENT_REPEATED_AFTER
            }
        };
        if is_news {
            match intent {
                Some(intent) => self.intents.insert(sender, (intent, now)),
                None => self.intents.remove(&sender),
            };
            self.outbox.transmit(Transmit::Traffic { sender, intent });
        }
    }

    fn is_asked(&mut self, now: Timestamp, by: NodeId, nonce: u64, of: &NodeSet) {
        if of.contains(self.config.id) {
            let responder = (self.responder).get_or_insert_with(|| Box::new(Responder::new()));
            responder.asks(by, nonce);
            self.respond(now);
        }
    }

    fn hears_unproven(&mut self, now: Timestamp, place: Place, sender: NodeId) {
        if let Some(challenger) = &mut self.challenger {
            if place.is_of_other_incarnation() {
                challenger.doubts(now, sender);
            } else {
                challenger.hears();
            }
            self.challenge(now);
        }
    }

    fn hears_revoked(&mut self, now: Timestamp) {
        if let Some(gossip) = &mut self.gossip {
            gossip.hears_revoked(now);
            self.pass_on_lists(now);
        }
    }

    /// Asks those who are unproven, if it is time.
    fn challenge(&mut self, now: Timestamp) {
        let Some(challenger) = self.challenger.as_mut().filter(|it| it.is_due(now)) else {
            return;
        };
        let mut of = self.admission.unproven();
        of = of.difference(&self.config.id.into());
        of.extend_from(challenger.doubted());
        if of.is_empty() {
            return challenger.rest();
        }
        if of.runs().len() > CHALLENGED_RUNS_MAX {
            of = NodeSet::from(0..self.config.members);
        }
        let nonce = challenger.sends(now);
        self.say(&Packet::Challenge { nonce, of });
    }

    /// Answers those who ask, if it is time.
    fn respond(&mut self, now: Timestamp) {
        let answered = self.responder.as_mut().map(|it| it.due(now));
        if let Some(answered) = answered.filter(|it| !it.is_empty()) {
            self.say(&Packet::Response(answered));
        }
    }

    /// Says what it has for a list of the expelled, if it is time.
    fn pass_on_lists(&mut self, now: Timestamp) {
        let own = self.authenticator.list_number();
        while let Some(saying) = self.gossip.as_mut().and_then(|it| it.due(now, own)) {
            let packet = match saying {
                Saying::Number => Some(Packet::ListNumber(own)),
                Saying::List => self.authenticator.list().map(Packet::List),
            };
            if let Some(packet) = packet {
                self.say(&packet);
            }
        }
    }

    /// Says something to all other radios.
    fn say(&mut self, packet: &Packet) {
        let payload = wire::encode_radio_packet(packet);
        if let Some(frame) = self.frame(NOBODY, &payload) {
            self.outbox.transmit(Transmit::Send {
                to: None,
                frame,
                keep_alive: matches!(packet, Packet::ListNumber(_)),
            });
        }
    }

    fn deadline(&self) -> Option<Timestamp> {
        let challenge = self.challenger.as_ref().and_then(|it| it.deadline());
        let response = self.responder.as_ref().and_then(|it| it.deadline());
        let list = self.gossip.as_ref().map(|it| it.deadline());
        let times = [challenge, response, list];
        times.into_iter().flatten().min()
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
            Input::Intend { intent, at_once } => {
                let is_news = self.intent != intent;
                self.intent = intent;
                if is_news && at_once {
                    self.say(&Packet::Intent);
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
            Input::Received {
                datagram,
                source,
                peer,
            } => {
                if let Err(reason) = self.receive(now, datagram, source, peer) {
                    self.outbox.event(Event::Dropped(reason));
                }
            }
        }
        Ok(())
    }

    fn handle_timeout(&mut self, now: Timestamp) {
        // From its first step on there is a checkpoint, which tells a later radio that this one was there.
        self.reserve();
        self.challenge(now);
        self.respond(now);
        self.pass_on_lists(now);
    }

    fn poll_output(&mut self) -> Output<Transmit, Event> {
        self.outbox.poll(self.deadline())
    }
}

#[cfg(test)]
mod tests;
