use proptest::prelude::*;

use super::*;
use crate::msp::Setpoint;

const HOME: (f64, f64) = (39.0, -0.3);

/// A link beside an autopilot that reports all that it knows ten times a second.
struct Bench {
    now: Timestamp,
    link: AutopilotLink,
    is_heard: bool,
    /// It says that it is a simulation.
    is_simulated: bool,
    armed: bool,
    mode: Mode,
    landed: Landed,
    position: Ned,
    velocity: Velocity,
    orders: Vec<Order>,
    telemetry: Option<Telemetry>,
    checkpoint: Option<Checkpoint>,
}

fn config(stage: Stage) -> Config {
    Config {
        stage,
        home: Geodetic::new(HOME.0, HOME.1, 10.0).unwrap(),
    }
}

const LEG: Setpoint = Setpoint::Leg {
    to: Ned::new(0.0, 0.0, -20.0),
    speed_mps: 3.0,
    acceleration_mps2: 1.0,
};

impl Bench {
    fn new(stage: Stage) -> Self {
        let link = AutopilotLink::new(config(stage), None, Timestamp::ZERO);
        Self {
            now: Timestamp::ZERO,
            link,
            is_heard: true,
            is_simulated: true,
            armed: false,
            mode: Mode::Other,
            landed: Landed::Ground,
            position: Ned::HOME,
            velocity: Velocity::ZERO,
            orders: Vec::new(),
            telemetry: None,
            checkpoint: None,
        }
    }

    /// In the air at 20 m, in the mode that takes orders.
    fn flying() -> Self {
        let mut bench = Self::new(Stage::Sim);
        bench.run(1.0);
        bench.command(FlightCommand::Arm);
        bench.mode = Mode::Guided;
        bench.run(2.0);
        bench.armed = true;
        bench.run(1.0);
        bench.command(FlightCommand::Fly(LEG));
        bench.landed = Landed::Air;
        bench.position = Ned::new(0.0, 0.0, -20.0);
        bench.run(1.0);
        bench
    }

    fn give(&mut self, input: Input) {
        self.link.handle_input(self.now, input);
        self.drain();
    }

    fn report(&mut self, report: AutopilotReport) {
        self.give(Input::Port(PortEvent::Autopilot(report)));
    }

    fn command(&mut self, command: FlightCommand) {
        self.give(Input::FlightCommand(command));
    }

    fn drain(&mut self) {
        loop {
            match self.link.poll_output() {
                Output::Transmit(Transmit::Order(order)) => self.orders.push(order),
                Output::Transmit(Transmit::Telemetry(it)) => self.telemetry = Some(it),
                Output::Transmit(Transmit::Resync) => {}
                Output::Transmit(it) => panic!("{it:?}"),
                Output::Event(Event::Checkpoint(it)) => self.checkpoint = Some(it),
                Output::Idle { .. } => return,
            }
        }
    }

    fn run(&mut self, seconds: f64) {
        let end = self.now + Duration::from_secs_f64(seconds);
        while self.now < end {
            self.now += Duration::from_millis(100);
            if self.is_heard {
                let (armed, mode) = (self.armed, self.mode);
                self.report(AutopilotReport::Heartbeat { armed, mode });
                if self.is_simulated {
                    self.report(AutopilotReport::Simulated);
                }
                self.report(AutopilotReport::Landed(self.landed));
                self.report(AutopilotReport::Origin(config(Stage::Sim).home));
                let (position, velocity) = (self.position, self.velocity);
                self.report(AutopilotReport::Place { position, velocity });
            }
            self.link.handle_timeout(self.now);
            self.drain();
        }
    }

    /// The orders of the next seconds.
    fn orders_of(&mut self, seconds: f64) -> Vec<Order> {
        self.orders.clear();
        self.run(seconds);
        self.orders.clone()
    }

    fn latest_telemetry(&mut self) -> Telemetry {
        self.command(FlightCommand::Report);
        self.telemetry.unwrap()
    }
}

#[test]
fn it_guides_arms_takes_off_and_flies_in_this_order() {
    let mut bench = Bench::new(Stage::Sim);
    bench.run(1.0);
    bench.orders.clear();
    bench.command(FlightCommand::Arm);
    assert_eq!(bench.orders, [Order::Guide]);
    bench.mode = Mode::Guided;
    assert!(bench.orders_of(0.1).contains(&Order::Arm));
    bench.armed = true;
    let orders = bench.orders_of(2.0);
    assert!(!orders.contains(&Order::Arm) && !orders.contains(&Order::Guide));

    bench.orders.clear();
    bench.command(FlightCommand::Fly(LEG));
    let speed = Order::Speed {
        over_ground_mps: 0.0,
        vertical_mps: 3.0,
    };
    assert_eq!(bench.orders, [speed, Order::TakeOff { height_m: 20.0 }]);
    bench.landed = Landed::TakingOff;
    bench.run(0.1);
    let is_target = |order: &Order| matches!(order, Order::Fly { .. });
    assert!(!bench.orders_of(2.0).iter().any(is_target), "not yet");
    bench.landed = Landed::Air;
    let orders = bench.orders_of(2.0);
    assert_eq!(orders.iter().filter(|it| is_target(it)).count(), 10);
    assert!(!orders.contains(&Order::TakeOff { height_m: 20.0 }));
}

