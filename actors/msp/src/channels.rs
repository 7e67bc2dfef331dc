//! RC channels and motor outputs. Two orders, two types: what is sent ([`SetRawRc`]) is in the receiver's order, what is
//! reported ([`Rc`]) in the controller's.

use std::ops::RangeInclusive;

use crate::field::{Field, Payload, Reader};
use crate::message::{Decode, DecodeError, Encode, Message};

/// Channels of a controller (`MAX_SUPPORTED_RC_CHANNEL_COUNT`).
pub const CHANNELS_MAX: usize = 18;
/// Channels beside the four sticks.
pub const AUX_MAX: usize = CHANNELS_MAX - 4;

/// Pulse width of a channel, in µs, 885 to 2115: what Betaflight takes for valid (`rx_min_usec`, `rx_max_usec`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Channel(u16);

/// Pulse width outside the range of RC channels or motors.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("pulse width {found_us} µs is out of range; accepted: {least_us} to {most_us} µs")]
pub struct OutOfRange {
    /// What was given, in µs.
    pub found_us: u16,
    /// The least that is allowed, in µs.
    pub least_us: u16,
    /// The most that is allowed, in µs.
    pub most_us: u16,
}

fn within(us: u16, accepted: RangeInclusive<u16>) -> Result<u16, OutOfRange> {
    if accepted.contains(&us) {
        return Ok(us);
    }
    Err(OutOfRange {
        found_us: us,
        least_us: *accepted.start(),
        most_us: *accepted.end(),
    })
}

impl Channel {
    /// 885 µs.
    pub const MIN: Self = Self(885);
    /// 1,000 µs: throttle closed, switch off.
    pub const LOW: Self = Self(1000);
    /// 1,500 µs: stick centred.
    pub const CENTRE: Self = Self(1500);
    /// 2,000 µs: throttle open, switch on.
    pub const HIGH: Self = Self(2000);
    /// 2,115 µs.
    pub const MAX: Self = Self(2115);

    /// A channel of `us` µs.
    ///
    /// # Errors
    /// If that is not within 885 to 2115 µs.
    pub fn new(us: u16) -> Result<Self, OutOfRange> {
        within(us, Self::MIN.0..=Self::MAX.0).map(Self)
    }

    /// Pulse width, in µs.
    #[must_use]
    pub fn us(self) -> u16 {
        self.0
    }
}

/// The four sticks, by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sticks {
    /// Right is higher.
    pub roll: Channel,
    /// Nose down is higher.
    pub pitch: Channel,
    /// Open is higher.
    pub throttle: Channel,
    /// Clockwise is higher.
    pub yaw: Channel,
}

impl Sticks {
    /// Level, throttle closed.
    pub const IDLE: Self = Self {
        roll: Channel::CENTRE,
        pitch: Channel::CENTRE,
        throttle: Channel::LOW,
        yaw: Channel::CENTRE,
    };
}

/// `MSP_SET_RAW_RC`: all channels that the sender means, as a receiver would report them: roll, pitch, throttle, yaw, aux.
/// That is Betaflight's order if its `map` is `AETR1234`. It takes channels that a frame lacks for 0 µs, a lost receiver.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SetRawRc {
    channels: [Channel; CHANNELS_MAX],
    count: usize,
}

/// More aux channels than a controller has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("{found} aux channels, {AUX_MAX} are allowed")]
pub struct TooManyChannels {
    /// Aux channels given.
    pub found: usize,
}

impl SetRawRc {
    /// Sticks and aux channels, AUX1 first.
    ///
    /// # Errors
    /// If there are over [`AUX_MAX`] aux channels.
    pub fn new(sticks: Sticks, aux: &[Channel]) -> Result<Self, TooManyChannels> {
        let count = 4 + aux.len();
        let mut channels = [Channel::LOW; CHANNELS_MAX];
        let places = channels.get_mut(4..count);
        let places = places.ok_or(TooManyChannels { found: aux.len() })?;
        places.copy_from_slice(aux);
        channels[..4].copy_from_slice(&[sticks.roll, sticks.pitch, sticks.throttle, sticks.yaw]);
        Ok(Self { channels, count })
    }

    /// The sticks.
    #[must_use]
    pub fn sticks(&self) -> Sticks {
        let [roll, pitch, throttle, yaw, ..] = self.channels;
        Sticks {
            roll,
            pitch,
            throttle,
            yaw,
        }
    }

    /// The aux channels, AUX1 first.
    #[must_use]
    pub fn aux(&self) -> &[Channel] {
        &self.channels[4..self.count]
    }
}

impl Message for SetRawRc {
    const COMMAND: u16 = 200;
    const NAME: &'static str = "MSP_SET_RAW_RC";
}

impl Encode for SetRawRc {
    fn encode(&self, to: &mut Payload) {
        for channel in &self.channels[..self.count] {
            channel.0.write(to);
        }
    }
}

/// `MSP_SET_RAW_RC` as a controller receives it: in the receiver's order, any value, 0 for a channel that wasn't sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ReceivedRc {
    /// Pulse widths, in µs.
    pub channels_us: [u16; CHANNELS_MAX],
}

