//! One patrol: what happens when, and what came of it.

mod outcome;

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

use muster_indoor::coverage::{self, PlanError, Seen};
use muster_indoor::frames::MapXy;
use muster_indoor::path::Floor;
use muster_indoor::patrol::{Config, Input, Patrol, Transmit, Velocity, thesis_sonars};
use muster_indoor::random::stream;
use muster_indoor::reading::{Echo, Mounting, Reading};
use muster_indoor::sensor::{Disc, Reflector, Room, SonarModel};
use muster_machines::machine::{Emitted, Stimulus};
use muster_machines::time::Timestamp;
use rand_chacha::ChaCha8Rng;

pub use self::outcome::{Clearance, Outcome, Sample, Track};
pub use crate::failing::Failing;
pub use crate::rule::{CLEARANCE_M, Touch, Touched};

use crate::flat::Flat;
use crate::people::Person;
use crate::robot::Robot;
use crate::rule::{is_kept_out, person_touch, wall_m};
use muster_indoor::avoidance::{Limits, Method};

/// Step of the world.
const TICK: Duration = Duration::from_micros(12_500);
/// Ticks between two measurements of the odometry: 20 Hz.
const ODOMETRY_TICKS: u64 = 4;
/// Ticks between the pings of one sonar, 8 Hz; the sonars fire one after another.
const SONAR_TICKS: u64 = 10;
/// Time for which a sonar's reading holds.
const READING_HOLDS: Duration = Duration::from_millis(300);
/// Ticks between two looks of the camera.
const LOOK_TICKS: u64 = 4;
/// Ticks between two samples of the track.
const SAMPLE_TICKS: u64 = 40;
/// A drone ends a patrol that takes so long.
const LASTS_MAX: Duration = Duration::from_secs(3_000);
/// A patrol that takes longer has failed.
const DURATION_MAX: Duration = Duration::from_secs(3_600);
/// What the drone needs and can do: half a metre a second, as the robots of VFH's papers.
pub const LIMITS: Limits = Limits {
    radius_m: 0.25,
    speed_max_mps: 0.5,
    turn_rate_max_rps: 1.5,
};
const ACCELERATION_MPS2: f64 = 1.0;
/// Sonars of a world without noise.
const EXACT: SonarModel = SonarModel {
    sigma_m: 0.0,
    lost: 0.0,
};
/// Distance that takes as long as to look round once, in metres.
const TURN_M: f64 = 3.5;

/// What is chosen for a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Setup {
    /// Seed of people, odometry and sonars.
    pub seed: u64,
    /// Whether odometry and sonars err.
    pub noise: bool,
    /// Whether there are people.
    pub people: bool,
    /// Sonars that fail, by their place, from when on.
    pub failing: Vec<(usize, Failing, Duration)>,
}

impl Setup {
    /// With noise and people, all sonars working.
    #[must_use]
    pub const fn seeded(seed: u64) -> Self {
        Self {
            seed,
            noise: true,
            people: true,
            failing: Vec::new(),
        }
    }

    /// The same route among the same people without noise: what a patrol's time is compared with.
    #[must_use]
    pub fn exact(seed: u64) -> Self {
        Self {
            noise: false,
            ..Self::seeded(seed)
        }
    }

    /// The same route without noise and people.
    #[must_use]
    pub const fn undisturbed() -> Self {
        Self {
            seed: 0,
            noise: false,
            people: false,
            failing: Vec::new(),
        }
    }
}

/// A flat that is ready to be patrolled. All runs can share it.
#[derive(Debug, Clone)]
pub struct Prepared {
    /// The flat.
    pub flat: Flat,
    /// The drone's configuration. What its places see can be seen: the drone plans with a camera that sees a little less than its
    /// own, and is judged by that plan.
    pub config: Config,
}

impl Prepared {
    /// Plans the patrol of a flat. It takes a moment.
    ///
    /// # Errors
    /// If the drone can't start where the flat says.
    pub fn new(flat: Flat, method: Method) -> Result<Self, PlanError> {
        let floor = Floor::new(Arc::clone(&flat.map), LIMITS.radius_m);
        let starts = [flat.start.at];
        let view = flat.camera.cautious();
        let (tours, places) = coverage::plan(&floor, view, &starts, TURN_M)?;
        let stops = tours.into_iter().flat_map(|tour| tour.stops).collect();
        let config = Config {
            floor,
            places: Arc::new(places),
            tables: Config::tables_of(&flat.map).expect("the start is free"),
            stops,
            view,
            start: flat.start,
            sonars: thesis_sonars(),
            method,
            limits: LIMITS,
            acceleration_mps2: ACCELERATION_MPS2,
            lasts_max: LASTS_MAX,
        };
        Ok(Self { flat, config })
    }
}

