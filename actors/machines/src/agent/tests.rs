mod failures;
mod leaving;

use std::num::NonZeroU32;
use std::sync::{Arc, Mutex};

use bytes::Bytes;

use super::*;
use crate::formation::{Formation, Kind, Layout, Separation};
use crate::identity::Ballot;
use crate::machine::{Emitted, Stimulus, step};
use crate::mission::{
    self, Alone, Barrier, Conduct, Event, Holds, Input, LandingReason, Liveness, Mission, Order,
    Succession, Transmit,
};
use crate::navigation::{Failure, Notice as NavigationNotice};
use crate::routing::{Notice, Outcome};
use crate::supervision::RestartLimits;
use crate::time::Timestamp;
use crate::wire;

const SECOND: Duration = Duration::from_secs(1);
const TICK: TimerId = TimerId(7);
/// Where an agent flies from its slot.
const FIRST_GOAL: Goal = Goal::FlyTo {
    to: Ned::new(50.0, 0.0, -10.0),
    hold_altitude_m: 10.0,
};

/// What the agent was told, in order.
type Calls = Arc<Mutex<Vec<String>>>;

/// Does what each call asks for, and records it.
struct Recorder {
    calls: Calls,
}

impl Recorder {
    fn record(&self, call: String) {
        self.calls.lock().unwrap().push(call);
    }
}

impl Agent for Recorder {
    fn start(&mut self, context: &mut Context<'_>) {
        let kept = context.kept().map(<[u8]>::to_vec);
        let north_m = context.position().north_m();
        self.record(format!("start at {north_m} m, kept {kept:?}"));
        context.set_timer(TICK, SECOND);
        context.keep(b"one").unwrap();
        context.go_to(Ned::new(50.0, 0.0, -10.0));
        context
            .send(Destination::Leader, b"here", Reliability::Acknowledged)
            .unwrap();
    }

    fn telemetry(&mut self, telemetry: &Telemetry, _context: &mut Context<'_>) {
        self.record(format!("telemetry, arrived {}", telemetry.has_arrived));
    }

    fn message(&mut self, from: NodeId, payload: &[u8], context: &mut Context<'_>) {
        self.record(format!("message from {from}: {}", payload.len()));
        match payload {
            b"land later" => context.set_timer(TimerId(8), SECOND),
            b"land" => context.land(),
            b"leave" => context.leave(),
            b"go on" => context.go_to(Ned::new(90.0, 0.0, -10.0)),
            b"panic in a timer" => context.set_timer(TimerId(9), SECOND / 2),
            b"arrivals only" => context.set_telemetry(None),
            b"as often as possible" => context.set_telemetry(Some(Duration::ZERO)),
            b"panic" => {
                context.keep(b"two").unwrap();
                context.hold();
                panic!("told to");
            }
            _ => {}
        }
    }

    fn timer(&mut self, timer: TimerId, context: &mut Context<'_>) {
        self.record(format!("timer {}", timer.0));
        match timer.0 {
            8 => context.land(),
            9 => panic!("timed"),
            _ => {}
        }
        context.observe("ticks", 1.0);
    }

    fn swarm(&mut self, event: SwarmEvent, context: &mut Context<'_>) {
        self.record(format!("{event:?}"));
        if let SwarmEvent::MessageSent { id, .. } = event {
            context.keep(format!("sent {}", id.0).as_bytes()).unwrap();
        }
    }
}

const MASTER: NodeId = NodeId(1);

const fn ballot(term: u32, rank: u32, master: u32) -> Ballot {
    Ballot {
        term,
        rank,
        master: NodeId(master),
    }
}

fn mission_config(id: u32) -> mission::Config {
    let separation = Separation {
        horizontal_m: 5.0,
        vertical_m: 5.0,
    };
    let formation = Formation::new(Kind::Linear, NonZeroU32::new(3).unwrap(), 100.0, 0.0);
    mission::Config {
        id: NodeId(id),
        layout: Arc::new(Layout::new(formation, 10.0, separation)),
        mission: [Ned::new(0.0, 0.0, -25.0)].into(),
        holds: Holds::default(),
        changes: Arc::default(),
        conduct: Conduct::Task,
        barrier: Barrier::Strict,
        liveness: Liveness::Heartbeat,
        succession: Succession::Elect,
        alone: Alone::CarryOn,
        spreading_grace: Duration::ZERO,
        candidacy_back_off: SECOND / 2,
        set_up_limit: 30 * SECOND,
        take_off_limit: 60 * SECOND,
        landing_limit: 60 * SECOND,
        climb_limit: 10 * SECOND,
        leg_limit: 100 * SECOND,
        flight_time: 600 * SECOND,
        waypoints_max: 100,
    }
}

