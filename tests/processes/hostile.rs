//! A short attack; `cargo bench --bench hostile` runs a long one.

use std::time::Duration;

use super::attack::{self, Attack};

#[test]
fn hostile_frames_are_counted_and_genuine_frames_get_through() {
    let outcome = attack::fly(Attack {
        volleys: 50,
        datagrams: 1_000,
        pause: Duration::from_millis(100),
    });
    assert_eq!(outcome.hostile(), 50_000);
    assert!(
        outcome.duration < Duration::from_secs(20),
        "the attack is too slow"
    );
    assert!(outcome.is_balanced(), "{outcome:#?}");
    assert!(outcome.let_in <= *outcome.genuine.end(), "{outcome:#?}");
    assert!(outcome.delivery[1] >= 0.9, "{outcome:#?}");
    for reason in [
        "too_long",
        "other_version",
        "other_swarm",
        "stranger",
        "replayed",
    ] {
        assert!(outcome.counted[reason] > 0, "{reason}: {outcome:#?}");
    }
    let [before, most] = outcome.memory_kib;
    assert!(most < before + 4_096, "{outcome:#?}");
    assert_eq!(outcome.orders_refused, 0);
    assert_eq!(outcome.exit_codes, [Some(0); 5], "{outcome:#?}");
    for ballots in &outcome.ballots {
        assert_eq!(ballots.len(), 1, "{outcome:#?}");
        assert_eq!(ballots[0]["term"], 1);
    }
}
