mod agent;

use std::fs::File;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use muster_runtime::diagnostic::BadInput;

use super::{Failure, Outcome, terminal};

const SCENARIO: &str = include_str!("new/scenario.toml");
const MISSION: &str = include_str!("new/mission.waypoints");
/// Stands for the name in [`SCENARIO`].
const NAME: &str = "NAME";

/// Write files to start from.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  muster new scenario my-first
  muster new agent search")]
pub(crate) struct Arguments {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// Write a commented scenario, NAME.toml, and its mission, NAME.waypoints. They fly as they are.
    Scenario {
        /// Name of the files, which may have a folder before it; existing files are not overwritten.
        #[arg(default_value = "my-flight")]
        name: PathBuf,
    },
    /// Write a crate with an agent of your own, a scenario and a test. It builds and flies as it is.
    Agent {
        /// Name of the crate and its folder: lower-case letters, digits, - and _. An existing folder is not touched.
        name: PathBuf,
        /// Where muster's sources are [default: where this program was built from]
        #[arg(long, value_name = "DIR")]
        muster: Option<PathBuf>,
    },
}

pub(crate) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    match &arguments.what {
        What::Scenario { name } => new_scenario(name),
        What::Agent { name, muster } => agent::run(name, muster.as_deref()),
    }
}

fn new_scenario(name: &Path) -> Result<Outcome, Failure> {
    let stem = name.file_name().unwrap_or_default().to_string_lossy();
    let is_folder = name.as_os_str().as_encoded_bytes().ends_with(b"/");
    if stem.is_empty()
        || is_folder
        || !stem
            .chars()
            .all(|c| c.is_alphanumeric() || "-_".contains(c))
    {
        let help = "a name has letters, digits, - and _; the extensions are added";
        return Err(
            BadInput::without_excerpt(name, "can't be the name of a scenario", help).into(),
        );
    }
    let [scenario, mission] = ["toml", "waypoints"].map(|it| name.with_extension(it));
    if let Some(existing) = [&scenario, &mission]
        .into_iter()
        .find(|it| it.symlink_metadata().is_ok())
    {
        let help = "give another name";
        return Err(
            BadInput::without_excerpt(existing, "exists and is not overwritten", help).into(),
        );
    }
    let folder = name
        .parent()
        .filter(|it| *it != Path::new("") && !it.is_dir());
    if let Some(folder) = folder {
        let help = "create the folder first";
        return Err(BadInput::without_excerpt(folder, "there is no such folder", help).into());
    }
    write(&mission, MISSION)?;
    write(&scenario, &SCENARIO.replace(NAME, &stem))?;
    let shown = scenario.display();
    terminal::print(&format!(
        "wrote {} and {}\n\nCheck it: muster check {shown}\nFly it:   muster sim {shown}\n",
        scenario.display(),
        mission.display()
    ))?;
    Ok(Outcome::Success)
}

fn write(path: &Path, text: &str) -> Result<(), Failure> {
    let written = File::create_new(path).and_then(|mut file| file.write_all(text.as_bytes()));
    written.map_err(|source| Failure::Create {
        path: path.to_owned(),
        source,
    })
}
