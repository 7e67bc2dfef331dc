//! Edges of a sonar's echo line: a range is never negative, and never longer than the line can be high.

use std::time::Duration;

use muster_indoor::reading::Echo;
use muster_sensors::hc_sr04::{EchoTimer, Edge};

pub(super) fn run(bytes: &[u8]) {
    let mut timer = EchoTimer::default();
    for edge in bytes.chunks_exact(3) {
        match edge[0] % 8 {
            0 => timer.restart(),
            kind => timer.edge(Edge {
                at: Duration::from_micros(u64::from(u16::from_le_bytes([edge[1], edge[2]]))),
                is_rising: kind % 2 == 1,
            }),
        }
        if let Some(Echo::At(range_m)) = timer.echo() {
            assert!((0.0..7.0).contains(&range_m));
        }
    }
}
