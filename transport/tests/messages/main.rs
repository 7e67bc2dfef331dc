//! Messages over the simulated medium keep their promises: latency, delivery, large ones, and fairness.

mod figures;
mod swarm;

use std::time::Duration;

use muster_machines::routing::Reliability;

use crate::figures::{beside, large, latency};
use crate::swarm::{fading, lossy, unreported};

#[test]
fn message_of_the_farthest_of_15_takes_10_ms_and_8_ms_a_hop() {
    for hops in [7, 14] {
        let it = latency(fading(3.0), hops, Reliability::Acknowledged, 300, 2);
        assert!(
            it.median <= Duration::from_millis(10 + 8 * u64::from(hops)),
            "{it:?}"
        );
        assert!(it.acknowledged >= 0.999 && it.arrived >= 0.999, "{it:?}");
        assert_eq!((it.twice, it.over_budget), (0, 0));
        // There and back, each hop once and once accepted, and a heartbeat of each drone in each ten.
        assert!(it.frames < 300 * (4 * hops as usize + 3), "{it:?}");
    }
}

#[test]
fn best_effort_is_repaired_at_each_hop() {
    for config in [fading(1.0), unreported(0.2)] {
        let it = latency(config, 7, Reliability::BestEffort, 300, 3);
        assert!(it.arrived >= 0.99, "{it:?}");
        assert!(
            it.p99 <= it.longest && it.longest < Duration::from_secs(1),
            "{it:?}"
        );
        assert_eq!((it.twice, it.over_budget), (0, 0));
    }
}

#[test]
fn megabyte_arrives_whole_over_3_hops_at_20_percent_loss_and_more() {
    for config in [lossy(0.2), lossy(0.3), unreported(0.2)] {
        let it = large(config, 3, 1_000_000, 4);
        assert!(it.is_acknowledged, "{it:?}");
        assert!(
            it.took.is_some_and(|took| took < Duration::from_secs(40)),
            "{it:?}"
        );
        // Three hops, a fifth of the frames twice, headers, signatures and acknowledgements.
        assert!(it.bytes_a_byte < 6.5, "{it:?}");
        assert_eq!(it.over_budget, 0);
    }
}

#[test]
fn sender_at_ten_times_its_budget_costs_no_one_else_a_message() {
    for config in [fading(3.0), unreported(0.2)] {
        let (alone, beside) = (beside(config, false, 5), beside(config, true, 5));
        assert_eq!((alone.arrived, beside.arrived), (alone.sent, beside.sent));
        assert!(beside.median < alone.median * 2, "{alone:?} {beside:?}");
        assert!((35.0..=45.0).contains(&beside.greedy_hz), "{beside:?}");
        assert_eq!(beside.over_budget, 0);
    }
}
