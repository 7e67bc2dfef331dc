//! The bytes on the air: the frame, and what it carries. Everything from outside is checked once, here.
//!
//! A frame is
//!
//! | part | bytes |
//! | --- | --- |
//! | version | 1 |
//! | header: swarm, sender, life, counter, ballot (term, rank, master) | 7 postcard varints |
//! | of version 2, where the sender is and goes: two places, north, east and down | 6 postcard varints |
//! | payload | what the two fixed ends leave |
//! | authenticator | 64, over all that stands before it |
//!
//! postcard numbers the variants of an enum by position, so enums on the wire grow at the end only; golden bytes
//! in the tests hold them to it.

mod kind;
mod radio;
mod reader;
mod tree;
mod writer;

use std::time::Duration;

use serde::{Deserialize, Serialize};
use thiserror::Error;

pub use self::kind::PacketKind;
pub use self::radio::{decode_radio_packet, encode_radio_packet};
use self::reader::Reader;
pub use self::tree::{Runs, TreeFrame, TreeFront};
use self::writer::Writer;
use crate::geometry::{Ned, Velocity};
use crate::identity::{Ballot, NodeId, SwarmId};
use crate::mission::{Holds, Order, Step};
use crate::routing::{Flood, Member, Packet, Tree};
use crate::traffic::Intent;

/// The version of a frame that says nothing of where its sender is.
pub const VERSION: u8 = 1;
/// The version of one that says where its sender is and goes.
pub const VERSION_WITH_INTENT: u8 = 2;
/// The largest datagram, in bytes: what an Ethernet frame of 1,500 leaves beside the headers of IPv4 and UDP (the
/// ancestor's limit too).
pub const DATAGRAM_MAX: usize = 1_472;
/// The size of an authenticator, in bytes: that of an Ed25519 signature.
pub const AUTHENTICATOR_LEN: usize = 64;
/// The largest header with its version, in bytes: five varints of 32 bits, one of 64 and one of 32. Where a sender is and
/// goes is left out of a frame that has no room for it.
pub const HEADER_MAX: usize = 1 + 6 * 5 + 10;
/// The largest payload that fits any header, in bytes.
pub const PAYLOAD_MAX: usize = DATAGRAM_MAX - HEADER_MAX - AUTHENTICATOR_LEN;
/// The most waypoints that one [`Order::Plan`] carries, so that it fits a payload beside the lists of members.
pub const PLAN_PART_MAX: usize = 24;

/// What stands before a frame's payload.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Header {
    /// The swarm that the frame is for.
    pub swarm: SwarmId,
    /// Who sent it.
    pub sender: NodeId,
    /// Which life of the sender's process this is, as [`Incarnations`](crate::radio::Incarnations) numbers them.
    pub incarnation: u32,
    /// Rises with each frame of a life.
    pub counter: u64,
    /// Whom the sender obeys; of what its radio says by itself, nobody.
    pub ballot: Ballot,
    /// Where the sender is and goes, if it says so.
    pub intent: Option<Intent>,
}

/// A frame whose form is right; whether its sender is who it says is the authenticator's to tell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Frame<'a> {
    /// Who says it, as whom, and when in its life.
    pub header: Header,
    /// What it says.
    pub payload: &'a [u8],
    /// What the authenticator covers: all of the frame before it.
    pub covered: &'a [u8],
    /// The sender's word for all of that.
    pub authenticator: &'a [u8; AUTHENTICATOR_LEN],
}

/// Why bytes are not a frame. A peer's fault each: counted, never obeyed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Error)]
pub enum FrameError {
    /// Longer than any frame.
    #[error("longer than {DATAGRAM_MAX} bytes")]
    TooLong,
    /// Too short for a header and an authenticator, or ended within one.
    #[error("ends before its authenticator")]
    TooShort,
    /// Another version.
    #[error("of another version")]
    Version,
}

