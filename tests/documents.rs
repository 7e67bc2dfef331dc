//! The documents tell the truth: their commands run, their files are accepted, what they point to is there.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use assert_cmd::Command;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");
const DOCUMENTS: [&str; 6] = [
    "README.md",
    "ARCHITECTURE.md",
    "CONTRIBUTING.md",
    "CHANGELOG.md",
    "scenarios/README.md",
    "deploy/README.md",
];

/// A campaign of hundreds of runs: `.ci/run` flies it, in a release build, and compares what comes of it.
const BARRIERS: &str =
    "muster campaign scenarios/barrier-line.toml --seeds 0..100 --vary radio.loss=0,0.1,0.3";

/// A flight in real time, which `tests/processes` flies.
const KILLED_IN_REAL_TIME: &str = "muster swarm scenarios/hardware/swarm-kill-master.toml";

fn text(name: &str) -> String {
    fs::read_to_string(Path::new(ROOT).join(name)).unwrap()
}

/// The code blocks of a document that are marked as `language`.
fn blocks(document: &str, language: &str) -> Vec<String> {
    let opening = format!("```{language}\n");
    document
        .split(&opening)
        .skip(1)
        .map(|rest| rest.split("```").next().unwrap().to_owned())
        .collect()
}

/// The folder in which examples run: the shipped scenarios, and nothing else.
fn fresh_folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let missions = folder.path().join("scenarios/missions");
    fs::create_dir_all(&missions).unwrap();
    fs::create_dir_all(folder.path().join("scenarios/hardware")).unwrap();
    for source in ["scenarios", "scenarios/missions", "scenarios/hardware"] {
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

fn fly_the_parts_to_merge(folder: &Path) {
    for part in ["1", "2"] {
        Command::cargo_bin("muster")
            .unwrap()
            .current_dir(folder)
            .args(["campaign", "scenarios/thesis-1.toml", "--seeds", "0..2"])
            .args([
                "--shard",
                &format!("{part}/2"),
                "--out",
                &format!("part-{part}"),
            ])
            .assert()
            .success();
    }
}

#[test]
fn the_scenarios_in_the_documents_are_accepted() {
    let folder = fresh_folder();
    let scenarios: Vec<_> = DOCUMENTS
        .iter()
        .flat_map(|name| blocks(&text(name), "toml"))
        .collect();
    assert!(scenarios.len() >= 2);
    for scenario in scenarios {
        let path = folder.path().join("scenarios/example.toml");
        fs::write(&path, &scenario).unwrap();
        Command::cargo_bin("muster")
            .unwrap()
            .arg("sim")
            .arg(&path)
            .args(["--engine", "events", "--out"])
            .arg(folder.path().join("out"))
            .assert()
            .success();
    }
}

#[test]
fn what_the_documents_point_to_is_there() {
    for name in DOCUMENTS {
        let document = text(name);
        let folder = Path::new(ROOT).join(name);
        let folder = folder.parent().unwrap();
        let links = document
            .split("](")
            .skip(1)
            .map(|rest| rest.split(')').next().unwrap());
        for link in links.filter(|link| !link.starts_with("http")) {
            assert!(folder.join(link).exists(), "{name} points to {link}");
        }
        // Paths in backticks, as ARCHITECTURE and CONTRIBUTING name them from the root.
        let named = document.split('`').skip(1).step_by(2).filter(|word| {
            let is_path = word
                .chars()
                .all(|c| c.is_alphanumeric() || "/._-".contains(c));
            is_path
                && (word.ends_with(".rs") || word.ends_with('/'))
                && word.matches('/').count() > 1
        });
        for path in named.filter(|path| !path.starts_with("runs/")) {
            assert!(
                Path::new(ROOT).join(path).exists() || folder.join(path).exists(),
                "{name} names {path}"
            );
        }
    }
}

#[test]
fn the_list_of_public_missions_is_well_formed_and_says_what_the_page_says() {
    let list = text("docs/public-missions.csv");
    let mut rows = csv::Reader::from_reader(list.as_bytes());
    let columns = [
        "repository",
        "path",
        "sha256",
        "plausible",
        "verdict",
        "reason",
    ];
    assert_eq!(rows.headers().unwrap(), &columns[..]);
    let mut files = BTreeSet::new();
    let (mut plausible, mut fly, mut above_ground) = (0_u32, 0_u32, 0_u32);
    for row in rows.deserialize() {
        let [repository, path, sha256, is_plausible, verdict, reason]: [String; 6] = row.unwrap();
        let is_named = repository
            .split('/')
            .filter(|part| !part.is_empty())
            .count()
            == 2;
        assert!(
            is_named && !path.is_empty() && !path.starts_with('/'),
            "{repository} {path}"
        );
        let is_digit = |digit: u8| digit.is_ascii_digit() || (b'a'..=b'f').contains(&digit);
        assert!(
            sha256.len() == 64 && sha256.bytes().all(is_digit),
            "{path}: {sha256}"
        );
        match (is_plausible.as_str(), verdict.as_str()) {
            ("yes", "flies") => {
                assert_eq!(reason, "", "{path}");
                fly += 1;
            }
            ("yes" | "no", "refused") | ("no", "flies") => assert_ne!(reason, "", "{path}"),
            other => panic!("{repository} {path}: {other:?}"),
        }
        plausible += u32::from(is_plausible == "yes");
        above_ground += u32::from(reason == "heights above the ground");
        assert!(files.insert((repository, path)), "a file is there twice");
    }
    let share = |of: u32| format!("{:.1} %", 100.0 * f64::from(fly) / f64::from(of));
    let rest = plausible - above_ground;
    let page = text("scenarios/README.md");
    let page: Vec<&str> = page.split_whitespace().collect();
    let page = page.join(" ");
    for said in [
        format!("lists {} mission files", files.len()),
        format!(
            "{plausible} are plausible and {fly} of them fly ({}).",
            share(plausible)
        ),
        format!(
            "Of the {rest} without heights above the ground, {fly} fly ({}).",
            share(rest)
        ),
    ] {
        assert!(page.contains(&said), "the page does not say: {said}");
    }
}

#[test]
fn the_page_on_scenarios_describes_every_field_and_no_other() {
    let all: Vec<_> = muster_scenarios::scenario::fields().collect();
    assert_describes("scenarios/README.md", &all);
}

/// `.ci/schemas` holds them against shipped files.
#[test]
fn the_schemas_are_those_that_muster_prints_and_shipped_files_name_theirs() {
    for files in ["scenario", "drone", "hosts"] {
        let printed = Command::cargo_bin("muster")
            .unwrap()
            .args(["schema", files])
            .output()
            .unwrap();
        let printed = String::from_utf8(printed.stdout).unwrap();
        let kept = text(&format!("docs/schemas/{files}.schema.json"));
        assert_eq!(
            printed, kept,
            "muster schema {files} > docs/schemas/{files}.schema.json"
        );
    }
    for folder in [
        "scenarios",
        "scenarios/found",
        "scenarios/hardware",
        "scenarios/scale",
    ] {
        let up = "../".repeat(folder.split('/').count());
        let names = format!("#:schema {up}docs/schemas/scenario.schema.json\n");
        for file in fs::read_dir(Path::new(ROOT).join(folder)).unwrap() {
            let path = file.unwrap().path();
            let is_scenario = path.extension().is_some_and(|it| it == "toml")
                && path.file_name().is_some_and(|it| it != "Cargo.toml");
            if is_scenario {
                let text = fs::read_to_string(&path).unwrap();
                assert!(text.starts_with(&names), "{}", path.display());
            }
        }
    }
}

#[test]
fn the_page_on_drones_describes_every_field_and_no_other() {
    let of_drones = muster_daemon::config::fields();
    let all: Vec<_> = of_drones.chain(muster_deploy::swarm::fields()).collect();
    assert_describes("deploy/README.md", &all);
}

/// The rows of a page's tables are the fields of a kind of file, in their order; tables of fields have none.
fn assert_describes(page: &str, all: &[&str]) {
    let page = text(page);
    let described: Vec<&str> = page
        .lines()
        .filter_map(|line| line.strip_prefix("| `"))
        .filter_map(|rest| rest.split('`').next())
        .filter(|field| !field.contains('/') && !field.ends_with(".toml"))
        .collect();
    let is_table = |field: &str| {
        let has_it = |other: &&str| {
            other
                .strip_prefix(field)
                .is_some_and(|it| it.starts_with('.'))
        };
        all.iter().any(has_it)
    };
    let fields: Vec<&str> = all
        .iter()
        .copied()
        .filter(|field| !is_table(field))
        .collect();
    assert_eq!(described, fields);
}

#[test]
fn the_drones_files_in_the_documents_are_accepted() {
    let folder = fresh_folder();
    for arguments in [
        &["keys", "fleet", "my-fleet"][..],
        &["keys", "drone", "my-fleet", "2"],
    ] {
        Command::cargo_bin("muster")
            .unwrap()
            .current_dir(folder.path())
            .args(arguments)
            .assert()
            .success();
    }
    let files: Vec<_> = DOCUMENTS
        .iter()
        .flat_map(|name| blocks(&text(name), "toml drone"))
        .collect();
    assert_eq!(files.len(), 1);
    for file in files {
        fs::write(folder.path().join("drone-2.toml"), &file).unwrap();
        Command::cargo_bin("musterd")
            .unwrap()
            .current_dir(folder.path())
            .args(["--config", "drone-2.toml", "--check"])
            .assert()
            .success();
    }
}

#[test]
fn the_hosts_files_in_the_documents_are_accepted() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("hosts.toml");
    let files = DOCUMENTS
        .iter()
        .flat_map(|name| blocks(&text(name), "toml hosts"));
    let files: Vec<_> = files.collect();
    assert_eq!(files.len(), 1);
    for text in files {
        fs::write(&file, text).unwrap();
        muster_deploy::swarm::Hosts::load(&file, 5).unwrap();
    }
}

