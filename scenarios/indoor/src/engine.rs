//! The two engines, as scenarios have them: a loop that steps the machine, and actors under virtual time. The same world with
//! the same seed has the same outcome on both.

mod actors;

use muster_indoor::patrol::Patrol;
use muster_machines::machine::step;

use crate::world::{Outcome, Prepared, Setup, World};

pub use self::actors::{EngineError, run as run_on_actors};

/// Patrols a flat by stepping the machine.
#[must_use]
pub fn run(prepared: &Prepared, setup: Setup) -> Outcome {
    let mut world = World::new(prepared, setup);
    let mut patrol = Patrol::new(prepared.config.clone(), world.seed(), world.now(), None);
    let mut outputs = Vec::new();
    while let Some(stimulus) = world.next_stimulus() {
        let deadline = step(&mut patrol, world.now(), stimulus, |it| outputs.push(it));
        outputs.drain(..).for_each(|output| world.carry_out(output));
        world.set_deadline(deadline);
    }
    world.finish()
}