/// Writes version, header and payload to the end of `out`: what the authenticator is to cover.
pub fn encode_covered(header: &Header, payload: &[u8], out: Vec<u8>) -> Vec<u8> {
    let mut to = Writer(out);
    to.byte(match header.intent {
        None => VERSION,
        Some(_) => VERSION_WITH_INTENT,
    });
    to.number(header.swarm.0);
    to.number(header.sender.0);
    to.number(header.incarnation);
    to.long_number(header.counter);
    to.number(header.ballot.term);
    to.number(header.ballot.rank);
    to.number(header.ballot.master.0);
    if let Some(intent) = header.intent {
        intent.from_dm.into_iter().for_each(|it| to.signed(it));
        intent.to_dm.into_iter().for_each(|it| to.signed(it));
        to.byte((intent.flown << 1) | u8::from(intent.is_heedless));
    }
    to.0.extend_from_slice(payload);
    to.0
}

/// Reads a frame's form; nothing is copied.
///
/// # Errors
/// When the bytes are not a frame of this version.
#[inline]
pub fn decode_frame(datagram: &[u8]) -> Result<Frame<'_>, FrameError> {
    if datagram.len() > DATAGRAM_MAX {
        return Err(FrameError::TooLong);
    }
    let (covered, authenticator) = datagram
        .split_last_chunk::<AUTHENTICATOR_LEN>()
        .ok_or(FrameError::TooShort)?;
    let (version, rest) = covered.split_first().ok_or(FrameError::TooShort)?;
    let says_intent = match *version {
        VERSION => false,
        VERSION_WITH_INTENT => true,
        _ => return Err(FrameError::Version),
    };
    let mut from = Reader(rest);
    let mut header = read_header(&mut from).ok_or(FrameError::TooShort)?;
    if says_intent {
        header.intent = Some(read_intent(&mut from).ok_or(FrameError::TooShort)?);
    }
    Ok(Frame {
        header,
        payload: from.0,
        covered,
        authenticator,
    })
}

/// Who sent a frame, by its own word; nothing for bytes that can't be a frame.
#[must_use]
pub fn sender(datagram: &[u8]) -> Option<NodeId> {
    let [VERSION | VERSION_WITH_INTENT, rest @ ..] = datagram else {
        return None;
    };
    let mut from = Reader(rest);
    from.number()?;
    from.number().map(NodeId)
}

/// What [`encode_covered`] has written behind the version.
#[inline]
fn read_header(from: &mut Reader<'_>) -> Option<Header> {
    Some(Header {
        swarm: SwarmId(from.number()?),
        sender: NodeId(from.number()?),
        incarnation: from.number()?,
        counter: from.long_number()?,
        ballot: Ballot {
            term: from.number()?,
            rank: from.number()?,
            master: NodeId(from.number()?),
        },
        intent: None,
    })
}

fn read_intent(from: &mut Reader<'_>) -> Option<Intent> {
    let mut place = || Some([from.signed()?, from.signed()?, from.signed()?]);
    let (from_dm, to_dm) = (place()?, place()?);
    let last = from.byte()?;
    Some(Intent {
        from_dm,
        to_dm,
        flown: last >> 1,
        is_heedless: last & 1 == 1,
    })
}

/// A payload or an order that is not one: a peer's fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Error)]
#[error("not a payload of this version")]
pub struct PayloadError;

/// What packets of the routing begin with, by their kind; as postcard numbers the variants of an enum. The numbers from 4 on
/// are the radio's.
const HELLO: u8 = 0;
const HOP_UPDATE: u8 = 1;
const FLOOD: u8 = 2;
const TREE: u8 = 3;

const OUT_OF_RANGE: u8 = 1;
const LANDING: u8 = 2;