/// A host, and the clock of its drone.
struct Drone {
    host: Host,
    now: Timestamp,
    calls: Calls,
    checkpoints: (Option<mission::Checkpoint>, Option<Checkpoint>),
    id: u32,
}

impl Drone {
    fn new(id: u32) -> Self {
        let calls = Calls::default();
        Self {
            host: host(id, &calls, (None, None)),
            now: Timestamp::ZERO,
            calls,
            checkpoints: (None, None),
            id,
        }
    }

    fn step(&mut self, stimulus: Stimulus<Input>) -> (Vec<Transmit>, Vec<Event>) {
        let (mut transmits, mut events) = (Vec::new(), Vec::new());
        let is_timeout = stimulus == Stimulus::Timeout;
        let deadline = step(
            &mut self.host,
            self.now,
            stimulus,
            |emitted| match emitted {
                Emitted::Transmit(transmit) => transmits.push(transmit),
                Emitted::Event(event) => events.push(event),
            },
        );
        let is_overdue = is_timeout && deadline.is_some_and(|deadline| deadline <= self.now);
        assert!(
            !is_overdue,
            "deadline {deadline:?} is not after {}",
            self.now
        );
        for event in &events {
            match event {
                Event::Checkpoint(it) => self.checkpoints.0 = Some(it.as_ref().clone()),
                Event::AgentCheckpoint(it) => self.checkpoints.1 = Some(it.as_ref().clone()),
                _ => {}
            }
        }
        (transmits, events)
    }

    fn input(&mut self, input: Input) -> (Vec<Transmit>, Vec<Event>) {
        self.step(Stimulus::Input(input))
    }

    fn notice(&mut self, notice: Notice) -> (Vec<Transmit>, Vec<Event>) {
        self.input(Input::Routing(notice))
    }

    fn order(&mut self, sequence: u32, order: &Order) -> (Vec<Transmit>, Vec<Event>) {
        self.notice(Notice::Order {
            ballot: ballot(1, 0, MASTER.0),
            sequence,
            order: wire::encode_order(order).into(),
        })
    }

    fn message(&mut self, payload: &'static [u8]) -> (Vec<Transmit>, Vec<Event>) {
        self.notice(Notice::Message {
            from: NodeId(0),
            payload: Bytes::from_static(payload),
        })
    }

    /// Advances the clock, then fires timeouts.
    fn wait(&mut self, duration: Duration) -> (Vec<Transmit>, Vec<Event>) {
        self.now += duration;
        self.step(Stimulus::Timeout)
    }

    fn restart(&mut self) {
        self.host = host(self.id, &self.calls, self.checkpoints.clone());
    }

    /// What the agent was told since the last call.
    fn calls(&self) -> Vec<String> {
        std::mem::take(&mut self.calls.lock().unwrap())
    }
}

fn host(
    id: u32,
    calls: &Calls,
    (mission, agent): (Option<mission::Checkpoint>, Option<Checkpoint>),
) -> Host {
    let calls = Arc::clone(calls);
    let config = Config {
        id: NodeId(id),
        drones: 3,
        slot: Ned::new(0.0, 0.0, -25.0),
        waypoints: Arc::default(),
        altitude_max_m: 100.0,
        telemetry: SECOND,
        restarts: RestartLimits {
            restarts_max: 2,
            msp_restarts_max: 2,
            window: 60 * SECOND,
            back_off: SECOND,
            back_off_max: SECOND,
        },
        factory: Factory::new(move || {
            Box::new(Recorder {
                calls: Arc::clone(&calls),
            })
        }),
    };
    Host::new(
        config,
        Mission::new(mission_config(id), mission),
        agent,
        u64::from(id),
    )
}

