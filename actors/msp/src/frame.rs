//! Frames and their encoder, the only source of bytes for a port.
//!
//! | version | layout |
//! | --- | --- |
//! | v1 | `$M`, direction, size u8, command u8, payload, XOR from size on |
//! | v1 jumbo | size 255, command u8, size u16, payload, XOR from the first size on |
//! | v2 | `$X`, direction, flag u8, command u16, size u16, payload, CRC-8/DVB-S2 from flag on |
//! | v2 over v1 | a v1 frame of command 255; its payload is a v2 frame from flag on |
//!
//! Source: Betaflight, `src/main/msp/msp_serial.c`.

use crc::{CRC_8_DVB_S2, Crc};

use crate::field::Payload;
use crate::message::{Encode, Message};

/// The longest payload that is read or written, in bytes. Betaflight's longest reply without flash data is 512 bytes
/// (`MSP_PORT_OUTBUF_SIZE_MIN`).
pub const PAYLOAD_MAX: usize = 1024;
/// The longest payload that is sent to a controller, in bytes. Betaflight's buffer has 192 (`MSP_PORT_INBUF_SIZE`), which v2
/// over v1 fills with 6 more; a longer v2 frame is written beyond it.
pub const REQUEST_MAX: usize = 186;
/// The longest frame: v2 over a v1 jumbo.
pub const FRAME_MAX: usize = PAYLOAD_MAX + 14;

/// The v1 command that says: a v2 frame is inside.
pub(crate) const V2_INSIDE: u8 = 255;
/// The v1 size that says: a u16 size follows.
pub(crate) const JUMBO: u8 = 255;

pub(crate) const CRC8: Crc<u8> = Crc::<u8>::new(&CRC_8_DVB_S2);

/// Who a frame is from, and whether it refuses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// `<`: to the controller.
    Request,
    /// `>`: from the controller.
    Reply,
    /// `!`: the controller doesn't know the command, or refuses it.
    Error,
}

impl Direction {
    pub(crate) fn byte(self) -> u8 {
        match self {
            Self::Request => b'<',
            Self::Reply => b'>',
            Self::Error => b'!',
        }
    }

    pub(crate) fn from_byte(byte: u8) -> Option<Self> {
        match byte {
            b'<' => Some(Self::Request),
            b'>' => Some(Self::Reply),
            b'!' => Some(Self::Error),
            _ => None,
        }
    }
}

/// How a frame is laid out. A controller answers in the version of the request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Version {
    /// Commands below 255. Payloads of 255 bytes and more make it a jumbo frame; Betaflight writes those but doesn't read
    /// them.
    V1,
    /// All commands.
    V2,
    /// All commands, through what knows v1 only.
    V2OverV1,
}

/// A frame whose checksums are right.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Frame<'a> {
    /// Layout.
    pub version: Version,
    /// From whom.
    pub direction: Direction,
    /// The message's number.
    pub command: u16,
    /// v2's flag; bit 0 asks the controller for no reply. 0 in v1.
    pub flag: u8,
    /// The message's body.
    pub payload: &'a [u8],
}

/// A frame that can't be written. Nothing was.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum EncodeError {
    /// Ours: no message is that long.
    #[error("payload of {found} bytes, at most {most} are allowed")]
    TooLong {
        /// Bytes given.
        found: usize,
        /// Bytes allowed in this direction.
        most: usize,
    },
    /// Ours: such a command needs v2.
    #[error("command {command} in an MSP v1 frame, 0 to 254 are allowed")]
    NeedsV2 {
        /// The message's number.
        command: u16,
    },
    /// Ours: a flag needs v2.
    #[error("flag {flag} in an MSP v1 frame, only v2 has flags")]
    FlagNeedsV2 {
        /// The flag of the frame.
        flag: u8,
    },
}

