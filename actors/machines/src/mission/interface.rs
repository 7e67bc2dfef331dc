//! Inputs and outputs of a mission.

use bytes::Bytes;
use serde::{Deserialize, Serialize};

use super::{Checkpoint, State};
use crate::agent;
use crate::identity::{Ballot, NodeId};
use crate::navigation::{Goal, Notice as NavigationNotice};
use crate::routing::{Notice as RoutingNotice, Outgoing};

/// Inputs of a mission.
#[derive(Debug, Clone, PartialEq)]
pub enum Input {
    /// From the operator, to the drone at the centre slot: lead the swarm along its mission.
    Fly,
    /// From the operator, to a followed master: stop, assemble the swarm and land.
    Land,
    /// From the routing.
    Routing(RoutingNotice),
    /// From the navigation.
    Navigation(NavigationNotice),
    /// From the supervisor: an actor keeps failing, so the drone lands.
    GiveUp,
    /// From the drone's process: land on the spot, or stay on the ground.
    Abort(LandingReason),
}

/// Outputs of a mission to other machines.
#[derive(Debug, Clone, PartialEq)]
pub enum Transmit {
    /// To the routing: this drone is the master.
    Lead(Ballot),
    /// To the routing, as master: a new order.
    Publish {
        /// The master's own ballot.
        ballot: Ballot,
        /// Sequence number of the order.
        sequence: u32,
        /// The order, encoded.
        order: Bytes,
    },
    /// To the routing: this drone has executed this order and all before it.
    Acknowledge {
        /// The ballot of the master that issued the order.
        ballot: Ballot,
        /// Sequence number of the order.
        sequence: u32,
    },
    /// To the routing, as master: start neighbour discovery.
    Discover,
    /// To the routing: links may change, as drones change places.
    TopologyChanges,
    /// To the routing: this drone leaves the swarm.
    Leave,
    /// To the routing: this drone is going to land.
    Land,
    /// To the routing: this drone has landed; stop.
    Stop,
    /// To the routing: repeat the current leader, the newest order and the state of the routes.
    Resync,
    /// To the routing: send these messages.
    Messages(Vec<Outgoing>),
    /// To the navigation: the new goal.
    Goal(Goal),
    /// To the navigation: report position and velocity.
    Locate,
}

/// Why a drone lands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum LandingReason {
    /// The mission is over.
    MissionOver,
    /// The master is silent.
    MasterSilent,
    /// The drone was not in its slot when the swarm moved on.
    Late,
    /// A leg took longer than its limit.
    Overdue,
    /// An actor of the drone kept failing.
    ActorGivenUp,
    /// The drone's process restarted on the ground. The drone stays there.
    Restarted,
    /// The flight controller landed without a command.
    Controller,
    /// No other drone was heard for the time to live.
    Alone,
    /// The drone was about to leave the geofence.
    Geofence,
    /// The battery was low.
    BatteryLow,
    /// The position was unknown.
    PositionLost,
    /// The battery was almost empty.
    BatteryCritical,
    /// The flight time was used up.
    FlightTime,
    /// The drone's process was told to land it.
    Recalled,
    /// The journal could not be written or read.
    JournalLost,
    /// The process could not receive any more.
    NetworkLost,
    /// The pilot took the aircraft over.
    TakenOver,
    /// The aircraft leant too far.
    Tilt,
    /// The throttle had no effect.
    Thrust,
    /// A motor was at its limit, or all of them trembled.
    Motors,
    /// The voltage under load was too low.
    Volts,
}

/// Observable outputs of a mission.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Event {
    /// The drone entered this state.
    State(State),
    /// The drone follows another leader, perhaps itself.
    Follows(Ballot),
    /// As master: opened a waypoint.
    Opened {
        /// Number of the waypoint, from 0.
        waypoint: u16,
    },
    /// As master: does not wait for this member any more.
    LeftOut(NodeId),
    /// The drone was given its first goal out of lockstep with the others since its mission started, or started again.
    LeftLockstep,
    /// The drone lands, or stays on the ground.
    Landing(LandingReason),
    /// An input was invalid, or not valid in the current state.
    Refused,
    /// The state from which a restarted mission is built.
    Checkpoint(Box<Checkpoint>),
    /// The state from which a restarted agent is built.
    AgentCheckpoint(Box<agent::Checkpoint>),
    /// The drone's agent failed with this message. It is restarted, or given up if it failed too often.
    AgentFailed(String),
    /// A value that the drone's agent reports.
    Observed(agent::Observed),
}
