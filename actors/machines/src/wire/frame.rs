use thiserror::Error;

use super::reader::Reader;
use super::writer::Writer;
use super::{AUTHENTICATOR_LEN, DATAGRAM_MAX, HEADER_MAX, INTENT_MAX, Intent};
use crate::identity::{Ballot, NodeId, SwarmId};

/// Version of a frame without intent.
pub const VERSION: u8 = 1;
/// Version of a frame with intent.
pub const VERSION_WITH_INTENT: u8 = 2;

/// The fields before a frame's payload.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Header {
    /// The swarm of sender and receivers.
    pub swarm: SwarmId,
    /// The sender.
    pub sender: NodeId,
    /// Incarnation of the sender's process.
    pub incarnation: u32,
    /// Rises with each frame of an incarnation.
    pub counter: u64,
    /// The sender's current leader; term 0 in frames of the radio itself.
    pub ballot: Ballot,
    /// Where the sender is and goes; `None` if it is not reported.
    pub intent: Option<Intent>,
}

/// A frame of valid form. The authenticator has yet to confirm the sender.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Frame<'a> {
    /// Sender, leader and counter.
    pub header: Header,
    /// A packet, encoded.
    pub payload: &'a [u8],
    /// The bytes that the authenticator covers: all before it.
    pub covered: &'a [u8],
    /// The sender's signature over `covered`.
    pub authenticator: &'a [u8; AUTHENTICATOR_LEN],
}

/// Why bytes are not a frame: a peer's fault, which is counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Error)]
pub enum FrameError {
    /// Longer than [`DATAGRAM_MAX`].
    #[error("longer than {DATAGRAM_MAX} bytes")]
    TooLong,
    /// Too short for a header and an authenticator.
    #[error("ends before its authenticator")]
    TooShort,
    /// Unknown version.
    #[error("unknown version")]
    Version,
}

/// Encodes version, header and payload: the bytes that the authenticator covers. Leaves room for it.
#[must_use]
pub fn encode_covered(header: &Header, payload: &[u8]) -> Vec<u8> {
    let frame_max = HEADER_MAX + INTENT_MAX + payload.len() + AUTHENTICATOR_LEN;
    let mut writer = Writer(Vec::with_capacity(frame_max));
    writer.u8(match header.intent {
        None => VERSION,
        Some(_) => VERSION_WITH_INTENT,
    });
    writer.u32(header.swarm.0);
    writer.u32(header.sender.0);
    writer.u32(header.incarnation);
    writer.u64(header.counter);
    writer.u32(header.ballot.term);
    writer.u32(header.ballot.rank);
    writer.u32(header.ballot.master.0);
    if let Some(intent) = header.intent {
        intent.from_dm.into_iter().for_each(|it| writer.i32(it));
        intent.to_dm.into_iter().for_each(|it| writer.i32(it));
        writer.u8((intent.flown << 1) | u8::from(intent.has_priority));
    }
    writer.0.extend_from_slice(payload);
    writer.0
}

/// Reads a frame without copying.
///
/// # Errors
/// The bytes are too long, too short or of another version.
#[inline]
pub fn decode_frame(datagram: &[u8]) -> Result<Frame<'_>, FrameError> {
    if datagram.len() > DATAGRAM_MAX {
        return Err(FrameError::TooLong);
    }
    let (covered, authenticator) = datagram
        .split_last_chunk::<AUTHENTICATOR_LEN>()
        .ok_or(FrameError::TooShort)?;
    let (version, rest) = covered.split_first().ok_or(FrameError::TooShort)?;
    let has_intent = match *version {
        VERSION => false,
        VERSION_WITH_INTENT => true,
        _ => return Err(FrameError::Version),
    };
    let mut reader = Reader(rest);
    let mut header = read_header(&mut reader).ok_or(FrameError::TooShort)?;
    if has_intent {
        header.intent = Some(read_intent(&mut reader).ok_or(FrameError::TooShort)?);
    }
    Ok(Frame {
        header,
        payload: reader.0,
        covered,
        authenticator,
    })
}

/// The sender that a frame claims, unchecked; `None` if the bytes are no frame.
#[must_use]
pub fn sender(datagram: &[u8]) -> Option<NodeId> {
    let [VERSION | VERSION_WITH_INTENT, rest @ ..] = datagram else {
        return None;
    };
    let mut reader = Reader(rest);
    reader.u32()?;
    reader.u32().map(NodeId)
}

/// Reads the header behind the version, as [`encode_covered`] writes it.
#[inline]
fn read_header(reader: &mut Reader<'_>) -> Option<Header> {
    Some(Header {
        swarm: SwarmId(reader.u32()?),
        sender: NodeId(reader.u32()?),
        incarnation: reader.u32()?,
        counter: reader.u64()?,
        ballot: Ballot {
            term: reader.u32()?,
            rank: reader.u32()?,
            master: NodeId(reader.u32()?),
        },
        intent: None,
    })
}

#[inline(never)]
fn read_intent(reader: &mut Reader<'_>) -> Option<Intent> {
    let mut position = || Some([reader.i32()?, reader.i32()?, reader.i32()?]);
    let (from_dm, to_dm) = (position()?, position()?);
    let last = reader.u8()?;
    Some(Intent {
        from_dm,
        to_dm,
        flown: last >> 1,
        has_priority: last & 1 == 1,
    })
}
