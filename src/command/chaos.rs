use std::io;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;
use indicatif::ProgressBar;
use muster_experiments::campaign::{RunOptions, Seeds};
use muster_experiments::chaos::{self, Progress, RUN_LIMIT, Request, Search, SearchResult};
use muster_experiments::output;
use muster_scenarios::scenario::Override;

use super::campaign::{jobs, run_limit};
use super::overrides::check_distinct;
use super::{Failure, Outcome, folder, terminal};

/// Search for a fault plan that breaks a rule, and shrink it.
///
/// Each seed gives a plan: a swarm within the limits of the scenario's table `[chaos]`, and faults. Plans are simulated
/// until one breaks a rule. That plan is shrunk and written as a scenario, with its report. With --keep-going, all plans
/// that break a rule are listed instead. An interrupted search resumes with the same command.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  muster chaos chaos --seeds 0..1000
  muster chaos chaos --seeds 0..1000 --set protocol.policy=tree --out runs/tree
  muster chaos chaos --seeds 0..1000 --keep-going

Exit code 3 if a rule was broken. Resumes an existing folder with the same first seed.")]
pub(crate) struct Arguments {
    /// A scenario file, or the name of a shipped scenario (`muster list`).
    #[arg(value_name = "SCENARIO")]
    scenario: PathBuf,
    /// Random seeds of the plans: A..B excludes B, A..=B includes it.
    #[arg(long, value_name = "A..B", allow_hyphen_values = true)]
    seeds: Seeds,
    /// Fix a field of the scenario in every plan, for example radio.loss=0.1; may be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<Override>,
    /// Number of parallel plans [default: one per core]
    #[arg(long, value_name = "N", value_parser = jobs, allow_negative_numbers = true)]
    jobs: Option<NonZeroUsize>,
    /// Wall-clock limit of a plan; a longer run breaks rule 10
    #[arg(long, value_name = "SECONDS", value_parser = run_limit, allow_negative_numbers = true, default_value_t = RUN_LIMIT.as_secs())]
    run_limit: u64,
    /// Continue after a plan that breaks a rule, and list all such plans
    #[arg(long)]
    keep_going: bool,
    /// Also show which faults met drones in which state, and how long the search took
    #[arg(long)]
    explain: bool,
    /// Output folder; resumes a search found there [default: runs/SCENARIO-chaos-A, with -2, -3, … appended if another search
    /// has the folder]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

pub(crate) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    check_distinct(&arguments.scenario, &arguments.overrides)?;
    let search = Search::load(&Request {
        scenario: arguments.scenario.clone(),
        set: arguments.overrides.clone(),
        seeds: arguments.seeds,
        keeps_going: arguments.keep_going,
    })?;
    let out = arguments.out.clone().unwrap_or_else(|| {
        let suffix = format!("chaos-{}", arguments.seeds.at(0));
        let folder = folder::default_for(&arguments.scenario, suffix);
        output::numbered(&folder, |folder| search.is_in(folder))
    });
    folder::check_writable(&out)?;
    let jobs = arguments
        .jobs
        .or_else(|| std::thread::available_parallelism().ok())
        .unwrap_or(NonZeroUsize::MIN);
    let run_limit = Duration::from_secs(arguments.run_limit);
    let options = RunOptions { jobs, run_limit };
    let bar = terminal::progress_bar(
        "{pos:>8}/{len} plans {bar:40.cyan/dim} {percent:>3} %  {elapsed} elapsed, {eta} left{msg}",
    );
    let mut before = 0;
    let searched = chaos::run(&search, &out, options, &|fly| fly(), |progress| {
        if let Progress::Searching { kept, .. } = progress {
            before = kept;
        }
        show(&bar, progress);
    })?;
    bar.finish_and_clear();
    let colour = terminal::colour(&io::stdout());
    let mut text = chaos::table(&searched, colour);
    if arguments.explain {
        text.push('\n');
        text.push_str(&chaos::explanation(&searched, colour));
    }
    let resumed = folder::resumed(("search", "plan"), &out, before);
    let resumed = resumed.map_or_else(String::new, |it| format!(" {it}\n"));
    text.push_str(&format!("\n{resumed}"));
    for path in files(&searched, &out) {
        text.push_str(&format!(" wrote {}\n", path.display()));
    }
    terminal::print(&text)?;
    Ok(
        if searched.finding.is_some() || !searched.broken.is_empty() {
            Outcome::RuleBroken
        } else {
            Outcome::Success
        },
    )
}

/// The files that a search wrote.
fn files(searched: &SearchResult, out: &Path) -> Vec<PathBuf> {
    let mut files = vec![out.join(chaos::CHAOS_JSON)];
    if let Some(finding) = &searched.finding {
        let written = &finding.written;
        files.extend([&finding.scenario, &written.html, &written.json].map(Clone::clone));
    }
    files
}

fn show(bar: &ProgressBar, progress: Progress) {
    match progress {
        Progress::Searching {
            plans,
            kept,
            total,
            simulated_s,
        } => {
            if plans == kept {
                bar.update(|state| {
                    state.set_len(total);
                    state.set_pos(kept);
                });
                bar.reset_eta();
            }
            bar.set_position(plans);
            let hours = Duration::from_secs_f64(simulated_s).as_secs() / 3_600;
            bar.set_message(format!(", {hours} h simulated"));
        }
        Progress::Shrinking {
            seed,
            faults,
            tried,
        } => bar.set_message(format!(
            ", seed {seed} breaks a rule: {faults} faults left after {tried} smaller plans"
        )),
    }
}
