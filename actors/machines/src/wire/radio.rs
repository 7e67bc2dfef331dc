//! What radios say to each other, in bytes.

use bytes::Bytes;

use super::reader::Reader;
use super::writer::Writer;
use crate::identity::NodeId;
use crate::radio::Packet;

/// What such packets begin with, by their kind; the numbers before these are the routing's.
pub(super) const CHALLENGE: u8 = 4;
const RESPONSE: u8 = 5;
const LIST_NUMBER: u8 = 6;
const LIST: u8 = 7;
pub(super) const INTENT: u8 = 8;

/// Writes a packet of the radio.
#[must_use]
pub fn encode_radio_packet(packet: &Packet) -> Vec<u8> {
    let mut to = Writer(Vec::with_capacity(32));
    match packet {
        Packet::Challenge { nonce, of } => {
            to.byte(CHALLENGE);
            to.long_number(*nonce);
            to.set(of);
        }
        Packet::Response(answered) => {
            to.byte(RESPONSE);
            to.count(answered.len());
            for (id, nonce) in answered {
                to.number(id.0);
                to.long_number(*nonce);
            }
        }
        Packet::ListNumber(number) => {
            to.byte(LIST_NUMBER);
            to.long_number(*number);
        }
        Packet::List(list) => {
            to.byte(LIST);
            to.0.extend_from_slice(list);
        }
        Packet::Intent => to.byte(INTENT),
    }
    to.0
}

/// Reads a packet of the radio; nothing for whatever is none, which is the routing's to read.
#[inline]
#[must_use]
pub fn decode_radio_packet(payload: &[u8]) -> Option<Packet> {
    match payload {
        [kind, packet @ ..] if *kind >= CHALLENGE => read(*kind, packet),
        _ => None,
    }
}

fn read(kind: u8, packet: &[u8]) -> Option<Packet> {
    let mut from = Reader(packet);
    let packet = match kind {
        CHALLENGE => Packet::Challenge {
            nonce: from.long_number()?,
            of: from.set()?,
        },
        RESPONSE => {
            let count = from.number()? as usize;
            // Each takes two bytes at least, whatever is claimed.
            let mut answered = Vec::with_capacity(count.min(packet.len() / 2));
            for _ in 0..count {
                answered.push((NodeId(from.number()?), from.long_number()?));
            }
            Packet::Response(answered)
        }
        LIST_NUMBER => Packet::ListNumber(from.long_number()?),
        LIST => return Some(Packet::List(Bytes::copy_from_slice(packet))),
        INTENT => Packet::Intent,
        _ => return None,
    };
    from.0.is_empty().then_some(packet)
}
