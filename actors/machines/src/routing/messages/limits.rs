//! Limits of the messages. Each has a policy for what exceeds it, in `docs/src/how/messages.md`.

use std::time::Duration;

use crate::radio::Budget;

/// Most own messages that wait or are not acknowledged yet.
pub const QUEUE_MAX: usize = 64;
/// Most bytes of own messages that wait or are not acknowledged yet.
pub const QUEUE_BYTES_MAX: usize = 2 << 20;

/// Frames that a drone starts for its own messages: pieces and repeated messages count, frames repeated at a hop and
/// receipts do not. 40 full frames a second are 48 kB/s, a twelfth of the air at 6 Mb/s.
pub const ORIGIN_BUDGET: Budget = Budget {
    interval: Duration::from_millis(25),
    burst: 20,
};
/// Frames of one origin that a drone accepts: twice the origin's budget, because other drones hold frames back and
/// release them together.
pub const FORWARD_BUDGET: Budget = Budget {
    interval: Duration::from_micros(12_500),
    burst: 40,
};
/// Frames that a drone sends in all before a message may follow. It is as much as policy `tree` allows itself, so both
/// together stay below what a radio admits: 64 frames, then one each 5 ms.
pub const SEND_BUDGET: Budget = Budget {
    interval: Duration::from_millis(6),
    burst: 20,
};
/// Tokens of [`SEND_BUDGET`] that pieces leave for other frames.
pub(super) const RESERVED_FROM_PIECES: u32 = 10;

/// Most frames of all origins that wait at a drone or are not accepted by the next hop yet.
pub const FORWARD_MAX: usize = 256;
/// Most such frames of one origin. The hop before keeps further ones.
pub const FORWARD_EACH_MAX: usize = 16;
/// Most frames at a time that one neighbour has not accepted yet.
pub(super) const HOP_WINDOW: usize = 16;
/// Most neighbours that a broadcast asks to accept it. Repetitions ask the others.
pub(super) const AWAITED_MAX: usize = 16;

/// Drones whose numbers are remembered. If there are more, one that was silent for a minute is forgotten, and
/// without such a one the new drone is ignored.
pub const NODES_MAX: usize = 1_024;
/// Longer than any frame lives.
pub(super) const FORGET_AFTER: Duration = Duration::from_secs(60);
/// Messages in pieces that a drone receives at a time, one from each origin.
pub const REASSEMBLIES_MAX: usize = 8;
/// A message in pieces is forgotten after this time without a new piece.
pub const REASSEMBLY_TIMEOUT: Duration = Duration::from_secs(30);
/// A reassembly without a new piece for this time makes room for another origin's.
pub(super) const REASSEMBLY_IDLE: Duration = Duration::from_secs(5);

/// Time after which a best-effort message is given up.
pub const BEST_EFFORT_LIFETIME: Duration = Duration::from_secs(5);
/// Time after which a message to be acknowledged is given up; one in pieces after this time without progress.
pub const ACKNOWLEDGED_LIFETIME: Duration = Duration::from_secs(30);
/// Time after which a message in pieces is given up in any case.
pub const TRANSFER_LIFETIME: Duration = Duration::from_secs(600);
/// Lifetime of one try of a message to be acknowledged.
pub(super) const TRY_LIFETIME: Duration = Duration::from_secs(3);
/// Longest lifetime that is believed of a frame of another drone.
pub(super) const FRAME_LIFETIME_MAX: Duration = BEST_EFFORT_LIFETIME;
/// First wait of an origin for the receiver's acknowledgement; doubled with each try.
pub(super) const RETRY_MIN: Duration = Duration::from_millis(400);
/// Longest such wait.
pub(super) const RETRY_MAX: Duration = Duration::from_secs(4);
/// Most pieces under way.
pub(super) const PIECES_WINDOW: u32 = 32;

/// A drone collects what it has accepted for this time.
pub(super) const ACCEPT_DELAY: Duration = Duration::from_millis(3);
/// A receiver collects whole messages for this time before it acknowledges them.
pub(super) const RECEIPT_DELAY: Duration = Duration::from_millis(20);
/// A receiver collects pieces for this time, unless they are as many as [`PIECES_A_RECEIPT`].
pub(super) const PROGRESS_DELAY: Duration = Duration::from_millis(60);
/// Number of pieces that a receiver acknowledges at once.
pub(super) const PIECES_A_RECEIPT: u32 = 8;

/// Longest wait before a frame is repeated at its hop.
pub(super) const REPAIR_MAX: Duration = Duration::from_millis(200);
/// Wait before a frame is repeated of which the medium reports that it was lost.
pub(super) const LOST_DELAY: Duration = Duration::from_millis(2);
/// Wait before a frame is repeated that the medium has delivered but the neighbour has not accepted; longer with each
/// try.
pub(super) const DELIVERED_WAIT: Duration = Duration::from_millis(120);
/// Longest such wait.
pub(super) const DELIVERED_WAIT_MAX: Duration = Duration::from_millis(500);
/// Tries in vain at one neighbour, after which another next hop is taken if there is one.
pub(super) const TRIES_MAX: u32 = 4;
/// Broadcasts are repeated this often at most.
pub(super) const BROADCAST_TRIES_MAX: u32 = 8;
/// Wait for a next hop, before the routes are asked again.
pub(super) const ROUTE_WAIT: Duration = Duration::from_millis(50);
/// A frame without a next hop for this time is passed on by all drones.
pub(super) const FLOOD_AFTER: Duration = Duration::from_millis(300);
/// A learned route is used for this time.
pub(super) const ROUTE_LIFETIME: Duration = Duration::from_secs(10);
/// A neighbour counts as heard for this time after a message frame of it.
pub(super) const HEARD_FOR: Duration = Duration::from_secs(5);
/// Time slot of a frame that several drones pass on at once: each draws its own delay up to this.
pub(super) const FLOOD_JITTER: Duration = Duration::from_millis(3);
/// Longest time until the medium reports the delivery of a unicast.
pub(super) const DELIVERY_REPORT_MAX: Duration = Duration::from_millis(60);
