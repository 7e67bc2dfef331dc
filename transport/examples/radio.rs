//! Compares the delivery of the simulated medium with ns-3.37, by distance and by load.
//!
//! `cargo run --release -p muster-transport --example radio`

#![allow(clippy::print_stdout, reason = "printing is its purpose")]

#[path = "../tests/support/mod.rs"]
mod support;

fn main() {
    println!("Delivery by distance, Nakagami fading (ns-3.37: 802.11a, 6 Mb/s, 64 B)\n");
    println!(
        "{:>4} {:>6} {:>8} {:>8} {:>8}",
        "m", "d (m)", "ns-3", "muster", "error"
    );
    for row in support::distance_rows() {
        let delivery = support::measure_distance(&row, 50_000, 1);
        println!(
            "{:>4} {:>6} {:>8.3} {delivery:>8.3} {:>+8.3}",
            row.shape,
            row.distance_m,
            row.delivery,
            delivery - row.delivery
        );
    }
    println!("\nDelivery by load, medium access of 802.11a\n");
    println!(
        "{:>8} {:>6} {:>10} {:>8} {:>8} {:>8}",
        "geometry", "drones", "frames/s", "ns-3", "muster", "error"
    );
    for row in support::load_rows() {
        let delivery = support::measure_load(&row, 20.0, 1);
        println!(
            "{:>8} {:>6} {:>10} {:>8.4} {delivery:>8.4} {:>+8.4}",
            row.geometry,
            row.drones,
            row.rate_hz,
            row.delivery,
            delivery - row.delivery
        );
    }
}
