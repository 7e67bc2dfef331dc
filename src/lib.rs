//! An actor-based runtime for swarms of drones: a library for agents of one's own.
//!
//! An [`Agent`](agent::Agent) decides where one drone flies and what it tells others. [`Sim`] flies a swarm of them in a
//! simulation, [`main`] makes a program with all of muster's commands, and [`daemon`] one that flies a drone as a process.
//!
//! ```no_run
//! use muster::agent::{Agent, Context};
//! use muster::{Ned, Sim};
//!
//! struct North;
//!
//! impl Agent for North {
//!     fn start(&mut self, context: &mut Context<'_>) {
//!         context.go_to(context.slot() + Ned::new(100.0, 0.0, 0.0));
//!     }
//! }
//!
//! # fn main() -> Result<(), muster::Error> {
//! let run = Sim::load("north.toml")?
//!     .set("radio.loss", 0.2)?
//!     .agents(|_id| Box::new(North))?
//!     .run()?;
//! println!("{:.0} s", run.report.simulated_s);
//! # Ok(())
//! # }
//! ```

mod command;
mod simulation;

use std::process::ExitCode;

pub use muster_experiments::campaign::{COMBINATIONS_MAX, Row};
pub use muster_experiments::output;
pub use muster_machines::agent;
pub use muster_machines::geometry::{Ned, Velocity};
pub use muster_machines::identity::{NodeId, NodeSet};
pub use muster_machines::time::Timestamp;
pub use muster_runtime::agents::{AgentFactory, AgentSpec, Agents, ParametersError};
pub use muster_runtime::failure::with_causes;
pub use muster_scenarios::engine::{Engine, Stop};
pub use muster_scenarios::report;
pub use muster_scenarios::scenario::Variation;

pub use self::simulation::{Error, Run, Sim, check_folder};

/// Runs the examples of the book's page on agents as documentation tests.
#[cfg(doctest)]
#[doc = include_str!("../docs/src/extend/agent.md")]
struct AgentPage;

/// Runs the command of muster that the arguments of this process name, with these agents: `sim`, `campaign`, `chaos`, `swarm`
/// and all others. Returns the exit code.
#[must_use]
pub fn main(agents: Agents) -> ExitCode {
    install(agents);
    command::run()
}

/// Runs a drone as a process, as `musterd` does, with these agents. Returns the exit code.
#[must_use]
pub fn daemon(agents: Agents) -> ExitCode {
    install(agents);
    muster_daemon::program::main()
}

fn install(agents: Agents) {
    agents.install().expect(
        "a program's main function installs its agents once, and nothing reads scenarios before",
    );
}
