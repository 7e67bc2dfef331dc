//! The scene of a scenario at the start of a run.

use std::time::Duration;

use muster_machines::identity::{NodeId, SwarmId};
use muster_machines::node::Blueprint;
use muster_machines::time::Timestamp;
use muster_runtime::plan::Plan;
use muster_runtime::vehicle::Vehicle;
use muster_transport::sim::Medium;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::air::Air;
use super::airspace::Airspace;
use super::controllers::Controllers;
use super::core::Core;
use super::drone::Drone;
use super::event::Event;
use super::faults::FaultPlan;
use super::inbox::Inbox;
use super::links::LinkWatch;
use super::processes::{Processes, Timeouts};
use super::scene::Scene;
use super::swarm::{Swarm, Swarms};
use super::tampering::Tampering;
use super::timeline::Timeline;
use super::trace::Trace;
use crate::checkers::Checkers;
use crate::scenario::Scenario;

/// Streams of the random generator that are drawn from the scenario's seed; those of drones follow.
const MEDIUM_STREAM: u64 = 0;
const FIRST_DRONE_STREAM: u64 = 1;
const LINES_STREAM: u64 = u64::MAX - 2;
const CONTROLLERS_STREAM: u64 = u64::MAX - 1;
const FAULTS_STREAM: u64 = u64::MAX;

/// The scene with all drones on the ground. The order to fly is scheduled for each master.
pub(super) fn scene(scenario: &Scenario) -> Scene {
    let generator = |stream: u64| {
        let mut rng = ChaCha8Rng::seed_from_u64(scenario.seed);
        rng.set_stream(stream);
        rng
    };
    let limits = &scenario.plan.limits;
    let mut timeline = Timeline::new(Timestamp::ZERO + scenario.bound());
    let (mut swarms, mut places, mut vehicles) = (Vec::new(), Vec::new(), Vec::new());
    let mut controllers = Controllers::default();
    let mut sensors = generator(CONTROLLERS_STREAM);
    let mut lines = generator(LINES_STREAM);
    let mut nodes = 0;
    for (swarm, joins) in scenario.swarms() {
        let began = Swarm::new(swarm, nodes);
        timeline.schedule_after(joins.after, Event::Fly(began.recorder.centre()));
        places.extend(swarm.plan.start_positions().map(|place| place + joins.home));
        vehicles.extend(swarm.plan.start_positions().map(|place| {
            Vehicle::new(swarm.plan.landing, place)
                .with_endurance(swarm.plan.endurance)
                .with_home(joins.home)
        }));
        controllers.extend(swarm, &mut sensors, &mut lines);
        swarms.push(began);
        nodes += swarm.plan.nodes();
    }
    for drone in controllers.drones() {
        timeline.schedule_after(Duration::ZERO, Event::PortTick(drone));
    }
    let faults = FaultPlan::new(&scenario.faults);
    faults.schedule_timed(&mut timeline);
    let listened_to = faults.listened_to(scenario.plan.nodes());
    let has_journals = faults.restarts_processes();
    let drones = (0..u64::from(nodes))
        .map(|id| Drone::new(generator(FIRST_DRONE_STREAM + id), has_journals));
    let medium = Medium::new(scenario.radio, generator(MEDIUM_STREAM), &places);
    let tampering = Tampering::new(generator(FAULTS_STREAM), listened_to.into_iter());
    Scene {
        air: Air::new(medium, tampering),
        controllers,
        airspace: Airspace::new(vehicles, limits.separation, !scenario.unchecked),
        processes: Processes::new(
            drones.collect(),
            Timeouts {
                actor: limits.hang,
                watchdog: limits.watchdog,
                link: limits.controller,
            },
        ),
        links: LinkWatch::new(),
        core: Core {
            timeline,
            inbox: Inbox::new(nodes as usize, limits.waiting_max),
            swarms: Swarms::new(swarms),
            faults,
            checkers: Checkers::new(nodes, limits.waiting_max, !scenario.unchecked),
            trace: Trace::new(),
        },
    }
}

/// The blueprints of all drones of a scenario, by the world's numbers. Each names its drone by its swarm's number.
pub(crate) fn blueprints(scenario: &Scenario) -> Vec<Blueprint> {
    let swarms = (Plan::FIRST_SWARM.0..).map(SwarmId);
    swarms
        .zip(scenario.swarms())
        .flat_map(|(id, (swarm, _))| {
            (0..swarm.plan.nodes()).map(move |member| swarm.plan.blueprint(id, NodeId(member)))
        })
        .collect()
}
