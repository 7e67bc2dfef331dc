//! Messages as the protocol gives them, and what is to be reported to it of them.

use bytes::Bytes;
use thiserror::Error;

use super::limits::QUEUE_MAX;
#[cfg(doc)]
use crate::routing::Notice;
use crate::routing::SharedState;
use crate::wire::{Destination, MESSAGE_FRAME_MAX, MESSAGE_MAX};

/// A message that the protocol sends.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Outgoing {
    /// The protocol's number of the message, for [`Notice::Sent`].
    pub id: u32,
    /// Where it goes.
    pub to: Destination,
    /// Whether it is repeated until it is acknowledged.
    pub reliability: Reliability,
    /// The message: at most [`MESSAGE_MAX`] bytes, to neighbours or all at most [`MESSAGE_FRAME_MAX`].
    pub payload: Bytes,
}

/// Whether a message is repeated until it is acknowledged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Reliability {
    /// Each hop repeats it, the origin does not, unless it is sent in pieces. To neighbours it is sent once.
    BestEffort,
    /// The origin repeats it until the receiver has acknowledged it, or each neighbour has. Not for all drones.
    Acknowledged,
}

/// What became of a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Outcome {
    /// The receiver has acknowledged it; with [`Destination::Neighbours`] each neighbour.
    Delivered,
    /// It was not acknowledged in time, and may have arrived. A best-effort message: it did not leave this drone in
    /// time.
    Expired,
    /// This drone did not send it.
    Dropped(DropReason),
}

/// Why a message was not sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Error)]
pub enum DropReason {
    /// More messages wait than the queue holds.
    #[error("send queue full: at most {QUEUE_MAX} messages and 2 MiB")]
    QueueFull,
    /// It is too long.
    #[error(
        "longer than {MESSAGE_MAX} bytes, or to neighbours or all longer than {MESSAGE_FRAME_MAX}"
    )]
    TooLong,
    /// The receiver is no drone of the swarm.
    #[error("no drone of the swarm has the receiver's number")]
    UnknownDrone,
    /// A message to all can't be acknowledged.
    #[error("a message to all drones can't be acknowledged; accepted is best effort")]
    NotAcknowledgeable,
    /// The drone has finished, and sends nothing more.
    #[error("this drone has finished and sends nothing more")]
    Stopped,
}

impl Outgoing {
    /// Whether it is sent in pieces.
    pub(super) fn is_large(&self) -> bool {
        self.payload.len() > MESSAGE_FRAME_MAX
    }

    pub(super) fn is_acknowledged(&self) -> bool {
        self.reliability == Reliability::Acknowledged
    }

    /// Why it is not sent, by its fields; `None` if it is.
    pub(super) fn refusal(&self, shared: &SharedState) -> Option<DropReason> {
        let is_for_many = matches!(self.to, Destination::All | Destination::Neighbours);
        let length_max = if is_for_many {
            MESSAGE_FRAME_MAX
        } else {
            MESSAGE_MAX
        };
        if shared.durable.stopped {
            Some(DropReason::Stopped)
        } else if self.payload.len() > length_max {
            Some(DropReason::TooLong)
        } else if matches!(self.to, Destination::Drone(id) if id.0 >= shared.drones) {
            Some(DropReason::UnknownDrone)
        } else if self.to == Destination::All && self.reliability == Reliability::Acknowledged {
            Some(DropReason::NotAcknowledgeable)
        } else {
            None
        }
    }
}
