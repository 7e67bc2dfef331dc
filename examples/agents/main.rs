//! Five agents, and a program that flies them: `cargo run --release --example agents -- sim scenarios/agents/lanes.toml`.

mod auction;
mod flocking;
mod lanes;
mod mule;
mod pursuit;

use std::process::ExitCode;

use muster::{AgentFactory, Agents};

/// The agents of these examples, by name.
fn agents() -> Agents {
    Agents::default()
        .with("auction", AgentFactory::new(auction::Auction::new))
        .with("flocking", AgentFactory::new(flocking::Flocking::new))
        .with("lanes", AgentFactory::new(lanes::Lanes::new))
        .with("mule", AgentFactory::new(mule::Mule::new))
        .with("pursuit", AgentFactory::new(pursuit::Pursuit::new))
}

fn main() -> ExitCode {
    muster::main(agents())
}
