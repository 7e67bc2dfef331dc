use std::path::Path;
use std::sync::Arc;

use muster_controller::Contact;
use muster_machines::geometry::Ned;
use muster_machines::machine::Output;
use muster_machines::msp::controller::Stage;
use muster_machines::msp::{
    Checkpoint, Event, FlightCommand, Input, LandingCause, Link, Setpoint, Telemetry, Transmit,
};
use muster_machines::node::LinkBuilder;
use muster_msp::TICK;
use rand::RngExt;

use super::*;
use crate::scenario::{Override, load};
use rand::SeedableRng;

const DRONE: NodeId = NodeId(0);

/// A controller and the link of its drone, without the rest of the swarm.
struct Bench {
    controllers: Controllers,
    link: Box<dyn Link>,
    new_link: Arc<LinkBuilder>,
    kept: Option<Checkpoint>,
    /// Whether the link runs.
    is_up: bool,
    now: Timestamp,
    telemetry: Option<Telemetry>,
    truth: Option<Truth>,
    violation: Option<Violation>,
}

impl Bench {
    /// On the ground, told to arm. `seed` draws the errors of sensors and line.
    fn new(receiver: &str, seed: u64) -> Self {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("chaos-controllers.toml");
        let receiver: Override = format!("vehicle.receiver={receiver}").parse().unwrap();
        let scenario = load(&path, &[receiver]).unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut controllers = Controllers::default();
        controllers.extend(&scenario, &mut rng.clone(), &mut rng);
        let plan = &scenario.plan;
        let new_link = plan.link(VehicleKind::Msp, Stage::Sim, plan.receiver);
        Self {
            controllers,
            link: new_link(None, Timestamp::ZERO),
            new_link,
            kept: None,
            is_up: true,
            now: Timestamp::ZERO,
            telemetry: None,
            truth: None,
            violation: None,
        }
    }

    /// 12 m high.
    fn flying(receiver: &str, seed: u64) -> Self {
        let mut bench = Self::new(receiver, seed);
        bench.controllers.show_pilot(DRONE, true);
        bench.pass(6.0);
        bench.give(Input::FlightCommand(FlightCommand::Arm));
        bench.pass(2.0);
        assert!(bench.telemetry.is_some_and(|it| it.armed));
        bench.fly(12.0, 0.0);
        bench
    }

    fn fly(&mut self, altitude_m: f64, north_m: f64) {
        let to = self.telemetry.expect("it was reported").position.0;
        let to = Ned::new(to.x + north_m, to.y, -altitude_m);
        self.give(Input::FlightCommand(FlightCommand::Fly(Setpoint::Leg {
            to,
            speed_mps: 5.0,
            acceleration_mps2: 1.0,
        })));
    }

    fn give(&mut self, input: Input) {
        self.link.handle_input(self.now, input);
        self.drain();
    }

    fn drain(&mut self) {
        loop {
            match self.link.poll_output() {
                Output::Transmit(Transmit::Rc(rc)) => self.controllers.set_rc(self.now, DRONE, rc),
                Output::Transmit(Transmit::Telemetry(telemetry)) => {
                    self.telemetry = Some(telemetry);
                }
                Output::Event(Event::Checkpoint(kept)) => self.kept = Some(kept),
                Output::Transmit(_) => {}
                Output::Idle { .. } => return,
            }
        }
    }

    fn pass(&mut self, seconds: f64) {
        let end = self.now + Duration::from_secs_f64(seconds);
        while self.now < end {
            self.now += TICK;
            let mut events = Vec::new();
            let flown = (self.controllers).tick(self.now, DRONE, PortState::Runs, |event| {
                events.push(event);
            });
            self.truth = flown.map(|(truth, _)| truth).or(self.truth);
            let found = self.controllers.check(self.now, DRONE);
            self.violation = self.violation.take().or(found);
            if self.is_up {
                for event in events {
                    self.give(Input::Port(event));
                }
                self.link.handle_timeout(self.now);
                self.drain();
            }
        }
    }

    /// The link crashes, and another goes on with what it kept.
    fn restart_link(&mut self) {
        self.link = (self.new_link)(self.kept, self.now);
        let events: Vec<_> = self.controllers.introduction(self.now, DRONE).collect();
        for event in events {
            self.give(Input::Port(event));
        }
    }

