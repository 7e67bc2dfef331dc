//! Values over time, as SMIL writes them.

use maud::{Markup, html};

use super::clock::Clock;

/// Values of an attribute, each from its share of the picture's length on; in order of time.
pub(super) type Keys = Vec<(f64, String)>;

/// An attribute that moves from value to value.
pub(super) fn moving(clock: &Clock, attribute: &str, mut keys: Keys) -> Markup {
    if let Some((last, value)) = keys.last().cloned()
        && last < 1.0
    {
        keys.push((1.0, value));
    }
    animate(clock, attribute, &keys, "linear")
}

/// An attribute that jumps from value to value.
pub(super) fn jumping(clock: &Clock, attribute: &str, mut keys: Keys) -> Markup {
    keys.dedup_by(|later, earlier| later.1 == earlier.1);
    animate(clock, attribute, &keys, "discrete")
}

fn animate(clock: &Clock, attribute: &str, keys: &Keys, mode: &str) -> Markup {
    let (times, values) = texts(keys);
    if keys.iter().all(|(_, value)| *value == keys[0].1) {
        return html! { set attributeName=(attribute) to=(keys.first().map_or("", |key| &key.1)) {} };
    }
    html! {
        animate attributeName=(attribute) calcMode=(mode) dur=(duration(clock)) repeatCount="indefinite"
            keyTimes=(times) values=(values) {}
    }
}

/// A place that moves.
pub(super) fn moving_place(clock: &Clock, places: &[(f64, (f64, f64))]) -> Markup {
    let mut keys: Keys = (places.iter())
        .map(|(share, (x, y))| (*share, format!("{x} {y}")))
        .collect();
    if let Some((_, value)) = keys.last().cloned() {
        keys.push((1.0, value));
    }
    let (times, values) = texts(&keys);
    html! {
        animateTransform attributeName="transform" type="translate" dur=(duration(clock)) repeatCount="indefinite"
            keyTimes=(times) values=(values) {}
    }
}

pub(super) fn duration(clock: &Clock) -> String {
    format!("{:.2}s", clock.total_s)
}

fn texts(keys: &Keys) -> (String, String) {
    let times = keys.iter().map(|(share, _)| short(share.clamp(0.0, 1.0)));
    let values = keys.iter().map(|(_, value)| value.clone());
    (
        times.collect::<Vec<_>>().join(";"),
        values.collect::<Vec<_>>().join(";"),
    )
}

/// A share with as many digits as it needs, at most five.
fn short(share: f64) -> String {
    format!("{}", (share * 1e5).round() / 1e5)
}
