//! What takes time: silence that has to last.

use super::fleet::Fleet;
use super::{Places, until};

#[test]
fn a_connection_with_a_drone_that_fell_silent_goes() {
    let (fleet, places) = (Fleet::new(), Places::free());
    let mut one = places.open(&fleet, 0, &[1]);
    let mut other = places.open(&fleet, 1, &[0]);
    until("connected", &mut [&mut one, &mut other], |ends| {
        ends.iter().all(|end| end.connections().open == 1)
    });
    // Nobody runs the other end any more.
    until("gone", &mut [&mut one], |ends| {
        ends[0].connections().open == 0
    });
    let refused = one.connections().refused;
    assert!(refused.is_empty(), "it was not refused: {refused:?}");
    // A process that was stopped, and goes on.
    until("connected again", &mut [&mut one, &mut other], |ends| {
        ends.iter().all(|end| end.connections().open == 1)
    });
}