#[test]
fn level_leg_leaves_the_vertical_speed_as_it_is() {
    let mut bench = Bench::flying();
    bench.position = Ned::new(0.0, 0.0, -19.96);
    bench.run(0.1);
    bench.orders.clear();
    bench.command(FlightCommand::Fly(Setpoint::Leg {
        to: Ned::new(100.0, 0.0, -20.0),
        speed_mps: 8.0,
        acceleration_mps2: 1.0,
    }));
    let Some(Order::Speed {
        over_ground_mps,
        vertical_mps,
    }) = bench.orders.first()
    else {
        panic!("{:?}", bench.orders);
    };
    assert!((over_ground_mps - 8.0).abs() < 0.01 && vertical_mps.abs() < 1e-9);
}

#[test]
fn targets_and_positions_are_moved_between_the_autopilots_frame_and_the_drones() {
    let mut bench = Bench::flying();
    let origin = Geodetic::new(HOME.0 + 0.001, HOME.1, 250.0).unwrap();
    let mut other = AutopilotLink::new(config(Stage::Sim), None, Timestamp::ZERO);
    std::mem::swap(&mut bench.link, &mut other);
    bench.landed = Landed::Air;
    bench.report(AutopilotReport::Origin(origin));
    bench.run(1.0);
    // 0.001° of latitude, and no difference of altitude.
    let telemetry = bench.latest_telemetry();
    assert!(
        (telemetry.position.north_m() - 111.0).abs() < 0.5,
        "{telemetry:?}"
    );
    assert!((telemetry.position.altitude_m() - 20.0).abs() < 1e-9);
    bench.orders.clear();
    bench.command(FlightCommand::Fly(LEG));
    let to = bench.orders.iter().find_map(|order| match order {
        Order::Fly { to, .. } => Some(*to),
        _ => None,
    });
    assert!((to.unwrap().north_m() + 111.0).abs() < 0.5, "{to:?}");
}

#[test]
fn heartbeats_lost_in_the_air_are_a_lost_link_and_it_lands_once_heard_again() {
    let mut bench = Bench::flying();
    bench.is_heard = false;
    bench.run(3.5);
    assert!(!bench.latest_telemetry().landing);
    bench.run(1.0);
    let telemetry = bench.latest_telemetry();
    assert!(telemetry.armed && telemetry.landing && telemetry.position_lost_for.is_some());
    assert!(!bench.orders_of(3.0).contains(&Order::Heartbeat));
    bench.is_heard = true;
    let orders = bench.orders_of(2.0);
    assert!(orders.contains(&Order::Land));
    assert!(!orders.iter().any(|it| matches!(it, Order::Fly { .. })));
    bench.command(FlightCommand::Fly(LEG));
    (bench.armed, bench.landed) = (false, Landed::Ground);
    let orders = bench.orders_of(2.0);
    assert!(orders.contains(&Order::Heartbeat) && !orders.contains(&Order::Arm));
    assert!(!bench.latest_telemetry().armed);
}

#[test]
fn an_aircraft_that_another_mode_takes_gets_no_order_but_heartbeats() {
    let mut bench = Bench::flying();
    bench.mode = Mode::Other;
    bench.run(0.1);
    let telemetry = bench.latest_telemetry();
    assert!(telemetry.landing && telemetry.landing_cause == Some(crate::msp::LandingCause::Pilot));
    bench.command(FlightCommand::Fly(LEG));
    bench.command(FlightCommand::Land);
    bench.mode = Mode::Guided;
    bench.run(0.1);
    let orders = bench.orders_of(5.0);
    assert!(
        orders.iter().all(|it| *it == Order::Heartbeat),
        "{orders:?}"
    );
}

#[test]
fn restarted_link_continues_the_leg_and_never_arms_again() {
    let mut bench = Bench::flying();
    let checkpoint = bench.checkpoint;
    bench.link = AutopilotLink::new(config(Stage::Sim), checkpoint, bench.now);
    bench.orders.clear();
    bench.run(2.0);
    assert!(
        bench
            .orders
            .iter()
            .any(|it| matches!(it, Order::Fly { .. }))
    );
    (bench.armed, bench.landed) = (false, Landed::Ground);
    bench.run(0.1);
    bench.command(FlightCommand::Arm);
    assert!(!bench.orders_of(3.0).contains(&Order::Arm));
}