fn ids(ids: &[u32]) -> NodeSet {
    ids.iter().copied().map(NodeId).collect()
}

/// A member in its slot that waits for its task.
fn member_in_slot() -> Drone {
    let mut drone = Drone::new(2);
    let plan = Order::Plan {
        index: 0,
        count: 1,
        waypoints: vec![Ned::new(0.0, 0.0, -25.0)],
        holds: Vec::new(),
    };
    drone.order(1, &plan);
    let (transmits, _) = drone.order(2, &Order::TakeOff { wave: 0 });
    let in_slot = NavigationNotice::Arrived(goals(&transmits)[0]);
    drone.input(Input::Navigation(in_slot));
    drone.notice(Notice::RoutesReady);
    assert_eq!(drone.calls(), Vec::<String>::new());
    drone
}

fn member_on_task() -> Drone {
    let mut drone = member_in_slot();
    let order = Order::Task {
        drones: ids(&[0, 1, 2]),
    };
    drone.order(3, &order);
    assert_eq!(drone.calls(), ["start at 0 m, kept None"]);
    drone
}

fn goals(transmits: &[Transmit]) -> Vec<Goal> {
    let goals = transmits.iter().filter_map(|transmit| match transmit {
        Transmit::Goal(goal) => Some(*goal),
        _ => None,
    });
    goals.collect()
}

fn messages(transmits: &[Transmit]) -> usize {
    let messages = transmits.iter().map(|it| match it {
        Transmit::Messages(messages) => messages.len(),
        _ => 0,
    });
    messages.sum()
}

#[test]
fn agent_starts_once_its_drone_is_on_task_and_its_checkpoint_leaves_first() {
    let mut drone = member_in_slot();
    let order = Order::Task {
        drones: ids(&[0, 1, 2]),
    };
    let mut emitted = Vec::new();
    let input = Input::Routing(Notice::Order {
        ballot: ballot(1, 0, MASTER.0),
        sequence: 3,
        order: wire::encode_order(&order).into(),
    });
    step(
        &mut drone.host,
        drone.now,
        Stimulus::Input(input),
        |it| match it {
            Emitted::Transmit(transmit) => emitted.push(format!("{transmit:?}")),
            Emitted::Event(event) => emitted.push(format!("{event:?}")),
        },
    );
    let place = |what: &str| emitted.iter().position(|it| it.starts_with(what)).unwrap();
    assert!(place("AgentCheckpoint") < place("Messages"));
    assert!(place("AgentCheckpoint") < place("Goal(FlyTo"));
    assert!(emitted.iter().any(|it| it.starts_with("Acknowledge")));
}

#[test]
fn a_restart_gets_what_the_agent_kept_last_in_a_step() {
    let mut drone = member_on_task();
    let sent = [4, 5].map(|id| (id, Outcome::Delivered));
    drone.notice(Notice::Sent(sent.to_vec()));
    let checkpoint = drone.checkpoints.1.unwrap();
    assert_eq!(checkpoint.kept.as_deref(), Some(&b"sent 5"[..]));
}

#[test]
fn agent_sets_the_period_of_its_telemetry_until_it_restarts() {
    let mut drone = member_on_task();
    let requests = |(transmits, _): (Vec<Transmit>, Vec<Event>)| {
        (transmits.iter().filter(|it| **it == Transmit::Locate)).count()
    };
    assert_eq!(requests(drone.wait(Duration::ZERO)), 1);
    drone.message(b"arrivals only");
    assert_eq!(requests(drone.wait(5 * SECOND)), 0);
    drone.calls();
    drone.input(Input::Navigation(NavigationNotice::Arrived(FIRST_GOAL)));
    assert_eq!(drone.calls(), ["telemetry, arrived true"]);
    drone.message(b"as often as possible");
    for _ in 0..2 {
        assert_eq!(requests(drone.wait(TELEMETRY_MIN / 2)), 0);
        assert_eq!(requests(drone.wait(TELEMETRY_MIN / 2)), 1);
    }
    drone.message(b"arrivals only");
    drone.message(b"panic");
    assert_eq!(requests(drone.wait(SECOND)), 1, "as configured");
}

