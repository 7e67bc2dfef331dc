//! The status of a drone's process, for `/status`, `/metrics` and `/health`.

use std::collections::BTreeMap;
use std::time::Duration;

use muster_machines::mission::{self, LandingReason};
use muster_machines::node::Address;
use muster_machines::time::Timestamp;
use muster_machines::wire::PacketKind;

use super::State;
use crate::status::{
    ActorStatus, Datagrams, Doing, Frames, Heard, LeaderEpoch, Sent, Status, VehicleStatus,
};

/// The drone is unhealthy if an actor takes longer than this for a message. On a busy machine it takes a tenth of it.
pub(in crate::daemon) const ANSWER_MAX: Duration = Duration::from_secs(2);

/// Names of the mission's states, for programs.
pub(in crate::daemon) const STATES: [&str; 15] = [
    "start",
    "set_up",
    "taking_off",
    "neighbour_discovery",
    "hop_update",
    "waypoint_reached",
    "moving_to_waypoint",
    "changing_formation",
    "following",
    "assembling",
    "moving_to_land",
    "landing",
    "finished",
    "on_task",
    "independent",
];

impl State {
    /// The drone's status.
    pub(in crate::daemon) fn status(&self, now: Timestamp) -> Status {
        let ballot = self.checkpoints().ballot();
        Status {
            drone: self.own.id.0,
            swarm: self.own.swarm.0,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            incarnation: self.checkpoints().boot(),
            up_s: now.since(self.clock.started()).as_secs_f64(),
            faults: self.faults(now),
            state: doing(self.checkpoints().state()),
            in_flight: !self.is_idle(),
            role: self.own.role(ballot),
            ballot: ballot.map(|ballot| LeaderEpoch {
                term: ballot.term,
                rank: ballot.rank,
                master: ballot.master.0,
            }),
            hops: self.monitor.routes.hops,
            parent: self.monitor.routes.parent.map(|id| id.0),
            proven: self.monitor.counts.proven.iter().map(|id| id.0).collect(),
            heard: self.heard(now),
            vehicle: self.vehicle(now),
            port: self.vehicle.port(),
            actors: self.actor_status(),
            agent: self.monitor.agent_status(),
            frames: self.frames(),
            datagrams: self.datagrams(),
            messages_refused: self.actors.refused.messages,
            journal_unwritten: self.durable.failures,
            log_lines_lost: self.monitor.lines_lost(),
            computer: self.monitor.computer.status(),
        }
    }

    /// Why the drone is unhealthy. Empty if all five actors run and answer and the journal is written.
    pub(in crate::daemon) fn faults(&self, now: Timestamp) -> Vec<String> {
        let mut faults = Vec::new();
        if self.outcome.gave_up() {
            faults.push("an actor failed too often: the drone lands".to_owned());
        }
        for address in Address::ALL {
            let seat = self.actors.seat(address);
            let waiting = seat.waiting_for(now);
            if !seat.is_up {
                faults.push(format!("the {address} actor does not run"));
            } else if waiting > ANSWER_MAX {
                let seconds = waiting.as_secs_f64();
                faults.push(format!(
                    "the {address} actor has not answered for {seconds:.1} s"
                ));
            }
        }
        for finding in self.vehicle.refused() {
            faults.push(format!(
                "the flight controller is not fit to fly: {finding}"
            ));
        }
        if let Some(refusal) = self.vehicle.ungranted() {
            faults.push(format!("the stage falls to bench: {refusal}"));
        }
        if self.durable.failures > 0 {
            faults.push("the journal can't be written: the drone lands".to_owned());
        } else if self.outcome.landing() == Some(LandingReason::JournalLost) {
            faults.push("the journal has no valid state of the flight: the drone lands".to_owned());
        }
        faults
    }

    /// Drones heard since the start.
    fn heard(&self, now: Timestamp) -> BTreeMap<u32, Heard> {
        let heard = self.monitor.counts.heard.iter().map(|(id, heard)| {
            let heard = Heard {
                frames: heard.frames,
                silent_s: now.since(heard.last).as_secs_f64(),
            };
            (id.0, heard)
        });
        heard.collect()
    }

    fn vehicle(&self, now: Timestamp) -> VehicleStatus {
        let telemetry = self.vehicle.telemetry(now);
        VehicleStatus {
            north_m: telemetry.position.north_m(),
            east_m: telemetry.position.east_m(),
            altitude_m: telemetry.position.altitude_m(),
            position_lost_s: telemetry.position_lost_for.map(|it| it.as_secs_f64()),
            charge: telemetry.charge,
            armed: telemetry.armed,
        }
    }

    fn actor_status(&self) -> BTreeMap<String, ActorStatus> {
        let book = self.actors.book();
        let number = |len: Option<usize>| u32::try_from(len.unwrap_or(0)).unwrap_or(u32::MAX);
        let actors = Address::ALL.into_iter().map(|address| {
            let seat = self.actors.seat(address);
            let actor = ActorStatus {
                up: seat.is_up,
                waiting: number(book.and_then(|book| book.waiting(address))),
                waiting_max: number(book.map(muster_actors::AddressBook::waiting_max)),
                failures: seat.failures,
                restarts: seat.restarts(),
                overdue: seat.overdue,
            };
            (address.to_string(), actor)
        });
        actors.collect()
    }

    fn frames(&self) -> Frames {
        let counts = &self.monitor.counts;
        let sent = counts.sent.iter().map(|(kind, sent)| {
            let sent = Sent {
                news: sent.news,
                keep_alives: sent.keep_alives,
            };
            (kind.to_string(), sent)
        });
        let accepted = counts.admitted_by_kind.iter().map(|(kind, n)| (*kind, *n));
        let accepted = accepted.chain([(PacketKind::Radio, counts.for_radio())]);
        let by_radio = counts.dropped.iter();
        let by_radio = by_radio.map(|(why, n)| (why.to_string().replace(' ', "_"), *n));
        let before_radio = [
            ("out_of_range".to_owned(), self.link.out_of_range),
            ("no_room".to_owned(), self.actors.refused.frames),
        ];
        Frames {
            sent: sent.collect(),
            let_in: accepted.map(|(kind, n)| (kind.to_string(), n)).collect(),
            dropped: by_radio.chain(before_radio).collect(),
            ignored: counts.ignored,
            orders_refused: counts.orders_refused,
        }
    }

    fn datagrams(&self) -> Datagrams {
        let counters = self.link.network.counters();
        Datagrams {
            sent: counters.sent,
            unsent: counters.unsent,
            received: counters.received,
            too_long: counters.too_long,
            overflowed: self.link.network.overflowed(),
        }
    }
}

fn doing(state: mission::State) -> Doing {
    use mission::State as Is;
    let (index, waypoint) = match state {
        Is::Start => (0, None),
        Is::SetUp => (1, None),
        Is::TakingOff => (2, None),
        Is::NeighbourDiscovery => (3, None),
        Is::HopUpdate => (4, None),
        Is::WaypointReached { waypoint } => (5, Some(waypoint)),
        Is::MovingToWaypoint { waypoint } => (6, Some(waypoint)),
        Is::ChangingFormation { .. } => (7, None),
        Is::Following => (8, None),
        Is::Assembling => (9, None),
        Is::MovingToLand => (10, None),
        Is::Landing => (11, None),
        Is::Finished => (12, None),
        Is::OnTask => (13, None),
        Is::Independent => (14, None),
    };
    Doing {
        name: STATES[index].to_owned(),
        words: state.to_string(),
        waypoint,
    }
}
