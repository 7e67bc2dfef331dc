//! `muster swarm --hosts`: drones that are started on other hosts, over ssh or in namespaces of this machine.

use std::collections::BTreeSet;
use std::fs;
use std::net::UdpSocket;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use serde_json::Value;
use tempfile::TempDir;

use super::fleet::{Process, SCENARIO, address, assert_refused, free_port, said_by};
use super::network::{Network, skip};
use super::swarm::{hanging, processes_of, stopped, swarm, wait_until, with_faults};

use super::fleet::MUSTERD;

/// Who flies on which of the three hosts.
const PLACES: [&str; 3] = ["[0, 1]", "[2]", "[3, 4]"];

/// The host of whoever starts them all.
const OPERATOR: u32 = 3;

/// Three hosts to which ssh leads, and one from which it does.
struct Fleet {
    network: Network,
    folder: TempDir,
    /// What runs there before and after a flight.
    idle: BTreeSet<u32>,
    _sshd: Vec<Process>,
}

impl Fleet {
    fn new() -> Option<Self> {
        let tools = ["/usr/sbin/sshd", "/usr/bin/ssh", "/usr/bin/ssh-keygen"];
        if let Some(missing) = tools.iter().find(|tool| !Path::new(tool).exists()) {
            return skip(&format!("there is no {missing}"));
        }
        let network = Network::new(4)?;
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        for name in ["host", "user"] {
            let mut keygen = Command::new("ssh-keygen");
            keygen
                .args(["-q", "-t", "ed25519", "-N", "", "-f"])
                .arg(path(name));
            assert!(keygen.status().unwrap().success());
        }
        fs::create_dir_all("/run/sshd").unwrap();
        let server = format!(
            "Port 2222\nHostKey {}\nAuthorizedKeysFile {}\nStrictModes no\nUsePAM no\nPidFile none\n\
             PasswordAuthentication no\nPermitRootLogin prohibit-password\n\
             ClientAliveInterval 1\nClientAliveCountMax 3\n",
            path("host").display(),
            path("user.pub").display(),
        );
        fs::write(path("sshd_config"), server).unwrap();
        let host_key = fs::read_to_string(path("host.pub")).unwrap();
        fs::write(path("known_hosts"), format!("[10.77.0.*]:2222 {host_key}")).unwrap();
        let client = format!(
            "User root\nPort 2222\nBatchMode yes\nIdentityFile {}\nIdentitiesOnly yes\nUserKnownHostsFile {}\n",
            path("user").display(),
            path("known_hosts").display(),
        );
        fs::write(path("ssh_config"), client).unwrap();
        let mut hosts = String::new();
        for (host, drones) in (1..).zip(PLACES) {
            let files = path(&format!("host-{host}"));
            fs::create_dir(&files).unwrap();
            let run = [
                "ssh".to_owned(),
                "-F".to_owned(),
                path("ssh_config").display().to_string(),
                format!("10.77.0.{host}"),
                "env".to_owned(),
                format!("TMPDIR={}", files.display()),
            ];
            hosts += &host_table(&run, drones);
            hosts += &format!("address = \"10.77.0.{host}:4700\"\n");
        }
        fs::write(path("hosts.toml"), hosts).unwrap();
        let sshd = (0..3).map(|host| {
            let mut command = network.command(host, "/usr/sbin/sshd");
            command.args(["-D", "-e", "-f"]).arg(path("sshd_config"));
            Process::start(host, command)
        });
        let sshd = sshd.collect();
        let is_up = |host: u32| {
            let mut connect = network.command(OPERATOR, "ssh");
            connect.arg("-F").arg(path("ssh_config"));
            connect.args([&format!("10.77.0.{}", host + 1), "true"]);
            connect.stderr(Stdio::null()).status().unwrap().success()
        };
        wait_until("ssh leads to all hosts", || (0..3).all(is_up));
        wait_until("nobody is there", || network.processes(0..4).len() == 3);
        Some(Self {
            idle: network.processes(0..4),
            network,
            folder,
            _sshd: sshd,
        })
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// `muster swarm`, on the operator's host.
    fn swarm(&self, scenario: &Path) -> Command {
        let mut command = self.network.command(OPERATOR, env!("CARGO_BIN_EXE_muster"));
        command
            .arg("swarm")
            .arg(scenario)
            .arg("--out")
            .arg(self.path("out"));
        command.arg("--hosts").arg(self.path("hosts.toml"));
        command
    }

    /// Nothing is left on any host: no process, and no file.
    fn wait_until_left(&self) {
        wait_until("no process is left", || {
            self.network.processes(0..4) == self.idle
        });
        for host in 1..4 {
            let files = self.path(&format!("host-{host}"));
            assert_eq!(fs::read_dir(files).unwrap().count(), 0);
        }
    }
}

fn host_table(run: &[String], drones: &str) -> String {
    format!(
        "[[hosts]]\nrun = {run:?}\ndrones = {drones}\nmusterd = \"{}\"\ninterface = \"eth0\"\n",
        *MUSTERD
    )
}

/// A file of hosts that are the first namespaces of a network, a drone each.
pub(crate) fn in_namespaces(network: &Network, drones: u32) -> String {
    let mut hosts = "broadcast = \"10.77.0.255:4700\"\n".to_owned();
    for host in 0..drones {
        let name = network.host(host);
        let run = ["ip", "netns", "exec", &name].map(str::to_owned);
        hosts += &host_table(&run, &format!("[{host}]"));
    }
    hosts
}

fn scenario(name: &str) -> PathBuf {
    Path::new(SCENARIO).with_file_name(name)
}

/// What a flight in which the master is killed came to.
fn assert_master_was_replaced(output: &std::process::Output) -> Value {
    assert!(output.status.success(), "{output:?}");
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["violations"], Value::Array(Vec::new()));
    assert_eq!(report["mission_completed"], true);
    let state = |id: usize| report["drones"][id]["state"].as_str().unwrap();
    assert_eq!(state(2), "killed while moving to waypoint 2");
    for id in [0, 1, 3, 4] {
        assert_eq!(state(id), "finished", "drone {id}");
    }
    let masters = report["elections"][0]["masters"].as_array().unwrap();
    assert_eq!(masters.len(), 2, "{report:#}");
    let uncertainty_s = report["clock_uncertainty_s"].as_f64().unwrap();
    assert!(
        uncertainty_s > 0.0 && uncertainty_s < 1.0,
        "{uncertainty_s}"
    );
    report
}

