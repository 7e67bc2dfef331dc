//! Packets that carry messages between drones, and their bytes.

use bytes::Bytes;

use super::reader::Reader;
use super::writer::Writer;
use crate::identity::{NodeId, NodeSet};

/// Kind of a message packet, in the first byte. Numbers 4 to 8 are the radio's.
pub(super) const MESSAGE: u8 = 9;

/// Most bytes of a message in one frame. The rest of a datagram is for the headers, and for the acknowledgements that
/// ride along.
pub const MESSAGE_FRAME_MAX: usize = 1_200;
/// Largest message, in bytes.
pub const MESSAGE_MAX: usize = 1 << 20;
/// Most hops of a message.
pub const MESSAGE_HOPS_MAX: u8 = 64;

/// A packet of the messages: acknowledgements of this hop, and at most one frame of a message.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Message {
    /// The sender's session, drawn at random when its routing starts. Numbers are unique in a session.
    pub session: u32,
    /// Frames that the sender has accepted.
    pub accepted: Vec<Accepted>,
    /// A frame of a message.
    pub frame: Option<MessageFrame>,
}

/// Numbers of frames of one drone that a neighbour has accepted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Accepted {
    /// The drone that numbered the frames.
    pub by: NodeId,
    /// Its session.
    pub session: u32,
    /// The highest of the numbers.
    pub number: u32,
    /// Bit i stands for `number` − 1 − i.
    pub before: u32,
}

/// A part of a message, or a whole one, on its way.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MessageFrame {
    /// Number of the frame, unique in the session of the drone that numbered it.
    pub number: u32,
    /// The drone that numbered the frame and its session, if all drones pass it on. `None` if only the next hop
    /// does; the frame's sender has numbered it then.
    pub flood: Option<(NodeId, u32)>,
    /// Number of hops so far.
    pub hops: u8,
    /// Remaining lifetime in milliseconds.
    pub left_ms: u32,
    /// The neighbours that must accept it. If `flood` is `None` and the destination is not [`Destination::Neighbours`],
    /// it is for these only.
    pub awaited: NodeSet,
    /// The drone that sent the message.
    pub origin: NodeId,
    /// Session of the origin.
    pub origin_session: u32,
    /// Number of the message, unique in the origin's session.
    pub message: u32,
    /// Where it goes.
    pub to: Destination,
    /// What it carries.
    pub body: MessageBody,
}

/// Where a message goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Destination {
    /// The current leader. Each hop sends it to the leader that it follows itself.
    Leader,
    /// All drones of the swarm.
    All,
    /// The drones that hear the origin.
    Neighbours,
    /// One drone.
    Drone(NodeId),
}

/// What a frame carries.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum MessageBody {
    /// A whole message, at most [`MESSAGE_FRAME_MAX`] bytes.
    Whole {
        /// Whether the receiver acknowledges it to the origin.
        acknowledge: bool,
        /// The message.
        payload: Bytes,
    },
    /// A piece of a larger message, [`MESSAGE_FRAME_MAX`] bytes long but for the last one.
    Piece {
        /// Index of the piece, from 0.
        index: u32,
        /// Length of the whole message in bytes, at most [`MESSAGE_MAX`].
        length: u32,
        /// The piece.
        payload: Bytes,
    },
    /// The receiver has got whole messages of a session of this frame's destination.
    Receipt {
        /// That session.
        session: u32,
        /// The highest of their numbers.
        message: u32,
        /// Bit i stands for `message` − 1 − i.
        before: u32,
    },
    /// The receiver has got pieces of a message of this frame's destination.
    Progress {
        /// Session of that destination.
        session: u32,
        /// Number of the message.
        message: u32,
        /// All pieces below this index have arrived.
        below: u32,
        /// Bit i stands for piece `below` + 1 + i.
        beyond: u64,
    },
}

/// Number of pieces of a message.
#[must_use]
pub const fn message_pieces(length: u32) -> u32 {
    length.div_ceil(MESSAGE_FRAME_MAX as u32)
}

const LEADER: u8 = 0;
const ALL: u8 = 1;
const NEIGHBOURS: u8 = 2;
const DRONE: u8 = 3;

const WHOLE: u8 = 0;
const WHOLE_TO_ACKNOWLEDGE: u8 = 1;
const PIECE: u8 = 2;
const RECEIPT: u8 = 3;
const PROGRESS: u8 = 4;

/// Writes a packet behind its kind.
pub(super) fn write(message: &Message, writer: &mut Writer) {
    writer.u32(message.session);
    writer.count(message.accepted.len());
    for accepted in &message.accepted {
        writer.u32(accepted.by.0);
        writer.u32(accepted.session);
        writer.u32(accepted.number);
        writer.u32(accepted.before);
    }
    writer.option(message.frame.as_ref(), |writer, frame| {
        write_frame(frame, writer);
    });
}

