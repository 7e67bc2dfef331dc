mod apart;
mod barrier;
mod change;
mod election;
mod failsafe;
mod follow;
mod hold;
mod landing;
mod restart;
mod start;
mod waves;

use std::num::NonZeroU32;

use std::sync::Arc;
use std::time::Duration;

use bytes::Bytes;

use super::*;
use crate::formation::Change;
use crate::formation::{Formation, Kind, Layering, Separation};
use crate::geometry::Ned;
use crate::identity::{Ballot, NodeId, NodeSet};
use crate::machine::{Emitted, Stimulus, step};
use crate::navigation::Failure;
use crate::navigation::Goal;
use crate::routing::Notice as RoutingNotice;
use crate::wire;

/// The leader epoch that the operator starts.
const INITIAL_BALLOT: Ballot = Ballot {
    term: 1,
    rank: 0,
    master: NodeId(1),
};

const SECOND: Duration = Duration::from_secs(1);

/// Height of the lowest layer above the slots, in metres.
const LAYER_SPACING_M: f64 = 5.5;

/// The goal of a leg to `to` in lockstep.
fn fly_to(to: Ned) -> Goal {
    Goal::FlyTo {
        to,
        hold_altitude_m: to.altitude_m() + LAYER_SPACING_M,
    }
}

fn waypoints() -> Vec<Ned> {
    [0.0, 100.0, 200.0]
        .map(|north_m| Ned::new(north_m, 0.0, -25.0))
        .into()
}

/// Drone `id` of a line of three; drone 1 is the centre.
fn mission(id: u32, liveness: Liveness) -> Mission {
    Mission::new(config(id, liveness), None)
}

fn config(id: u32, liveness: Liveness) -> Config {
    let drones = NonZeroU32::new(3).unwrap();
    let separation = Separation {
        horizontal_m: 5.0,
        vertical_m: 5.0,
    };
    let formation = Formation::new(Kind::Linear, drones, 100.0, 0.0);
    Config {
        id: NodeId(id),
        layout: Arc::new(Layout::new(formation, 10.0, separation)),
        mission: waypoints().into(),
        holds: Holds::default(),
        changes: Arc::default(),
        conduct: Conduct::Waypoints,
        barrier: Barrier::Strict,
        liveness,
        succession: Succession::Land,
        alone: Alone::CarryOn,
        spreading_grace: Duration::ZERO,
        candidacy_back_off: Duration::ZERO,
        set_up_limit: 30 * SECOND,
        take_off_limit: 60 * SECOND,
        landing_limit: 60 * SECOND,
        climb_limit: 10 * SECOND,
        leg_limit: 100 * SECOND,
        flight_time: 2_000 * SECOND,
        waypoints_max: 100,
    }
}

fn stimulate(
    mission: &mut Mission,
    at_s: f64,
    stimulus: Stimulus<Input>,
) -> (Vec<Transmit>, Vec<Event>) {
    let (mut transmits, mut events) = (Vec::new(), Vec::new());
    let now = Timestamp::from_secs_f64(at_s);
    let is_timeout = stimulus == Stimulus::Timeout;
    let deadline = step(mission, now, stimulus, |emitted| match emitted {
        Emitted::Transmit(transmit) => transmits.push(transmit),
        Emitted::Event(event) => events.push(event),
    });
    let is_overdue = is_timeout && deadline.is_some_and(|deadline| deadline <= now);
    assert!(!is_overdue, "deadline {deadline:?} is not after {now}");
    (transmits, events)
}

fn send(mission: &mut Mission, at_s: f64, input: Input) -> Vec<Transmit> {
    stimulate(mission, at_s, Stimulus::Input(input)).0
}

fn deliver(mission: &mut Mission, sequence: u32, order: &Order) -> Vec<Transmit> {
    let ballot = INITIAL_BALLOT;
    let order = wire::encode_order(order).into();
    let notice = RoutingNotice::Order {
        ballot,
        sequence,
        order,
    };
    send(mission, 1.0, Input::Routing(notice))
}

