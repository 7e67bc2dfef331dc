//! Formation error of drones that follow the master.

use std::time::Duration;

use muster_machines::formation::Layout;
use muster_machines::geometry::Ned;
use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;

use super::FormationError;
use super::figures::count;
use crate::scenario::Scenario;
use crate::world::{Record, SwarmOutcome};
use muster_runtime::vehicle::Vehicle;

/// Sampling period of the formation error.
const SAMPLE_EVERY: Duration = Duration::from_millis(100);

/// Each drone's distances from its slot while following, in metres; empty for the master and for drones that don't follow.
pub(super) fn distances_m(
    scenario: &Scenario,
    flown: &SwarmOutcome,
    ended: Timestamp,
) -> Vec<Vec<f64>> {
    let layout = scenario
        .plan
        .changes
        .last()
        .map_or(&*scenario.plan.layout, |change| change.layout());
    let drones = || {
        let records = flown.recorder.drones().map(|(_, record)| record);
        (0..).map(NodeId).zip(records.zip(&flown.vehicles))
    };
    let centre = layout.formation().centre();
    let master = drones().find(|(id, _)| *id == centre);
    let of_drone = |(id, drone)| match master {
        Some((centre, master)) if centre != id => {
            drone_distances_m((id, drone), master, layout, ended)
        }
        _ => Vec::new(),
    };
    drones().map(of_drone).collect()
}

fn drone_distances_m(
    (id, (record, vehicle)): (NodeId, (&Record, &Vehicle)),
    (masters_record, masters_vehicle): (&Record, &Vehicle),
    layout: &Layout,
    ended: Timestamp,
) -> Vec<f64> {
    let (Some(own), Some(masters)) = (record.following(ended), masters_record.following(ended))
    else {
        return Vec::new();
    };
    let until = own.end.min(masters.end);
    std::iter::successors(Some(own.start), |at| Some(*at + SAMPLE_EVERY))
        .take_while(|at| *at < until)
        .map(|at| {
            let slot: Ned = layout.slot(id, masters_vehicle.motion().position(at));
            slot.distance_m(vehicle.motion().position(at))
        })
        .collect()
}

/// Summary of the distances; `None` if there are none.
pub(super) fn error(mut distances_m: Vec<f64>) -> Option<FormationError> {
    distances_m.sort_by(f64::total_cmp);
    let number = distances_m.len();
    let max_m = *distances_m.last()?;
    // Nearest-rank percentile.
    let p95_m = distances_m[(number * 95).div_ceil(100) - 1];
    let number = count(number as u64);
    Some(FormationError {
        followed_s: number * SAMPLE_EVERY.as_secs_f64(),
        mean_m: distances_m.iter().sum::<f64>() / number,
        p95_m,
        max_m,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ninety_five_of_a_hundred_are_within_the_95th_percentile() {
        let error = error((1..=100).rev().map(f64::from).collect()).unwrap();
        assert_eq!((error.p95_m, error.max_m), (95.0, 100.0));
        assert_eq!((error.mean_m, error.followed_s), (50.5, 10.0));
        let one = super::error(vec![2.0]);
        assert_eq!(one.map(|error| error.p95_m), Some(2.0));
        assert_eq!(super::error(Vec::new()), None);
    }
}
