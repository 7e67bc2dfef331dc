//! Campaigns on several machines: hosts over ssh, and Slurm.

use std::fs;
use std::os::unix::fs::PermissionsExt;

use super::{CAMPAIGN, assert_same, campaign, campaign_files, error_text, files};
use crate::support::muster;

#[test]
fn campaign_on_hosts_has_the_bytes_of_one_machine_and_outlives_a_host() {
    let home = tempfile::tempdir().unwrap();
    let whole = campaign_files(home.path(), "whole", &[]);
    // A host that is lost in the middle of its first shard, by ssh's exit code.
    let flaky = home.path().join("flaky");
    let script = "#!/bin/sh\ncase $1 in env) exit 255;; esac\nexec \"$@\"\n";
    fs::write(&flaky, script).unwrap();
    fs::set_permissions(&flaky, fs::Permissions::from_mode(0o755)).unwrap();
    let host = |run: &str, drone| format!("[[hosts]]\nrun = [\"{run}\"]\ndrones = [{drone}]\n");
    let hosts = [
        host("env", 0),
        host(flaky.to_str().unwrap(), 1),
        host("env", 2),
    ];
    fs::write(home.path().join("hosts.toml"), hosts.concat()).unwrap();
    let on_hosts = |out| {
        let shipped = [
            "campaign",
            "thesis-1",
            "--hosts",
            "hosts.toml",
            "--out",
            out,
        ];
        muster(home.path(), &[&shipped, &CAMPAIGN[..]].concat())
    };
    let run = on_hosts("spread");
    assert!(run.status.success(), "{}", error_text(&run));
    assert!(
        error_text(&run).contains("host 2 is given up"),
        "{}",
        error_text(&run)
    );
    let one = muster(
        home.path(),
        &[&["campaign", "thesis-1", "--out", "one"], &CAMPAIGN[..]].concat(),
    );
    assert!(one.status.success(), "{}", error_text(&one));
    let spread = files(&home.path().join("spread/whole"));
    assert_same(&spread, &files(&home.path().join("one")));
    assert_eq!(spread["runs.csv"].len(), whole["runs.csv"].len());
    let other_seeds = muster(
        home.path(),
        &[
            "campaign",
            "thesis-1",
            "--hosts",
            "hosts.toml",
            "--out",
            "spread",
            "--seeds",
            "90..99",
        ],
    );
    assert_eq!(other_seeds.status.code(), Some(2));
    let refused = error_text(&other_seeds);
    assert!(refused.contains("belongs to another campaign"), "{refused}");
    assert!(on_hosts("spread").status.success(), "the same again");
    // All hosts lost: nothing is complete.
    fs::write(home.path().join("hosts.toml"), host("false", 0)).unwrap();
    let run = on_hosts("none");
    assert_eq!(run.status.code(), Some(1));
    assert!(
        error_text(&run).contains("all hosts failed, 4 shards are missing"),
        "{}",
        error_text(&run)
    );
}

/// A stand-in for Slurm's `sbatch`: it runs each task at once, and the first one twice, as if its node had been lost. Jobs that
/// depend on others come after them anyway.
const SBATCH: &str = r#"#!/bin/sh
cat > job; echo "$@" >> submitted
case "$*" in
    *--array=1-*) last=$(echo "$*" | sed 's/.*--array=1-\([0-9]*\).*/\1/'); tasks="1 $(seq 1 "$last")" ;;
    *) tasks=1 ;;
esac
for task in $tasks; do SLURM_ARRAY_TASK_ID=$task sh job > output 2>&1 || exit 1; done
echo 17
"#;

#[test]
fn slurm_script_runs_each_shard_and_joins_them_to_the_bytes_of_the_undivided_campaign() {
    let dir = tempfile::tempdir().unwrap();
    let whole = campaign_files(dir.path(), "one", &[]);
    let out = "it's a folder";
    let written = campaign(dir.path(), out, &["--slurm", "3"]);
    assert!(written.status.success(), "{}", error_text(&written));
    let sbatch = dir.path().join("bin/sbatch");
    fs::create_dir(sbatch.parent().unwrap()).unwrap();
    fs::write(&sbatch, SBATCH).unwrap();
    fs::set_permissions(&sbatch, fs::Permissions::from_mode(0o755)).unwrap();
    let path = format!("{}:/usr/bin:/bin", sbatch.parent().unwrap().display());
    let mut submit = std::process::Command::new(dir.path().join(out).join("submit.sh"));
    let submitted = submit
        .arg("--partition=drones")
        .env("PATH", path)
        .output()
        .unwrap();
    assert!(submitted.status.success(), "{}", error_text(&submitted));
    assert_same(&whole, &files(&dir.path().join(out).join("whole")));
    let jobs = fs::read_to_string(dir.path().join("submitted")).unwrap();
    let jobs: Vec<_> = jobs.lines().collect();
    assert!(jobs[0].contains("--array=1-3 --requeue"), "{jobs:?}");
    assert!(jobs[1].contains("--dependency=afterok:17"), "{jobs:?}");
    assert!(
        jobs.iter().all(|job| job.contains("--partition=drones")),
        "{jobs:?}"
    );
}
