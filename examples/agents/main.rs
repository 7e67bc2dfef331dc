//! Five agents, and a program that flies them: `cargo run --release --example agents -- sim examples/agents/lanes.toml`.

#[path = "all.rs"]
mod all;

use std::process::ExitCode;

fn main() -> ExitCode {
    muster::main(all::agents())
}