    fn affect(&mut self, fault: ControllerFault) {
        self.controllers.affect(self.now, DRONE, fault, None);
    }

    fn attached(&mut self) -> &mut Attached {
        self.controllers.get(DRONE).expect("it has a controller")
    }

    /// Roll, pitch, yaw and throttle that count, and those of the pilot.
    fn sticks(&mut self) -> [[u16; 4]; 2] {
        let attached = self.attached();
        let pilots = attached.pilot.as_ref().expect("there is one").channels;
        [attached.faulty.controller.channels(), pilots].map(|it| [it[0], it[1], it[2], it[3]])
    }

    fn is_armed(&self) -> bool {
        self.truth.is_some_and(|it| it.is_armed)
    }
}

#[test]
fn pilot_who_takes_over_at_any_moment_has_the_sticks_and_nothing_arms_again() {
    let mut rng = ChaCha8Rng::seed_from_u64(24);
    for flight in 0..40 {
        let mut bench = Bench::flying("override", flight);
        let at_s: f64 = rng.random_range(0.0..12.0);
        bench.pass(at_s.min(6.0));
        bench.fly(12.0, 60.0);
        bench.pass(at_s - at_s.min(6.0));
        bench.affect(ControllerFault::TakeOver);
        bench.pass(0.1);
        let [counting, pilots] = bench.sticks();
        // The pilot moves the sticks with every tick, and the controller looks at them with every tick.
        let is_near = counting
            .iter()
            .zip(pilots)
            .all(|(it, other)| it.abs_diff(other) <= 20);
        assert!(is_near, "{counting:?}, {pilots:?}, flight {flight}");
        bench.pass(0.2);
        assert!(
            bench
                .telemetry
                .is_some_and(|it| it.landing && it.landing_cause == Some(LandingCause::Pilot)),
            "flight {flight}"
        );
        bench.pass(40.0);
        assert!(!bench.is_armed(), "flight {flight}");
        let truth = bench.truth.expect("it has flown");
        assert_eq!(truth.contact, Contact::Ground, "flight {flight}, {truth:?}");
        assert!(
            bench.telemetry.is_some_and(|it| !it.armed),
            "flight {flight}"
        );
        bench.give(Input::FlightCommand(FlightCommand::Arm));
        bench.pass(10.0);
        assert!(!bench.is_armed() && bench.violation.is_none());
    }
}

#[test]
fn rule_7_breaks_when_rc_has_been_missing_for_a_tenth_of_a_second() {
    let mut bench = Bench::flying("sole", 1);
    bench.pass(3.0);
    let stopped_at = bench.now;
    bench.is_up = false;
    bench.pass(1.0);
    let violation = bench.violation.expect("it gave no sticks");
    assert_eq!((violation.rule, &violation.drones[..]), (7, &[DRONE][..]));
    // The port repeats the last sticks for 100 ms.
    let after_ms = violation.at.since(stopped_at).as_millis();
    assert!((180..=210).contains(&after_ms), "{after_ms} ms");
}

#[test]
fn sticks_of_before_a_port_was_closed_do_not_leave_when_it_opens_again() {
    let mut bench = Bench::flying("sole", 5);
    // The link hangs, so the newest sticks, with a high arm switch, are held for 100 ms.
    bench.is_up = false;
    let closed = Some(Duration::from_millis(30));
    (bench.controllers).affect(bench.now, DRONE, ControllerFault::ClosePort, closed);
    let opened = bench.attached().port.figures().opened;
    bench.pass(0.15);
    assert_eq!(bench.attached().port.figures().opened, opened + 1);
    assert_eq!(bench.violation, None);
}

#[test]
fn new_link_gets_its_port_and_the_newest_statuses_at_once() {
    let mut bench = Bench::flying("sole", 1);
    bench.pass(3.0);
    let events: Vec<_> = bench.controllers.introduction(bench.now, DRONE).collect();
    assert!(
        matches!(
            events[..],
            [
                PortEvent::Identified { .. },
                PortEvent::Telemetry(muster_msp::Telemetry::Status(_)),
                PortEvent::Telemetry(muster_msp::Telemetry::Status(_))
            ]
        ),
        "{events:?}"
    );
    bench.controllers.close(bench.now, DRONE);
    assert_eq!(bench.controllers.introduction(bench.now, DRONE).count(), 0);
}

