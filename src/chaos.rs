use std::io;
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use indicatif::ProgressBar;
use muster_scenarios::campaign::{Effort, Seeds};
use muster_scenarios::chaos::{self, Progress, RUN_LIMIT, Request, Search};
use muster_scenarios::scenario::Override;

use crate::campaign::{jobs, run_limit};
use crate::{Ended, Failure, folder, terminal};

/// Search for a fault plan that breaks a rule, and make it as small as it gets.
///
/// Each seed is a plan: which swarm it is of those that the scenario's table `[chaos]` allows, and what befalls it.
/// Plans are flown until one breaks a rule. That one is made small and written as a scenario that breaks the rule by
/// itself, with its report, or all that break a rule are listed. Interrupted, the same command goes on from there.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  muster chaos scenarios/chaos.toml --seeds 0..1000
  muster chaos scenarios/chaos.toml --seeds 0..1000 --set protocol.policy=tree --out runs/tree
  muster chaos scenarios/chaos.toml --seeds 0..1000 --keep-going

Exit code 3 if a rule was broken. A folder of fewer plans from the same seed on is gone on with.")]
pub(crate) struct Arguments {
    /// The scenario file.
    scenario: PathBuf,
    /// The seeds of the plans: A..B leaves B out, A..=B does not.
    #[arg(long, value_name = "A..B", allow_hyphen_values = true)]
    seeds: Seeds,
    /// Set a field of the scenario in every plan, as in radio.loss=0.1: it does not vary then; may be given several times.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<Override>,
    /// How many plans are flown at once [default: one a core]
    #[arg(long, value_name = "N", value_parser = jobs)]
    jobs: Option<NonZeroUsize>,
    /// Wall-clock seconds that a plan may take; one that takes longer breaks rule 10
    #[arg(long, value_name = "SECONDS", value_parser = run_limit, default_value_t = RUN_LIMIT.as_secs())]
    run_limit: u64,
    /// Go on past plans that break a rule, and list them
    #[arg(long)]
    keep_going: bool,
    /// The folder to write to, and to go on in [default: runs/SCENARIO-chaos-A]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

pub(crate) fn run(arguments: &Arguments) -> Result<Ended, Failure> {
    let search = Search::load(&Request {
        scenario: arguments.scenario.clone(),
        set: arguments.overrides.clone(),
        seeds: arguments.seeds,
        keeps_going: arguments.keep_going,
    })?;
    let out = arguments.out.clone().unwrap_or_else(|| {
        let what = format!("chaos-{}", arguments.seeds.at(0));
        folder::of(&arguments.scenario, what)
    });
    folder::check(&out)?;
    let jobs = arguments
        .jobs
        .or_else(|| std::thread::available_parallelism().ok())
        .unwrap_or(NonZeroUsize::MIN);
    let run_limit = Duration::from_secs(arguments.run_limit);
    let effort = Effort { jobs, run_limit };
    let bar = terminal::progress_bar(
        "{pos:>8}/{len} plans {bar:40.cyan/dim} {percent:>3} %  {elapsed} elapsed, {eta} left{msg}",
    );
    let searched = chaos::run(&search, &out, effort, &|fly| fly(), |progress| {
        show(&bar, progress);
    })?;
    bar.finish_and_clear();
    let mut text = chaos::table(&searched, terminal::colour(&io::stdout()));
    text.push_str(&format!(
        "\n wrote {}\n",
        out.join(chaos::CHAOS_JSON).display()
    ));
    if let Some(finding) = &searched.finding {
        for path in [
            &finding.scenario,
            &finding.written.html,
            &finding.written.json,
        ] {
            text.push_str(&format!(" wrote {}\n", path.display()));
        }
    }
    terminal::print(&text)?;
    Ok(
        if searched.finding.is_some() || !searched.broken.is_empty() {
            Ended::RuleBroken
        } else {
            Ended::Well
        },
    )
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
            let flown = Duration::from_secs_f64(simulated_s).as_secs() / 3_600;
            bar.set_message(format!(", {flown} h simulated"));
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