/// A flat with one drone in it, while it is patrolled.
///
/// Invariant: all order is decided here; an engine adds none.
#[derive(Debug)]
pub struct World {
    prepared: Prepared,
    setup: Setup,
    tick: u64,
    robot: Robot,
    people: Vec<Person>,
    sonar_model: SonarModel,
    sonar_rngs: Vec<ChaCha8Rng>,
    due: VecDeque<Input>,
    deadline: Option<Timestamp>,
    seen: Seen,
    outcome: Outcome,
}

impl World {
    /// A flat at the begin of a patrol.
    #[must_use]
    pub fn new(prepared: &Prepared, setup: Setup) -> Self {
        let Prepared { flat, config } = prepared;
        let mut walkers = stream(setup.seed, 1);
        let odometry_rng = setup.noise.then(|| stream(setup.seed, 2));
        let people = flat.people.iter().filter(|_| setup.people);
        let people = people.map(|walk| Person::new(walk, &mut walkers)).collect();
        let sonars = 0..config.sonars.len() as u64;
        Self {
            robot: Robot::new(flat.start, config.acceleration_mps2, odometry_rng),
            people,
            sonar_model: if setup.noise {
                SonarModel::default()
            } else {
                EXACT
            },
            sonar_rngs: sonars.map(|sonar| stream(setup.seed, 10 + sonar)).collect(),
            due: VecDeque::new(),
            deadline: Some(Timestamp::ZERO),
            seen: Seen::none(config.places.targets().len()),
            outcome: Outcome::new(config),
            prepared: prepared.clone(),
            setup,
            tick: 0,
        }
    }

    /// What the drone is stepped with next; `None` once the patrol is over.
    pub fn next_stimulus(&mut self) -> Option<Stimulus<Input>> {
        loop {
            if self.outcome.is_over() {
                return None;
            }
            if let Some(input) = self.due.pop_front() {
                return Some(Stimulus::Input(input));
            }
            let now = self.now();
            if self.deadline.take_if(|deadline| *deadline <= now).is_some() {
                return Some(Stimulus::Timeout);
            }
            self.advance();
        }
    }

    /// The time.
    #[must_use]
    pub fn now(&self) -> Timestamp {
        Timestamp::ZERO + TICK * u32::try_from(self.tick).unwrap_or(u32::MAX)
    }

    /// Seed of the drone's machine.
    #[must_use]
    pub const fn seed(&self) -> u64 {
        self.setup.seed
    }

    /// Carries out one output of the drone.
    pub fn carry_out(&mut self, output: Emitted<Patrol>) {
        match output {
            Emitted::Transmit(Transmit::Velocity(velocity)) => self.command(velocity),
            Emitted::Event(event) => self.outcome.observe(self.now(), event, self.robot.pose),
        }
    }

    /// Stops the drone, as a flight controller does that gets no RC.
    pub fn hover(&mut self) {
        self.robot.wanted = Velocity::default();
    }

    /// Sets the drone's next deadline.
    pub const fn set_deadline(&mut self, deadline: Option<Timestamp>) {
        self.deadline = deadline;
    }

    /// What came of the patrol.
    #[must_use]
    pub fn finish(mut self) -> Outcome {
        let unseen = self.seen.missing_of(self.prepared.config.places.visible());
        self.outcome.unseen_targets = unseen.collect();
        self.outcome
    }

    fn command(&mut self, velocity: Velocity) {
        self.robot.wanted = velocity;
        self.outcome.check_blind(
            self.now(),
            velocity,
            &self.setup,
            &self.prepared.config.sonars,
        );
    }

