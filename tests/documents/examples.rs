//! Examples in documents run. An info string says how: `sh` is run line by line, `toml` is flown as a scenario,
//! `toml drone`, `toml observe` and `toml hosts` are read as such files, `rust` is a doc test, `rust,ignore` is an excerpt of
//! an example's source, `text` is not run.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use assert_cmd::Command;

use super::{Document, ROOT, documents, files};

const INFO: [&str; 9] = [
    "sh",
    "text",
    "rust",
    "rust,no_run",
    EXCERPT,
    "toml",
    "toml drone",
    "toml observe",
    "toml hosts",
];

/// An excerpt of an agent's source, in a page about it.
const EXCERPT: &str = "rust,ignore";

/// The pages whose examples `scenarios/src/lib.rs` and `src/lib.rs` include as doc tests.
const WITH_RUST: [&str; 2] = ["docs/src/extend/protocol.md", "docs/src/extend/agent.md"];

/// A campaign of hundreds of runs: `.ci/run` flies it and compares the result.
const BARRIERS: &str =
    "muster campaign scenarios/barrier-line.toml --seeds 0..100 --vary radio.loss=0,0.1,0.3";

/// A flight in real time, which `tests/processes` flies.
const KILLED_IN_REAL_TIME: &str = "muster swarm scenarios/hardware/swarm-kill-master.toml";

pub(crate) fn muster() -> Command {
    Command::cargo_bin("muster").unwrap()
}

/// The daemon's program: that of the environment variable `MUSTERD`, or the one that is built next to `muster`.
pub(crate) fn musterd() -> PathBuf {
    let beside = || assert_cmd::cargo::cargo_bin("musterd");
    std::env::var_os("MUSTERD").map_or_else(beside, PathBuf::from)
}

/// The folder in which examples run: the shipped scenarios, and nothing else.
pub(crate) fn fresh_folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for source in ["scenarios", "scenarios/missions", "scenarios/hardware"] {
        fs::create_dir_all(folder.path().join(source)).unwrap();
        for entry in fs::read_dir(Path::new(ROOT).join(source)).unwrap() {
            let path = entry.unwrap().path();
            if path.is_file() {
                let name = path.file_name().unwrap();
                fs::copy(&path, folder.path().join(source).join(name)).unwrap();
            }
        }
    }
    folder
}

/// The examples with an info string, each with its place.
fn examples(info: &str) -> Vec<(String, String)> {
    let mut found = Vec::new();
    for document in documents() {
        for block in document.blocks() {
            if block.info == info {
                found.push((format!("{}:{}", document.path, block.line), block.text));
            }
        }
    }
    assert!(!found.is_empty(), "no example is marked `{info}`");
    found
}

/// Makes the fleet whose keys the examples of drones' files name.
pub(crate) fn make_fleet(folder: &Path) {
    for arguments in [
        &["keys", "fleet", "my-fleet"][..],
        &["keys", "drone", "my-fleet", "2"],
    ] {
        muster()
            .current_dir(folder)
            .args(arguments)
            .assert()
            .success();
    }
}

#[test]
fn every_example_says_how_it_is_run() {
    for document in documents() {
        for block in document.blocks() {
            let place = format!("{}:{}", document.path, block.line);
            assert!(
                INFO.contains(&block.info.as_str()),
                "{place}: `{}`",
                block.info
            );
            let is_tested = !block.info.starts_with("rust")
                || block.info == EXCERPT
                || WITH_RUST.contains(&document.path.as_str());
            assert!(is_tested, "{place}: only {WITH_RUST:?} are doc tests");
        }
    }
}

#[test]
fn each_example_agent_has_a_page_with_excerpts_of_its_source() {
    const FOLDER: &str = "docs/src/extend/examples";
    let scenarios = files("examples/agents", "toml");
    let names = scenarios.iter().map(|path| Path::new(path).file_stem());
    let names: Vec<_> = names.map(|name| name.unwrap().to_str().unwrap()).collect();
    let pages: Vec<_> = names.iter().map(|it| format!("{FOLDER}/{it}.md")).collect();
    assert_eq!(files(FOLDER, "md"), pages);
    let trimmed = |text: &str| -> Vec<_> { text.lines().map(|it| it.trim().to_owned()).collect() };
    for document in documents() {
        let excerpts: Vec<_> = (document.blocks().into_iter())
            .filter(|block| block.info == EXCERPT)
            .collect();
        let Some(index) = pages.iter().position(|page| *page == document.path) else {
            assert!(excerpts.is_empty(), "{}: whose excerpt?", document.path);
            continue;
        };
        assert!(!excerpts.is_empty(), "{} has no excerpt", document.path);
        let source = format!("examples/agents/{}.rs", names[index]);
        let source = trimmed(&Document::read(&source).text);
        for excerpt in excerpts {
            let lines = trimmed(&excerpt.text);
            let is_there = source.windows(lines.len()).any(|part| part == lines);
            assert!(
                is_there,
                "{}:{} is not in the source",
                document.path, excerpt.line
            );
        }
    }
}

