//! Modes: which there are, what switches them, which are active.

use super::{code, fields, message};
use crate::field::{Field, Payload, Reader, Short, ShortList, Text};

code! {
    /// A mode by its permanent number (`msp_box.c`). Only those that concern this project have names here.
    Mode {
        Arm = 0 "ARM",
        Angle = 1 "ANGLE",
        Horizon = 2 "HORIZON",
        AltHold = 3 "ALTHOLD",
        HeadFree = 6 "HEADFREE",
        PosHold = 11 "POS HOLD",
        Failsafe = 27 "FAILSAFE",
        AirMode = 28 "AIR MODE",
        Prearm = 36 "PREARM",
        Paralyze = 45 "PARALYZE",
        GpsRescue = 46 "GPS RESCUE",
        MspOverride = 50 "MSP OVERRIDE",
    }
}

impl Mode {
    /// Modes in which sticks are no tilts about the body's axes, or throttle is no thrust.
    pub const OTHER_STICKS: [Self; 5] = [
        Self::Horizon,
        Self::AltHold,
        Self::HeadFree,
        Self::PosHold,
        Self::GpsRescue,
    ];
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

code! {
    /// How a range is combined with the other ranges of its mode.
    ModeLogic {
        Or = 0 "OR",
        And = 1 "AND",
    }
}

fields! {
    /// What [`ModeRange`] does not tell of a range.
    ModeRangeExtra {
        /// Which mode.
        mode: Mode,
        /// Whether the mode needs this range besides others, or is on with any of them.
        logic: ModeLogic,
        /// The mode is on while this one is, whatever the range; ARM: while no other mode is, for none can be linked to ARM.
        linked_to: Mode,
    }
}

impl ModeRangeExtra {
    /// Whether the range alone activates its mode.
    #[must_use]
    pub fn is_plain(&self) -> bool {
        self.logic == ModeLogic::Or && self.linked_to == Mode::Arm
    }
}

message! {
    /// What [`ModeRanges`] does not tell, in the same order. Betaflight 4.0 and newer.
    ModeRangesExtra = 238 as "MSP_MODE_RANGES_EXTRA" {
        /// As many as there are ranges.
        extras: ShortList<ModeRangeExtra>,
    }
}
