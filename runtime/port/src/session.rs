//! One question after the other.

use std::io;
use std::time::{Duration, Instant};

use muster_msp::{
    Ask, Counts, Decode, DecodeError, Decoder, Direction, Encode, EncodeError, Version, order,
};

use crate::address::Address;
use crate::wire::Wire;

/// How long a read waits.
const WAIT: Duration = Duration::from_millis(20);
/// How long an answer may take. Betaflight's median is 10 ms.
const ANSWER_MAX: Duration = Duration::from_millis(300);
/// How often a question is asked.
const TRIES: u32 = 3;

/// Why there is no answer.
#[derive(Debug, thiserror::Error)]
pub enum AskError {
    /// The controller is silent, or its answers get lost.
    #[error("no answer to {message} after {TRIES} tries")]
    Silent {
        /// The message asked for.
        message: &'static str,
    },
    /// The controller doesn't know the message.
    #[error("the controller refuses {message}")]
    Refused {
        /// The message asked for.
        message: &'static str,
    },
    /// The controller's answer isn't the message.
    #[error("the controller's answer can't be read")]
    Malformed(#[from] DecodeError),
    /// Ours: the question can't be written.
    #[error("the question can't be written")]
    Question(#[from] EncodeError),
    /// The port failed.
    #[error("the port failed")]
    Port(#[from] io::Error),
}

/// How long answers took.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Latency {
    /// Questions asked, repeated ones included.
    pub asked: u64,
    /// Questions answered.
    pub answered: u64,
    /// Sum of the answers' delays.
    pub total: Duration,
    /// Longest delay.
    pub max: Duration,
}

impl Latency {
    /// Mean delay of an answer.
    #[must_use]
    pub fn mean(&self) -> Duration {
        let answered = u32::try_from(self.answered).unwrap_or(u32::MAX);
        self.total.checked_div(answered).unwrap_or_default()
    }

    /// Share of questions without an answer, 0 to 1.
    #[must_use]
    pub fn loss(&self) -> f64 {
        let lost = self.asked.saturating_sub(self.answered);
        lost as f64 / self.asked.max(1) as f64
    }

    pub(crate) fn add(&mut self, delay: Duration) {
        self.answered += 1;
        self.total += delay;
        self.max = self.max.max(delay);
    }
}

/// An open port, to ask one thing after the other. It sends no RC.
#[derive(Debug)]
pub struct Session {
    pub(crate) wire: Wire,
    opened: Instant,
    decoder: Decoder,
    latency: Latency,
}

impl Session {
    /// Opens a port.
    ///
    /// # Errors
    /// If it can't be opened.
    pub fn open(address: &Address) -> io::Result<Self> {
        Ok(Self {
            wire: Wire::open(address, WAIT)?,
            opened: Instant::now(),
            decoder: Decoder::default(),
            latency: Latency::default(),
        })
    }

    /// How long answers took.
    #[must_use]
    pub fn latency(&self) -> Latency {
        self.latency
    }

    /// Starts to measure anew.
    pub fn reset_latency(&mut self) {
        self.latency = Latency::default();
    }

    /// What was read, frames and noise.
    #[must_use]
    pub fn counts(&self) -> Counts {
        self.decoder.counts()
    }

    /// The first answer to a command: `None` if there is none in time.
    fn wait<M: Decode>(&mut self, asked: Instant) -> Result<Option<M>, AskError> {
        let mut buffer = [0; 512];
        let mut answer = None;
        while answer.is_none() && asked.elapsed() < ANSWER_MAX {
            let length = self.wire.read(&mut buffer)?;
            let mut take = |frame: muster_msp::Frame<'_>| {
                if frame.command == M::COMMAND && answer.is_none() {
                    answer = match frame.direction {
                        Direction::Reply => Some(M::decode(frame.payload).map_err(Into::into)),
                        Direction::Error => Some(Err(AskError::Refused { message: M::NAME })),
                        Direction::Request => None,
                    };
                }
            };
            self.decoder.read(&buffer[..length], &mut take);
            self.decoder.expire(self.opened.elapsed(), &mut take);
        }
        if answer.is_some() {
            self.latency.add(asked.elapsed());
        }
        answer.transpose()
    }
}

impl Ask for Session {
    type Error = AskError;

    fn ask<Q: Encode, M: Decode>(&mut self, request: &Q) -> Result<M, AskError> {
        // Betaflight answers v1 and v2 alike; v1 is what the oldest firmware knows.
        let version = if Q::COMMAND < 255 {
            Version::V1
        } else {
            Version::V2
        };
        let mut frame = Vec::new();
        order(version, request, &mut frame)?;
        for _ in 0..TRIES {
            let asked = Instant::now();
            self.wire.write(&frame)?;
            self.latency.asked += 1;
            if let Some(answer) = self.wait(asked)? {
                return Ok(answer);
            }
        }
        Err(AskError::Silent { message: M::NAME })
    }
}