#[test]
fn it_lands_when_the_supervisor_gives_up_and_ignores_commands() {
    let mut bench = Bench::flying();
    bench.give(Input::GiveUp);
    assert_eq!(bench.orders.last(), Some(&Order::Land));
    bench.mode = Mode::Landing;
    bench.command(FlightCommand::Fly(LEG));
    let orders = bench.orders_of(3.0);
    assert!(
        orders.iter().all(|it| *it == Order::Heartbeat),
        "{orders:?}"
    );
    assert!(bench.latest_telemetry().landing);
}

#[test]
fn it_does_not_arm_without_a_position() {
    let mut bench = Bench::new(Stage::Sim);
    let heartbeat = AutopilotReport::Heartbeat {
        armed: false,
        mode: Mode::Guided,
    };
    bench.report(AutopilotReport::Simulated);
    bench.report(heartbeat);
    bench.command(FlightCommand::Arm);
    assert_eq!(bench.orders, [Order::Heartbeat, Order::RequestTelemetry]);
    assert!(bench.latest_telemetry().position_lost_for.is_some());
}

#[test]
fn it_does_not_arm_an_autopilot_that_does_not_say_that_it_is_a_simulation() {
    let mut bench = Bench::new(Stage::Sim);
    bench.is_simulated = false;
    bench.mode = Mode::Guided;
    bench.run(1.0);
    bench.command(FlightCommand::Arm);
    let orders = bench.orders_of(10.0);
    assert!(!orders.is_empty() && orders.iter().all(|it| *it == Order::RequestTelemetry));
    bench.is_simulated = true;
    assert!(bench.orders_of(2.0).contains(&Order::Arm));
}

#[test]
fn it_does_not_arm_an_autopilot_that_said_so_some_seconds_ago() {
    let mut bench = Bench::new(Stage::Sim);
    bench.mode = Mode::Guided;
    bench.run(1.0);
    bench.is_simulated = false;
    bench.run(3.5);
    bench.command(FlightCommand::Arm);
    assert!(!bench.orders_of(10.0).contains(&Order::Arm));
}

#[test]
fn restarted_link_lands_an_autopilot_only_once_that_says_again_that_it_is_a_simulation() {
    let mut bench = Bench::flying();
    let checkpoint = bench.checkpoint;
    bench.link = AutopilotLink::new(config(Stage::Sim), checkpoint, bench.now);
    bench.is_simulated = false;
    bench.command(FlightCommand::Land);
    assert!(!bench.orders_of(2.0).contains(&Order::Land));
    bench.is_simulated = true;
    assert!(bench.orders_of(1.5).contains(&Order::Land));
}

fn inputs() -> impl Strategy<Value = Input> {
    let mode = prop_oneof![Just(Mode::Guided), Just(Mode::Landing), Just(Mode::Other)];
    let report = prop_oneof![
        (any::<bool>(), mode).prop_map(|(armed, mode)| AutopilotReport::Heartbeat { armed, mode }),
        Just(AutopilotReport::Landed(Landed::Ground)),
        Just(AutopilotReport::Landed(Landed::Air)),
        Just(AutopilotReport::Simulated),
        Just(AutopilotReport::Origin(config(Stage::Bench).home)),
        Just(AutopilotReport::Place {
            position: Ned::HOME,
            velocity: Velocity::ZERO
        }),
    ];
    prop_oneof![
        4 => report.prop_map(|report| Input::Port(PortEvent::Autopilot(report))),
        1 => Just(Input::FlightCommand(FlightCommand::Arm)),
        1 => Just(Input::FlightCommand(FlightCommand::Fly(LEG))),
        1 => Just(Input::FlightCommand(FlightCommand::Land)),
        1 => Just(Input::GiveUp),
    ]
}

proptest! {
    #[test]
    fn in_the_stage_bench_it_only_asks_for_telemetry(inputs in proptest::collection::vec(inputs(), 1..60)) {
        let mut bench = Bench::new(Stage::Bench);
        for input in inputs {
            bench.now += Duration::from_millis(300);
            bench.give(input);
            bench.link.handle_timeout(bench.now);
            bench.drain();
        }
        prop_assert!(bench.orders.iter().all(|it| *it == Order::RequestTelemetry), "{:?}", bench.orders);
    }

    #[test]
    fn autopilot_that_reports_no_simulation_gets_only_telemetry_requests(inputs in proptest::collection::vec(inputs(), 1..60)) {
        let mut bench = Bench::new(Stage::Sim);
        let says_so = Input::Port(PortEvent::Autopilot(AutopilotReport::Simulated));
        for input in inputs.into_iter().filter(|it| *it != says_so) {
            bench.now += Duration::from_millis(300);
            bench.give(input);
            bench.link.handle_timeout(bench.now);
            bench.drain();
        }
        prop_assert!(bench.orders.iter().all(|it| *it == Order::RequestTelemetry), "{:?}", bench.orders);
    }
}
