//! The messages.

mod battery;
mod gps;
mod identity;
mod modes;
mod motors;
mod orders;
mod rates;
mod receiver;
mod sensors;
mod serial;
mod status;

pub use battery::{Analog, BatteryConfig, BatteryLevel, BatteryState, CellLimits};
pub use gps::{CompGps, RawGps};
pub use identity::{ApiVersion, BoardInfo, FcVariant, FcVersion, Name, Uid};
pub use modes::{
    BoxIds, BoxNames, Mode, ModeLogic, ModeRange, ModeRangeExtra, ModeRanges, ModeRangesExtra,
    Modes,
};
pub use motors::{AdvancedConfig, Motor, MotorProtocol};
pub use orders::{AccCalibration, EepromWrite, Reboot, RebootMode};
pub use rates::{PidAdvanced, RatesType, RcTuning, ThrottleLimit};
pub use receiver::{
    ArmingConfig, FailsafeConfig, FailsafeProcedure, FailsafeSwitch, FeatureConfig, RxConfig,
    RxFail, RxFailConfig, RxFailMode, RxMap,
};
pub use sensors::{Altitude, Attitude, OpticalFlow, RangefinderSample, RawImu, Sonar};
pub use serial::{CfSerialConfig, SerialPort};
pub use status::{ArmingFlags, Sensors, Status, StatusEx, StatusFlags, StatusHead};

use crate::field::{Field, Payload, Reader, Short};

/// A kind of message.
pub trait Message {
    /// Its number on the wire.
    const COMMAND: u16;
    /// Its name in Betaflight's sources.
    const NAME: &'static str;
}

/// A message that can be written.
pub trait Encode: Message {
    /// Writes the body of a frame.
    fn encode(&self, to: &mut Payload);
}

/// A message that can be read.
pub trait Decode: Message + Sized {
    /// Reads the body of a frame. What newer firmware adds at the end is ignored.
    ///
    /// # Errors
    /// If the payload is too short or too long to be this message: the sender's fault.
    fn decode(payload: &[u8]) -> Result<Self, DecodeError>;
}

/// A payload that is not the message. The sender's fault; nothing changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum DecodeError {
    /// Older firmware, or not this message.
    #[error("{message} of {found} bytes, at least {needed} are needed")]
    TooShort {
        /// Name of the message.
        message: &'static str,
        /// Bytes found.
        found: usize,
        /// Bytes needed.
        needed: usize,
    },
    /// Not this message.
    #[error("{message} of {found} bytes, at most {most} are allowed")]
    TooLong {
        /// Name of the message.
        message: &'static str,
        /// Bytes found.
        found: usize,
        /// Bytes allowed.
        most: usize,
    },
}

impl<M: Message + Field> Encode for M {
    fn encode(&self, to: &mut Payload) {
        self.write(to);
    }
}

impl<M: Message + Field> Decode for M {
    fn decode(payload: &[u8]) -> Result<Self, DecodeError> {
        M::read(&mut Reader::new(payload)).map_err(|Short { needed }| DecodeError::TooShort {
            message: M::NAME,
            found: payload.len(),
            needed: needed.max(M::SHORTEST),
        })
    }
}

/// A group of fields in the order in which they are on the wire.
macro_rules! fields {
    (
        $(#[$about:meta])*
        $name:ident { $( $(#[$field_about:meta])* $field:ident: $type:ty, )* }
    ) => {
        $(#[$about])*
        #[derive(Debug, Clone, PartialEq, Eq, Default)]
        pub struct $name {
            $( $(#[$field_about])* pub $field: $type, )*
        }

        impl $crate::field::Field for $name {
            const SHORTEST: usize = 0 $( + <$type as $crate::field::Field>::SHORTEST )*;

            #[allow(unused_variables, reason = "a message may have no fields")]
            fn read(
                from: &mut $crate::field::Reader<'_>,
            ) -> Result<Self, $crate::field::Short> {
                Ok(Self { $( $field: $crate::field::Field::read(from)?, )* })
            }

            #[allow(unused_variables, reason = "a message may have no fields")]
            fn write(&self, to: &mut $crate::field::Payload) {
                $( self.$field.write(to); )*
            }
        }
    };
}

/// A message: its number, and its fields in the order in which they are on the wire.
macro_rules! message {
    (
        $(#[$about:meta])*
        $name:ident = $command:literal as $wire:literal { $($fields:tt)* }
    ) => {
        $crate::message::fields! { $(#[$about])* $name { $($fields)* } }

        impl $crate::message::Message for $name {
            const COMMAND: u16 = $command;
            const NAME: &'static str = $wire;
        }
    };
}

/// A byte that stands for one of several things; newer firmware may know more of them.
macro_rules! code {
    (
        $(#[$about:meta])*
        $name:ident { $first:ident = $first_code:literal $first_word:literal, $( $other:ident = $code:literal $word:literal, )* }
    ) => {
        $(#[$about])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
        #[allow(missing_docs, reason = "the names are Betaflight's")]
        pub enum $name {
            #[default]
            $first,
            $( $other, )*
            /// Not known here.
            Other(u8),
        }

        impl From<u8> for $name {
            fn from(code: u8) -> Self {
                match code {
                    $first_code => Self::$first,
                    $( $code => Self::$other, )*
                    other => Self::Other(other),
                }
            }
        }

        impl From<$name> for u8 {
            fn from(name: $name) -> Self {
                match name {
                    $name::$first => $first_code,
                    $( $name::$other => $code, )*
                    $name::Other(other) => other,
                }
            }
        }

        /// As Betaflight's command line calls it.
        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                match self {
                    Self::$first => f.write_str($first_word),
                    $( Self::$other => f.write_str($word), )*
                    Self::Other(other) => write!(f, "{other}"),
                }
            }
        }

        impl $crate::field::Field for $name {
            const SHORTEST: usize = 1;

            fn read(from: &mut $crate::field::Reader<'_>) -> Result<Self, $crate::field::Short> {
                u8::read(from).map(Self::from)
            }

            fn write(&self, to: &mut $crate::field::Payload) {
                u8::from(*self).write(to);
            }
        }
    };
}

use {code, fields, message};
