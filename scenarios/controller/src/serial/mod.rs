//! Serial port: requests as bytes in, replies as bytes out, one request at a time.

pub(crate) mod answers;

use std::collections::VecDeque;
use std::time::Duration;

use muster_msp::{Decoder, Direction, Encode, Frame, Version};

/// Longest payload of a request (`MSP_PORT_INBUF_SIZE`); longer ones are dropped without a reply.
const PAYLOAD_MAX: usize = 192;

/// Requests that wait. A UART's buffer of 256 bytes holds 42 of the shortest; further ones are dropped.
const REQUESTS_MAX: usize = 42;

/// Bytes that wait to be taken. Replies beyond are dropped: nobody reads the port.
const OUT_MAX: usize = 4_096;

/// The flag of MSP v2 that asks for no reply.
const NO_REPLY: u8 = 1;

/// What a port dropped.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Dropped {
    /// Requests with a payload over 192 bytes.
    pub too_long: u64,
    /// Requests that found the buffer full.
    pub too_many: u64,
    /// Replies that nobody took.
    pub unread: u64,
}

/// A request whose checksum is right.
#[derive(Debug, Clone)]
pub(crate) struct Request {
    version: Version,
    flag: u8,
    pub(crate) command: u16,
    pub(crate) payload: Vec<u8>,
}

#[derive(Debug, Default)]
pub(crate) struct Serial {
    decoder: Decoder,
    requests: VecDeque<Request>,
    out: Vec<u8>,
    dropped: Dropped,
}

impl Serial {
    /// Takes bytes. What holds no request, or has a wrong checksum, stays without a reply.
    pub(crate) fn receive(&mut self, now: Duration, bytes: &[u8]) {
        let (requests, dropped) = (&mut self.requests, &mut self.dropped);
        let mut take = |frame: Frame<'_>| {
            if frame.direction != Direction::Request {
                return;
            }
            if frame.payload.len() > PAYLOAD_MAX {
                dropped.too_long += 1;
            } else if requests.len() >= REQUESTS_MAX {
                dropped.too_many += 1;
            } else {
                requests.push_back(Request {
                    version: frame.version,
                    flag: frame.flag,
                    command: frame.command,
                    payload: frame.payload.to_vec(),
                });
            }
        };
        self.decoder.read(bytes, &mut take);
        self.decoder.expire(now, &mut take);
    }

    /// The next request.
    pub(crate) fn next_request(&mut self) -> Option<Request> {
        self.requests.pop_front()
    }

    /// Whether no request waits.
    pub(crate) fn is_idle(&self) -> bool {
        self.requests.is_empty()
    }

    /// Whether bytes wait to be taken.
    pub(crate) fn has_output(&self) -> bool {
        !self.out.is_empty()
    }

    /// Takes the replies.
    pub(crate) fn take(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.out)
    }

    pub(crate) fn dropped(&self) -> Dropped {
        self.dropped
    }

    fn send(&mut self, request: &Request, write: impl FnOnce(Version, &mut Vec<u8>)) {
        if request.flag & NO_REPLY != 0 {
            return;
        }
        let before = self.out.len();
        write(request.version, &mut self.out);
        if self.out.len() > OUT_MAX {
            self.out.truncate(before);
            self.dropped.unread += 1;
        }
    }

    /// Answers with a message.
    pub(crate) fn reply(&mut self, request: &Request, message: &impl Encode) {
        self.send(request, |version, out| {
            muster_msp::reply(version, message, out)
                .expect("a reply has the version of its request, and fits");
        });
    }

    /// Says that an order was carried out.
    pub(crate) fn acknowledge(&mut self, request: &Request) {
        self.send(request, |version, out| {
            muster_msp::acknowledge(version, request.command, out)
                .expect("a reply has the version of its request");
        });
    }

    /// Says that the command isn't known or its payload is bad.
    pub(crate) fn refuse(&mut self, request: &Request) {
        self.send(request, |version, out| {
            muster_msp::refuse(version, request.command, out)
                .expect("a reply has the version of its request");
        });
    }
}