impl Message for ReceivedRc {
    const COMMAND: u16 = SetRawRc::COMMAND;
    const NAME: &'static str = SetRawRc::NAME;
}

impl Decode for ReceivedRc {
    /// # Errors
    /// If there are over [`CHANNELS_MAX`] channels, which Betaflight refuses, too.
    fn decode(payload: &[u8]) -> Result<Self, DecodeError> {
        let sent = read_all(payload);
        let mut channels_us = [0; CHANNELS_MAX];
        let places = channels_us.get_mut(..sent.len());
        let places = places.ok_or(DecodeError::TooLong {
            message: Self::NAME,
            found: payload.len(),
            most: 2 * CHANNELS_MAX,
        })?;
        places.copy_from_slice(&sent);
        Ok(Self { channels_us })
    }
}

fn read_all(payload: &[u8]) -> Vec<u16> {
    Vec::read(&mut Reader::new(payload)).unwrap_or_default()
}

/// `MSP_RC`: what the controller takes its channels for, in its own order: roll, pitch, yaw, throttle, aux.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Rc {
    /// µs.
    pub roll_us: u16,
    /// µs.
    pub pitch_us: u16,
    /// µs.
    pub yaw_us: u16,
    /// µs.
    pub throttle_us: u16,
    /// AUX1 first, in µs.
    pub aux_us: Vec<u16>,
}

impl From<&ReceivedRc> for Rc {
    /// From the receiver's order to the controller's (`map AETR1234`).
    fn from(received: &ReceivedRc) -> Self {
        let [roll_us, pitch_us, throttle_us, yaw_us, aux @ ..] = received.channels_us;
        Self {
            roll_us,
            pitch_us,
            yaw_us,
            throttle_us,
            aux_us: aux.to_vec(),
        }
    }
}

impl Message for Rc {
    const COMMAND: u16 = 105;
    const NAME: &'static str = "MSP_RC";
}

impl Encode for Rc {
    fn encode(&self, to: &mut Payload) {
        [self.roll_us, self.pitch_us, self.yaw_us, self.throttle_us].write(to);
        self.aux_us.write(to);
    }
}

impl Decode for Rc {
    fn decode(payload: &[u8]) -> Result<Self, DecodeError> {
        match read_all(payload)[..] {
            [roll_us, pitch_us, yaw_us, throttle_us, ref aux @ ..] => Ok(Self {
                roll_us,
                pitch_us,
                yaw_us,
                throttle_us,
                aux_us: aux.to_vec(),
            }),
            _ => Err(DecodeError::TooShort {
                message: Self::NAME,
                found: payload.len(),
                needed: 8,
            }),
        }
    }
}

/// Output of a motor as MSP writes it for all motor protocols, in µs: 1,000 is stopped, 2,000 is full. For motors that turn both
/// ways 1,500 is stopped, 1,000 is full backwards.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct MotorOutput(u16);

impl MotorOutput {
    /// 1,000 µs.
    pub const STOPPED: Self = Self(1000);
    /// 1,500 µs.
    pub const CENTRE: Self = Self(1500);
    /// 2,000 µs.
    pub const FULL: Self = Self(2000);

    /// An output of `us` µs.
    ///
    /// # Errors
    /// If that is not within 1000 to 2000 µs.
    pub fn new(us: u16) -> Result<Self, OutOfRange> {
        within(us, Self::STOPPED.0..=Self::FULL.0).map(Self)
    }

    /// Pulse width, in µs.
    #[must_use]
    pub const fn us(self) -> u16 {
        self.0
    }
}

/// `MSP_SET_MOTOR`: turns motors of a disarmed controller. It never times out: who turns a motor must stop it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SetMotor {
    /// Motor 1 first; Betaflight reads as many as it has.
    pub outputs: [MotorOutput; 8],
}

impl SetMotor {
    /// All motors stopped that turn one way.
    pub const STOP: Self = Self {
        outputs: [MotorOutput::STOPPED; 8],
    };
    /// All motors stopped that turn both ways.
    pub const STOP_REVERSIBLE: Self = Self {
        outputs: [MotorOutput::CENTRE; 8],
    };
}

impl Message for SetMotor {
    const COMMAND: u16 = 214;
    const NAME: &'static str = "MSP_SET_MOTOR";
}

impl Encode for SetMotor {
    fn encode(&self, to: &mut Payload) {
        self.outputs.map(MotorOutput::us).write(to);
    }
}

/// `MSP_SET_MOTOR` as a controller receives it: any number, any value.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ReceivedMotors {
    /// Motor 1 first, in µs.
    pub outputs_us: Vec<u16>,
}

impl Message for ReceivedMotors {
    const COMMAND: u16 = SetMotor::COMMAND;
    const NAME: &'static str = SetMotor::NAME;
}

impl Decode for ReceivedMotors {
    fn decode(payload: &[u8]) -> Result<Self, DecodeError> {
        Ok(Self {
            outputs_us: read_all(payload),
        })
    }
}
