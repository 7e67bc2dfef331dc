//! Pages that repeat what the programs say agree with them.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use assert_cmd::Command;
use muster_daemon::config;
use muster_deploy::hosts;
use muster_runtime::plan;

use super::examples::{muster, musterd};
use super::{Document, ROOT, assert_generated, documents, files};

fn help(program: &str, arguments: &[&str]) -> String {
    let mut command = match program {
        "musterd" => Command::new(musterd()),
        _ => muster(),
    };
    let run = command.args(arguments).arg("--help").output().unwrap();
    String::from_utf8(run.stdout).unwrap()
}

/// The subcommands that a help lists, but for `help` itself.
fn subcommands(help: &str) -> Vec<&str> {
    let list = help.lines().skip_while(|line| *line != "Commands:").skip(1);
    list.take_while(|line| !line.is_empty())
        .filter_map(|line| line.strip_prefix("  ")?.split_once(' '))
        .map(|(name, _)| name)
        .filter(|name| !matches!(*name, "" | "help"))
        .collect()
}

fn describe(page: &mut String, depth: usize, program: &str, arguments: &[&str]) {
    let help = help(program, arguments);
    let heading = "#".repeat(depth + 2);
    let name = [&[program], arguments].concat().join(" ");
    writeln!(
        page,
        "\n{heading} `{name}`\n\n```text\n{}\n```",
        help.trim()
    )
    .unwrap();
    for subcommand in subcommands(&help) {
        let arguments = [arguments, &[subcommand]].concat();
        describe(page, arguments.len().min(2), program, &arguments);
    }
}

#[test]
fn command_line_page_is_the_help() {
    let mut page = String::from(
        "# What does the command line accept?\n\n\
         `muster` is the operator's command. `musterd` is one drone as a process. \
         This page is generated from their help.\n\n\
         | exit code | of `muster` | of `musterd` |\n\
         | --- | --- | --- |\n\
         | 0 | success | the mission was flown, or the drone was recalled and has landed |\n\
         | 1 | something failed on this machine, or a drone did not answer | something failed on this machine, or the starter of a `--controlled` process is gone |\n\
         | 2 | a file or an argument can't be used | a file or an argument can't be used, or the flight is over |\n\
         | 3 | a rule was broken | |\n\
         | 4 | all came down safely, but a mission was not completed, or was flown by segments that never met | the drone came down by itself before the end of the mission |\n\
         | 5 | a flight controller is not fit to fly | |\n",
    );
    describe(&mut page, 0, "muster", &[]);
    describe(&mut page, 0, "musterd", &[]);
    assert_generated("docs/src/reference/cli.md", &page);
}

#[test]
fn picture_of_a_masters_death_is_what_its_command_writes() {
    let folder = tempfile::tempdir().unwrap();
    let scenario = format!("{ROOT}/scenarios/kill-at-waypoint.toml");
    muster()
        .current_dir(folder.path())
        .args(["sim", &scenario, "--animation", "picture.svg"])
        .assert()
        .success();
    let picture = fs::read_to_string(folder.path().join("picture.svg")).unwrap();
    assert_generated("docs/src/kill-at-waypoint.svg", &picture);
}

/// Options of `muster` and `musterd` that examples use exist.
#[test]
fn options_in_documents_exist() {
    let known = Document::read("docs/src/reference/cli.md").text;
    let known: BTreeSet<_> = (known.split(|c: char| !c.is_alphanumeric() && c != '-'))
        .filter(|word| word.starts_with("--"))
        .collect();
    for document in documents() {
        if document.path == "CHANGELOG.md" || document.path.contains("/decisions/") {
            continue;
        }
        let blocks = document.blocks();
        let commands = (blocks.iter().flat_map(|block| block.text.lines()))
            .filter(|line| line.starts_with("muster"));
        let options = commands.flat_map(|line| line.split([' ', '=']));
        for option in options.filter(|word| word.starts_with("--") && word.len() > 2) {
            assert!(known.contains(option), "{}: {option}", document.path);
        }
    }
}

