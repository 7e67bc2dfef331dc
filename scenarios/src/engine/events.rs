//! The engine that steps machines directly, without actors.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

use muster_actors::InjectedCrash;
use muster_machines::identity::NodeId;
use muster_machines::machine::Stimulus;
use muster_machines::node::{Address, Blueprint, NodeMachine, StepOutput};
use muster_machines::supervision::Supervision;

use super::Meter;
use crate::scenario::Scenario;
use crate::world::{What, World, blueprints};

struct Drone {
    /// Apart from the machines, since it is seldom read.
    blueprint: Box<Blueprint>,
    machines: [Option<NodeMachine>; 5],
    supervision: Supervision,
}

pub(super) fn run(scenario: &Scenario, mut world: World, mut meter: Option<Meter>) -> World {
    let mut output = StepOutput::default();
    let mut drones: Vec<Drone> = blueprints(scenario)
        .into_iter()
        .map(|blueprint| Drone {
            blueprint: Box::new(blueprint),
            machines: [const { None }; 5],
            supervision: Supervision::new(scenario.plan.limits.restarts),
        })
        .collect();
    for (id, drone) in (0..).map(NodeId).zip(&mut drones) {
        drone.build_all(&mut world, id, &mut output);
    }
    let mut soon = Vec::new();
    while let Some(task) = world.next() {
        if world.look_ahead(&mut soon) {
            read_ahead(&drones, &soon);
        }
        if let Some(meter) = &mut meter {
            meter.read(&world);
        }
        let (id, address) = (task.drone, task.address);
        let drone = &mut drones[id.0 as usize];
        match task.what {
            What::Restart => {
                drone.build(&mut world, id, address, &mut output);
                continue;
            }
            What::Boot => {
                drone.supervision = Supervision::new(scenario.plan.limits.restarts);
                drone.build_all(&mut world, id, &mut output);
                continue;
            }
            What::Step(_) | What::Crash => {}
        }
        let Some(machine) = &mut drone.machines[address as usize] else {
            continue;
        };
        let step = AssertUnwindSafe(|| match task.what {
            What::Step(stimulus) => machine.step(world.now_of(id), stimulus, &mut output),
            What::Crash | What::Restart | What::Boot => resume_unwind(Box::new(InjectedCrash)),
        });
        match catch_unwind(step) {
            Ok(()) => world.carry_out(id, address, &mut output),
            Err(_) => drone.fail(&mut world, id, address),
        }
    }
    world
}

/// Loads the memory of radios and routings that will be needed soon: first what lies in each, then what that refers to, so
/// that the loads overlap.
fn read_ahead(drones: &[Drone], soon: &[(NodeId, Option<NodeId>)]) {
    let machines = |id: NodeId| {
        let [radio, routing, ..] = &drones[id.0 as usize].machines;
        radio.iter().chain(routing)
    };
    for (id, _) in soon {
        machines(*id).for_each(NodeMachine::read_ahead);
    }
    for (id, sender) in soon {
        machines(*id).for_each(|machine| machine.read_further_ahead(*sender));
    }
}

impl Drone {
    fn build_all(&mut self, world: &mut World, id: NodeId, output: &mut StepOutput) {
        for address in Address::ALL {
            self.build(world, id, address, output);
        }
    }

    fn build(&mut self, world: &mut World, id: NodeId, address: Address, output: &mut StepOutput) {
        world.starting(id, address);
        let seed = world.seed(id);
        let now = world.now_of(id);
        let checkpoints = world.checkpoints(id);
        let build = AssertUnwindSafe(|| {
            let mut machine = self.blueprint.build(address, seed, now, checkpoints);
            machine.step(now, Stimulus::Timeout, output);
            machine
        });
        match catch_unwind(build) {
            Ok(machine) => {
                world.carry_out(id, address, output);
                self.machines[address as usize] = Some(machine);
            }
            Err(_) => self.fail(world, id, address),
        }
    }

    fn fail(&mut self, world: &mut World, id: NodeId, address: Address) {
        self.machines[address as usize] = None;
        let decision = self.supervision.failed(world.now_of(id), address);
        world.failed(id, address, decision);
    }
}
