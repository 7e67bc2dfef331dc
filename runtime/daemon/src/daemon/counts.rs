//! Counters of a drone's process.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Display;

use muster_machines::identity::NodeId;
use muster_machines::radio::DropReason;
use muster_machines::time::Timestamp;
use muster_machines::wire::{self, PacketKind};

use super::actors::Actors;
use super::radio_link::RadioLink;

/// Counters of a drone's process since its start, for its log, `/metrics` and `/status`.
#[derive(Debug, Default)]
pub(super) struct Counts {
    /// Sent frames, by kind of packet.
    pub(super) sent: BTreeMap<PacketKind, Sent>,
    /// Frames that the radio admitted, for itself or for the routing.
    pub(super) admitted: u64,
    /// Senders of admitted frames: each has signed this process's nonce.
    pub(super) proven: BTreeSet<NodeId>,
    /// Admitted frames for the routing, by kind of packet.
    pub(super) admitted_by_kind: BTreeMap<PacketKind, u64>,
    /// Senders of admitted frames; members only.
    pub(super) heard: BTreeMap<NodeId, Heard>,
    /// Frames that the radio did not admit, by reason.
    pub(super) dropped: BTreeMap<DropReason, u64>,
    /// Admitted frames that the routing ignored.
    pub(super) ignored: u64,
    /// Orders that the mission could not read or execute.
    pub(super) orders_refused: u64,
}

/// Sent frames.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Sent {
    /// Sent because of a change or a repair.
    pub(super) news: u64,
    /// Sent only because a period had passed.
    pub(super) keep_alives: u64,
}

/// Admitted frames of one sender.
#[derive(Debug, Clone, Copy)]
pub(super) struct Heard {
    pub(super) frames: u64,
    /// When the last one was received.
    pub(super) last: Timestamp,
}

/// Frames that were sent and admitted.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Traffic {
    pub(super) news: u64,
    pub(super) keep_alives: u64,
    pub(super) let_in: u64,
}

impl Counts {
    /// Counts a sent frame.
    pub(super) fn sent(&mut self, frame: &[u8], keep_alive: bool) {
        let payload = wire::decode_frame(frame).map_or(&[][..], |frame| frame.payload);
        let sent = self.sent.entry(PacketKind::of(payload)).or_default();
        if keep_alive {
            sent.keep_alives += 1;
        } else {
            sent.news += 1;
        }
    }

    /// Counts an admitted frame for the routing.
    pub(super) fn admitted_for_routing(&mut self, now: Timestamp, sender: NodeId, payload: &[u8]) {
        *self
            .admitted_by_kind
            .entry(PacketKind::of(payload))
            .or_default() += 1;
        let first = Heard {
            frames: 0,
            last: now,
        };
        let heard = self.heard.entry(sender).or_insert(first);
        heard.frames += 1;
        heard.last = now;
    }

    /// Admitted frames for the radio itself.
    pub(super) fn for_radio(&self) -> u64 {
        self.admitted
            .saturating_sub(self.admitted_by_kind.values().sum())
    }

    /// Counts a frame that the radio did not admit.
    pub(super) fn dropped(&mut self, reason: DropReason) {
        *self.dropped.entry(reason).or_default() += 1;
    }

    /// Totals of sent and admitted frames.
    pub(super) fn traffic(&self) -> Traffic {
        Traffic {
            news: self.sent.values().map(|sent| sent.news).sum(),
            keep_alives: self.sent.values().map(|sent| sent.keep_alives).sum(),
            let_in: self.admitted_by_kind.values().sum(),
        }
    }

    /// Logs all counters of the process.
    pub(super) fn report(
        &self,
        link: &RadioLink,
        actors: &Actors,
        unwritten: u64,
        lines_lost: u64,
    ) {
        let network = &link.network;
        let transport = network.counters();
        // `None` without connections, as over UDP.
        let connections = network.connections();
        let connections = connections.as_ref();
        tracing::info!(
            sent = transport.sent,
            unsent = transport.unsent,
            received = transport.received,
            too_long = transport.too_long,
            overflowed = network.overflowed(),
            connections = connections.map(|it| it.open),
            connections_refused = connections.map(|it| list(&it.refused)),
            beacons_refused = connections.map(|it| it.beacons_refused),
            dropped = list(&self.dropped),
            out_of_range = link.out_of_range,
            no_room = actors.refused.frames,
            ignored = self.ignored,
            refused = actors.refused.messages,
            failures = actors.failures(),
            late_ms_max = actors.late_max().as_secs_f64() * 1e3,
            unwritten,
            lines_lost,
            "counted"
        );
    }
}

fn list(counts: &BTreeMap<impl Display, u64>) -> String {
    let counts: Vec<_> = (counts.iter())
        .map(|(what, n)| format!("{what} {n}"))
        .collect();
    counts.join(", ")
}