/// What is named so flies in real time, some of it: `.ci/run` lets it run beside all else.
mod real_time {
    use super::*;

    #[test]
    fn every_command_in_the_documents_runs() {
        let folder = fresh_folder();
        let mut run = 0;
        for name in DOCUMENTS {
            for line in blocks(&text(name), "sh")
                .iter()
                .flat_map(|block| block.lines())
            {
                let command = line.split('#').next().unwrap().trim();
                if command == BARRIERS || command == KILLED_IN_REAL_TIME {
                    continue;
                }
                let arguments = match command.split_once(" -- ") {
                    Some(("cargo run --release", arguments)) => arguments,
                    _ => match command.strip_prefix("muster ") {
                        Some(arguments) => arguments,
                        // This very test is part of it.
                        None if command == "cargo test --workspace" => continue,
                        // What it compares, the transport's own tests do, too.
                        None if command.ends_with("-p muster-transport --example radio") => {
                            continue;
                        }
                        // It searches for minutes; smaller searches are among the tests of the machines.
                        None if command.contains("-p muster-machines --example model") => continue,
                        // Fewer plans are among those tests, too.
                        None if command.ends_with("-p muster-machines --example apart") => continue,
                        None => panic!("{name} has a command that nothing runs: {command}"),
                    },
                };
                Command::cargo_bin("muster")
                    .unwrap()
                    .current_dir(folder.path())
                    .args(arguments.split_whitespace())
                    .assert()
                    .success();
                run += 1;
            }
        }
        assert!(run >= 6, "the README shows more commands than {run}");
    }