fn notify(mission: &mut Mission, at_s: f64, notice: RoutingNotice) -> Vec<Transmit> {
    send(mission, at_s, Input::Routing(notice))
}

/// The drone arrives where its mission sent it.
fn arrive(mission: &mut Mission, at_s: f64) -> Vec<Transmit> {
    let goal = mission.goal().unwrap_or(Goal::Hold);
    let arrived = NavigationNotice::Arrived(goal);
    send(mission, at_s, Input::Navigation(arrived))
}

/// The drone ends the leg that it flies, though its mission may have another goal for it by now.
fn arrive_at_end_of_leg(mission: &mut Mission, at_s: f64) -> Vec<Transmit> {
    let leg = mission.given_goal.unwrap();
    let arrived = NavigationNotice::Arrived(leg);
    send(mission, at_s, Input::Navigation(arrived))
}

fn progress(member: u32, acknowledged: u32) -> RoutingNotice {
    RoutingNotice::Progress {
        sequence: acknowledged,
        acknowledged: NodeId(member).into(),
        landing: NodeSet::default(),
    }
}

fn acknowledgement(sequence: u32) -> Transmit {
    Transmit::Acknowledge {
        ballot: INITIAL_BALLOT,
        sequence,
    }
}

fn orders(transmits: &[Transmit]) -> Vec<Order> {
    let published = transmits.iter().filter_map(|transmit| match transmit {
        Transmit::Publish { order, .. } => Some(wire::decode_order(order).unwrap()),
        _ => None,
    });
    published.collect()
}

const fn open_waypoint(waypoint: u16) -> Order {
    Order::Move {
        waypoint,
        apart: false,
    }
}

/// An order to climb out of lockstep at a waypoint, or to fly there so.
const fn move_apart(waypoint: u16) -> Order {
    let apart = true;
    Order::Move { waypoint, apart }
}

fn land_at(at: Ned) -> Order {
    Order::Land {
        at,
        changes: 0,
        apart: false,
        wave: 0,
    }
}

fn complete_plan() -> Order {
    Order::Plan {
        index: 0,
        count: 1,
        waypoints: waypoints(),
        holds: Vec::new(),
    }
}

/// A member at waypoint 0, which is open.
fn member_at_open_waypoint(config: Config) -> Mission {
    let mut member = Mission::new(config, None);
    deliver(&mut member, 1, &complete_plan());
    deliver(&mut member, 2, &Order::TakeOff { wave: 0 });
    arrive(&mut member, 20.0);
    notify(&mut member, 30.0, RoutingNotice::RoutesReady);
    deliver(&mut member, 3, &open_waypoint(0));
    member
}

/// A member at waypoint 0 with routes.
fn member_at_waypoint_0(liveness: Liveness) -> Mission {
    let mut member = mission(0, liveness);
    deliver(&mut member, 1, &complete_plan());
    deliver(&mut member, 2, &Order::TakeOff { wave: 0 });
    arrive(&mut member, 20.0);
    for notice in [
        RoutingNotice::DiscoveryStarted,
        RoutingNotice::HopUpdateStarted,
        RoutingNotice::RoutesReady,
    ] {
        notify(&mut member, 30.0, notice);
    }
    assert_eq!(member.durable.state, State::WaypointReached { waypoint: 0 });
    member
}

/// A master that has ordered its two members to take off.
fn master_taking_off() -> Mission {
    master_taking_off_with(Barrier::Strict)
}

fn master_taking_off_with(barrier: Barrier) -> Mission {
    let config = Config {
        barrier,
        ..config(1, Liveness::Heartbeat)
    };
    let mut master = Mission::new(config, None);
    send(&mut master, 0.0, Input::Fly);
    notify(&mut master, 1.0, progress(0, 1));
    let transmits = notify(&mut master, 1.0, progress(2, 1));
    assert_eq!(orders(&transmits), [Order::TakeOff { wave: 0 }]);
    master
}

fn goal(transmits: &[Transmit]) -> Option<Goal> {
    transmits.iter().find_map(|transmit| match transmit {
        Transmit::Goal(goal) => Some(*goal),
        _ => None,
    })
}
