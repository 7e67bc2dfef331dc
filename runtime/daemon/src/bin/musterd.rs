//! The daemon's program.

use std::process::ExitCode;

fn main() -> ExitCode {
    muster_daemon::program::main()
}
