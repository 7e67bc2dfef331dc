//! Names and paths of scenarios and missions on the command line.

use std::fs;
use std::path::Path;

use serde_json::Value;

use super::{ROOT, muster, scenario};

#[test]
fn completions_are_printed_for_every_shell() {
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let run = muster(Path::new(ROOT))
            .args(["completions", shell])
            .assert()
            .success();
        assert!(String::from_utf8_lossy(&run.get_output().stdout).contains("muster"));
    }
}

#[test]
fn path_after_set_is_completed_as_a_file_in_bash() {
    let folder = tempfile::tempdir().unwrap();
    let script = muster(folder.path())
        .args(["completions", "bash"])
        .output()
        .unwrap()
        .stdout;
    fs::write(folder.path().join("muster.bash"), script).unwrap();
    // Readline splits words at `=`. No reply of the script's own means bash's names of files.
    let asked = "source muster.bash; COMP_WORDS=(muster sim thesis-1 --set mission.file = ri); COMP_CWORD=6; \
                 _muster muster ri =; echo \"${#COMPREPLY[@]}\"; complete -p muster";
    let bash = std::process::Command::new("bash")
        .current_dir(folder.path())
        .args(["-c", asked])
        .output()
        .unwrap();
    let answer = String::from_utf8(bash.stdout).unwrap();
    assert!(
        answer.starts_with("0\n") && answer.contains("-o default"),
        "{answer}"
    );
}

#[test]
fn shipped_scenarios_and_missions_fly_by_name_anywhere() {
    let folder = tempfile::tempdir().unwrap();
    // A file of the same name does not take the name's place.
    fs::write(folder.path().join("thesis-1"), "not a scenario").unwrap();
    let trace = |scenario: &str, more: &[&str]| {
        let run = muster(folder.path())
            .args(["sim", scenario, "--engine", "events", "--json"])
            .args(more)
            .assert()
            .success();
        let report: Value = serde_json::from_slice(&run.get_output().stdout).unwrap();
        (
            report["trace"].clone(),
            report["command"].as_str().unwrap().to_owned(),
        )
    };
    let (by_name, command) = trace("thesis-1", &[]);
    assert_eq!(command, "muster sim thesis-1 --seed 1 --engine events");
    assert_eq!(by_name, trace(&scenario("thesis-1.toml"), &[]).0);
    let river = format!("mission.file={}", scenario("missions/river.waypoints"));
    let (by_name, _) = trace("thesis-1", &["--set", "mission.file=river"]);
    assert_eq!(by_name, trace("thesis-1", &["--set", &river]).0);
    for more in [
        &["check", "two-swarms", "river", "swarm-short"][..],
        &["list"],
    ] {
        muster(folder.path()).args(more).assert().success();
    }
    let campaign = ["campaign", "thesis-1", "--seeds", "0..1"];
    muster(folder.path()).args(campaign).assert().success();
    assert!(
        folder
            .path()
            .join("runs/thesis-1-campaign/runs.csv")
            .exists()
    );
    let refused = muster(folder.path())
        .args(["sim", "thesis2"])
        .assert()
        .code(2);
    let refused = String::from_utf8_lossy(&refused.get_output().stderr).into_owned();
    assert!(refused.contains("did you mean `thesis-2`?"), "{refused}");
}

#[test]
fn paths_that_are_set_start_at_the_current_folder() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("here");
    fs::create_dir(&place).unwrap();
    fs::copy(
        scenario("missions/river.waypoints"),
        place.join("mine.waypoints"),
    )
    .unwrap();
    let sim = |mission: &str| {
        let mut command = muster(&place);
        command.args(["sim", &scenario("thesis-1.toml"), "--engine", "events"]);
        command.args(["--set", &format!("mission.file={mission}")]);
        command.assert()
    };
    sim("mine.waypoints").success();
    let refused = sim("mine.waypoint").code(2);
    let refused = String::from_utf8_lossy(&refused.get_output().stderr).into_owned();
    for words in [
        "did you mean `mine.waypoints`?",
        "current folder",
        "[mission]",
    ] {
        assert!(refused.contains(words), "{words}: {refused}");
    }
}

#[test]
fn new_scenario_is_written_once_and_flies() {
    let folder = tempfile::tempdir().unwrap();
    let new = ["new", "scenario", "my-first"];
    muster(folder.path()).args(new).assert().success();
    let again = muster(folder.path()).args(new).assert().code(2);
    let again = String::from_utf8_lossy(&again.get_output().stderr).into_owned();
    assert!(again.contains("is not overwritten"), "{again}");
    let checked = muster(folder.path())
        .args(["check", "my-first.toml"])
        .assert()
        .success();
    let checked = String::from_utf8_lossy(&checked.get_output().stdout).into_owned();
    assert!(
        checked.starts_with("my-first.toml: OK: 9 drones"),
        "{checked}"
    );
    muster(folder.path())
        .args(["sim", "my-first.toml"])
        .assert()
        .success();
    let path = folder.path().join("my-first.toml");
    let text = fs::read_to_string(&path).unwrap();
    // What the tutorial says to do.
    let tutorial = include_str!("../../../docs/src/tutorial/kill-the-master.md");
    assert!(tutorial.contains("Remove the `#` before the last four lines"));
    let mut lines: Vec<_> = text.lines().collect();
    let fault = lines.len() - 4;
    for line in &mut lines[fault..] {
        *line = line.strip_prefix("# ").unwrap();
    }
    assert!(tutorial.contains(&lines[fault..].join("\n")), "{lines:?}");
    fs::write(&path, lines.join("\n")).unwrap();
    let killed = muster(folder.path())
        .args(["sim", "my-first.toml"])
        .assert()
        .success();
    let killed = String::from_utf8_lossy(&killed.get_output().stdout).into_owned();
    assert!(killed.contains(" election "), "{killed}");
    fs::create_dir(folder.path().join("d")).unwrap();
    for bad in ["a.b", "", "no-such-folder/x", "d/"] {
        muster(folder.path())
            .args(["new", "scenario", bad])
            .assert()
            .code(2);
    }
}

#[test]
fn name_of_a_file_without_its_end_is_refused_with_the_files_name() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("my-flight.toml"), "").unwrap();
    fs::write(folder.path().join("my-field.plan"), "").unwrap();
    for (arguments, file) in [
        (&["sim", "my-flight"][..], "my-flight.toml"),
        (
            &["sim", "thesis-1", "--set", "mission.file=my-field"],
            "my-field.plan",
        ),
    ] {
        let run = muster(folder.path()).args(arguments).assert().code(2);
        let errors = String::from_utf8_lossy(&run.get_output().stderr).into_owned();
        assert!(
            errors.contains(&format!("the file here is named {file}")),
            "{errors}"
        );
    }
}
