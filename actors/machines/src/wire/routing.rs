//! Bytes of packets between routings.

use std::time::Duration;

use bytes::Bytes;

use super::message::MESSAGE;
use super::reader::Reader;
use super::writer::Writer;
use super::{Flood, Member, Message, Packet, PayloadError, Tree, TreeFrame, TreeHeader};
use super::{message, tree};
use crate::identity::NodeId;

/// Kinds of packets, in the first byte; numbered as postcard numbers the variants of an enum. Numbers 4 to 8 are the
/// radio's, 9 is for messages.
pub(super) const HELLO: u8 = 0;
pub(super) const HOP_UPDATE: u8 = 1;
pub(super) const FLOOD: u8 = 2;
pub(super) const TREE: u8 = 3;

const OUT_OF_RANGE: u8 = 1;
const LANDING: u8 = 2;

/// Encodes a packet between routings.
#[must_use]
pub fn encode_packet(packet: &Packet) -> Vec<u8> {
    let members = match packet {
        Packet::Flood(flood) => flood.members.len(),
        _ => 0,
    };
    let mut writer = Writer(Vec::with_capacity(64 + 8 * members));
    match packet {
        Packet::Hello { remaining } => {
            writer.u8(HELLO);
            writer.u32(u32::try_from(remaining.as_millis()).unwrap_or(u32::MAX));
        }
        Packet::HopUpdate { hops, routing_list } => {
            writer.u8(HOP_UPDATE);
            writer.u32((*hops).into());
            writer.count(routing_list.len());
            routing_list.iter().for_each(|id| writer.u32(id.0));
        }
        Packet::Flood(flood) => {
            writer.u8(FLOOD);
            write_flood(flood, &mut writer);
        }
        Packet::Tree(tree) => return encode_tree(tree),
        Packet::Message(message) => return encode_message(message),
    }
    writer.0
}

/// Encodes a packet of policy `tree`; see [`encode_packet`].
#[must_use]
pub fn encode_tree(tree: &Tree) -> Vec<u8> {
    let mut writer = Writer(Vec::with_capacity(64));
    writer.u8(TREE);
    tree::write(tree, &mut writer);
    writer.0
}

/// Encodes a packet of the messages; see [`encode_packet`].
#[must_use]
pub fn encode_message(message: &Message) -> Vec<u8> {
    let mut writer = Writer(Vec::with_capacity(96));
    writer.u8(MESSAGE);
    message::write(message, &mut writer);
    writer.0
}

/// Whether a payload is a packet of the messages, by its kind; the rest is not checked.
#[inline]
#[must_use]
pub const fn is_message(payload: &[u8]) -> bool {
    matches!(payload, [MESSAGE, ..])
}

/// Decodes a packet of the messages.
///
/// # Errors
/// The bytes are no such packet, exceed a limit, or bytes follow it.
pub fn decode_message(payload: &[u8]) -> Result<Message, PayloadError> {
    let packet = payload.strip_prefix(&[MESSAGE]).ok_or(PayloadError)?;
    message::read(packet).ok_or(PayloadError)
}

/// Decodes a packet between routings. An order of policy `flood` shares the memory of the payload.
///
/// # Errors
/// The bytes are no such packet, or bytes follow it.
pub fn decode_packet(payload: &Bytes) -> Result<Packet, PayloadError> {
    decode_packet_reusing(payload, Vec::new())
}

/// As [`decode_packet`]. The members of policy `flood` replace those in `members`, and take their memory.
///
/// # Errors
/// See [`decode_packet`].
pub fn decode_packet_reusing(
    payload: &Bytes,
    members: Vec<Member>,
) -> Result<Packet, PayloadError> {
    match &**payload {
        [HELLO, hello @ ..] => read_hello(hello),
        [HOP_UPDATE, hop_update @ ..] => read_hop_update(hop_update),
        [FLOOD, flood @ ..] => read_flood(flood, payload, members).map(Packet::Flood),
        [TREE, ..] => return decode_tree(payload).map(|tree| Packet::Tree(tree.to_tree())),
        [MESSAGE, ..] => return decode_message(payload).map(Packet::Message),
        _ => None,
    }
    .ok_or(PayloadError)
}

