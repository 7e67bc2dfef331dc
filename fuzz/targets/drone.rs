//! A drone that hears anything at all at any time: its machines never panic, never talk for ever, and their tables stay
//! within their limits.

use muster_fuzz::{Drone, ops, scenarios};
use muster_machines::identity::NodeId;

pub(crate) fn run(bytes: &[u8]) {
    let [which, id, bytes @ ..] = bytes else {
        return;
    };
    let all = scenarios();
    let scenario = &all[usize::from(*which) % all.len()];
    let id = u32::from(*id) % scenario.plan.nodes();
    let mut drone = Drone::new(scenario, NodeId(id), *which >= 128);
    ops(bytes).for_each(|op| drone.happen(op));
}