#[test]
fn a_swarm_flies_on_three_hosts_over_ssh_loses_its_master_and_leaves_nothing_there() {
    let Some(fleet) = Fleet::new() else { return };
    let mut swarm = fleet.swarm(&scenario("swarm-kill-master.toml"));
    let output = swarm.arg("--json").output().unwrap();
    assert_master_was_replaced(&output);
    fleet.wait_until_left();
    let log = fs::read_to_string(fleet.path("out/drones/drone-4/log.jsonl")).unwrap();
    assert!(log.contains("\"ready\""), "{log}");
}

#[test]
fn nothing_is_left_on_any_host_when_whoever_started_it_is_killed_and_a_drone_stands_still() {
    let Some(fleet) = Fleet::new() else { return };
    for signal in ["KILL", "TERM"] {
        let mut swarm = fleet.swarm(&hanging(fleet.folder.path()));
        let mut operator = swarm.stderr(Stdio::null()).spawn().unwrap();
        wait_until("a drone stands still", || {
            fleet.network.processes([0]).iter().any(|pid| stopped(*pid))
        });
        let mut kill = Command::new("kill");
        kill.args([format!("-{signal}"), operator.id().to_string()]);
        assert!(kill.status().unwrap().success());
        operator.wait().unwrap();
        fleet.wait_until_left();
    }
}

