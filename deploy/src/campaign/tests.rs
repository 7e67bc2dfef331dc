use std::os::unix::fs::PermissionsExt;

use tempfile::TempDir;

use super::*;

/// Writes a program of the shell. `HOME` in it is the folder.
fn script(folder: &TempDir, name: &str, text: &str) -> PathBuf {
    let path = folder.path().join(name);
    let home = folder.path().display().to_string();
    fs::write(
        &path,
        format!("#!/bin/sh\n{}\n", text.replace("HOME", &home)),
    )
    .unwrap();
    fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).unwrap();
    path
}

/// A command that runs others on this machine.
fn host(program: &Path) -> Vec<String> {
    vec![program.display().to_string()]
}

/// In place of `muster campaign`: its result says which shard it is.
const SHARD: &str =
    "while [ \"$1\" != --shard ]; do shift; done; mkdir part; echo \"$2\" > part/shard";

fn spread_on(
    hosts: &[Vec<String>],
    program: &Path,
    runs: u64,
    folder: &Path,
) -> Result<Vec<PathBuf>, SpreadError> {
    let request = SpreadRequest {
        hosts,
        program,
        files: &[],
        arguments: &[],
        runs,
        folder,
    };
    spread(&request, &|_| {})
}

fn shards(parts: &[PathBuf]) -> Vec<String> {
    let read = |part: &PathBuf| fs::read_to_string(part.join("shard")).unwrap();
    parts
        .iter()
        .map(|part| read(part).trim().to_owned())
        .collect()
}

#[test]
fn host_without_shards_runs_the_one_that_another_fails_last() {
    let home = tempfile::tempdir().unwrap();
    let folder = home.path().join("parts");
    // The healthy host begins once the other has a shard. That one fails once the healthy one has completed its own.
    let healthy = format!("until [ -e HOME/begun ]; do sleep 0.01; done; {SHARD}");
    let program = script(&home, "muster", &healthy);
    let failing = "if [ \"$1\" = env ]; then touch HOME/begun; for _ in $(seq 300); do ls HOME/parts/part-*[0-9] && break; sleep 0.1; done; exit 255; fi
         exec \"$@\"";
    let failing = script(&home, "failing", failing);
    let hosts = [host(Path::new("env")), host(&failing)];
    let parts = spread_on(&hosts, &program, 2, &folder).unwrap();
    assert_eq!(shards(&parts), ["1/2", "2/2"]);
}

#[test]
fn campaign_resumes_on_other_hosts_and_keeps_its_complete_shards() {
    let home = tempfile::tempdir().unwrap();
    let folder = home.path().join("parts");
    let failing = script(&home, "failing", &format!("{SHARD}; [ \"$2\" != 3/4 ]"));
    let one = [host(Path::new("env"))];
    let failed = spread_on(&one, &failing, 20, &folder).unwrap_err();
    assert!(
        matches!(failed, SpreadError::NoHost { missing: 2, .. }),
        "{failed}"
    );
    let mark = folder.join("part-1-of-4/mark");
    fs::write(&mark, "").unwrap();
    let program = script(&home, "muster", SHARD);
    let three = [(); 3].map(|()| host(Path::new("env")));
    let parts = spread_on(&three, &program, 20, &folder).unwrap();
    assert_eq!(shards(&parts), ["1/4", "2/4", "3/4", "4/4"]);
    assert!(mark.exists(), "a complete shard was run again");
}

#[test]
fn a_host_that_greets_loses_no_folder_of_its_user() {
    let home = tempfile::tempdir().unwrap();
    let precious = home.path().join("precious");
    fs::create_dir(&precious).unwrap();
    // As a shell of ssh does, it splits what it is told.
    let greeting = script(&home, "greeting", "echo HOME/precious; eval \"$*\"");
    let program = script(&home, "muster", SHARD);
    let folder = home.path().join("parts");
    // The greeting is in the archive of the results, too.
    spread_on(&[host(&greeting)], &program, 1, &folder).unwrap_err();
    assert!(precious.is_dir());
}

#[test]
fn complete_campaign_asks_no_host() {
    let home = tempfile::tempdir().unwrap();
    let folder = home.path().join("parts");
    let program = script(&home, "muster", SHARD);
    let healthy = [host(Path::new("env"))];
    let parts = spread_on(&healthy, &program, 1, &folder).unwrap();
    let silent = script(&home, "silent", "touch HOME/asked; sleep 60");
    let again = spread_on(&[host(&silent)], &program, 1, &folder).unwrap();
    assert_eq!(again, parts);
    assert!(!home.path().join("asked").exists());
}
