//! Error output of the programs: what is wrong, on standard error, and the exit code.

use std::error::Error;
use std::process::ExitCode;

use crate::diagnostic::BadInput;

/// Prints what is wrong in input files, where, and what is accepted. The exit code is 2.
#[expect(clippy::print_stderr, reason = "this is where errors are shown")]
#[must_use]
pub fn report_bad_inputs(inputs: &[BadInput]) -> ExitCode {
    inputs
        .iter()
        .for_each(|input| eprint!("{}", input.rendered()));
    ExitCode::from(2)
}

/// Prints an error and its causes on one line, and returns `code`.
#[expect(clippy::print_stderr, reason = "this is where errors are shown")]
#[must_use]
pub fn report_error(error: &dyn Error, code: u8) -> ExitCode {
    eprintln!("Error: {}", with_causes(error));
    ExitCode::from(code)
}

/// An error and its causes, such as what the system said, on one line.
#[must_use]
pub fn with_causes(error: &dyn Error) -> String {
    let mut words = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        words.push_str(&format!(": {error}"));
        cause = error.source();
    }
    words
}