#[test]
fn a_flight_ends_everywhere_when_a_host_is_cut_off_and_there_too() {
    let Some(fleet) = Fleet::new() else { return };
    let mut swarm = fleet.swarm(Path::new(SCENARIO));
    let swarm = swarm.stderr(Stdio::piped()).spawn().unwrap();
    let log = fleet.path("out/drones/drone-3/log.jsonl");
    wait_until("it takes off", || {
        fs::read_to_string(&log).is_ok_and(|log| log.contains("TakingOff"))
    });
    (fleet.network).let_hear(|from, to| from != 2 && to != 2);
    let output = swarm.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    let said = String::from_utf8(output.stderr).unwrap();
    let says = format!(
        "10.77.0.3 env TMPDIR={}` is not heard any more",
        fleet.path("host-3").display()
    );
    assert!(said.contains(&says), "{said}");
    fleet.wait_until_left();
}

#[test]
fn the_same_scenario_flies_over_a_network_whose_line_is_real() {
    let Some(network) = Network::line(5) else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("hosts.toml");
    fs::write(&file, in_namespaces(&network, 5)).unwrap();
    let output = swarm(
        "hardware/swarm-kill-master.toml",
        &folder.path().join("out"),
    )
    .args(["--unlimited-range", "--json", "--hosts"])
    .arg(file)
    .output()
    .unwrap();
    assert_master_was_replaced(&output);
    assert_eq!(network.processes(0..5), BTreeSet::new());
}

/// A file of two hosts that are this machine, the first reached by a command, the second too; who has drones 0 and 1, and
/// 2 to 4.
fn two_hosts(folder: &Path, runs: [&[&str]; 2]) -> (PathBuf, UdpSocket) {
    let port = free_port();
    let number = port.local_addr().unwrap().port();
    let tables = runs.iter().zip([("[0, 1]", 0), ("[2, 3, 4]", 2)]);
    let tables = tables.map(|(run, (drones, first))| {
        let address = address(number, first);
        format!("[[hosts]]\nrun = {run:?}\ndrones = {drones}\nmusterd = \"{}\"\naddress = \"{address}\"\n", *MUSTERD)
    });
    let file = folder.join("hosts.toml");
    fs::write(&file, tables.collect::<String>()).unwrap();
    (file, port)
}

#[test]
fn a_host_waits_for_another_that_is_slow_to_start_and_to_be_handed_its_files() {
    let folder = tempfile::tempdir().unwrap();
    // It takes seven seconds to be there, and a quarter for each line, until it has got its files.
    let slow = "sleep 7; n=0
        while IFS= read -r line; do
            printf '%s\\n' \"$line\"; n=$((n + 1)); [ $n -gt 80 ] || sleep 0.25
        done | \"$@\"";
    let (hosts, _port) = two_hosts(folder.path(), [&["sh", "-c", slow, "--"], &["env"]]);
    let padding = format!("\n# {}\n", "long ".repeat(20_000));
    let scenario = with_faults(folder.path(), &padding);
    let out = folder.path().join("out");
    let mut command = swarm(scenario.to_str().unwrap(), &out);
    let command = command.arg("--hosts").arg(hosts).stderr(Stdio::piped());
    let mut run = command.spawn().unwrap();
    let log = out.join("drones/drone-0/log.jsonl");
    let mut ended = None;
    wait_until("it takes off", || {
        ended = run.try_wait().unwrap();
        ended.is_some() || fs::read_to_string(&log).is_ok_and(|log| log.contains("TakingOff"))
    });
    if ended.is_some() {
        panic!("{:?}", run.wait_with_output());
    }
    run.kill().unwrap();
    run.wait().unwrap();
    wait_until("none is left", || processes_of(&out).is_empty());
}

#[test]
fn what_a_host_was_handed_is_removed_when_another_starts_no_drones() {
    let folder = tempfile::tempdir().unwrap();
    let files = folder.path().join("files");
    fs::create_dir(&files).unwrap();
    let place = format!("TMPDIR={}", files.display());
    let fails = format!(
        "until [ -e {}/muster-*/scenario ]; do sleep 0.05; done; echo no way there >&2; exit 1",
        files.display()
    );
    let runs: [&[&str]; 2] = [&["env", &place], &["sh", "-c", &fails, "--"]];
    let (hosts, _port) = two_hosts(folder.path(), runs);
    let out = folder.path().join("out");
    let mut command = swarm("hardware/swarm-short.toml", &out);
    let (code, said) = said_by(command.arg("--hosts").arg(hosts));
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("no way there"), "{said}");
    assert_eq!(fs::read_dir(&files).unwrap().count(), 0);
    assert_eq!(processes_of(&out), [0; 0]);
}