    fn advance(&mut self) {
        self.tick += 1;
        let dt_s = TICK.as_secs_f64();
        self.robot.step(dt_s);
        for person in &mut self.people {
            person.step(dt_s, self.robot.pose.at);
        }
        self.check_clearance();
        if self.tick.is_multiple_of(ODOMETRY_TICKS) {
            let motion = self.robot.odometry(dt_s * ODOMETRY_TICKS as f64);
            self.due.push_back(Input::Odometry(motion));
        }
        let sonars = self.prepared.config.sonars.clone();
        for (place, mounting) in sonars.iter().enumerate() {
            let turn = place as u64 * SONAR_TICKS / sonars.len() as u64;
            if self.tick % SONAR_TICKS == turn {
                self.ping(place, mounting);
            }
        }
        if self.tick.is_multiple_of(LOOK_TICKS) {
            let (map, view) = (&self.prepared.flat.map, self.prepared.flat.camera);
            let targets = self.prepared.config.places.targets();
            targets.look(map, self.robot.pose, view, &mut self.seen);
        }
        if self.tick.is_multiple_of(SAMPLE_TICKS) {
            let people = self.people.iter().map(|person| person.at).collect();
            self.outcome
                .track
                .sample(self.now(), self.robot.pose, people);
        }
        let missing = self.seen.missing(self.prepared.config.places.visible());
        self.outcome.progress(self.now(), missing, DURATION_MAX);
    }

    fn ping(&mut self, place: usize, mounting: &Mounting) {
        let now = Duration::from_nanos(self.now().as_nanos());
        let failing = self.setup.failing.iter();
        let failing = failing.filter(|(sonar, _, from)| *sonar == place && *from <= now);
        let failing = failing.map(|(_, failing, _)| *failing).next_back();
        let echo = match failing {
            Some(failing) => failing.echo(),
            None => Some(self.hear(place, mounting)),
        };
        if let Some(echo) = echo {
            self.due.push_back(Input::Range(Reading {
                mounting: *mounting,
                echo,
                taken: now,
                expires: now + READING_HOLDS,
            }));
        }
    }

    fn hear(&mut self, place: usize, mounting: &Mounting) -> Echo {
        let discs: Vec<Disc> = self.people.iter().map(Person::disc).collect();
        let room = Room {
            map: self.prepared.config.floor.map(),
            surfaces: &|_| Reflector::Rough,
            discs: &discs,
        };
        let rng = &mut self.sonar_rngs[place];
        self.sonar_model
            .measure(room, self.robot.pose, mounting, &[], rng)
    }

    fn check_clearance(&mut self) {
        let drone = self.robot.pose.at;
        let velocity = self.room_velocity();
        let map = self.prepared.config.floor.map();
        let mut near = vec![(wall_m(map, drone), Touched::Wall)];
        if is_kept_out(map, drone) {
            near.push((0.0, Touched::Zone));
        }
        let people = self.people.iter();
        near.extend(people.map(|person| person_touch(drone, velocity, person)));
        let now = self.now();
        self.outcome.clearance.measure(now, drone, &near);
    }

    /// The drone's velocity along x and y, in m/s.
    fn room_velocity(&self) -> (f64, f64) {
        let velocity = self.robot.velocity;
        let ahead = muster_indoor::frames::BodyXy::new(velocity.forward_mps, velocity.left_mps);
        let MapXy { x_m, y_m, .. } = self.robot.pose.place(ahead);
        (x_m - self.robot.pose.at.x_m, y_m - self.robot.pose.at.y_m)
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn drone_in_a_zone_breaks_the_rule_far_from_walls_and_people() {
        let row = format!("#{}{}#\n", ".".repeat(10), "x".repeat(10));
        let wall = "#".repeat(22);
        let text = format!(
            "about = \"\"\ncell_m = 0.25\nplan = '''\n{wall}\n{}{wall}\n'''\n\
             start = {{ x_m = 1.0, y_m = 1.5, heading_deg = 0.0 }}\ncamera = {{ range_m = 4.0, cone_deg = 60.0 }}\n",
            row.repeat(10)
        );
        let flat = Flat::parse(Path::new("zone"), &text).unwrap();
        let prepared = Prepared::new(flat, Method::default()).unwrap();
        let mut world = World::new(&prepared, Setup::undisturbed());
        for (x_m, is_at_fault) in [(2.7, false), (2.8, true)] {
            world.robot.pose.at = MapXy::new(x_m, 1.5);
            world.check_clearance();
            assert_eq!(world.outcome.clearance.is_at_fault(), is_at_fault, "{x_m}");
        }
        let touches = world.finish().clearance;
        assert_eq!(touches.touches()[0].what, Touched::Zone);
    }
}
