//! A campaign as jobs of Slurm.

use std::fs::{self, Permissions};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

use muster_experiments::campaign::Campaign;
use muster_runtime::text::plural;

use super::super::{Failure, Outcome, folder, terminal};
use super::{Arguments, spread};

/// Name of the script in the output folder.
const SCRIPT: &str = "submit.sh";

/// Writes a script that submits the shards and the job that joins them.
pub(super) fn run(
    arguments: &Arguments,
    campaign: &Campaign,
    (shards, out): (u32, &Path),
) -> Result<Outcome, Failure> {
    folder::check_writable(out)?;
    let program = std::env::current_exe().map_err(Failure::Print)?;
    let here = std::env::current_dir().map_err(Failure::Print)?;
    let shards = u64::from(shards).min(campaign.shard_runs());
    let words = spread::words(arguments);
    let path = out.join(SCRIPT);
    let written = fs::create_dir_all(out)
        .and_then(|()| {
            fs::write(
                &path,
                script(&program, (&here, &here.join(out)), &words, shards),
            )
        })
        .and_then(|()| fs::set_permissions(&path, Permissions::from_mode(0o755)));
    if let Err(source) = written {
        return Err(Failure::Create { path, source });
    }
    let number = |number: u64| usize::try_from(number).unwrap_or(usize::MAX);
    terminal::print(&format!(
        " wrote {}: {} of {}; run it where sbatch is, with options for sbatch if it needs some\n",
        path.display(),
        plural(number(shards), "shard"),
        plural(number(campaign.shard_runs()), "run"),
    ))?;
    Ok(Outcome::Success)
}

/// A word as a shell reads it.
fn quoted(word: &str) -> String {
    format!("'{}'", word.replace('\'', r"'\''"))
}

/// The script. Tasks are queued again if their node is lost, and resume; the joining waits for all of them.
fn script(program: &Path, (here, out): (&PathBuf, &Path), words: &[String], shards: u64) -> String {
    let path = |path: &Path| quoted(&path.display().to_string());
    let (program, here, parts) = (path(program), path(here), path(&out.join("parts")));
    let (log, whole) = (path(&out.join("shard-%a.log")), path(&out.join("whole")));
    let merge_log = path(&out.join("merge.log"));
    let words: Vec<_> = words.iter().map(|word| quoted(word)).collect();
    let words = words.join(" ");
    format!(
        r#"#!/bin/sh
# Submits a campaign to Slurm. Written by `muster campaign --slurm`. Arguments are options for sbatch. All nodes must have
# muster, the scenario and this folder at the same paths.
set -eu
cd {here}
mkdir -p {parts}
shards=$(sbatch --parsable "$@" --job-name=muster-campaign --array=1-{shards} --requeue --open-mode=append --output={log} <<'END'
#!/bin/sh
# A task that is started again resumes its shard. Codes 3 and 4 say that a rule was broken or a mission is incomplete.
{program} campaign {words} --jobs "${{SLURM_CPUS_PER_TASK:-1}}" \
    --shard "$SLURM_ARRAY_TASK_ID/{shards}" --out {parts}/"$SLURM_ARRAY_TASK_ID" || case $? in 3 | 4) ;; *) exit 1 ;; esac
END
)
sbatch --parsable "$@" --job-name=muster-campaign-merge --dependency="afterok:$shards" --requeue --output={merge_log} <<'END'
#!/bin/sh
{program} campaign-merge {parts}/* --out {whole}
END
"#
    )
}
