//! Packets between radios, and their bytes.

use bytes::Bytes;

use super::reader::Reader;
use super::writer::Writer;
use crate::identity::{NodeId, NodeSet};

/// A packet between radios. All other payloads are for the routing.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum RadioPacket {
    /// A restarted radio asks senders for proof that their frames are fresh.
    Challenge {
        /// A number that the radio has not used before.
        nonce: u64,
        /// The senders that are asked.
        of: NodeSet,
    },
    /// The proof of freshness: the last challengers, each with its nonce.
    Response(Vec<(NodeId, u64)>),
    /// Number of the newest known revocation list.
    ListNumber(u64),
    /// A revocation list, encoded, with the fleet's signature.
    List(Bytes),
    /// Empty; the frame's header carries the intent.
    Intent,
}

// Kinds of packets, in the first byte. Other numbers are the routing's.

/// A packet that asks for proof of an incarnation.
pub(super) const CHALLENGE: u8 = 4;
const RESPONSE: u8 = 5;
const LIST_NUMBER: u8 = 6;
const LIST: u8 = 7;
pub(super) const INTENT: u8 = 8;

/// Encodes a packet between radios.
#[must_use]
pub fn encode_radio_packet(packet: &RadioPacket) -> Vec<u8> {
    let mut writer = Writer(Vec::with_capacity(32));
    match packet {
        RadioPacket::Challenge { nonce, of } => {
            writer.u8(CHALLENGE);
            writer.u64(*nonce);
            writer.set(of);
        }
        RadioPacket::Response(answered) => {
            writer.u8(RESPONSE);
            writer.count(answered.len());
            for (id, nonce) in answered {
                writer.u32(id.0);
                writer.u64(*nonce);
            }
        }
        RadioPacket::ListNumber(number) => {
            writer.u8(LIST_NUMBER);
            writer.u64(*number);
        }
        RadioPacket::List(list) => {
            writer.u8(LIST);
            writer.0.extend_from_slice(list);
        }
        RadioPacket::Intent => writer.u8(INTENT),
    }
    writer.0
}

/// Decodes a packet between radios; `None` for any other payload.
#[inline]
#[must_use]
pub fn decode_radio_packet(payload: &[u8]) -> Option<RadioPacket> {
    match payload {
        [kind, packet @ ..] if *kind >= CHALLENGE => read(*kind, packet),
        _ => None,
    }
}

fn read(kind: u8, packet: &[u8]) -> Option<RadioPacket> {
    let mut reader = Reader(packet);
    let packet = match kind {
        CHALLENGE => RadioPacket::Challenge {
            nonce: reader.u64()?,
            of: reader.set()?,
        },
        RESPONSE => {
            let count = reader.u32()? as usize;
            // An entry takes at least two bytes, whatever count is claimed.
            let mut answered = Vec::with_capacity(count.min(packet.len() / 2));
            for _ in 0..count {
                answered.push((NodeId(reader.u32()?), reader.u64()?));
            }
            RadioPacket::Response(answered)
        }
        LIST_NUMBER => RadioPacket::ListNumber(reader.u64()?),
        LIST => return Some(RadioPacket::List(Bytes::copy_from_slice(packet))),
        INTENT => RadioPacket::Intent,
        _ => return None,
    };
    reader.0.is_empty().then_some(packet)
}
