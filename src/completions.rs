use clap::{Args, CommandFactory};
use clap_complete::Shell;

use crate::{Ended, Failure, terminal};

/// Print a script that completes this command's arguments in a shell.
#[derive(Debug, Args)]
#[command(after_help = "Example, for bash:
  muster completions bash > ~/.local/share/bash-completion/completions/muster")]
pub(crate) struct Arguments {
    /// The shell.
    #[arg(value_enum)]
    shell: Shell,
}

pub(crate) fn run(arguments: &Arguments) -> Result<Ended, Failure> {
    let mut command = crate::Arguments::command();
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut command, "muster", &mut script);
    terminal::print(&String::from_utf8_lossy(&script))?;
    Ok(Ended::Well)
}