fn read_hello(bytes: &[u8]) -> Option<Packet> {
    let mut reader = Reader(bytes);
    let remaining = Duration::from_millis(reader.u32()?.into());
    reader.0.is_empty().then_some(Packet::Hello { remaining })
}

fn read_hop_update(bytes: &[u8]) -> Option<Packet> {
    let mut reader = Reader(bytes);
    let hops = u16::try_from(reader.u32()?).ok()?;
    let count = reader.u32()? as usize;
    // An id takes at least one byte, whatever count is claimed.
    let mut routing_list = Vec::with_capacity(count.min(bytes.len()));
    for _ in 0..count {
        routing_list.push(NodeId(reader.u32()?));
    }
    let packet = Packet::HopUpdate { hops, routing_list };
    reader.0.is_empty().then_some(packet)
}

/// Decodes a packet of policy `tree` without copying its sets.
///
/// # Errors
/// The bytes are no such packet, or bytes follow it.
pub fn decode_tree(payload: &[u8]) -> Result<TreeFrame<'_>, PayloadError> {
    let (header, body) = split_tree(payload)?;
    TreeFrame::read(header, body).ok_or(PayloadError)
}

/// Decodes the header of a packet of policy `tree`, which changes with each packet, and returns the body, which seldom
/// does.
///
/// # Errors
/// The bytes do not start with such a header.
#[inline]
pub fn split_tree(payload: &[u8]) -> Result<(TreeHeader, &[u8]), PayloadError> {
    let packet = payload.strip_prefix(&[TREE]).ok_or(PayloadError)?;
    let mut reader = Reader(packet);
    let header = TreeHeader::read(&mut reader).ok_or(PayloadError)?;
    Ok((header, reader.0))
}

/// Writes a packet of policy `flood` behind its kind.
fn write_flood(flood: &Flood, writer: &mut Writer) {
    writer.hops(flood.hops);
    writer.id(flood.parent);
    writer.u32(flood.heartbeat);
    writer.u32(flood.sequence);
    writer.set(&flood.hears);
    writer.count(flood.members.len());
    for member in &flood.members {
        writer.u32(member.id.0);
        writer.u32(member.number);
        writer.u32(member.acknowledged);
        let out_of_range = if member.out_of_range { OUT_OF_RANGE } else { 0 };
        let landing = if member.landing { LANDING } else { 0 };
        writer.u8(out_of_range | landing);
    }
    writer.option(flood.order.as_deref(), Writer::bytes);
}

/// Reads a packet as [`write_flood`] writes it, from a part of `payload`. Its members replace those in `members`.
fn read_flood(bytes: &[u8], payload: &Bytes, mut members: Vec<Member>) -> Option<Flood> {
    let mut reader = Reader(bytes);
    members.clear();
    let mut flood = Flood {
        hops: reader.hops()?,
        parent: reader.id()?,
        heartbeat: reader.u32()?,
        sequence: reader.u32()?,
        hears: reader.set()?,
        members,
        order: None,
    };
    let count = reader.u32()? as usize;
    // A member takes at least four bytes, whatever count is claimed.
    flood.members.reserve_exact(count.min(bytes.len() / 4));
    for _ in 0..count {
        let (id, number, acknowledged) = (reader.u32()?, reader.u32()?, reader.u32()?);
        let flags = reader.u8()?;
        flood.members.push(Member {
            id: NodeId(id),
            number,
            acknowledged,
            out_of_range: flags & OUT_OF_RANGE != 0,
            landing: flags & LANDING != 0,
        });
    }
    if reader.option_tag()? {
        flood.order = Some(payload.slice_ref(reader.bytes()?));
    }
    reader.0.is_empty().then_some(flood)
}
