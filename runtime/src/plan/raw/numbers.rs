//! Numbers with bounds in their types. Each is checked where it is read; the error tells the bounds.

use std::borrow::Cow;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};

use crate::schema::FromRatio;

/// A number of more digits is shown with an exponent.
const DIGITS_MAX: usize = 20;

macro_rules! number {
    ($name:ident, $what:literal, $min:literal, $max:literal $(, $after:literal)?) => {
        #[derive(Debug, Clone, Copy, Default, Deserialize, Serialize)]
        #[serde(try_from = "f64")]
        pub struct $name(pub f64);

        impl TryFrom<f64> for $name {
            type Error = String;

            fn try_from(value: f64) -> Result<Self, String> {
                if ($min..=$max).contains(&value) {
                    return Ok(Self(value));
                }
                let digits = value.to_string();
                let shown = if digits.len() > DIGITS_MAX {
                    format!("{value:e}")
                } else {
                    digits
                };
                let (min, max): (f64, f64) = ($min, $max);
                Err(format!(concat!("{} is not ", $what, " from {} to {}" $(, $after)?), shown, min, max))
            }
        }

        impl FromRatio for $name {
            fn from_ratio(numerator: u64, denominator: u64) -> Self {
                Self(numerator as f64 / denominator as f64)
            }
        }

        impl JsonSchema for $name {
            fn inline_schema() -> bool {
                true
            }

            fn schema_name() -> Cow<'static, str> {
                stringify!($name).into()
            }

            fn json_schema(_: &mut SchemaGenerator) -> Schema {
                json_schema!({ "type": "number", "minimum": $min, "maximum": $max })
            }
        }
    };
}

number!(Length, "a length", 0.01, 100_000.0);
number!(Offset, "an offset", -100_000.0, 100_000.0);
number!(Height, "a height", 0.0, 100_000.0);
number!(Rate, "a rate", 0.01, 100.0);
number!(Velocity, "a speed", -100.0, 100.0);
number!(Seconds, "a time", 0.001, 604_800.0, " (a week)");
number!(SecondsFrom0, "a time", 0.0, 604_800.0, " (a week)");
number!(Shape, "a shape", 0.5, 100.0);
number!(Share, "a share", 0.0, 1.0);
number!(Sigma, "a standard deviation", 0.001, 100.0);
number!(PoseSigma, "a standard deviation", 0.001, 1.0);
number!(Volts, "a voltage", 0.01, 100.0);
number!(TurnRate, "a rate of turn", 1.0, 2_000.0);
number!(Heading, "an angle", -360.0, 360.0);
number!(Payload, "a mass", 0.0, 1.0);
number!(Wear, "a share", 0.0, 0.9);
number!(Wind, "a wind speed", -20.0, 20.0);
number!(Gain, "a gain", 0.05, 10.0);
number!(IntegralGain, "a gain", 0.0, 10.0);
number!(Lean, "an angle", 0.05, 0.9);
number!(Throttle, "a throttle", 0.1, 0.8);
number!(FrameRate, "a number of frames", 0.0, 1_000_000.0);
number!(Gusts, "a standard deviation", 0.0, 10.0);

/// Milliseconds: at least one, at most an hour.
pub type Milliseconds = Whole<1, 3_600_000>;

/// Microseconds: at most a minute.
pub type Microseconds = Whole<0, 60_000_000>;

/// A random seed.
pub type Seed = Whole<0, { i64::MAX as u64 }>;

/// A whole number within bounds.
#[derive(Debug, Clone, Copy, Deserialize, Serialize)]
#[serde(try_from = "i64")]
pub struct Whole<const MIN: u64, const MAX: u64>(pub u64);

impl<const MIN: u64, const MAX: u64> Whole<MIN, MAX> {
    /// The number with 32 bits; the greatest one if it is greater.
    #[must_use]
    pub fn to_u32(self) -> u32 {
        u32::try_from(self.0).unwrap_or(u32::MAX)
    }
}

impl<const MIN: u64, const MAX: u64> TryFrom<i64> for Whole<MIN, MAX> {
    type Error = String;

    fn try_from(value: i64) -> Result<Self, String> {
        match u64::try_from(value) {
            Ok(whole) if (MIN..=MAX).contains(&whole) => Ok(Self(whole)),
            _ => Err(format!("{value} is not a whole number from {MIN} to {MAX}")),
        }
    }
}

impl<const MIN: u64, const MAX: u64> FromRatio for Whole<MIN, MAX> {
    fn from_ratio(numerator: u64, denominator: u64) -> Self {
        Self(numerator / denominator)
    }
}

impl<const MIN: u64, const MAX: u64> JsonSchema for Whole<MIN, MAX> {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        format!("whole number from {MIN} to {MAX}").into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "integer", "minimum": MIN, "maximum": MAX })
    }
}

/// How many millionths a clock gains.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(try_from = "i64")]
pub struct PartsPerMillion(pub i32);

impl PartsPerMillion {
    const MAX: i32 = 500_000;
}

impl TryFrom<i64> for PartsPerMillion {
    type Error = String;

    fn try_from(value: i64) -> Result<Self, String> {
        match i32::try_from(value) {
            Ok(ppm) if (-Self::MAX..=Self::MAX).contains(&ppm) => Ok(Self(ppm)),
            _ => Err(format!(
                "{value} is not a whole number from -{max} to {max}",
                max = Self::MAX
            )),
        }
    }
}

impl JsonSchema for PartsPerMillion {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "PartsPerMillion".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "integer", "minimum": -Self::MAX, "maximum": Self::MAX })
    }
}
