/// Number of terms after which neither sum below changes, for shapes up to 1,000.
const TERMS_MAX: u32 = 1_000;

/// The regularised upper incomplete gamma function Q(a, x) = Γ(a, x) / Γ(a), for a above 0.
///
/// The relative error is about 1e-12. It uses libm, so that the result is the same on every processor: the power series of
/// P = 1 − Q (DLMF 8.11.4) up to x = a + 1, and the continued fraction of Q (DLMF 8.9.2) beyond.
pub(super) fn upper_regularised(a: f64, x: f64) -> f64 {
    if x <= 0.0 {
        return 1.0;
    }
    let scale = libm::exp(a * libm::log(x) - x - libm::lgamma(a));
    if x < a + 1.0 {
        (1.0 - scale * lower_series(a, x)).max(0.0)
    } else {
        scale * upper_fraction(a, x)
    }
}

/// Σ xⁿ / (a (a + 1) … (a + n)).
fn lower_series(a: f64, x: f64) -> f64 {
    let mut term = 1.0 / a;
    let mut sum = term;
    for n in 1..TERMS_MAX {
        term *= x / (a + f64::from(n));
        sum += term;
        if term < sum * f64::EPSILON {
            break;
        }
    }
    sum
}

/// 1 / (x + 1 − a − 1 (1 − a) / (x + 3 − a − 2 (2 − a) / (x + 5 − a − …))), as the limit of its convergents, computed from
/// the front. None of their denominators is 0 for x above a + 1.
fn upper_fraction(a: f64, x: f64) -> f64 {
    let mut below = x + 1.0 - a;
    let mut ratio = 1.0 / below;
    let mut step = ratio;
    let mut value = ratio;
    for n in 1..TERMS_MAX {
        let n = f64::from(n);
        let numerator = -n * (n - a);
        below += 2.0;
        ratio = 1.0 / (below + numerator * ratio);
        step *= below * ratio - 1.0;
        value += step;
        if step.abs() < value.abs() * f64::EPSILON {
            break;
        }
    }
    value
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn integer_shapes_match_the_finite_sum(shape in 1_u32..20, x in 0.0..60.0_f64) {
            // Q(n, x) = exp(-x) Σ xᵏ / k! for k below n: DLMF 8.4.10.
            let mut term = 1.0;
            let mut sum = 1.0;
            for k in 1..shape {
                term *= x / f64::from(k);
                sum += term;
            }
            let expected = libm::exp(-x) * sum;
            let found = upper_regularised(f64::from(shape), x);
            prop_assert!((found - expected).abs() < 1e-11, "{found} for {expected}");
        }

        #[test]
        fn shape_one_half_matches_the_complementary_error_function(x in 0.0..60.0_f64) {
            let expected = libm::erfc(x.sqrt());
            let found = upper_regularised(0.5, x);
            prop_assert!((found - expected).abs() < 1e-11, "{found} for {expected}");
        }

        #[test]
        fn result_falls_from_one_to_zero(a in 0.5..100.0_f64, x in 0.0..1_000.0_f64, more in 0.01..10.0_f64) {
            let (first, second) = (upper_regularised(a, x), upper_regularised(a, x + more));
            prop_assert!((0.0..=1.0).contains(&first));
            prop_assert!(second <= first + 1e-12);
        }
    }
}
