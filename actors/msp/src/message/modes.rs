//! Modes: which there are, what switches them, which are active.

use super::{code, message};
use crate::field::{Field, Payload, Reader, Short, Text};

code! {
    /// A mode by its permanent number (`msp_box.c`). Only those that concern this project have names here.
    Mode {
        Arm = 0 "ARM",
        Angle = 1 "ANGLE",
        Horizon = 2 "HORIZON",
        AltHold = 3 "ALTHOLD",
        PosHold = 11 "POS HOLD",
        Failsafe = 27 "FAILSAFE",
        AirMode = 28 "AIR MODE",
        Prearm = 36 "PREARM",
        Paralyze = 45 "PARALYZE",
        GpsRescue = 46 "GPS RESCUE",
        MspOverride = 50 "MSP OVERRIDE",
    }
}

message! {
    /// The modes of this controller, in the order of the bits of [`Status`](super::Status): 32 a page. A request may name the
    /// page.
    BoxIds = 119 as "MSP_BOXIDS" {
        /// Permanent numbers.
        modes: Vec<Mode>,
    }
}

impl BoxIds {
    /// Whether a mode is among the active ones; `None` if this controller doesn't have it.
    #[must_use]
    pub fn is_active(&self, mode: Mode, active: Modes) -> Option<bool> {
        let place = self.modes.iter().position(|it| *it == mode)?;
        Some(active.0.checked_shr(u32::try_from(place).ok()?)? & 1 == 1)
    }
}

/// The active modes of a controller, as bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Modes(pub u128);

message! {
    /// Names of the modes, in the order of [`BoxIds`].
    BoxNames = 116 as "MSP_BOXNAMES" {
        /// Each ends in `;`.
        names: Text,
    }
}

impl BoxNames {
    /// The names one by one.
    pub fn iter(&self) -> impl Iterator<Item = &str> {
        self.names.0.split_terminator(';')
    }
}

/// A range of an aux channel that activates a mode.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ModeRange {
    /// Which mode.
    pub mode: Mode,
    /// Which channel: 0 is AUX1.
    pub aux: u8,
    /// First value that activates it, in steps of 25 µs from 900 µs.
    pub first_step: u8,
    /// First value beyond the range, in steps of 25 µs from 900 µs.
    pub end_step: u8,
}

impl ModeRange {
    /// First value that activates it, in µs.
    #[must_use]
    pub fn first_us(self) -> u16 {
        900 + 25 * u16::from(self.first_step)
    }

    /// First value beyond the range, in µs.
    #[must_use]
    pub fn end_us(self) -> u16 {
        900 + 25 * u16::from(self.end_step)
    }

    /// Whether any value activates it: Betaflight's unused places have an empty range.
    #[must_use]
    pub fn is_used(self) -> bool {
        self.first_step < self.end_step
    }
}

impl Field for ModeRange {
    const SHORTEST: usize = 4;

    fn read(from: &mut Reader<'_>) -> Result<Self, Short> {
        Ok(Self {
            mode: Mode::read(from)?,
            aux: u8::read(from)?,
            first_step: u8::read(from)?,
            end_step: u8::read(from)?,
        })
    }

    fn write(&self, to: &mut Payload) {
        self.mode.write(to);
        [self.aux, self.first_step, self.end_step].write(to);
    }
}

message! {
    /// What activates the modes.
    ModeRanges = 34 as "MSP_MODE_RANGES" {
        /// 20 in Betaflight; most are not used.
        ranges: Vec<ModeRange>,
    }
}

impl ModeRanges {
    /// The ranges that activate a mode.
    pub fn of(&self, mode: Mode) -> impl Iterator<Item = ModeRange> {
        self.ranges
            .iter()
            .copied()
            .filter(move |it| it.mode == mode && it.is_used())
    }
}
