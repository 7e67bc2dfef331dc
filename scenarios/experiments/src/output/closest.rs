//! The closest pair of flying drones over time.

use muster_machines::geometry::Ned;
use muster_machines::time::Timestamp;
use muster_scenarios::report::{Flight, FlightOfDrone, Report};

/// Most samples of a run, and of all its drones together.
const SAMPLES_MAX: f64 = 1_500.0;
const POSITIONS_MAX: f64 = 500_000.0;
/// Shortest interval between samples, in seconds.
const STEP_MIN_S: f64 = 0.25;

/// Two drones and their distance, in metres.
pub(super) type Pair = (f64, u32, u32);

/// The closest pair at regular times.
#[derive(Debug)]
pub(super) struct Closest {
    /// Interval between samples, in seconds.
    pub(super) step_s: f64,
    /// The pair of each sample; `None` if fewer than two fly.
    pub(super) pairs: Vec<Option<Pair>>,
}

/// Samples of a run, over the drones of all swarms, and their relays.
pub(super) fn closest(report: &Report, flight: &Flight) -> Closest {
    let swarms = report.swarms().zip(flight.swarms());
    let drones: Vec<_> = swarms
        .flat_map(|(report, flight)| report.drones.iter().zip(&flight.drones))
        .map(|(report, flown)| (report.id, flown))
        .collect();
    let relays = report.swarms().flat_map(|report| &report.relays);
    let relays: Vec<_> = relays
        .map(|it| (it.id, Ned::new(it.north_m, it.east_m, -it.altitude_m)))
        .collect();
    let end_s = report.simulated_s;
    let number = drones.len().max(1) as f64;
    let samples = SAMPLES_MAX.min(POSITIONS_MAX / number);
    let step_s = (end_s / samples).max(STEP_MIN_S);
    let mut pairs = Vec::new();
    let mut flying = Vec::new();
    let times = (0..).map(|sample| f64::from(sample) * step_s);
    for time_s in times.take_while(|time_s| *time_s <= end_s) {
        let at = Timestamp::from_secs_f64(time_s);
        flying.clear();
        flying.extend(
            drones
                .iter()
                .filter_map(|(id, drone)| Some((*id, place(drone, at)?))),
        );
        let nearest = nearest(&mut flying);
        let passed = flying.iter().flat_map(|(drone, place)| {
            relays
                .iter()
                .map(|(relay, at)| (place.distance_m(*at), *drone, *relay))
        });
        let found = nearest.into_iter().chain(passed);
        pairs.push(found.min_by(|(a_m, ..), (b_m, ..)| a_m.total_cmp(b_m)));
    }
    Closest { step_s, pairs }
}

/// Position of a drone that flies at this time.
fn place(drone: &FlightOfDrone, at: Timestamp) -> Option<Ned> {
    let (from, to) = (drone.track.first()?.0, drone.track.last()?.0);
    (from <= at && at <= to && from < to)
        .then(|| drone.position_at(at))
        .flatten()
}

/// The closest two, the lower id first; by a sweep along the longer side of their extent. Sorts the drones.
pub(super) fn nearest(flying: &mut [(u32, Ned)]) -> Option<Pair> {
    let spread = |axis: fn(Ned) -> f64| {
        let values = || flying.iter().map(|(_, place)| axis(*place));
        values().fold(f64::MIN, f64::max) - values().fold(f64::MAX, f64::min)
    };
    let axis: fn(Ned) -> f64 = if spread(Ned::north_m) > spread(Ned::east_m) {
        Ned::north_m
    } else {
        Ned::east_m
    };
    flying.sort_by(|(_, a), (_, b)| axis(*a).total_cmp(&axis(*b)));
    let mut best: Option<Pair> = None;
    for (index, (a, from)) in flying.iter().enumerate() {
        for (b, to) in &flying[index + 1..] {
            let least_m = best.map_or(f64::INFINITY, |(distance_m, ..)| distance_m);
            if axis(*to) - axis(*from) >= least_m {
                break;
            }
            let distance_m = from.distance_m(*to);
            if distance_m < least_m {
                best = Some((distance_m, *a.min(b), *a.max(b)));
            }
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::sample;

    #[test]
    fn sweep_finds_the_closest_pair() {
        let place = |north_m, east_m| Ned::new(north_m, east_m, -20.0);
        let mut flying = [
            (7, place(0.0, 0.0)),
            (1, place(100.0, 3.0)),
            (4, place(50.0, 0.0)),
            (2, place(100.0, -3.0)),
        ];
        assert_eq!(nearest(&mut flying), Some((6.0, 1, 2)));
        assert_eq!(nearest(&mut flying[..1]), None);
    }

    #[test]
    fn relay_that_a_drone_passes_is_in_the_closest_pair() {
        let (mut report, flight) = sample::swarm(5);
        let before = closest(&report, &flight);
        let middle = before.pairs.len() / 2;
        let at = Timestamp::from_secs_f64(before.step_s * middle as f64);
        let beside = place(&flight.drones[3], at).unwrap();
        report.relays = vec![sample::relay(9, beside + Ned::new(0.0, 2.0, 0.0))];
        let (distance_m, drone, relay) = closest(&report, &flight).pairs[middle].unwrap();
        assert!((distance_m - 2.0).abs() < 1e-6, "{distance_m}");
        assert_eq!((drone, relay), (3, 9));
    }

    #[test]
    fn drones_of_the_sample_are_a_slot_apart_on_legs() {
        let (report, flight) = sample::swarm(5);
        let closest = closest(&report, &flight);
        let (distance_m, a, b) = closest.pairs[closest.pairs.len() / 2].unwrap();
        assert!(
            (159.0..=161.0).contains(&distance_m) && b == a + 1,
            "{distance_m}"
        );
    }
}