#[test]
fn a_host_that_starts_no_drones_is_told_with_what_it_said() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("hosts.toml");
    let refused = |run: &str, says: &str| {
        let here = "[[hosts]]\ndrones = [0, 1]\naddress = \"127.0.0.1:4700\"\n";
        let there = "[[hosts]]\ndrones = [2, 3, 4]\naddress = \"127.0.0.2:4700\"\n";
        let musterd = format!("musterd = \"{}\"\n", *MUSTERD);
        fs::write(&file, format!("{here}{musterd}{there}run = {run}\n")).unwrap();
        let mut run = swarm("hardware/swarm-short.toml", &folder.path().join("out"));
        let (code, said) = said_by(run.arg("--hosts").arg(&file));
        assert_eq!(code, Some(1), "{said}");
        assert!(said.contains(says), "{said}");
    };
    refused(
        r#"["sh", "-c", "echo no way there >&2", "--"]"#,
        "no way there",
    );
    refused(r#"["no-such-program"]"#, "can't start no-such-program");
    let other = r#"["sh", "-c", "echo '{\"Here\":{\"version\":\"0.0.9\"}}'", "--"]"#;
    refused(other, "is of version 0.0.9");
}

#[test]
fn what_is_wrong_with_a_hosts_file_is_shown_with_what_would_be_accepted() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("hosts.toml");
    let right = r#"group = "239.77.0.1:4700"

[[hosts]]
run = ["ssh", "pi@10.0.0.7"]
drones = [0, 1]
musterd = "/usr/local/bin/musterd"

[[hosts]]
run = ["ssh", "pi@10.0.0.8"]
drones = [2, 3, 4]
interface = "wlan0"
"#;
    for (from, to, says) in [
        ("[0, 1]", "[0, 5]", "have numbers up to 4"),
        ("[0, 1]", "[0, 2]", "drone 2 is at a host already"),
        ("[0, 1]", "[0]", "no host has drone 1 of the scenario"),
        ("[0, 1]", "[]", "no drone flies here"),
        (
            "[0, 1]",
            "\"all\"",
            "`hosts.drones` is the numbers of the drones",
        ),
        (
            "drones = [0, 1]",
            "",
            "`hosts.drones` is the numbers of the drones",
        ),
        ("interface", "port", "unknown field `port`"),
        (
            "[\"ssh\", \"pi@10.0.0.7\"]",
            "\"ssh\"",
            "`hosts.run` is the command, with its arguments",
        ),
        ("[\"ssh\", \"pi@10.0.0.7\"]", "[]", "this names no command"),
        (
            "bin/musterd",
            "bin/muster d",
            "would not take this for the path of a program",
        ),
        (
            "bin/musterd",
            "bin/$HOME",
            "would not take this for the path of a program",
        ),
        ("239.77", "10.77", "not a multicast group"),
        (":4700", ":0", "needs a port that all know"),
        (
            ":4700\"",
            ":4700\"\nbroadcast = \"10.0.0.255:1\"",
            "one of them",
        ),
        ("group = \"239.77.0.1:4700\"", "", "this one has none"),
        (
            "interface =",
            "address = \"10.0.0.8:1\"\ninterface =",
            "take a port of their own",
        ),
        ("group", "groups", "unknown field `groups`"),
    ] {
        assert!(right.contains(from));
        fs::write(&file, right.replacen(from, to, 1)).unwrap();
        let out = folder.path().join("out");
        let mut run = swarm("hardware/swarm-short.toml", &out);
        let run = run.arg("--hosts").arg(&file);
        assert_refused(run, says);
        assert_refused(run, "hosts.toml");
        assert!(!out.exists(), "{from} made {to}");
    }
}
