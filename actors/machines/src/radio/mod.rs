//! Radio: admission of received frames, counters and signatures of sent frames, and packets between radios.

mod admission;
mod authenticator;
mod budget;
mod config;
mod counters;
mod freshness;
mod intents;
mod message;
mod revocation;

use std::cmp::Ordering;
use std::hint::black_box;
use std::ops::Range;

use bytes::{Buf, Bytes};

pub use admission::{Admission, DropReason, ProofPolicy, SenderLookup};
pub use authenticator::{Authenticator, IdealAuthenticator};
pub use budget::Budget;
pub(crate) use budget::TokenBucket;
pub use config::{Config, Incarnations};
pub use counters::Checkpoint;
pub use message::{Event, Input, Source, Transmit};
pub use revocation::Revoked;

use self::counters::Counters;
use self::freshness::{Challenger, Responder};
use self::intents::{Intents, has_room_for_intent};
use self::revocation::{ListGossip, ListMessage};
use crate::flaw::{self, Flaw};
use crate::identity::{Ballot, NodeId, NodeSet};
use crate::machine::{Machine, Outbox, Output};
use crate::time::Timestamp;
use crate::traffic::Intent;
use crate::wire::{self, Header, PAYLOAD_MAX, RadioPacket};

/// Largest number of id ranges in a challenge, so that it fits a datagram; with more ranges it names all members.
const CHALLENGED_RUNS_MAX: usize = 64;

/// Ballot in frames of the radio itself, which does not know the leader.
const NO_BALLOT: Ballot = Ballot {
    term: 0,
    rank: 0,
    master: NodeId(0),
};

/// Radio of one drone.
#[derive(Debug)]
pub struct Radio<A> {
    config: Config,
    /// Incarnation in its frames.
    incarnation: u32,
    authenticator: A,
    admission: Admission,
    counters: Counters,
    outbox: Outbox<Transmit, Event>,
    /// `None` if senders need no freshness proof.
    challenger: Option<Box<Challenger>>,
    /// `None` until the first challenge.
    responder: Option<Box<Responder>>,
    /// The revocation list in force. `None` without lists.
    gossip: Option<Box<ListGossip>>,
    intents: Intents,
}

impl<A: Authenticator> Radio<A> {
    /// A radio that starts after the counters reserved by `checkpoint`, with an empty replay window, in incarnation
    /// `boot` of the drone's journal.
    ///
    /// A radio with earlier incarnations can't know which frames it has received. It accepts a sender only once that
    /// has signed `nonce`, which must never have been used before. With [`Incarnations::Drawn`] every radio does so.
    #[must_use]
    pub fn new(
        config: Config,
        authenticator: A,
        boot: u32,
        checkpoint: Checkpoint,
        nonce: u64,
    ) -> Self {
        let has_earlier_incarnation = boot > 1 || checkpoint != Checkpoint::default();
        let (incarnation, proof_policy) = match config.incarnations {
            Incarnations::Drawn(incarnation) => (incarnation, ProofPolicy::EachIncarnation),
            Incarnations::Counted if has_earlier_incarnation => (boot, ProofPolicy::UnknownSenders),
            Incarnations::Counted => (boot, ProofPolicy::NotRequired),
        };
        let mut outbox = Outbox::new();
        if has_earlier_incarnation {
            outbox.transmit(Transmit::Resync);
        }
        Self {
            admission: Admission::new(config.budget, config.members, proof_policy),
            authenticator,
            incarnation,
            counters: Counters::new(checkpoint),
            outbox,
            challenger: (proof_policy != ProofPolicy::NotRequired)
                .then(|| Box::new(Challenger::new(nonce))),
            responder: None,
            gossip: None,
            intents: Intents::default(),
            config,
        }
    }

    /// Puts a revocation list in force from the start; number 0 is none.
    #[must_use]
    pub fn with_list(mut self, list: Revoked) -> Self {
        self.gossip = (list.number > 0).then(|| Box::new(ListGossip::new(list)));
        self
    }