#[test]
fn a_vehicle_stays_on_its_leg_however_often_its_link_restarts() {
    for (receiver, every_s, height_m) in [
        ("sole", 3.0, 12.0),
        ("override", 3.0, 12.0),
        ("sole", 1.0, 12.0),
        ("sole", 0.5, 20.0),
        ("override", 7.0, 5.0),
    ] {
        let mut bench = Bench::flying(receiver, 1);
        bench.fly(height_m, 0.0);
        bench.pass(25.0);
        let begin = bench.truth.expect("it flies").position;
        bench.fly(height_m, 2_000.0);
        let (mut high_m, mut lateral_m, mut north_m) = (0.0_f64, 0.0_f64, 0.0);
        for step in 1..=1_800 {
            bench.pass(0.1);
            let place = bench.truth.expect("it flies").position;
            high_m = high_m.max(place.vertical_distance_m(begin));
            lateral_m = lateral_m.max((place.east_m() - begin.east_m()).abs());
            north_m = place.north_m() - begin.north_m();
            if f64::from(step) % (every_s * 10.0) == 0.0 {
                bench.restart_link();
            }
        }
        let what = format!(
            "{receiver}, every {every_s} s: {high_m:.1} m, {lateral_m:.1} m, {north_m:.0} m"
        );
        assert!(high_m < 1.0 && lateral_m < 4.0 && north_m > 50.0, "{what}");
        assert!(
            bench.violation.is_none() && bench.telemetry.is_some_and(|it| it.armed && !it.landing)
        );
    }
}

/// The bytes of all frames that are lost are noise, or are still held.
#[test]
fn bytes_that_were_altered_are_counted() {
    let mut bench = Bench::flying("sole", 1);
    bench.pass(5.0);
    let before = bench.controllers.figures(DRONE).unwrap();
    assert_eq!((before.bad_frames, before.noise_bytes), (0, 0));
    bench.affect(ControllerFault::CorruptBytes(0.005));
    bench.pass(20.0);
    let after = bench.controllers.figures(DRONE).unwrap();
    // 90 frames a second of 6 to 28 bytes: some 100 of them have a wrong byte.
    let frames = after.frames - before.frames;
    assert!((1_000..2_000).contains(&frames), "{after:?}");
    assert!((50..200).contains(&after.bad_frames), "{after:?}");
    assert!(after.noise_bytes > 10 * after.bad_frames, "{after:?}");
    assert!(after.questions_lost > 30, "{after:?}");
    assert!(bench.violation.is_none() && bench.telemetry.is_some_and(|it| !it.landing));
}

/// What is left of a flight in which something goes wrong.
#[derive(Debug)]
struct End {
    /// From the fault until the link reported that it lands, in seconds.
    reported_s: f64,
    why: Option<LandingCause>,
    contact: Contact,
    /// From the fault until the motors stopped, in seconds.
    disarmed_s: f64,
    /// The fastest descent from 10 s after the fault on, in m/s.
    descent_mps: f64,
}

/// Something goes wrong in a hover at 25 m.
fn end_of(seed: u64, fault: ControllerFault) -> End {
    let mut bench = Bench::flying("sole", seed);
    bench.pass(8.0);
    bench.fly(25.0, 0.0);
    bench.pass(15.0);
    assert!(bench.telemetry.is_some_and(|it| !it.landing), "it hovers");
    bench.affect(fault);
    let (mut reported_s, mut why, mut descent_mps) = (None, None, 0.0_f64);
    for step in 1..=600 {
        bench.pass(0.1);
        let seconds = f64::from(step) / 10.0;
        if let Some(telemetry) = bench.telemetry.filter(|it| it.landing) {
            reported_s.get_or_insert(seconds);
            why = why.or(telemetry.landing_cause);
        }
        let truth = bench.truth.expect("it has flown");
        if seconds > 10.0 && truth.contact == Contact::Airborne {
            descent_mps = descent_mps.max(truth.velocity.0.z);
        }
        if !truth.is_armed {
            return End {
                reported_s: reported_s.expect("it was reported before"),
                why,
                contact: truth.contact,
                disarmed_s: seconds,
                descent_mps,
            };
        }
    }
    panic!("still armed: {why:?}, {:?}", bench.truth);
}

