//! Axes and their ticks.

use maud::{Markup, html};
use muster_runtime::text::figure;

/// Linear map from a range of numbers to a range of pixels.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Axis {
    from: f64,
    start_px: f64,
    px_per_unit: f64,
}

impl Axis {
    /// Maps `from` to `start_px` and `to` to `end_px`, in either direction.
    pub(crate) fn new((from, to): (f64, f64), (start_px, end_px): (f64, f64)) -> Self {
        let span = if to > from { to - from } else { 1.0 };
        Self {
            from,
            start_px,
            px_per_unit: (end_px - start_px) / span,
        }
    }

    /// Pixel position of `value`.
    pub(crate) fn px(&self, value: f64) -> f64 {
        self.start_px + (value - self.from) * self.px_per_unit
    }
}

/// About `number` round values from `from` to `to`: multiples of 1, 2 or 5 times a power of ten.
pub(crate) fn ticks(from: f64, to: f64, number: f64) -> Vec<f64> {
    let span = to - from;
    if !(span.is_finite() && span > 0.0) {
        return vec![from];
    }
    let step = round_step(span / number.max(1.0));
    let first = (from / step - 1e-9).ceil();
    (0..)
        .map(|index| (first + f64::from(index)) * step + 0.0)
        .take_while(|&tick| tick <= to + step * 1e-9)
        .collect()
}

/// The smallest of 1, 2 or 5 times a power of ten that is at least `rough`.
fn round_step(rough: f64) -> f64 {
    let power = 10_f64.powf(rough.log10().floor());
    let fits = |factor: &f64| factor * power >= rough * (1.0 - 1e-9);
    [1.0, 2.0, 5.0].into_iter().find(fits).unwrap_or(10.0) * power
}

/// Number of decimals needed to distinguish `ticks`.
pub(crate) fn decimals(ticks: &[f64]) -> usize {
    let step = match ticks {
        [first, second, ..] => second - first,
        _ => 1.0,
    };
    (0..6_i32)
        .find(|&digits| {
            let scaled = step * 10_f64.powi(digits);
            scaled >= 1.0 - 1e-9 && (scaled - scaled.round()).abs() < 1e-6
        })
        .map_or(6, |digits| digits.unsigned_abs() as usize)
}

/// Grid lines at about `number` round heights from `low` to `high`, labelled on the left. They reach from `left` to `right`, in
/// pixels.
pub(crate) fn scale(
    y: &Axis,
    (low, high): (f64, f64),
    number: f64,
    (left, right): (f64, f64),
) -> Markup {
    let heights = ticks(low, high, number);
    let digits = decimals(&heights);
    html! {
        @for height in heights {
            @let at = px(y.px(height));
            line.grid x1=(left) x2=(right) y1=(at) y2=(at) {}
            text.tick x=(left - 7.0) y=(at) dy="0.35em" text-anchor="end" { (figure(height, digits)) }
        }
    }
}

/// Step between shown labels, for labels `pitch_px` apart and `label_px` wide.
pub(crate) fn stride(pitch_px: f64, label_px: f64) -> usize {
    [1, 2, 5, 10, 20, 25, 50, 100]
        .into_iter()
        .find(|&every| f64::from(every) * pitch_px >= label_px)
        .unwrap_or(200) as usize
}

/// Rounds a coordinate to 1/10 pixel.
pub(crate) fn px(value: f64) -> f64 {
    (value * 10.0).round() / 10.0 + 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_numbers_within_the_axis() {
        assert_eq!(
            ticks(-1120.0, 1120.0, 5.0),
            [-1000.0, -500.0, 0.0, 500.0, 1000.0]
        );
        assert_eq!(ticks(0.0, 9.0, 4.0), [0.0, 5.0]);
        assert_eq!(ticks(3.0, 3.0, 4.0), [3.0]);
        assert_eq!(ticks(0.0, f64::INFINITY, 4.0), [0.0]);
    }

    #[test]
    fn decimals_suffice_to_distinguish_ticks() {
        assert_eq!(decimals(&ticks(0.0, 0.9, 4.0)), 1);
        assert_eq!(decimals(&ticks(0.0, 400.0, 4.0)), 0);
    }

    #[test]
    fn stride_grows_as_labels_get_closer() {
        assert_eq!(stride(30.0, 20.0), 1);
        assert_eq!(stride(5.0, 20.0), 5);
        assert_eq!(stride(0.01, 20.0), 200);
    }
}
