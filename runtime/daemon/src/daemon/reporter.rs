//! Says what becomes of a drone in its log: to people in words, to programs each in a form that can be read again.

use muster_machines::identity::NodeId;
use muster_machines::msp::FlightCommand;
use muster_machines::node::Observation;
use muster_machines::routing::{self, Routes};
use muster_machines::time::Timestamp;
use muster_machines::{mission, radio};
use serde::Serialize;

use super::counts::Talk;

/// Who says what becomes of a drone.
pub(super) struct Reporter {
    drone: u32,
    for_programs: bool,
    /// What was last said of how much was sent and let in.
    talk: Talk,
}

impl Reporter {
    pub(super) fn new(drone: NodeId, for_programs: bool) -> Self {
        Self {
            drone: drone.0,
            for_programs,
            talk: Talk::default(),
        }
    }

    /// Its vehicle was told something, which is for programs.
    pub(super) fn commanded(&self, now: Timestamp, command: &FlightCommand) {
        if self.for_programs {
            let (drone, at_ns) = (self.drone, now.as_nanos());
            tracing::info!(drone, at_ns, commanded = in_json(command), "commanded");
        }
    }

    /// So much was sent and let in until now; what of it is new is for programs.
    pub(super) fn talked(&mut self, now: Timestamp, talk: Talk) {
        let before = std::mem::replace(&mut self.talk, talk);
        if self.for_programs && talk != before {
            let (drone, at_ns) = (self.drone, now.as_nanos());
            let news = talk.news - before.news;
            let keep_alives = talk.keep_alives - before.keep_alives;
            let let_in = talk.let_in - before.let_in;
            tracing::info!(drone, at_ns, news, keep_alives, let_in, "talked");
        }
    }

    /// Something was seen of it: what a peer sent that was not let in is only for those who want to know it all, for peers
    /// could fill a disk with it.
    pub(super) fn saw(&self, now: Timestamp, seen: &Observation) {
        let (drone, at_ns) = (self.drone, now.as_nanos());
        let is_of_peers = matches!(
            seen,
            Observation::Radio(radio::Event::Dropped(_))
                | Observation::Routing(routing::Event::Ignored(_))
        );
        match (self.for_programs, is_of_peers) {
            (true, true) => tracing::debug!(drone, at_ns, seen = in_json(seen), "seen"),
            (true, false) => tracing::info!(drone, at_ns, seen = in_json(seen), "seen"),
            (false, true) => tracing::debug!(drone, "{}", in_words(seen)),
            (false, false) => tracing::info!(drone, "{}", in_words(seen)),
        }
    }
}

fn in_json(said: &impl Serialize) -> String {
    serde_json::to_string(said).expect("what is said has names and numbers only")
}

/// A drone's way to its master.
fn in_words_of_way(routes: &Routes) -> String {
    let relays = if routes.relay {
        ", and relays for others"
    } else {
        ""
    };
    match (routes.hops, routes.parent) {
        (Some(0), _) => format!("is the master{relays}"),
        (Some(1), _) => format!("hears its master{relays}"),
        (Some(hops), Some(by)) => format!("is {hops} hops from its master, by drone {by}{relays}"),
        (Some(hops), None) => format!("is {hops} hops from its master{relays}"),
        (None, _) => "knows no way to a master".to_owned(),
    }
}

fn in_words(seen: &Observation) -> String {
    match seen {
        Observation::Mission(mission::Event::State(state)) => state.to_string(),
        Observation::Mission(mission::Event::Obeys(ballot)) => format!("obeys {ballot}"),
        Observation::Mission(mission::Event::Opened { waypoint }) => {
            format!("opens waypoint {waypoint}")
        }
        Observation::Mission(mission::Event::LeftOut(drone)) => {
            format!("flies without drone {drone}")
        }
        Observation::Mission(mission::Event::Landing(reason)) => {
            format!("comes down: {reason:?}")
        }
        Observation::Radio(radio::Event::Dropped(reason)) => format!("drops a frame: {reason}"),
        Observation::Radio(radio::Event::RevocationList { list }) => {
            format!("list {list} of the revoked was passed on to this drone")
        }
        Observation::Routing(routing::Event::Routes(routes)) => in_words_of_way(routes),
        Observation::Routing(routing::Event::Reached { member, via, .. }) if member == via => {
            format!("hears drone {member}")
        }
        Observation::Routing(routing::Event::Reached { member, via, .. }) => {
            format!("hears of drone {member} by drone {via}")
        }
        Observation::Routing(routing::Event::NeighbourStable(drone)) => {
            format!("has drone {drone} for a neighbour")
        }
        Observation::Mission(event) => format!("{event:?}"),
        Observation::Routing(event) => format!("{event:?}"),
        Observation::Radio(event) => format!("{event:?}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn people_are_told_the_way_to_the_master_in_words() {
        let way = |hops, parent: Option<u32>, relay| {
            let routes = Routes {
                hops,
                parent: parent.map(NodeId),
                relay,
                ..Routes::default()
            };
            in_words(&Observation::Routing(routing::Event::Routes(routes)))
        };
        assert_eq!(
            way(Some(0), None, true),
            "is the master, and relays for others"
        );
        assert_eq!(way(Some(1), Some(2), false), "hears its master");
        let by = "is 3 hops from its master, by drone 4, and relays for others";
        assert_eq!(way(Some(3), Some(4), true), by);
        assert_eq!(way(None, None, false), "knows no way to a master");
    }
}