    #[test]
    fn the_examples_in_the_help_run() {
        let folder = fresh_folder();
        for subcommand in [
            "sim",
            "campaign",
            "campaign-merge",
            "thesis",
            "check",
            "keys",
            "swarm",
            "completions",
        ] {
            let help = Command::cargo_bin("muster")
                .unwrap()
                .args([subcommand, "--help"])
                .output()
                .unwrap();
            let help = String::from_utf8(help.stdout).unwrap();
            let examples: Vec<_> = help
                .lines()
                .filter_map(|line| line.strip_prefix("  muster "))
                .map(|line| line.split(['|', '>']).next().unwrap())
                .collect();
            assert!(!examples.is_empty(), "{subcommand} shows no example");
            if subcommand == "campaign-merge" {
                fly_the_parts_to_merge(folder.path());
            }
            for example in examples {
                // A shell would spread the pattern.
                let example = example
                    .replace(
                        "scenarios/thesis-*.toml",
                        "scenarios/thesis-1.toml scenarios/thesis-2.toml",
                    )
                    .replace("missions/*", "missions/albufera.plan");
                Command::cargo_bin("muster")
                    .unwrap()
                    .current_dir(folder.path())
                    .args(example.split_whitespace())
                    .assert()
                    .success();
            }
        }
    }
}