#[test]
fn agent_gets_positions_arrivals_messages_and_timers() {
    let mut drone = member_on_task();
    assert_eq!(drone.wait(Duration::ZERO).0, [Transmit::Locate]);
    drone.input(Input::Navigation(NavigationNotice::Position {
        position: Ned::HOME,
        velocity: Velocity::new(1.0, 0.0, 0.0),
    }));
    drone.input(Input::Navigation(NavigationNotice::Arrived(FIRST_GOAL)));
    drone.message(b"hello");
    let (_, events) = drone.wait(SECOND);
    assert_eq!(
        drone.calls(),
        [
            "telemetry, arrived false",
            "telemetry, arrived true",
            "message from 0: 5",
            "timer 7"
        ]
    );
    let observed = Event::Observed(Observed {
        name: "ticks".to_owned(),
        value: 1.0,
    });
    assert!(events.contains(&observed));
}

#[test]
fn agent_hears_of_no_arrival_at_a_place_that_it_left_for_another() {
    let mut drone = member_on_task();
    drone.message(b"go on");
    drone.calls();
    drone.input(Input::Navigation(NavigationNotice::Arrived(FIRST_GOAL)));
    assert_eq!(drone.calls(), Vec::<String>::new());
}

#[test]
fn agent_gets_leaders_and_members() {
    let mut drone = member_on_task();
    drone.notice(Notice::MasterSilent);
    drone.notice(Notice::MasterReturned);
    let order = Order::Task {
        drones: ids(&[1, 2]),
    };
    drone.order(4, &order);
    drone.notice(Notice::Leader(ballot(2, 1, 0)));
    let calls = drone.calls();
    assert_eq!(calls.len(), 4, "{calls:?}");
    assert_eq!(calls[..2], ["LeaderSilent", "LeaderReturned"]);
    assert!(calls[2].starts_with("MembersLost"), "{calls:?}");
    assert_eq!(calls[3], "LeaderChanged(NodeId(0))");
}

#[test]
fn landing_agent_announces_the_landing_and_is_not_called_again() {
    let mut drone = member_on_task();
    let (transmits, events) = drone.message(b"land");
    assert!(transmits.contains(&Transmit::Land));
    assert_eq!(goals(&transmits), [Goal::Land]);
    assert!(events.contains(&Event::Landing(LandingReason::MissionOver)));
    drone.calls();
    drone.message(b"hello");
    drone.wait(10 * SECOND);
    assert_eq!(drone.calls(), Vec::<String>::new());
}

#[test]
fn agent_that_lands_when_a_timer_expires_has_no_deadline_left() {
    let mut drone = member_on_task();
    drone.message(b"land later");
    let (_, events) = drone.wait(SECOND);
    assert!(events.contains(&Event::Landing(LandingReason::MissionOver)));
}

#[test]
fn elected_leader_publishes_the_drones_on_task_without_the_lost_one() {
    let mut drone = member_on_task();
    drone.notice(Notice::MasterSilent);
    let (transmits, _) = drone.wait(SECOND / 2);
    let orders: Vec<_> = transmits
        .iter()
        .filter_map(|it| match it {
            Transmit::Publish { order, .. } => wire::decode_order(order).ok(),
            _ => None,
        })
        .collect();
    assert!(transmits.iter().any(|it| matches!(it, Transmit::Lead(_))));
    assert_eq!(
        orders,
        [Order::Task {
            drones: ids(&[0, 1, 2])
        }]
    );
    let (transmits, _) = drone.notice(Notice::Silent(MASTER.into()));
    assert!(
        transmits
            .iter()
            .any(|it| matches!(it, Transmit::Publish { .. }))
    );
    assert_eq!(*drone.host.mission().drones_on_task(), ids(&[0, 2]));
    drone.notice(Notice::Progress {
        sequence: 2,
        acknowledged: MASTER.into(),
        landing: NodeSet::default(),
    });
    assert_eq!(*drone.host.mission().drones_on_task(), ids(&[0, 1, 2]));
}

#[test]
fn outcome_of_a_message_is_reported() {
    let mut drone = member_on_task();
    drone.notice(Notice::Sent(vec![(5, Outcome::Delivered)]));
    assert_eq!(
        drone.calls(),
        ["MessageSent { id: MessageId(5), outcome: Delivered }"]
    );
}
