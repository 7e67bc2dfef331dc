//! The simulated medium agrees with ns-3.37.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod support;

/// Largest accepted difference of the delivery from the reference.
const TOLERANCE: f64 = 0.02;

#[test]
fn delivery_by_distance_agrees_with_ns3() {
    let rows = support::distance_rows();
    assert_eq!(rows.len(), 18);
    for row in rows {
        let delivery = support::measure_distance(&row, 20_000, 1);
        assert!(
            (delivery - row.delivery).abs() <= TOLERANCE,
            "{delivery} for {row:?}"
        );
    }
}

#[test]
fn delivery_by_load_agrees_with_ns3() {
    let rows = support::load_rows();
    assert_eq!(rows.len(), 9);
    for row in rows {
        let delivery = support::measure_load(&row, 5.0, 1);
        assert!(
            (delivery - row.delivery).abs() <= TOLERANCE,
            "{delivery} for {row:?}"
        );
    }
}

#[test]
fn hidden_terminal_destroys_frames_during_one_airtime() {
    // In a line, each link has one hidden terminal, beyond the receiver. The two links to the ends have none.
    let rate_hz = 100.0;
    let row = support::LoadRow {
        geometry: "line".to_owned(),
        drones: 15,
        rate_hz,
        delivery: (26.0 * libm::exp(-rate_hz * 196e-6) + 2.0) / 28.0,
    };
    let delivery = support::measure_load(&row, 20.0, 1);
    assert!(
        (delivery - row.delivery).abs() < 0.005,
        "{delivery} for {row:?}"
    );
}
