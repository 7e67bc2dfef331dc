//! Repeats the reference simulations on a medium, and reads their results.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::f64::consts::TAU;
use std::num::NonZeroUsize;
use std::time::Duration;

use bytes::Bytes;
use muster_machines::geometry::Ned;
use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;
use muster_transport::sim::{Access, Config, Medium, Propagation};
use muster_transport::{Destination, Event, Transport};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Spacing of a line or a grid, and diameter of a clique, in metres.
const SPACING_M: f64 = 160.0;
const RANGE_M: f64 = 300.0;
/// Range without fading in the closed form of the reference, in metres.
const FADING_RANGE_M: f64 = 299.9;
/// Queue length of ns-3.
const QUEUE_MAX: NonZeroUsize = NonZeroUsize::new(500).expect("500 is not 0");

/// A row of `delivery_by_load.csv`.
#[derive(Debug)]
pub(crate) struct LoadRow {
    pub(crate) geometry: String,
    pub(crate) drones: u32,
    pub(crate) rate_hz: f64,
    pub(crate) delivery: f64,
}

/// A row of `pdr_by_distance.csv`.
#[derive(Debug)]
pub(crate) struct DistanceRow {
    pub(crate) shape: f64,
    pub(crate) distance_m: f64,
    pub(crate) delivery: f64,
}

pub(crate) fn load_rows() -> Vec<LoadRow> {
    rows(include_str!("../data/delivery_by_load.csv"))
        .map(|row| LoadRow {
            geometry: row[0].to_owned(),
            drones: row[1].parse().expect("a number of drones"),
            rate_hz: row[2].parse().expect("a rate"),
            delivery: row[3].parse().expect("a share"),
        })
        .collect()
}

pub(crate) fn distance_rows() -> Vec<DistanceRow> {
    rows(include_str!("../data/pdr_by_distance.csv"))
        .map(|row| DistanceRow {
            shape: row[0].parse().expect("a shape"),
            distance_m: row[1].parse().expect("a distance"),
            delivery: row[2].parse().expect("a share"),
        })
        .collect()
}

fn rows(text: &'static str) -> impl Iterator<Item = csv::StringRecord> {
    csv::ReaderBuilder::new()
        .comment(Some(b'#'))
        .from_reader(text.as_bytes())
        .into_records()
        .map(|row| row.expect("a row of the reference"))
}

/// Delivery from a single sender to a receiver at the row's distance.
pub(crate) fn measure_distance(row: &DistanceRow, frames: u32, seed: u64) -> f64 {
    let propagation = Propagation::Nakagami {
        range_m: FADING_RANGE_M,
        shape: row.shape,
    };
    let positions = [Ned::HOME, Ned::new(row.distance_m, 0.0, 0.0)];
    let mut medium = medium(propagation, &positions, seed);
    let datagram = Bytes::from_static(&[0; 64]);
    let mut received = 0;
    for frame in 0..frames {
        let now = Timestamp::ZERO + Duration::from_millis(1) * frame;
        received += advance(&mut medium, now);
        medium
            .send(now, NodeId(0), Destination::Broadcast, &datagram)
            .expect("a short datagram of a known sender");
    }
    received += advance(&mut medium, Timestamp::from_nanos(u64::MAX));
    f64::from(received) / f64::from(frames)
}

/// Delivery between neighbours while all drones send at the row's rate.
pub(crate) fn measure_load(row: &LoadRow, seconds: f64, seed: u64) -> f64 {
    let positions = positions(&row.geometry, row.drones);
    let neighbours: Vec<u32> = positions
        .iter()
        .map(|own| {
            let near = positions.iter().filter(|it| it.distance_m(*own) <= RANGE_M);
            u32::try_from(near.count()).expect("few drones") - 1
        })
        .collect();
    let range = Propagation::Range { range_m: RANGE_M };
    let mut medium = medium(range, &positions, seed);
    let mut rng = ChaCha8Rng::seed_from_u64(seed + 1);
    let datagram = Bytes::from_static(&[0; 64]);
    let mut sends: BinaryHeap<_> = (0..row.drones)
        .map(|id| {
            let phase = Timestamp::from_secs_f64(rng.random::<f64>() / row.rate_hz);
            Reverse((phase, id))
        })
        .collect();
    let end = Timestamp::from_secs_f64(seconds);
    let (mut received, mut expected) = (0, 0);
    while let Some(Reverse((now, id))) = sends.pop()
        && now < end
    {
        received += advance(&mut medium, now);
        medium
            .send(now, NodeId(id), Destination::Broadcast, &datagram)
            .expect("a short datagram of a known sender");
        expected += neighbours[id as usize];
        let period_s = (0.9 + 0.2 * rng.random::<f64>()) / row.rate_hz;
        sends.push(Reverse((now + Duration::from_secs_f64(period_s), id)));
    }
    received += advance(&mut medium, end);
    f64::from(received) / f64::from(expected)
}

/// Advances the medium to `now`. Returns the number of datagrams that arrived.
fn advance(medium: &mut Medium, now: Timestamp) -> u32 {
    medium.handle_timeout(now);
    let arrivals = std::iter::from_fn(|| medium.poll_event())
        .filter(|event| matches!(event, Event::Arrival(_)));
    u32::try_from(arrivals.count()).expect("fewer than 2^32 arrivals")
}

fn medium(propagation: Propagation, positions: &[Ned], seed: u64) -> Medium {
    let config = Config {
        propagation,
        loss: 0.0,
        bursts: None,
        access: Access::Csma {
            jitter: Duration::ZERO,
            queue_max: QUEUE_MAX,
        },
        datagram_max: 64,
    };
    Medium::new(config, ChaCha8Rng::seed_from_u64(seed), positions)
}

fn positions(geometry: &str, drones: u32) -> Vec<Ned> {
    let side = (1..).find(|side| side * side >= drones).unwrap_or(drones);
    (0..drones)
        .map(|index| match geometry {
            "line" => Ned::new(0.0, f64::from(index) * SPACING_M, -20.0),
            "grid" => Ned::new(
                f64::from(index / side) * SPACING_M,
                f64::from(index % side) * SPACING_M,
                -20.0,
            ),
            "clique" => {
                let angle = TAU * f64::from(index) / f64::from(drones);
                let (sin, cos) = (libm::sin(angle), libm::cos(angle));
                Ned::new(SPACING_M / 2.0 * sin, SPACING_M / 2.0 * cos, -20.0)
            }
            other => panic!("the reference has no geometry `{other}`"),
        })
        .collect()
}
