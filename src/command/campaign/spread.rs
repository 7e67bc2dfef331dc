//! A campaign on several hosts.

use std::path::{Path, PathBuf};

use muster_deploy::campaign::{SpreadError, SpreadRequest, spread};
use muster_deploy::hosts;
use muster_experiments::campaign::{self, Campaign};
use muster_runtime::plan::file::Source;
use muster_runtime::text::plural;
use muster_scenarios::engine::Engine;
use muster_scenarios::scenario::{is_shipped, mission_file, mission_path};

use super::super::{Failure, Outcome, folder, terminal};
use super::{Arguments, outcome, print};

impl From<SpreadError> for Failure {
    fn from(error: SpreadError) -> Self {
        match error {
            SpreadError::Refused(input) => input.into(),
            error => Self::Spread(error),
        }
    }
}

/// Runs the shards on the hosts of a file, and joins them.
pub(super) fn run(
    arguments: &Arguments,
    campaign: &Campaign,
    (file, out): (&Path, &Path),
) -> Result<Outcome, Failure> {
    let hosts = hosts::commands(file)?;
    folder::check_writable(out)?;
    let program = std::env::current_exe().map_err(Failure::Print)?;
    let report = |text: &str| {
        let _ = std::io::Write::write_all(
            &mut std::io::stderr(),
            format!(
                "{text}
"
            )
            .as_bytes(),
        );
    };
    let parts = out.join("parts");
    campaign.check_shards(&parts)?;
    let parts = spread(
        &SpreadRequest {
            hosts: &hosts,
            program: &program,
            files: &files(&arguments.scenario)?,
            arguments: &words(arguments),
            runs: campaign.shard_runs(),
            folder: &parts,
        },
        &report,
    )?;
    let whole = out.join("whole");
    let published = campaign::merge(&parts, &whole)?;
    print(&published)?;
    let runs = usize::try_from(campaign.shard_runs()).unwrap_or(usize::MAX);
    let (runs, hosts) = (plural(runs, "run"), plural(hosts.len(), "host"));
    terminal::print(&format!(" {runs} on {hosts}\n"))?;
    Ok(outcome(&published))
}

/// The scenario's file and its mission's. None for a shipped scenario, which every muster has.
fn files(scenario: &Path) -> Result<Vec<PathBuf>, Failure> {
    if !scenario.is_file() && is_shipped(scenario) {
        return Ok(Vec::new());
    }
    let text = muster_runtime::diagnostic::read_text(scenario)?;
    let named = mission_file(&Source::new(scenario, text))?;
    let mission = mission_path(&named)?.into_owned();
    Ok(vec![scenario.to_owned(), mission])
}

/// The arguments that say what is run.
pub(super) fn words(arguments: &Arguments) -> Vec<String> {
    let mut words = vec![arguments.scenario.display().to_string()];
    words.extend(["--seeds".to_owned(), arguments.seeds.to_string()]);
    for vary in &arguments.vary {
        words.extend(["--vary".to_owned(), vary.to_string()]);
    }
    for set in &arguments.overrides {
        words.extend(["--set".to_owned(), set.to_string()]);
    }
    let engine = Engine::from(arguments.engine);
    words.extend(["--engine".to_owned(), engine.to_string()]);
    words.extend(["--run-limit".to_owned(), arguments.run_limit.to_string()]);
    words
}