/// Writes a packet of the routing.
#[must_use]
pub fn encode_packet(packet: &Packet) -> Vec<u8> {
    let members = match packet {
        Packet::Flood(flood) => flood.members.len(),
        _ => 0,
    };
    let mut to = Writer(Vec::with_capacity(64 + 8 * members));
    match packet {
        Packet::Hello { remaining } => {
            to.byte(HELLO);
            to.number(u32::try_from(remaining.as_millis()).unwrap_or(u32::MAX));
        }
        Packet::HopUpdate { hops, routing_list } => {
            to.byte(HOP_UPDATE);
            to.number((*hops).into());
            to.count(routing_list.len());
            routing_list.iter().for_each(|id| to.number(id.0));
        }
        Packet::Flood(flood) => {
            to.byte(FLOOD);
            write_flood(flood, &mut to);
        }
        Packet::Tree(tree) => return encode_tree(tree),
    }
    to.0
}

/// As [`encode_packet`], of policy `tree`.
#[must_use]
pub fn encode_tree(tree: &Tree) -> Vec<u8> {
    let mut to = Writer(Vec::with_capacity(64));
    to.byte(TREE);
    tree::write(tree, &mut to);
    to.0
}

/// Reads a packet of the routing.
///
/// # Errors
/// When it is not one, or holds more than a packet.
pub fn decode_packet(payload: &[u8]) -> Result<Packet, PayloadError> {
    match payload {
        [HELLO, hello @ ..] => read_hello(hello),
        [HOP_UPDATE, hop_update @ ..] => read_hop_update(hop_update),
        [FLOOD, flood @ ..] => read_flood(flood).map(Packet::Flood),
        [TREE, ..] => return decode_tree(payload).map(|tree| Packet::Tree(tree.to_tree())),
        _ => None,
    }
    .ok_or(PayloadError)
}

fn read_hello(bytes: &[u8]) -> Option<Packet> {
    let mut from = Reader(bytes);
    let remaining = Duration::from_millis(from.number()?.into());
    from.0.is_empty().then_some(Packet::Hello { remaining })
}

fn read_hop_update(bytes: &[u8]) -> Option<Packet> {
    let mut from = Reader(bytes);
    let hops = u16::try_from(from.number()?).ok()?;
    let count = from.number()? as usize;
    // Each takes a byte at least, whatever is claimed.
    let mut routing_list = Vec::with_capacity(count.min(bytes.len()));
    for _ in 0..count {
        routing_list.push(NodeId(from.number()?));
    }
    let packet = Packet::HopUpdate { hops, routing_list };
    from.0.is_empty().then_some(packet)
}

/// Reads a packet of policy `tree`, where it lies.
///
/// # Errors
/// When it is not one, or holds more than a packet.
pub fn decode_tree(payload: &[u8]) -> Result<TreeFrame<'_>, PayloadError> {
    let (front, words) = split_tree(payload)?;
    TreeFrame::read(front, words).ok_or(PayloadError)
}

/// Reads the front of a packet of policy `tree`, which changes from one to the next; what stands behind it, which seldom
/// does, is left as it is written.
///
/// # Errors
/// When it does not begin as such a packet does.
#[inline]
pub fn split_tree(payload: &[u8]) -> Result<(TreeFront, &[u8]), PayloadError> {
    let packet = payload.strip_prefix(&[TREE]).ok_or(PayloadError)?;
    let mut from = Reader(packet);
    let front = TreeFront::read(&mut from).ok_or(PayloadError)?;
    Ok((front, from.0))
}

/// Writes a packet of policy `flood`, behind its number.
fn write_flood(flood: &Flood, to: &mut Writer) {
    to.hops(flood.hops);
    to.id(flood.parent);
    to.number(flood.heartbeat);
    to.number(flood.sequence);
    to.set(&flood.hears);
    to.count(flood.members.len());
    for member in &flood.members {
        to.number(member.id.0);
        to.number(member.number);
        to.number(member.acknowledged);
        let out_of_range = if member.out_of_range { OUT_OF_RANGE } else { 0 };
        let landing = if member.landing { LANDING } else { 0 };
        to.byte(out_of_range | landing);
    }
    to.or_nothing(flood.order.as_deref(), Writer::bytes);
}

