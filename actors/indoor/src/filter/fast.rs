//! Functions of f32 made of sums and products alone: loops over them become vector instructions, and all processors agree.

/// Leaves the nearest whole number in the low bits of a float below 2²².
pub(super) const ROUND: f32 = 12_582_912.0;

/// A whole number that was added to [`ROUND`].
#[inline]
pub(super) fn whole(rounded: f32) -> u32 {
    rounded.to_bits() & 0x003f_ffff
}

/// Sine and cosine to within 1e-5, for angles up to a few hundred turns.
///
/// Source: Taylor's series to the 9th power, on a quarter of a turn about zero.
#[inline]
pub(super) fn sin_cos(angle: f32) -> (f32, f32) {
    /// A quarter of a turn in two parts, the first one exact in products with small whole numbers.
    const QUARTER: (f32, f32) = (1.570_312_5, 4.838_268e-4);
    let rounded = angle * std::f32::consts::FRAC_2_PI + ROUND;
    let quarters = rounded - ROUND;
    let x = angle - quarters * QUARTER.0 - quarters * QUARTER.1;
    let s = x * x;
    let odd = -1.0 / 6.0 + s * (1.0 / 120.0 + s * (-1.0 / 5_040.0 + s / 362_880.0));
    let sin = x + x * s * odd;
    let cos = 1.0 + s * (-0.5 + s * (1.0 / 24.0 + s * (-1.0 / 720.0 + s / 40_320.0)));
    let bits = rounded.to_bits();
    let (sin, cos) = if bits & 1 == 0 {
        (sin, cos)
    } else {
        (cos, -sin)
    };
    if bits & 2 == 0 {
        (sin, cos)
    } else {
        (-sin, -cos)
    }
}

/// The exponential of a number up to 0, to within 4e-6 of the result; below −80 that of −80.
///
/// Source: Taylor's series to the 6th power, on half a power of two about zero.
#[inline]
pub(super) fn exp(x: f32) -> f32 {
    let x = if x > -80.0 { x } else { -80.0 };
    let rounded = x * std::f32::consts::LOG2_E + ROUND;
    let f = (x * std::f32::consts::LOG2_E - (rounded - ROUND)) * std::f32::consts::LN_2;
    let tail = 1.0 / 6.0 + f * (1.0 / 24.0 + f * (1.0 / 120.0 + f / 720.0));
    let mantissa = 1.0 + f * (1.0 + f * (0.5 + f * tail));
    // The exponent is in the low bits, in two's complement.
    let power = rounded.to_bits().wrapping_add(127) << 23;
    mantissa * f32::from_bits(power)
}

/// A sum in eight lanes.
pub(super) fn sum(numbers: impl ExactSizeIterator<Item = f32>) -> f32 {
    let mut lanes = [0.0_f32; 8];
    for (index, number) in numbers.enumerate() {
        lanes[index % 8] += number;
    }
    lanes.iter().sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sine_and_cosine_agree_with_the_library() {
        for step in -20_000_i16..20_000 {
            let angle = f32::from(step) * 0.005;
            let (sin, cos) = sin_cos(angle);
            assert!((sin - libm::sinf(angle)).abs() < 1e-5, "{angle}");
            assert!((cos - libm::cosf(angle)).abs() < 1e-5, "{angle}");
        }
    }

    #[test]
    fn exponentials_agree_with_the_library() {
        for step in 0..8_000_u16 {
            let x = -f32::from(step) * 0.01;
            let expected = libm::expf(x);
            assert!((exp(x) - expected).abs() <= 4e-6 * expected, "{x}");
        }
    }
}
