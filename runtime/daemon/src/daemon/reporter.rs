//! Logs what is observed of a drone: in words for people, as JSON for programs.

use muster_machines::identity::NodeId;
use muster_machines::msp::FlightCommand;
use muster_machines::node::Observation;
use muster_machines::routing::{self, Routes};
use muster_machines::time::Timestamp;
use muster_machines::{mission, radio};
use serde::Serialize;

use super::counts::Traffic;

/// Writes a drone's observations to its log.
pub(super) struct Reporter {
    drone: u32,
    for_programs: bool,
    /// Totals when traffic was last logged.
    last: Traffic,
}

impl Reporter {
    pub(super) fn new(drone: NodeId, for_programs: bool) -> Self {
        Self {
            drone: drone.0,
            for_programs,
            last: Traffic::default(),
        }
    }

    /// Logs a flight-controller command, for programs only.
    pub(super) fn commanded(&self, now: Timestamp, command: &FlightCommand) {
        if self.for_programs {
            let (drone, at_ns) = (self.drone, now.as_nanos());
            tracing::info!(drone, at_ns, commanded = to_json(command), "commanded");
        }
    }

    /// Logs how many frames were sent and admitted since the last time, for programs only.
    pub(super) fn traffic(&mut self, now: Timestamp, traffic: Traffic) {
        let before = std::mem::replace(&mut self.last, traffic);
        if self.for_programs && traffic != before {
            let (drone, at_ns) = (self.drone, now.as_nanos());
            let news = traffic.news - before.news;
            let keep_alives = traffic.keep_alives - before.keep_alives;
            let let_in = traffic.let_in - before.let_in;
            tracing::info!(drone, at_ns, news, keep_alives, let_in, "talked");
        }
    }

    /// Logs an observation. Dropped and ignored frames are logged at debug level: an attacker could fill
    /// the disk with them.
    pub(super) fn observed(&self, now: Timestamp, seen: &Observation) {
        let (drone, at_ns) = (self.drone, now.as_nanos());
        let is_caused_by_peer = matches!(
            seen,
            Observation::Radio(radio::Event::Dropped(_))
                | Observation::Routing(routing::Event::Ignored(_))
        );
        match (self.for_programs, is_caused_by_peer) {
            (true, true) => tracing::debug!(drone, at_ns, seen = to_json(seen), "seen"),
            (true, false) => tracing::info!(drone, at_ns, seen = to_json(seen), "seen"),
            (false, true) => tracing::debug!(drone, "{}", describe(seen)),
            (false, false) => tracing::info!(drone, "{}", describe(seen)),
        }
    }
}

fn to_json(value: &impl Serialize) -> String {
    serde_json::to_string(value).expect("commands and observations have names and numbers only")
}

fn describe_route(routes: &Routes) -> String {
    let relays = if routes.relay {
        "; relays for others"
    } else {
        ""
    };
    match (routes.hops, routes.parent) {
        (Some(0), _) => format!("is the master{relays}"),
        (Some(1), _) => format!("is 1 hop from its master{relays}"),
        (Some(hops), Some(parent)) => {
            format!("is {hops} hops from its master, via drone {parent}{relays}")
        }
        (Some(hops), None) => format!("is {hops} hops from its master{relays}"),
        (None, _) => "has no route to a master".to_owned(),
    }
}

fn describe(seen: &Observation) -> String {
    match seen {
        Observation::Mission(mission::Event::State(state)) => state.to_string(),
        Observation::Mission(mission::Event::Follows(ballot)) => format!("follows ballot {ballot}"),
        Observation::Mission(mission::Event::Opened { waypoint }) => {
            format!("opens waypoint {waypoint}")
        }
        Observation::Mission(mission::Event::LeftOut(drone)) => {
            format!("flies without drone {drone}")
        }
        Observation::Mission(mission::Event::LeftLockstep) => {
            "flies out of lockstep, in its own altitude layer".to_owned()
        }
        Observation::Mission(mission::Event::Landing(reason)) => {
            format!("lands: {reason:?}")
        }
        Observation::Radio(radio::Event::Dropped(reason)) => format!("drops a frame: {reason}"),
        Observation::Radio(radio::Event::RevocationList { list }) => {
            format!("received revocation list {list} from another drone")
        }
        Observation::Routing(routing::Event::Routes(routes)) => describe_route(routes),
        Observation::Routing(routing::Event::Reached { member, via, .. }) if member == via => {
            format!("hears drone {member}")
        }
        Observation::Routing(routing::Event::Reached { member, via, .. }) => {
            format!("reaches drone {member} via drone {via}")
        }
        Observation::Routing(routing::Event::NeighbourStable(drone)) => {
            format!("has a stable link to drone {drone}")
        }
        Observation::Routing(routing::Event::Left) => "has left the swarm".to_owned(),
        Observation::Mission(event) => format!("{event:?}"),
        Observation::Routing(event) => format!("{event:?}"),
        Observation::Radio(event) => format!("{event:?}"),
        Observation::Navigation(event) => format!("{event:?}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn route_is_described_with_hops_and_parent() {
        let route = |hops, parent: Option<u32>, relay| {
            let routes = Routes {
                hops,
                parent: parent.map(NodeId),
                relay,
                ..Routes::default()
            };
            describe(&Observation::Routing(routing::Event::Routes(routes)))
        };
        assert_eq!(
            route(Some(0), None, true),
            "is the master; relays for others"
        );
        assert_eq!(route(Some(1), Some(2), false), "is 1 hop from its master");
        let expected = "is 3 hops from its master, via drone 4; relays for others";
        assert_eq!(route(Some(3), Some(4), true), expected);
        assert_eq!(route(None, None, false), "has no route to a master");
    }
}