fn write_frame(frame: &MessageFrame, writer: &mut Writer) {
    writer.u32(frame.number);
    writer.option(frame.flood, |writer, (by, session)| {
        writer.u32(by.0);
        writer.u32(session);
    });
    writer.u8(frame.hops);
    writer.u32(frame.left_ms);
    writer.set(&frame.awaited);
    writer.u32(frame.origin.0);
    writer.u32(frame.origin_session);
    writer.u32(frame.message);
    match frame.to {
        Destination::Leader => writer.u8(LEADER),
        Destination::All => writer.u8(ALL),
        Destination::Neighbours => writer.u8(NEIGHBOURS),
        Destination::Drone(id) => {
            writer.u8(DRONE);
            writer.u32(id.0);
        }
    }
    write_body(&frame.body, writer);
}

fn write_body(body: &MessageBody, writer: &mut Writer) {
    match body {
        MessageBody::Whole {
            acknowledge,
            payload,
        } => {
            writer.u8(if *acknowledge {
                WHOLE_TO_ACKNOWLEDGE
            } else {
                WHOLE
            });
            writer.bytes(payload);
        }
        MessageBody::Piece {
            index,
            length,
            payload,
        } => {
            writer.u8(PIECE);
            writer.u32(*index);
            writer.u32(*length);
            writer.bytes(payload);
        }
        MessageBody::Receipt {
            session,
            message,
            before,
        } => {
            writer.u8(RECEIPT);
            writer.u32(*session);
            writer.u32(*message);
            writer.u32(*before);
        }
        MessageBody::Progress {
            session,
            message,
            below,
            beyond,
        } => {
            writer.u8(PROGRESS);
            writer.u32(*session);
            writer.u32(*message);
            writer.u32(*below);
            writer.u64(*beyond);
        }
    }
}

/// Reads a packet behind its kind; `None` if it is malformed, exceeds a limit, or bytes follow it.
pub(super) fn read(bytes: &[u8]) -> Option<Message> {
    let mut reader = Reader(bytes);
    let session = reader.u32()?;
    let count = reader.u32()? as usize;
    // An entry takes at least four bytes, whatever count is claimed.
    let mut accepted = Vec::with_capacity(count.min(bytes.len() / 4));
    for _ in 0..count {
        accepted.push(Accepted {
            by: NodeId(reader.u32()?),
            session: reader.u32()?,
            number: reader.u32()?,
            before: reader.u32()?,
        });
    }
    let frame = match reader.option_tag()? {
        true => Some(read_frame(&mut reader)?),
        false => None,
    };
    reader.0.is_empty().then_some(Message {
        session,
        accepted,
        frame,
    })
}

fn read_frame(reader: &mut Reader<'_>) -> Option<MessageFrame> {
    Some(MessageFrame {
        number: reader.u32()?,
        flood: match reader.option_tag()? {
            true => Some((NodeId(reader.u32()?), reader.u32()?)),
            false => None,
        },
        hops: reader.u8().filter(|hops| *hops <= MESSAGE_HOPS_MAX)?,
        left_ms: reader.u32()?,
        awaited: reader.set()?,
        origin: NodeId(reader.u32()?),
        origin_session: reader.u32()?,
        message: reader.u32()?,
        to: match reader.u8()? {
            LEADER => Destination::Leader,
            ALL => Destination::All,
            NEIGHBOURS => Destination::Neighbours,
            DRONE => Destination::Drone(NodeId(reader.u32()?)),
            _ => return None,
        },
        body: read_body(reader)?,
    })
}

fn read_body(reader: &mut Reader<'_>) -> Option<MessageBody> {
    let kind = reader.u8()?;
    Some(match kind {
        WHOLE | WHOLE_TO_ACKNOWLEDGE => MessageBody::Whole {
            acknowledge: kind == WHOLE_TO_ACKNOWLEDGE,
            payload: (reader.bytes())
                .filter(|payload| payload.len() <= MESSAGE_FRAME_MAX)
                .map(Bytes::copy_from_slice)?,
        },
        PIECE => {
            let (index, length) = (reader.u32()?, reader.u32()?);
            let payload = reader.bytes()?;
            let fits = length as usize <= MESSAGE_MAX
                && index < message_pieces(length)
                && payload.len() == piece_length(index, length);
            if !fits {
                return None;
            }
            MessageBody::Piece {
                index,
                length,
                payload: Bytes::copy_from_slice(payload),
            }
        }
        RECEIPT => MessageBody::Receipt {
            session: reader.u32()?,
            message: reader.u32()?,
            before: reader.u32()?,
        },
        PROGRESS => MessageBody::Progress {
            session: reader.u32()?,
            message: reader.u32()?,
            below: reader.u32()?,
            beyond: reader.u64()?,
        },
        _ => return None,
    })
}

/// Length of a piece: all are full but the last one.
fn piece_length(index: u32, length: u32) -> usize {
    let begin = index as usize * MESSAGE_FRAME_MAX;
    (length as usize - begin).min(MESSAGE_FRAME_MAX)
}
