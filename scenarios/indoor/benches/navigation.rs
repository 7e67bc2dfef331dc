//! Work of a navigation with a map: `cargo bench -p muster-indoor-world --bench navigation`. It patrols the shipped flat with
//! noise and people; a step is one input, or one decision, and what the flat does with its outputs. A patrol is
//! the same each time, so a step counts with its shortest time of several patrols: what else runs here counts little.

#![expect(
    clippy::print_stdout,
    clippy::disallowed_methods,
    reason = "this is a program that measures times and prints a table"
)]

#[expect(dead_code, reason = "it does not crash here")]
#[path = "../tests/navigation/node.rs"]
mod node;

use std::error::Error;
use std::path::Path;
use std::time::{Duration, Instant};

use muster_indoor_world::flat::Flat;
use muster_indoor_world::world::{Prepared, Setup, World};

use self::node::Node;

const SEEDS: u64 = 3;
/// Patrols of each seed.
const REPEATED: usize = 8;
/// The most that a step may take.
const TARGET: Duration = Duration::from_millis(2);

fn main() -> Result<(), Box<dyn Error>> {
    let prepared = Prepared::new(Flat::read(Path::new("flat"))?, Default::default())?;
    println!("Work of a navigation with a map, µs a step, shortest of {REPEATED} patrols\n");
    println!(
        "{:>4} {:>8} {:>8} {:>8} {:>8}",
        "seed", "steps", "median", "p99", "longest"
    );
    let mut longest = Duration::ZERO;
    for seed in 0..SEEDS {
        let mut steps = steps(&prepared, seed);
        for _ in 1..REPEATED {
            let again = self::steps(&prepared, seed);
            assert_eq!(again.len(), steps.len(), "a patrol is the same each time");
            let pairs = steps.iter_mut().zip(again);
            pairs.for_each(|(step, again)| *step = again.min(*step));
        }
        steps.sort_unstable();
        let at = |share: f64| steps[((steps.len() - 1) as f64 * share) as usize];
        let us = |time: Duration| time.as_secs_f64() * 1e6;
        println!(
            "{seed:>4} {:>8} {:>8.1} {:>8.1} {:>8.1}",
            steps.len(),
            us(at(0.5)),
            us(at(0.99)),
            us(at(1.0))
        );
        longest = longest.max(at(1.0));
    }
    if longest > TARGET {
        return Err(format!("a step takes {longest:?}, more than {TARGET:?}").into());
    }
    Ok(())
}

/// The time of each step of a patrol.
fn steps(prepared: &Prepared, seed: u64) -> Vec<Duration> {
    let mut world = World::new(prepared, Setup::seeded(seed));
    let mut node = Node::new(prepared, seed);
    node.start(&mut world);
    let mut steps = Vec::new();
    while let Some(stimulus) = world.next_stimulus() {
        let begun = Instant::now();
        node.step(&mut world, &stimulus);
        steps.push(begun.elapsed());
    }
    steps
}
