use std::collections::BTreeMap;

use muster_machines::radio::DropReason;
use muster_transport::udp::Counters;

/// What a drone's process has counted, for its log.
#[derive(Debug, Default)]
pub(super) struct Counts {
    /// Frames that the radio did not let in.
    pub(super) dropped: BTreeMap<DropReason, u64>,
    /// Frames that would not have got here over the scenario's radio.
    pub(super) out_of_range: u64,
    /// Messages, frames among them, for which an actor had no room or was not there.
    pub(super) refused: u64,
    /// Actors that failed.
    pub(super) failures: u64,
    /// Records that could not be written.
    pub(super) unwritten: u64,
}

impl Counts {
    pub(super) fn dropped(&mut self, reason: DropReason) {
        *self.dropped.entry(reason).or_default() += 1;
    }

    /// Says all of it, with what the transport has counted.
    pub(super) fn report(&self, transport: Counters, overflowed: Option<u64>) {
        let dropped: Vec<_> = self
            .dropped
            .iter()
            .map(|(why, n)| format!("{why} {n}"))
            .collect();
        tracing::info!(
            sent = transport.sent,
            unsent = transport.unsent,
            received = transport.received,
            too_long = transport.too_long,
            overflowed,
            dropped = dropped.join(", "),
            out_of_range = self.out_of_range,
            refused = self.refused,
            failures = self.failures,
            unwritten = self.unwritten,
            "counted"
        );
    }
}
