//! The idle timeout of connections.

use super::fleet::Fleet;
use super::{Addresses, until};

#[test]
fn connection_with_a_silent_drone_times_out() {
    let (fleet, addresses) = (Fleet::new(), Addresses::free());
    let mut one = addresses.open(&fleet, 0, &[1]);
    let mut other = addresses.open(&fleet, 1, &[0]);
    until("connected", &mut [&mut one, &mut other], |ends| {
        ends.iter().all(|end| end.connections().open == 1)
    });
    // The other end does not run any more.
    until("disconnected", &mut [&mut one], |ends| {
        ends[0].connections().open == 0
    });
    let refused = one.connections().refused;
    assert!(refused.is_empty(), "{refused:?}");
    // The other end continues, like a process after SIGCONT.
    until("connected again", &mut [&mut one, &mut other], |ends| {
        ends.iter().all(|end| end.connections().open == 1)
    });
}