/// Reads what [`write_flood`] has written.
fn read_flood(bytes: &[u8]) -> Option<Flood> {
    let mut from = Reader(bytes);
    let mut flood = Flood {
        hops: from.hops()?,
        parent: from.id()?,
        heartbeat: from.number()?,
        sequence: from.number()?,
        hears: from.set()?,
        members: Vec::new(),
        order: None,
    };
    let members = from.number()? as usize;
    // Each takes four bytes at least, whatever is claimed.
    flood.members.reserve_exact(members.min(bytes.len() / 4));
    for _ in 0..members {
        let (id, number, acknowledged) = (from.number()?, from.number()?, from.number()?);
        let flags = from.byte()?;
        flood.members.push(Member {
            id: NodeId(id),
            number,
            acknowledged,
            out_of_range: flags & OUT_OF_RANGE != 0,
            landing: flags & LANDING != 0,
        });
    }
    if from.is_there()? {
        flood.order = Some(bytes::Bytes::copy_from_slice(from.bytes()?));
    }
    from.0.is_empty().then_some(flood)
}

#[derive(Serialize, Deserialize)]
enum WireOrder {
    Plan {
        index: u16,
        count: u16,
        waypoints: Vec<[i32; 3]>,
    },
    TakeOff,
    Move {
        waypoint: u16,
        apart: bool,
    },
    Land {
        at: [i32; 3],
        changes: u16,
        apart: bool,
    },
    Reform {
        change: u16,
        step: WireStep,
        apart: bool,
    },
    Follow {
        at: [i32; 3],
        velocity: [i32; 3],
    },
    Assemble {
        at: [i32; 3],
    },
    TakeOffInWave {
        wave: u16,
    },
    LandInWave {
        at: [i32; 3],
        changes: u16,
        apart: bool,
        wave: u16,
    },
    CrossInWave {
        change: u16,
        apart: bool,
        wave: u16,
    },
    /// A part of a plan in which the swarm waits at some waypoints: each with the milliseconds.
    PlanWithHolds {
        index: u16,
        count: u16,
        waypoints: Vec<([i32; 3], u32)>,
    },
}

#[derive(Serialize, Deserialize)]
enum WireStep {
    Climb,
    Cross,
    Descend,
}

/// Writes an order of the mission; places are rounded to millimetres, velocities to millimetres a second.
#[must_use]
pub fn encode_order(order: &Order) -> Vec<u8> {
    let wire = match order {
        Order::Plan {
            index,
            count,
            waypoints,
            holds,
        } => {
            let (index, count) = (*index, *count);
            let places = waypoints.iter().copied().map(to_millimetres);
            if holds.is_empty() {
                WireOrder::Plan {
                    index,
                    count,
                    waypoints: places.collect(),
                }
            } else {
                WireOrder::PlanWithHolds {
                    index,
                    count,
                    waypoints: places.zip(holds.iter().map(to_milliseconds)).collect(),
                }
            }
        }
        Order::TakeOff { wave: 0 } => WireOrder::TakeOff,
        Order::TakeOff { wave } => WireOrder::TakeOffInWave { wave: *wave },
        Order::Move { waypoint, apart } => WireOrder::Move {
            waypoint: *waypoint,
            apart: *apart,
        },
        Order::Land {
            at,
            changes,
            wave: 0,
            apart,
        } => WireOrder::Land {
            at: to_millimetres(*at),
            changes: *changes,
            apart: *apart,
        },
        Order::Land {
            at,
            changes,
            wave,
            apart,
        } => WireOrder::LandInWave {
            at: to_millimetres(*at),
            changes: *changes,
            apart: *apart,
            wave: *wave,
        },
        Order::Reform {
            change,
            step: Step::Cross,
            wave: wave @ 1..,
            apart,
        } => WireOrder::CrossInWave {
            change: *change,
            apart: *apart,
            wave: *wave,
        },
        Order::Reform {
            change,
            step,
            wave: _,
            apart,
        } => WireOrder::Reform {
            apart: *apart,
            change: *change,
            step: match step {
                Step::Climb => WireStep::Climb,
                Step::Cross => WireStep::Cross,
                Step::Descend => WireStep::Descend,
            },
        },
        Order::Follow { at, velocity } => WireOrder::Follow {
            at: to_millimetres(*at),
            velocity: to_millimetres(Ned(velocity.0)),
        },
        Order::Assemble { at } => WireOrder::Assemble {
            at: to_millimetres(*at),
        },
    };
    write(&wire, Vec::with_capacity(32))
}

