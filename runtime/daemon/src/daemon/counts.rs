use std::collections::BTreeMap;
use std::fmt::Display;

use muster_machines::identity::NodeId;
use muster_machines::radio::DropReason;
use muster_machines::time::Timestamp;
use muster_machines::wire::{self, PacketKind};

use super::network::Network;

/// What a drone's process has counted since its start, each in one place: for its log and for whoever asks.
#[derive(Debug, Default)]
pub(super) struct Counts {
    /// Frames that were sent, by what they carry.
    pub(super) sent: BTreeMap<PacketKind, Sent>,
    /// Frames that were let in, whether for the radio itself or for the routing.
    pub(super) admitted: u64,
    /// Those for the routing, by what they carry.
    pub(super) let_in: BTreeMap<PacketKind, u64>,
    /// Whose they were; members only.
    pub(super) heard: BTreeMap<NodeId, Heard>,
    /// Frames that the radio did not let in.
    pub(super) dropped: BTreeMap<DropReason, u64>,
    /// Frames that would not have got here over the scenario's radio.
    pub(super) out_of_range: u64,
    /// Frames for which the radio had no room or was not there.
    pub(super) no_room: u64,
    /// Frames that were let in and of no use to the routing.
    pub(super) ignored: u64,
    /// Orders that the mission could not read or not obey.
    pub(super) orders_refused: u64,
    /// Messages, no frames among them, for which an actor had no room or was not there.
    pub(super) refused: u64,
    /// Records that could not be written.
    pub(super) unwritten: u64,
}

/// Frames that were sent.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Sent {
    /// Because something had changed or was missed.
    pub(super) news: u64,
    /// Only because the time had come.
    pub(super) keep_alives: u64,
}

/// A drone that was heard.
#[derive(Debug, Clone, Copy)]
pub(super) struct Heard {
    pub(super) frames: u64,
    pub(super) last: Timestamp,
}

/// How much was sent and let in, in frames.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Talk {
    pub(super) news: u64,
    pub(super) keep_alives: u64,
    pub(super) let_in: u64,
}

impl Counts {
    pub(super) fn sent(&mut self, frame: &[u8], keep_alive: bool) {
        let payload = wire::decode_frame(frame).map_or(&[][..], |frame| frame.payload);
        let sent = self.sent.entry(PacketKind::of(payload)).or_default();
        if keep_alive {
            sent.keep_alives += 1;
        } else {
            sent.news += 1;
        }
    }

    pub(super) fn let_in(&mut self, now: Timestamp, sender: NodeId, payload: &[u8]) {
        *self.let_in.entry(PacketKind::of(payload)).or_default() += 1;
        let nothing = Heard {
            frames: 0,
            last: now,
        };
        let heard = self.heard.entry(sender).or_insert(nothing);
        heard.frames += 1;
        heard.last = now;
    }

    /// Those for the radio itself.
    pub(super) fn for_radio(&self) -> u64 {
        self.admitted.saturating_sub(self.let_in.values().sum())
    }

    pub(super) fn dropped(&mut self, reason: DropReason) {
        *self.dropped.entry(reason).or_default() += 1;
    }

    pub(super) fn talk(&self) -> Talk {
        Talk {
            news: self.sent.values().map(|sent| sent.news).sum(),
            keep_alives: self.sent.values().map(|sent| sent.keep_alives).sum(),
            let_in: self.let_in.values().sum(),
        }
    }

    /// Says all of it, with what the transport has counted, how often actors failed and how much of the log was lost.
    pub(super) fn report(&self, network: &Network, failures: u64, lines_lost: u64) {
        let transport = network.counters();
        // Nothing of it is said where there are no connections.
        let connections = network.connections();
        let connections = connections.as_ref();
        tracing::info!(
            sent = transport.sent,
            unsent = transport.unsent,
            received = transport.received,
            too_long = transport.too_long,
            overflowed = network.overflowed(),
            connections = connections.map(|it| it.open),
            connections_refused = connections.map(|it| in_words(&it.refused)),
            beacons_refused = connections.map(|it| it.beacons_refused),
            dropped = in_words(&self.dropped),
            out_of_range = self.out_of_range,
            no_room = self.no_room,
            ignored = self.ignored,
            refused = self.refused,
            failures,
            unwritten = self.unwritten,
            lines_lost,
            "counted"
        );
    }
}

fn in_words(counts: &BTreeMap<impl Display, u64>) -> String {
    let counts: Vec<_> = (counts.iter())
        .map(|(what, n)| format!("{what} {n}"))
        .collect();
    counts.join(", ")
}
