//! Median of a sample with a distribution-free confidence interval, and the 99th percentile.

/// Minimum confidence of an interval.
pub(super) const CONFIDENCE: f64 = 0.95;

/// Maximum number of values kept for plots.
const DRAWN_MAX: usize = 60;
/// Below this many values, the 99th percentile would be the largest.
const P99_FROM: usize = 100;

/// Median of a sample in ascending order: the middle value, or the mean of the two middle values; `None` for an empty one.
#[must_use]
pub fn median(sorted: &[f64]) -> Option<f64> {
    let last = sorted.len().checked_sub(1)?;
    Some(f64::midpoint(sorted[last / 2], sorted[sorted.len() / 2]))
}

/// 99th percentile (nearest rank) of a sample in ascending order; `None` below 100 values, where it would be the largest.
#[must_use]
pub fn p99(sorted: &[f64]) -> Option<f64> {
    let number = sorted.len();
    (number >= P99_FROM).then(|| sorted[(number * 99).div_ceil(100) - 1])
}

/// Statistics of a sample.
#[derive(Debug, Clone, PartialEq)]
pub struct Estimate {
    /// Number of values, at least one.
    pub n: usize,
    /// As [`median`].
    pub median: f64,
    /// Interval that contains the median of the distribution with at least 95 % confidence; `None` below six values.
    pub interval: Option<(f64, f64)>,
    /// As [`p99`].
    pub p99: Option<f64>,
    /// The sample in ascending order, or evenly ranked values of it with both ends.
    pub drawn: Vec<f64>,
}

impl Estimate {
    /// Statistics of a sample in any order; `None` for an empty one.
    #[must_use]
    pub fn of(mut sample: Vec<f64>) -> Option<Self> {
        sample.sort_unstable_by(f64::total_cmp);
        let number = sample.len();
        let last = number.checked_sub(1)?;
        let interval =
            interval_ranks(number).map(|(low, high)| (sample[low - 1], sample[high - 1]));
        let drawn = number.min(DRAWN_MAX);
        Some(Self {
            n: number,
            median: median(&sample)?,
            interval,
            p99: p99(&sample),
            drawn: (0..drawn)
                .map(|place| sample[place * last / (drawn - 1).max(1)])
                .collect(),
        })
    }
}

/// Ranks, from 1, of the values that bound the median of a sample of `number` with at least 95 % confidence.
///
/// The median lies between the j-th smallest and the j-th largest value unless fewer than j values are on one side of it.
/// Each value is on either side with probability ½. So j is the highest rank with 2 P(B < j) ≤ 0.05 for B binomial of
/// `number` and ½. No distribution is assumed.
///
/// Takes `number` / 2 steps of sums, products and powers of two, so the ranks are the same on all machines.
///
/// Source: H. A. David and H. N. Nagaraja, *Order Statistics*, 3rd ed., section 7.1; tabulated in J.-Y. Le Boudec,
/// *Performance Evaluation of Computer and Communication Systems*, appendix A.
#[must_use]
pub fn interval_ranks(number: usize) -> Option<(usize, usize)> {
    const STEP: i32 = 256;
    let tail_max = (1.0 - CONFIDENCE) / 2.0;
    // P(B = below) and P(B ≤ below), both scaled by 2^(number − shift) against underflow and overflow.
    let (mut term, mut sum, mut shift) = (1.0_f64, 1.0_f64, 0_usize);
    let mut below = 0;
    loop {
        let exponent = i32::try_from(number - shift).unwrap_or(i32::MAX);
        if exponent < 1_000 && sum * 2.0_f64.powi(-exponent) > tail_max {
            break;
        }
        term *= to_f64(number - below) / to_f64(below + 1);
        sum += term;
        below += 1;
        if sum > 2.0_f64.powi(STEP) {
            term *= 2.0_f64.powi(-STEP);
            sum *= 2.0_f64.powi(-STEP);
            shift += STEP.unsigned_abs() as usize;
        }
    }
    (below > 0).then(|| (below, number + 1 - below))
}

#[expect(
    clippy::cast_precision_loss,
    reason = "a sample has far fewer than 2^52 values"
)]
fn to_f64(number: usize) -> f64 {
    number as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_equal_the_published_table() {
        // Le Boudec, appendix A, median at 95 %.
        for (number, ranks) in [
            (6, (1, 6)),
            (7, (1, 7)),
            (8, (1, 8)),
            (9, (2, 8)),
            (10, (2, 9)),
            (12, (3, 10)),
            (15, (4, 12)),
            (20, (6, 15)),
            (25, (8, 18)),
            (30, (10, 21)),
            (100, (40, 61)),
        ] {
            assert_eq!(interval_ranks(number), Some(ranks), "{number}");
        }
    }

    #[test]
    fn fewer_than_six_values_have_no_interval() {
        for number in 0..6 {
            assert_eq!(interval_ranks(number), None, "{number}");
        }
    }

    #[test]
    fn ranks_of_large_samples_approach_the_normal_distribution() {
        for number in [1_000_usize, 10_000, 10_000_000] {
            let (low, high) = interval_ranks(number).unwrap();
            let half = to_f64(number) / 2.0 - to_f64(low);
            let expected = 1.959_964 * to_f64(number).sqrt() / 2.0;
            assert!((half - expected).abs() <= 1.5, "{number}: {low}");
            assert_eq!(low + high, number + 1);
        }
    }

    #[test]
    fn one_of_100_values_is_above_the_99th_percentile() {
        let p99 = |number: u32| Estimate::of((1..=number).rev().map(f64::from).collect());
        assert_eq!(p99(99).unwrap().p99, None);
        assert_eq!(p99(100).unwrap().p99, Some(99.0));
        assert_eq!(p99(1_000).unwrap().p99, Some(990.0));
        assert_eq!(p99(1_001).unwrap().p99, Some(991.0));
    }

    #[test]
    fn median_of_an_even_sample_is_the_mean_of_the_middle_two() {
        let estimate = Estimate::of(vec![4.0, 1.0, 3.0, 2.0]).unwrap();
        assert_eq!(estimate.median.to_bits(), 2.5_f64.to_bits());
        assert_eq!(estimate.n, 4);
        assert_eq!(estimate.interval, None);
        assert_eq!(estimate.drawn, [1.0, 2.0, 3.0, 4.0]);
        assert_eq!(Estimate::of(vec![7.0]).unwrap().drawn, [7.0]);
        assert_eq!(Estimate::of(vec![]), None);
    }

    #[test]
    fn interval_consists_of_values_of_the_sample() {
        let estimate = Estimate::of((1..=100).rev().map(f64::from).collect()).unwrap();
        assert_eq!(estimate.interval, Some((40.0, 61.0)));
        assert_eq!(estimate.median.to_bits(), 50.5_f64.to_bits());
    }

    #[test]
    fn plotted_values_include_both_ends_of_the_sample() {
        let drawn = Estimate::of((0..10_000).map(f64::from).collect())
            .unwrap()
            .drawn;
        assert_eq!(drawn.len(), DRAWN_MAX);
        assert_eq!((drawn[0], drawn[DRAWN_MAX - 1]), (0.0, 9_999.0));
    }
}
