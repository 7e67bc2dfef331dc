//! The operator's program.

use std::process::ExitCode;

fn main() -> ExitCode {
    muster::main(muster::Agents::default())
}