/// A drone or an actor may fail in an example, but no rule may break.
#[test]
fn scenarios_in_documents_fly() {
    let folder = fresh_folder();
    for (place, scenario) in examples("toml") {
        let path = folder.path().join("scenarios/example.toml");
        fs::write(&path, &scenario).unwrap();
        let run = muster()
            .arg("sim")
            .arg(&path)
            .args(["--engine", "events", "--out"])
            .arg(folder.path().join("out"))
            .output()
            .unwrap();
        let error = String::from_utf8_lossy(&run.stderr);
        assert!(run.status.success(), "{place}: {error}");
    }
}

#[test]
fn drone_files_in_documents_are_accepted() {
    let folder = fresh_folder();
    make_fleet(folder.path());
    let tables = examples("toml observe");
    for (place, mut file) in examples("toml drone") {
        file.extend(tables.iter().map(|(_, table)| table.as_str()));
        fs::write(folder.path().join("drone-2.toml"), &file).unwrap();
        let check = Command::new(musterd())
            .current_dir(folder.path())
            .args(["--config", "drone-2.toml", "--check"])
            .output()
            .unwrap();
        let error = String::from_utf8_lossy(&check.stderr);
        assert!(check.status.success(), "{place}: {error}");
    }
}

#[test]
fn hosts_files_in_documents_are_accepted() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("hosts.toml");
    for (place, text) in examples("toml hosts") {
        fs::write(&file, text).unwrap();
        let hosts = muster_deploy::hosts::Hosts::load(&file, 5);
        assert!(hosts.is_ok(), "{place}: {hosts:?}");
    }
}

/// The arguments of a command of `muster`; `None` for a command that another test or `.ci/run` runs.
fn arguments<'a>(place: &str, command: &'a str) -> Option<&'a str> {
    if command == BARRIERS || command == KILLED_IN_REAL_TIME {
        return None;
    }
    if let Some(arguments) = command.strip_prefix("muster ") {
        return Some(arguments);
    }
    if let Some(("cargo run --release", arguments)) = command.split_once(" -- ") {
        return Some(arguments);
    }
    // This test is a part of the first. The transport's and the machines' own tests do what the examples do, smaller.
    let is_run_elsewhere = command == "cargo test --workspace"
        || command.ends_with("-p muster-transport --example radio")
        || command.contains("-p muster-machines --example model")
        || command.ends_with("-p muster-machines --example apart");
    assert!(
        is_run_elsewhere,
        "{place}: nothing runs the command `{command}`"
    );
    None
}

/// Some of these fly in real time: `.ci/run` lets them run beside all else.
mod real_time {
    use super::*;

    /// Documents repeat commands; each is run once, in the order of the documents.
    #[test]
    #[ignore = "in real time: `.ci/run` runs it"]
    fn commands_in_documents_succeed() {
        let folder = fresh_folder();
        let mut done = BTreeSet::new();
        for (place, block) in examples("sh") {
            for line in block.lines() {
                let command = line.split('#').next().unwrap().trim();
                let Some(arguments) = arguments(&place, command) else {
                    continue;
                };
                if !done.insert(arguments.to_owned()) {
                    continue;
                }
                let mut run = muster();
                run.current_dir(folder.path())
                    .args(arguments.split_whitespace());
                if arguments.starts_with("swarm ") {
                    run.arg("--musterd").arg(musterd());
                }
                let run = run.output().unwrap();
                let error = String::from_utf8_lossy(&run.stderr);
                assert!(run.status.success(), "{place}: `{command}`: {error}");
            }
        }
        assert!(done.len() >= 6, "{done:?}");
    }

    #[test]
    #[ignore = "in real time: `.ci/run` runs it"]
    fn examples_in_the_help_succeed() {
        let folder = fresh_folder();
        for subcommand in [
            "sim",
            "campaign",
            "campaign-merge",
            "thesis",
            "check",
            "list",
            "new",
            "keys",
            "swarm",
            "completions",
        ] {
            let help = muster().args([subcommand, "--help"]).output().unwrap();
            let help = String::from_utf8(help.stdout).unwrap();
            let examples: Vec<_> = help
                .lines()
                .filter_map(|line| line.strip_prefix("  muster "))
                .map(|line| line.split(['|', '>']).next().unwrap())
                .collect();
            assert!(!examples.is_empty(), "{subcommand} shows no example");
            if subcommand == "campaign-merge" {
                fly_shards(folder.path());
            }
            for example in examples {
                // A shell would expand the pattern.
                let example = example
                    .replace(
                        "scenarios/thesis-*.toml",
                        "scenarios/thesis-1.toml scenarios/thesis-2.toml",
                    )
                    .replace("missions/*", "missions/albufera.plan");
                let mut run = muster();
                run.current_dir(folder.path())
                    .args(example.split_whitespace());
                if subcommand == "swarm" {
                    run.arg("--musterd").arg(musterd());
                }
                run.assert().success();
            }
        }
    }

    fn fly_shards(folder: &Path) {
        for part in ["1", "2"] {
            muster()
                .current_dir(folder)
                .args(["campaign", "scenarios/thesis-1.toml", "--seeds", "0..2"])
                .args(["--shard", &format!("{part}/2")])
                .args(["--out", &format!("part-{part}")])
                .assert()
                .success();
        }
    }
}
