//! One drone as a process, with the agents of the example `agents`. `agents swarm` starts it.

#[path = "../agents/all.rs"]
mod all;

use std::process::ExitCode;

fn main() -> ExitCode {
    muster::daemon(all::agents())
}
