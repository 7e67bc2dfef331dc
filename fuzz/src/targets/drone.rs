//! A drone that receives any bytes at any time: its machines never panic, never exchange messages without end, and their
//! tables stay within their limits.

use crate::{Drone, decode_ops, scenarios};
use muster_machines::identity::NodeId;

pub(super) fn run(bytes: &[u8]) {
    let [selector, id, bytes @ ..] = bytes else {
        return;
    };
    let all = scenarios();
    let scenario = &all[usize::from(*selector) % all.len()];
    let id = u32::from(*id) % scenario.plan.nodes();
    let mut drone = Drone::new(scenario, NodeId(id), *selector >= 128);
    decode_ops(bytes).for_each(|op| drone.apply(op));
}
