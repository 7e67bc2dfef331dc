//! The simulated medium delivers what ns-3.37 does.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod support;

/// The most that a share may differ from the reference.
const TOLERANCE: f64 = 0.02;

#[test]
fn delivery_by_distance_agrees_with_ns3() {
    let rows = support::distance_rows();
    assert_eq!(rows.len(), 18);
    for row in rows {
        let here = support::measure_distance(&row, 20_000, 1);
        assert!(
            (here - row.delivery).abs() <= TOLERANCE,
            "{here} for {row:?}"
        );
    }
}

#[test]
fn delivery_by_load_agrees_with_ns3() {
    let rows = support::load_rows();
    assert_eq!(rows.len(), 9);
    for row in rows {
        let here = support::measure_load(&row, 5.0, 1);
        assert!(
            (here - row.delivery).abs() <= TOLERANCE,
            "{here} for {row:?}"
        );
    }
}

#[test]
fn a_hidden_terminal_spoils_frames_through_one_airtime() {
    // On a line a link has one, beyond the receiver; the two links to the ends have none.
    let rate_hz = 100.0;
    let row = support::LoadRow {
        geometry: "line".to_owned(),
        drones: 15,
        rate_hz,
        delivery: (26.0 * libm::exp(-rate_hz * 196e-6) + 2.0) / 28.0,
    };
    let here = support::measure_load(&row, 20.0, 1);
    assert!((here - row.delivery).abs() < 0.005, "{here} for {row:?}");
}