#[test]
fn every_shipped_scenario_and_mission_is_listed() {
    let list = Document::read("scenarios/README.md");
    let mut listed: Vec<_> = (list.prose().lines())
        .filter_map(|line| {
            line.strip_prefix("| `")?
                .split_once(" | ")
                .map(|(names, _)| names.to_owned())
        })
        .flat_map(|names| {
            names
                .split(", ")
                .map(|it| it.trim_matches('`').to_owned())
                .collect::<Vec<_>>()
        })
        .map(|name| format!("scenarios/{name}"))
        .collect();
    listed.sort();
    let mut shipped: Vec<_> = ["toml", "plan", "waypoints"]
        .iter()
        .flat_map(|extension| files("scenarios", extension))
        .filter(|file| {
            let inside = [
                "controller/",
                "experiments/",
                "found/",
                "indoor/",
                "tests/",
                "src/",
                "Cargo.toml",
            ];
            !inside
                .iter()
                .any(|it| file["scenarios/".len()..].starts_with(it))
        })
        .collect();
    shipped.sort();
    assert_eq!(listed, shipped);
}

#[test]
fn list_of_public_missions_agrees_with_its_page() {
    let list = fs::read_to_string(Path::new(ROOT).join("docs/src/reference/public-missions.csv"));
    let list = list.unwrap();
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
        let parts = repository.split('/').filter(|part| !part.is_empty());
        let is_named = parts.count() == 2 && !path.is_empty() && !path.starts_with('/');
        assert!(is_named, "{repository} {path}");
        let is_digit = |digit: u8| digit.is_ascii_digit() || (b'a'..=b'f').contains(&digit);
        let is_hash = sha256.len() == 64 && sha256.bytes().all(is_digit);
        assert!(is_hash, "{path}: {sha256}");
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
    let page = Document::read("docs/src/reference/mission-files.md").text;
    let page = page.split_whitespace().collect::<Vec<_>>().join(" ");
    for expected in [
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
        assert!(
            page.contains(&expected),
            "the page does not say: {expected}"
        );
    }
}

/// `.ci/schemas` holds the schemas against shipped files.
#[test]
fn schemas_lists_and_pages_of_fields_are_those_declared() {
    let lists = [
        ("scenario", "runtime/src/plan/raw", plan::schema()),
        ("drone", "runtime/daemon/src/config", config::schema()),
        ("hosts", "deploy/src/hosts", hosts::schema()),
    ];
    for (kind, folder, schema) in lists {
        assert_generated(&format!("{folder}/fields.txt"), &schema.list());
        let printed = muster().args(["schema", kind]).output().unwrap();
        let printed = String::from_utf8(printed.stdout).unwrap();
        assert_generated(&format!("docs/schemas/{kind}.schema.json"), &printed);
        let printed = muster()
            .args(["schema", kind, "--format", "markdown"])
            .output()
            .unwrap();
        let printed = String::from_utf8(printed.stdout).unwrap();
        assert_generated(&format!("docs/src/reference/{kind}.md"), &printed);
    }
    for file in files("scenarios", "toml") {
        let is_of_a_crate = file.ends_with("Cargo.toml") || file.ends_with("clippy.toml");
        let is_no_scenario = ["scenarios/tests/", "scenarios/indoor/"];
        if is_of_a_crate || is_no_scenario.iter().any(|it| file.starts_with(it)) {
            continue;
        }
        let up = "../".repeat(file.matches('/').count());
        let name = format!("#:schema {up}docs/schemas/scenario.schema.json\n");
        assert!(Document::read(&file).text.starts_with(&name), "{file}");
    }
}

/// It starts a process, which `.ci/run` lets run beside all else.
mod real_time {
    use std::io::{Read, Write as _};
    use std::net::{TcpListener, TcpStream};
    use std::process::{Child, Command, Stdio};
    use std::time::{Duration, Instant};