/// Reads an order of the mission.
///
/// # Errors
/// When it is not one, or holds more than an order.
pub fn decode_order(bytes: &[u8]) -> Result<Order, PayloadError> {
    Ok(match read(bytes)? {
        WireOrder::Plan {
            index,
            count,
            waypoints,
        } => Order::Plan {
            index,
            count,
            waypoints: waypoints.into_iter().map(from_millimetres).collect(),
            holds: Vec::new(),
        },
        WireOrder::TakeOff => Order::TakeOff { wave: 0 },
        WireOrder::TakeOffInWave { wave } => Order::TakeOff { wave },
        WireOrder::Move { waypoint, apart } => Order::Move { waypoint, apart },
        WireOrder::Land { at, changes, apart } => Order::Land {
            at: from_millimetres(at),
            changes,
            wave: 0,
            apart,
        },
        WireOrder::LandInWave {
            at,
            changes,
            apart,
            wave,
        } => Order::Land {
            at: from_millimetres(at),
            changes,
            wave,
            apart,
        },
        WireOrder::CrossInWave {
            change,
            apart,
            wave,
        } => Order::Reform {
            change,
            step: Step::Cross,
            wave,
            apart,
        },
        WireOrder::Reform {
            change,
            step,
            apart,
        } => Order::Reform {
            apart,
            change,
            step: match step {
                WireStep::Climb => Step::Climb,
                WireStep::Cross => Step::Cross,
                WireStep::Descend => Step::Descend,
            },
            wave: 0,
        },
        WireOrder::Follow { at, velocity } => Order::Follow {
            at: from_millimetres(at),
            velocity: Velocity(from_millimetres(velocity).0),
        },
        WireOrder::Assemble { at } => Order::Assemble {
            at: from_millimetres(at),
        },
        WireOrder::PlanWithHolds {
            index,
            count,
            waypoints,
        } => {
            let (places, holds): (Vec<_>, Vec<_>) = waypoints.into_iter().unzip();
            Order::Plan {
                index,
                count,
                waypoints: places.into_iter().map(from_millimetres).collect(),
                holds: from_milliseconds(&holds)?,
            }
        }
    })
}

fn to_milliseconds(hold: &Duration) -> u32 {
    u32::try_from(hold.as_millis()).unwrap_or(u32::MAX)
}

/// How long a swarm waits at waypoints, if that is no longer than it may.
fn from_milliseconds(holds: &[u32]) -> Result<Vec<Duration>, PayloadError> {
    let holds = holds
        .iter()
        .map(|hold| Duration::from_millis((*hold).into()));
    let holds = holds.map(|hold| (hold <= Holds::MAX).then_some(hold).ok_or(PayloadError));
    holds.collect()
}

fn write<T: Serialize>(value: &T, out: Vec<u8>) -> Vec<u8> {
    postcard::to_extend(value, out)
        .expect("these types always serialise, and a vector takes any length")
}

fn read<'a, T: Deserialize<'a>>(bytes: &'a [u8]) -> Result<T, PayloadError> {
    match postcard::take_from_bytes(bytes) {
        Ok((value, [])) => Ok(value),
        _ => Err(PayloadError),
    }
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "saturates 2,147 km from home, beyond any mission that loads"
)]
fn to_millimetres(place: Ned) -> [i32; 3] {
    [place.0.x, place.0.y, place.0.z].map(|metres| (metres * 1_000.0).round() as i32)
}

fn from_millimetres(millimetres: [i32; 3]) -> Ned {
    let [north, east, down] = millimetres.map(|value| f64::from(value) / 1_000.0);
    Ned::new(north, east, down)
}

#[cfg(test)]
mod tests;