/// Appends a frame to `out`.
///
/// # Errors
/// If the payload is longer than [`PAYLOAD_MAX`], or [`REQUEST_MAX`] to a controller, or v1 can't carry the command or the
/// flag. `out` is unchanged.
pub fn encode(frame: &Frame<'_>, out: &mut Vec<u8>) -> Result<(), EncodeError> {
    let found = frame.payload.len();
    let most = match frame.direction {
        Direction::Request => REQUEST_MAX,
        Direction::Reply | Direction::Error => PAYLOAD_MAX,
    };
    if found > most {
        return Err(EncodeError::TooLong { found, most });
    }
    match frame.version {
        Version::V1 => {
            let command = v1_command(frame.command)?;
            if frame.flag != 0 {
                return Err(EncodeError::FlagNeedsV2 { flag: frame.flag });
            }
            write_v1(frame.direction, command, frame.payload, out);
        }
        Version::V2 => {
            out.extend([b'$', b'X', frame.direction.byte()]);
            write_v2_body(frame, out);
        }
        Version::V2OverV1 => {
            let mut inside = Vec::with_capacity(found + 6);
            write_v2_body(frame, &mut inside);
            write_v1(frame.direction, V2_INSIDE, &inside, out);
        }
    }
    Ok(())
}

fn v1_command(command: u16) -> Result<u8, EncodeError> {
    u8::try_from(command)
        .ok()
        .filter(|it| *it != V2_INSIDE)
        .ok_or(EncodeError::NeedsV2 { command })
}

fn write_v1(direction: Direction, command: u8, payload: &[u8], out: &mut Vec<u8>) {
    out.extend([b'$', b'M', direction.byte()]);
    let checked = out.len();
    match u8::try_from(payload.len()) {
        Ok(size) if size != JUMBO => out.extend([size, command]),
        _ => {
            out.extend([JUMBO, command]);
            out.extend(length_u16(payload).to_le_bytes());
        }
    }
    out.extend(payload);
    out.push(xor(&out[checked..]));
}

fn write_v2_body(frame: &Frame<'_>, out: &mut Vec<u8>) {
    let checked = out.len();
    out.push(frame.flag);
    out.extend(frame.command.to_le_bytes());
    out.extend(length_u16(frame.payload).to_le_bytes());
    out.extend(frame.payload);
    out.push(CRC8.checksum(&out[checked..]));
}

fn length_u16(payload: &[u8]) -> u16 {
    u16::try_from(payload.len()).expect("no payload is longer than PAYLOAD_MAX and a v2 header")
}

pub(crate) fn xor(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0, |sum, byte| sum ^ byte)
}

/// Appends a request for a message: a frame without payload.
///
/// # Errors
/// [`EncodeError::NeedsV2`] if v1 can't carry the command.
pub fn request<M: Message>(version: Version, out: &mut Vec<u8>) -> Result<(), EncodeError> {
    send(version, Direction::Request, M::COMMAND, &[], out)
}

/// Appends a message to the controller.
///
/// # Errors
/// [`EncodeError::NeedsV2`] if v1 can't carry the command, [`EncodeError::TooLong`] if the message is too long.
pub fn order<M: Encode>(
    version: Version,
    message: &M,
    out: &mut Vec<u8>,
) -> Result<(), EncodeError> {
    let payload = Payload::of(message);
    send(
        version,
        Direction::Request,
        M::COMMAND,
        payload.bytes(),
        out,
    )
}

/// Appends a controller's message.
///
/// # Errors
/// Those of [`order`].
pub fn reply<M: Encode>(
    version: Version,
    message: &M,
    out: &mut Vec<u8>,
) -> Result<(), EncodeError> {
    let payload = Payload::of(message);
    send(version, Direction::Reply, M::COMMAND, payload.bytes(), out)
}

/// Appends a controller's answer to an order that it carried out: a reply without payload.
///
/// # Errors
/// [`EncodeError::NeedsV2`] if v1 can't carry the command.
pub fn acknowledge(version: Version, command: u16, out: &mut Vec<u8>) -> Result<(), EncodeError> {
    send(version, Direction::Reply, command, &[], out)
}

/// Appends a controller's answer to what it doesn't know or refuses.
///
/// # Errors
/// [`EncodeError::NeedsV2`] if v1 can't carry the command.
pub fn refuse(version: Version, command: u16, out: &mut Vec<u8>) -> Result<(), EncodeError> {
    send(version, Direction::Error, command, &[], out)
}

fn send(
    version: Version,
    direction: Direction,
    command: u16,
    payload: &[u8],
    out: &mut Vec<u8>,
) -> Result<(), EncodeError> {
    let frame = Frame {
        version,
        direction,
        command,
        flag: 0,
        payload,
    };
    encode(&frame, out)
}