/// It is reported in time, with the reason, and the aircraft comes down whole.
fn assert_lands(
    seed: u64,
    fault: ControllerFault,
    why: LandingCause,
    (reported_s, disarmed_s): (f64, f64),
) {
    let end = end_of(seed, fault);
    assert_eq!(end.why, Some(why), "seed {seed}, {end:?}");
    assert!(end.reported_s <= reported_s, "seed {seed}, {end:?}");
    assert_ne!(end.contact, Contact::Wreck, "seed {seed}, {end:?}");
    // The landing asks for 1.5 m/s; a fall is braked with 1 m/s².
    assert!(end.descent_mps <= 2.5, "seed {seed}, {end:?}");
    assert!(end.disarmed_s <= disarmed_s, "seed {seed}, {end:?}");
}

#[test]
fn landing_with_late_heights_only_continues_slowly() {
    let delay = ControllerFault::DelayBytes(Duration::from_millis(92));
    for (seed, after_s) in (0..).zip([0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0]) {
        let mut bench = Bench::flying("sole", seed);
        bench.pass(8.0);
        bench.give(Input::FlightCommand(FlightCommand::Land));
        bench.pass(after_s);
        bench.affect(delay);
        bench.pass(30.0);
        let contact = bench.truth.expect("it has flown").contact;
        assert_eq!(contact, Contact::Ground, "{after_s} s");
    }
}

#[test]
fn an_aircraft_without_one_propeller_tumbles_is_reported_and_stops_its_motors() {
    for seed in 0..10 {
        let end = end_of(seed, ControllerFault::WeakenMotor(Some(2), 1.0));
        assert_eq!(end.why, Some(LandingCause::Tilt), "seed {seed}, {end:?}");
        assert!(end.reported_s <= 1.5, "seed {seed}, {end:?}");
        assert!(end.disarmed_s <= 20.0, "seed {seed}, {end:?}");
    }
}

#[test]
fn an_aircraft_that_lost_thrust_comes_down_at_a_bounded_rate() {
    for seed in 0..10 {
        for (motor, share) in [(None, 0.4), (Some(2), 0.7)] {
            let fault = ControllerFault::WeakenMotor(motor, share);
            assert_lands(seed, fault, LandingCause::Thrust, (2.5, 55.0));
        }
    }
}

/// It must be still for ten seconds more before its motors stop.
#[test]
fn an_aircraft_that_vibrates_comes_down() {
    for seed in 0..10 {
        assert_lands(
            seed,
            ControllerFault::Shake(20.0),
            LandingCause::Motors,
            (5.0, 65.0),
        );
    }
}

#[test]
fn a_voltage_too_low_under_load_brings_the_aircraft_down() {
    for seed in 0..10 {
        assert_lands(
            seed,
            ControllerFault::SagBattery(4.0),
            LandingCause::Volts,
            (2.0, 55.0),
        );
    }
}

#[test]
fn how_it_was_flown_is_recorded_with_every_gap() {
    let mut bench = Bench::flying("sole", 1);
    bench.pass(5.0);
    let longest = |bench: &Bench| {
        let series = bench
            .controllers
            .series(DRONE)
            .expect("it has a controller");
        let runs = series.runs();
        assert_eq!(runs.len(), 1);
        let all: Vec<_> = runs[0].iter().map(|(_, stretch)| *stretch).collect();
        assert!(all.iter().all(|it| it.throttle_us.is_some()));
        (all.iter().filter_map(|it| it.rc_gap_ms)).fold(0.0, f64::max)
    };
    let before_ms = longest(&bench);
    assert!((20.0..100.0).contains(&before_ms), "{before_ms}");
    let closed = Some(Duration::from_millis(400));
    bench
        .controllers
        .affect(bench.now, DRONE, ControllerFault::ClosePort, closed);
    bench.pass(3.0);
    assert!(longest(&bench) >= 400.0);
}
