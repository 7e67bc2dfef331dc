//! A drone's navigation in a flat: built from a plan's blueprint and checkpoints, as actors build it.

use std::path::Path;

use muster_indoor::patrol::{Event, Input, Patrol, Transmit};
use muster_indoor_world::world::{Prepared, World};
use muster_machines::identity::{NodeId, SwarmId};
use muster_machines::machine::{Emitted, Stimulus};
use muster_machines::navigation;
use muster_machines::node::{
    Address, Blueprint, Checkpoint, Checkpoints, Effect, Envelope, NodeMachine, Observation,
    StepOutput,
};
use muster_scenarios::scenario;

pub(crate) struct Node {
    blueprint: Blueprint,
    seed: u64,
    pub(crate) checkpoints: Checkpoints,
    machine: Option<NodeMachine>,
    output: StepOutput,
}

impl Node {
    /// A node that is to be started.
    pub(crate) fn new(prepared: &Prepared, seed: u64) -> Self {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../kill-at-waypoint.toml");
        let plan = scenario::load(&path, &[]).expect("a shipped scenario").plan;
        let mut blueprint = plan.blueprint(SwarmId(1), NodeId(1));
        blueprint.indoor = Some(Patrol::builder(prepared.config.clone()));
        Self {
            blueprint,
            seed,
            checkpoints: Checkpoints::default(),
            machine: None,
            output: StepOutput::default(),
        }
    }

    pub(crate) const fn is_up(&self) -> bool {
        self.machine.is_some()
    }

    /// Builds the navigation from the checkpoints, each time with another seed.
    pub(crate) fn start(&mut self, world: &mut World) {
        let (address, now) = (Address::Navigation, world.now());
        let machine = self
            .blueprint
            .build(address, self.seed, now, &self.checkpoints);
        self.machine = Some(machine);
        self.seed = self.seed.wrapping_add(1 << 32);
        self.step(world, &Stimulus::Timeout);
    }

    /// Loses the machine, and what the world wants of it meanwhile.
    pub(crate) fn crash(&mut self, world: &mut World) {
        self.machine = None;
        world.set_deadline(None);
    }

    /// Steps the machine; without one the stimulus is lost.
    pub(crate) fn step(&mut self, world: &mut World, stimulus: &Stimulus<Input>) {
        let Some(machine) = &mut self.machine else {
            return;
        };
        let stimulus = match stimulus {
            Stimulus::Timeout => Stimulus::Timeout,
            Stimulus::Input(input) => Stimulus::Input(Envelope::Navigation(Box::new(
                navigation::Input::Indoor(*input),
            ))),
        };
        machine.step(world.now(), stimulus, &mut self.output);
        world.set_deadline(self.output.deadline);
        for effect in self.output.effects.drain(..) {
            if let Some(output) = keep(&mut self.checkpoints, effect) {
                world.carry_out(output);
            }
        }
    }
}

/// Keeps checkpoints; what the flat carries out, if it is that.
fn keep(checkpoints: &mut Checkpoints, effect: Effect) -> Option<Emitted<Patrol>> {
    match effect {
        Effect::StoreCheckpoint(checkpoint) => {
            checkpoints.keep(checkpoint.clone());
            match checkpoint {
                Checkpoint::Indoor(indoor) => Some(Emitted::Event(Event::Checkpoint(indoor))),
                _ => None,
            }
        }
        Effect::Observe(Observation::Navigation(event)) => match event {
            navigation::Event::Velocity(velocity) => {
                Some(Emitted::Transmit(Transmit::Velocity(velocity)))
            }
            navigation::Event::Indoor(event) => Some(Emitted::Event(event)),
            navigation::Event::Checkpoint(_) => None,
        },
        _ => None,
    }
}
