//! Formatting of numbers and lists for people.

/// Shown where there is no value.
pub const NO_VALUE: &str = "–";

/// `value` with `decimals` digits after the point, commas between thousands, and a true minus sign.
#[must_use]
pub fn figure(value: f64, decimals: usize) -> String {
    let digits = format!("{:.decimals$}", value.abs());
    let (whole, fraction) = digits.split_at(digits.find('.').unwrap_or(digits.len()));
    let mut text = String::new();
    if value < 0.0 && digits.contains(|c: char| c.is_ascii_digit() && c != '0') {
        text.push('−');
    }
    for (at, digit) in whole.chars().enumerate() {
        if at > 0 && (whole.len() - at).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text + fraction
}

/// `value` rounded down to `decimals` digits, so that a value below a limit is not shown as the limit.
#[must_use]
pub fn rounded_down(value: f64, decimals: usize) -> String {
    let nearest = format!("{value:.decimals$}");
    match nearest.parse::<f64>() {
        Ok(above) if above > value => {
            let digit = 10_f64.powi(-i32::try_from(decimals).unwrap_or(i32::MAX));
            format!("{:.decimals$}", above - digit)
        }
        _ => nearest,
    }
}

/// `value` rounded up to `decimals` digits, so that a value above a limit is not shown as the limit.
#[must_use]
pub fn rounded_up(value: f64, decimals: usize) -> String {
    let down = rounded_down(-value, decimals);
    down.strip_prefix('-')
        .map_or_else(|| format!("-{down}"), str::to_owned)
}

/// As [`figure`]; [`NO_VALUE`] for `None`.
#[must_use]
pub fn figure_or_dash(value: Option<f64>, decimals: usize) -> String {
    value.map_or_else(|| NO_VALUE.to_owned(), |value| figure(value, decimals))
}

/// A count with its noun: "1 relay", "2 relays".
#[must_use]
pub fn plural(number: usize, thing: &str) -> String {
    let ending = if number == 1 { "" } else { "s" };
    format!("{number} {thing}{ending}")
}

/// Drones by their ids: "drone 3", "drones 3 and 4", "drones 3–5, 9".
#[must_use]
pub fn drones(ids: &[u32]) -> String {
    match ids {
        [] => "no drone".to_owned(),
        [only] => format!("drone {only}"),
        [one, other] => format!("drones {one} and {other}"),
        several => format!("drones {}", ranges(several)),
    }
}

/// Ids in rising order; three or more consecutive ones become a range: "0–6, 9".
#[must_use]
pub fn ranges(ids: &[u32]) -> String {
    let mut ids = ids.to_vec();
    ids.sort_unstable();
    ids.dedup();
    let runs: Vec<String> = ids
        .chunk_by(|a, b| a.checked_add(1) == Some(*b))
        .flat_map(|run| match run {
            [first, _, .., last] => vec![format!("{first}–{last}")],
            few => few.iter().map(u32::to_string).collect(),
        })
        .collect();
    if runs.is_empty() {
        NO_VALUE.to_owned()
    } else {
        runs.join(", ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_have_commas_between_thousands() {
        assert_eq!(figure(1_234_567.25, 1), "1,234,567.2");
        assert_eq!(figure(999.0, 0), "999");
        assert_eq!(figure(-1000.0, 0), "−1,000");
        assert_eq!(figure(-0.01, 1), "0.0");
        assert_eq!(figure(f64::NAN, 1), "NaN");
    }

    #[test]
    fn values_beyond_a_limit_are_not_rounded_to_it() {
        for (value, down, up) in [
            (1.997, "1.99", "2.00"),
            (2.0, "2.00", "2.00"),
            (2.001, "2.00", "2.01"),
            (-0.004, "-0.01", "-0.00"),
        ] {
            assert_eq!(
                (&*rounded_down(value, 2), &*rounded_up(value, 2)),
                (down, up)
            );
        }
    }

    #[test]
    fn drones_are_listed_by_id() {
        assert_eq!(drones(&[3]), "drone 3");
        assert_eq!(drones(&[3, 4]), "drones 3 and 4");
        assert_eq!(drones(&[3, 4, 5]), "drones 3–5");
    }

    #[test]
    fn consecutive_ids_become_a_range() {
        assert_eq!(ranges(&[0, 1, 2, 3, 6, 9, 8]), "0–3, 6, 8, 9");
        assert_eq!(ranges(&[]), "–");
    }
}
