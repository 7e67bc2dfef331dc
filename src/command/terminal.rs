//! Output on the terminal: progress bars, colours, printing.

use std::io::{self, IsTerminal, Write};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use muster_scenarios::report::Colour;

/// ANSI sequence that clears the terminal and its scrollback.
pub(crate) const CLEAR: &str = "\x1b[H\x1b[2J\x1b[3J";

/// A progress bar on standard error; hidden if that is no terminal.
pub(crate) fn progress_bar(template: &'static str) -> ProgressBar {
    let target = if io::stderr().is_terminal() {
        ProgressDrawTarget::stderr()
    } else {
        ProgressDrawTarget::hidden()
    };
    let style = ProgressStyle::with_template(template).expect("the template is a constant");
    let bar = ProgressBar::with_draw_target(None, target).with_style(style);
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}

/// Colours on a terminal, unless `NO_COLOR` is set.
pub(crate) fn colour(out: &impl IsTerminal) -> Colour {
    if out.is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|it| it.is_empty()) {
        Colour::Always
    } else {
        Colour::Never
    }
}

/// Prints on standard output. A closed pipe is no error: the exit code still reports the result.
pub(crate) fn print(text: &str) -> io::Result<()> {
    print_to_reader(text).map(drop)
}

/// As [`print`], for commands that print until they are interrupted. Returns whether the pipe has a reader; without one they
/// end.
pub(crate) fn print_to_reader(text: &str) -> io::Result<bool> {
    match io::stdout().lock().write_all(text.as_bytes()) {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(false),
        written => written.map(|()| true),
    }
}
