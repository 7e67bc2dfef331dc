use clap::{Args, CommandFactory};
use clap_complete::Shell;

use super::{Failure, Outcome, terminal};

/// Print a shell completion script.
#[derive(Debug, Args)]
#[command(after_help = "Example, for bash:
  muster completions bash > ~/.local/share/bash-completion/completions/muster")]
pub(crate) struct Arguments {
    /// Shell to complete for.
    #[arg(value_enum)]
    shell: Shell,
}

pub(crate) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let mut command = super::Arguments::command();
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut command, "muster", &mut script);
    terminal::print(&String::from_utf8_lossy(&script))?;
    Ok(Outcome::Success)
}