    use super::*;
    use crate::examples::{fresh_folder, make_fleet};

    struct Drone(Child);

    impl Drop for Drone {
        fn drop(&mut self) {
            drop(self.0.kill());
            drop(self.0.wait());
        }
    }

    /// What a drone on the ground answers at `/metrics`.
    fn metrics() -> String {
        let folder = fresh_folder();
        make_fleet(folder.path());
        let free = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = free.local_addr().unwrap();
        drop(free);
        let file = format!(
            "scenario = \"scenarios/hardware/swarm-short.toml\"\nid = 2\nstage = \"sim\"\n\
             vehicle = \"closed-form\"\ntransport = \"udp\"\njournal = \"journal\"\n\
             [keys]\ndrone = \"my-fleet/drone-2.key\"\nfleet = \"my-fleet/fleet.pub\"\n\
             roster = \"my-fleet/roster.toml\"\nrevoked = \"my-fleet/revoked.toml\"\n\
             [udp]\nbind = \"127.0.0.1:0\"\nbroadcast = \"127.0.0.1:9\"\ninterface = \"lo\"\n\
             [observe]\nhttp = \"{address}\"\n"
        );
        fs::write(folder.path().join("drone.toml"), file).unwrap();
        let drone = Command::new(musterd())
            .current_dir(folder.path())
            .args(["--config", "drone.toml"])
            .stderr(Stdio::null())
            .spawn();
        let _drone = Drone(drone.unwrap());
        let started = Instant::now();
        loop {
            if let Ok(mut stream) = TcpStream::connect(address) {
                let request = "GET /metrics HTTP/1.1\r\nHost: drone\r\nConnection: close\r\n\r\n";
                stream.write_all(request.as_bytes()).unwrap();
                let mut answer = String::new();
                stream.read_to_string(&mut answer).unwrap();
                return answer;
            }
            assert!(started.elapsed() < Duration::from_secs(20), "no answer");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    #[test]
    #[ignore = "in real time: `.ci/run` runs it"]
    fn metrics_page_has_every_metric_of_a_drone() {
        let answer = metrics();
        let mut page = String::from(
            "# Which metrics does a drone have?\n\n\
             A drone with a table `[observe]` answers at `/metrics`, in OpenMetrics' text. Counts are \
             since the start of the process. This table is generated from a drone's answer.\n\n\
             | metric | type | meaning |\n| --- | --- | --- |\n",
        );
        for line in answer.lines() {
            let Some((name, meaning)) = line
                .strip_prefix("# HELP ")
                .and_then(|it| it.split_once(' '))
            else {
                continue;
            };
            let kind = format!("# TYPE {name} ");
            let kind = answer
                .lines()
                .find_map(|it| it.strip_prefix(&kind))
                .unwrap();
            let suffix = if kind == "counter" { "_total" } else { "" };
            writeln!(page, "| `{name}{suffix}` | {kind} | {meaning} |").unwrap();
        }
        page.push_str(
            "\n| label | of | values |\n| --- | --- | --- |\n\
             | `state` | `muster_state` | what the drone may be doing |\n\
             | `state` | `muster_port_state` | `closed`, `identifying`, `open`, `silent` |\n\
             | `role` | `muster_role` | `none`, `master`, `member`, `relay` |\n\
             | `actor` | `muster_actor_…` | `radio`, `routing`, `mission`, `navigation`, `msp` |\n\
             | `kind` | `muster_frames_sent_total`, `muster_frames_let_in_total` | what a frame carries |\n\
             | `cause` | `muster_frames_sent_total` | `news`, `keep_alive` |\n\
             | `reason` | `muster_frames_dropped_total` | why a frame was not accepted |\n",
        );
        assert_generated("docs/src/reference/metrics.md", &page);
    }
}