    /// Used and maximum entries of the sender table.
    #[must_use]
    pub fn occupancy(&self) -> (usize, usize) {
        (self.admission.senders(), self.config.members as usize)
    }

    /// Prefetches; see [`NodeMachine::read_ahead`](crate::node::NodeMachine::read_ahead).
    pub(crate) fn read_ahead(&self) {
        black_box((self.config.id, self.config.swarm, self.outbox.is_empty()));
        black_box((
            self.counters.next(),
            self.incarnation,
            self.challenger.is_some(),
        ));
        self.admission.read_ahead();
    }

    /// Prefetches; see [`NodeMachine::read_further_ahead`](crate::node::NodeMachine::read_further_ahead).
    pub(crate) fn read_further_ahead(&self, sender: Option<NodeId>) {
        self.admission.read_further_ahead(sender);
    }

    /// Encodes the next frame; `None` for a payload that is too long.
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
            counter: self.counters.take(),
            ballot,
            intent: self.intents.own_for(payload),
        };
        let mut frame = wire::encode_covered(&header, payload);
        let authenticator = self.authenticator.sign(&frame);
        frame.extend_from_slice(&authenticator);
        Some(frame.into())
    }

    /// Reserves counters if none is left.
    fn reserve(&mut self) {
        if let Some(checkpoint) = self.counters.reserve() {
            self.outbox.event(Event::Checkpoint(checkpoint));
        }
    }

    fn receive(
        &mut self,
        now: Timestamp,
        datagram: Bytes,
        source: Option<Source>,
        peer: Option<NodeId>,
    ) -> Result<(), DropReason> {
        let frame = wire::decode_frame(&datagram)?;
        let header = frame.header;
        let sender = header.sender;
        self.check_header(&header, peer)?;
        if self.gossip.as_ref().is_some_and(|it| it.revokes(sender)) {
            self.handle_revoked_sender(now);
            return Err(DropReason::Revoked);
        }
        let lookup = self.admission.find(&header, source)?;
        if !lookup.is_proven() && !self.proves_or_challenges(sender, frame.payload) {
            self.handle_unproven_sender(now, lookup, sender);
            return Err(DropReason::Unproven);
        }
        self.admission.check(now, lookup, source)?;
        let is_genuine = peer.is_some()
            || (self.authenticator).verify(sender, frame.covered, frame.authenticator);
        if !is_genuine && !flaw::has(Flaw::SkipsSignatureCheck) {
            self.admission.refuse(now, lookup, source);
            return Err(DropReason::Forged);
        }
        let packet = wire::decode_radio_packet(frame.payload);
        if let (false, Some(RadioPacket::Challenge { nonce, of })) = (lookup.is_proven(), &packet) {
            // It may be a replay. Answering it is harmless, but its sender must prove itself.
            self.admission.refuse(now, lookup, source);
            self.handle_challenge(now, sender, *nonce, of);
            self.handle_unproven_sender(now, lookup, sender);
            return Ok(());
        }
        let is_newest = self.admission.admit(now, lookup, &header, source);
        if let (false, Some(challenger)) = (lookup.is_proven(), &mut self.challenger) {
            challenger.record_proof(sender);
        }
        if let Some(source) = source {
            self.outbox.transmit(Transmit::Locate { sender, source });
        }
        // A late frame has an old intent.
        let may_change = header.intent.is_some() || !self.intents.are_unknown();
        if may_change && is_newest && has_room_for_intent(frame.payload) {
            self.handle_intent(now, sender, header.intent);
        }
        if let Some(packet) = packet {
            return self.handle_packet(now, sender, packet);
        }
        let end = frame.covered.len();
        let payload = end - frame.payload.len()..end;
        self.deliver(&header, datagram, payload);
        Ok(())
    }

    /// Checks the swarm and the sender of a received frame.
    #[inline]
    fn check_header(&self, header: &Header, peer: Option<NodeId>) -> Result<(), DropReason> {
        if header.swarm != self.config.swarm && !flaw::has(Flaw::AcceptsOtherSwarms) {
            return Err(DropReason::OtherSwarm);
        }
        if header.sender == self.config.id {
            return Err(DropReason::OwnEcho);
        }
        if peer.is_some_and(|peer| peer != header.sender) {
            return Err(DropReason::Relayed);
        }
        Ok(())
    }

    /// Passes the payload of a frame, at this range of its datagram, to the routing.
    #[inline]
    fn deliver(&mut self, header: &Header, mut datagram: Bytes, payload: Range<usize>) {
        datagram.truncate(payload.end);
        datagram.advance(payload.start);
        self.outbox.transmit(Transmit::Received {
            sender: header.sender,
            ballot: header.ballot,
            payload: datagram,
        });
    }

    /// Whether the signature of an unproven sender's payload is worth checking: it holds the proof or a challenge.
    fn proves_or_challenges(&self, sender: NodeId, payload: &[u8]) -> bool {
        match wire::decode_radio_packet(payload) {
            Some(RadioPacket::Response(answered)) => {
                let nonce = self.challenger.as_ref().and_then(|it| it.nonce_for(sender));
                nonce.is_some_and(|nonce| answered.contains(&(self.config.id, nonce)))
            }
            Some(RadioPacket::Challenge { of, .. }) => of.contains(self.config.id),
            _ => false,
        }
    }

    /// Handles a packet of another radio.
    fn handle_packet(
        &mut self,
        now: Timestamp,
        sender: NodeId,
        packet: RadioPacket,
    ) -> Result<(), DropReason> {
        match packet {
            RadioPacket::Challenge { nonce, of } => self.handle_challenge(now, sender, nonce, &of),
            // The proof and the intent were already handled.
            RadioPacket::Response(_) | RadioPacket::Intent => {}
            RadioPacket::ListNumber(theirs) => {
                if let Some(gossip) = &mut self.gossip {
                    gossip.update_peer_number(theirs);
                }
                self.gossip_lists(now);
            }
            RadioPacket::List(list) => {
                let Some(offered) = self.authenticator.read_list(&list) else {
                    return Err(DropReason::UnsignedList);
                };
                self.handle_list(now, list, offered);
            }
        }
        Ok(())
    }

    /// Handles a list of a peer, signed by the fleet.
    fn handle_list(&mut self, now: Timestamp, signed: Bytes, offered: Revoked) {
        match offered.number.cmp(&self.list_number()) {
            Ordering::Less => {}
            Ordering::Equal => {
                if let Some(gossip) = &mut self.gossip {
                    gossip.list_received(now);
                }
            }
            Ordering::Greater => {
                let list = offered.number;
                self.outbox.transmit(Transmit::KeepList(signed));
                self.outbox.event(Event::RevocationList { list });
                self.put_in_force(now, offered);
            }
        }
    }

    /// Number of the revocation list in force; 0 without lists.
    fn list_number(&self) -> u64 {
        (self.gossip.as_ref()).map_or(0, |it| it.in_force().number)
    }

    /// Puts a list in force and passes it on.
    fn put_in_force(&mut self, now: Timestamp, list: Revoked) {
        match &mut self.gossip {
            Some(gossip) => gossip.replace(list),
            None => self.gossip = Some(Box::new(ListGossip::new(list))),
        }
        self.gossip_lists(now);
    }

    fn handle_intent(&mut self, now: Timestamp, sender: NodeId, intent: Option<Intent>) {
        if self.intents.update(now, sender, intent) {
            self.outbox.transmit(Transmit::Traffic {
                sender,
                intent,
                heard_at: now,
            });
        }
    }

    fn handle_challenge(&mut self, now: Timestamp, by: NodeId, nonce: u64, of: &NodeSet) {
        if of.contains(self.config.id) {
            let responder = (self.responder).get_or_insert_with(|| Box::new(Responder::new()));
            responder.enqueue(by, nonce);
            self.respond(now);
        }
    }

    fn handle_unproven_sender(&mut self, now: Timestamp, lookup: SenderLookup, sender: NodeId) {
        if let Some(challenger) = &mut self.challenger {
            if lookup.is_of_other_incarnation() {
                challenger.recheck(now, sender);
            } else {
                challenger.request();
            }
            self.challenge(now);
        }
    }

    fn handle_revoked_sender(&mut self, now: Timestamp) {
        if let Some(gossip) = &mut self.gossip {
            gossip.revoked_sender_heard(now);
            self.gossip_lists(now);
        }
    }

    /// Challenges unproven senders, if it is time.
    fn challenge(&mut self, now: Timestamp) {
        let Some(challenger) = self.challenger.as_mut().filter(|it| it.is_due(now)) else {
            return;
        };
        let mut of = self.admission.unproven();
        of = of.difference(&self.config.id.into());
        of.extend_from(challenger.rechecked());
        if of.is_empty() {
            return challenger.stop();
        }
        if of.runs().len() > CHALLENGED_RUNS_MAX {
            of = NodeSet::from(0..self.config.members);
        }
        let nonce = challenger.next_nonce(now);
        self.broadcast(&RadioPacket::Challenge { nonce, of });
    }

    /// Answers challenges, if it is time.
    fn respond(&mut self, now: Timestamp) {
        let answered = self.responder.as_mut().map(|it| it.take_due(now));
        if let Some(answered) = answered.filter(|it| !it.is_empty()) {
            self.broadcast(&RadioPacket::Response(answered));
        }
    }

    /// Sends the number or content of the revocation list, if it is time.
    fn gossip_lists(&mut self, now: Timestamp) {
        while let Some(gossip) = &mut self.gossip
            && let Some(message) = gossip.take_due(now)
        {
            let list = gossip.in_force();
            let packet = match message {
                ListMessage::Number => Some(RadioPacket::ListNumber(list.number)),
                ListMessage::List => list.signed.clone().map(RadioPacket::List),
            };
            if let Some(packet) = packet {
                self.broadcast(&packet);
            }
        }
    }

    /// Broadcasts a packet to all other radios.
    fn broadcast(&mut self, packet: &RadioPacket) {
        let payload = wire::encode_radio_packet(packet);
        if let Some(frame) = self.frame(NO_BALLOT, &payload) {
            self.outbox.transmit(Transmit::Send {
                to: None,
                frame,
                keep_alive: matches!(packet, RadioPacket::ListNumber(_)),
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

    fn handle_input(&mut self, now: Timestamp, input: Input) {
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
            Input::AnnounceIntent {
                intent,
                immediately,
            } => {
                let is_changed = self.intents.set_own(intent);
                if is_changed && immediately {
                    self.broadcast(&RadioPacket::Intent);
                }
            }
            Input::ResendTraffic => {
                for traffic in self.intents.of_others() {
                    self.outbox.transmit(traffic);
                }
            }
            Input::Delivery {
                to,
                frame,
                delivered,
            } => {
                if let Ok(own) = wire::decode_frame(&frame) {
                    self.outbox.transmit(Transmit::Delivery {
                        to,
                        payload: frame.slice_ref(own.payload),
                        delivered,
                    });
                }
            }
            Input::Revoked(list) => self.put_in_force(now, *list),
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
    }

    fn handle_timeout(&mut self, now: Timestamp) {
        // The first step leaves a checkpoint, so that a later radio knows that this one existed.
        self.reserve();
        self.challenge(now);
        self.respond(now);
        self.gossip_lists(now);
    }

    fn poll_output(&mut self) -> Output<Transmit, Event> {
        self.outbox.poll(self.deadline())
    }
}

#[cfg(test)]
mod tests;
