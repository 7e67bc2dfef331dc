//! How both programs end that can't do what they were asked for: what is wrong is shown on standard error.

use std::error::Error;
use std::process::ExitCode;

use crate::diagnostic::BadInput;

/// Shows what is wrong with files: where, and what would be accepted.
#[expect(clippy::print_stderr, reason = "this is where errors are shown")]
#[must_use]
pub fn refuse(inputs: &[BadInput]) -> ExitCode {
    inputs
        .iter()
        .for_each(|input| eprint!("{}", input.rendered()));
    ExitCode::from(2)
}

/// Shows what went wrong, with what brought it about.
#[expect(clippy::print_stderr, reason = "this is where errors are shown")]
#[must_use]
pub fn complain(error: &dyn Error, code: u8) -> ExitCode {
    eprint!("Error: {error}");
    let mut cause = error.source();
    while let Some(error) = cause {
        eprint!(": {error}");
        cause = error.source();
    }
    eprintln!();
    ExitCode::from(code)
}
