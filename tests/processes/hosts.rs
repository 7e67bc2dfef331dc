//! The command `muster swarm --hosts`, over ssh and in namespaces of this machine.

use std::collections::BTreeSet;
use std::fs;
use std::net::UdpSocket;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use serde_json::Value;
use tempfile::TempDir;

use super::fleet::{Process, SCENARIO, address, assert_refused, free_port, run_command};
use super::network::{Network, skip};
use super::swarm::{hanging, is_stopped, processes_of, swarm, wait_until, with_faults};

use super::fleet::MUSTERD;

/// The drones of each of the three hosts.
const DRONES_OF_HOSTS: [&str; 3] = ["[0, 1]", "[2]", "[3, 4]"];

/// The operator's host.
const OPERATOR: u32 = 3;

/// Three hosts with an ssh server, and the operator's host.
struct Fleet {
    network: Network,
    folder: TempDir,
    /// Processes without a flight.
    idle: BTreeSet<u32>,
    _sshd: Vec<Process>,
}

impl Fleet {
    fn new() -> Option<Self> {
        let tools = ["/usr/sbin/sshd", "/usr/bin/ssh", "/usr/bin/ssh-keygen"];
        if let Some(missing) = tools.iter().find(|tool| !Path::new(tool).exists()) {
            return skip(&format!("{missing} is missing"));
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
        for (host, drones) in (1..).zip(DRONES_OF_HOSTS) {
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
        wait_until("all ssh servers answer", || (0..3).all(is_up));
        wait_until("all sessions have ended", || {
            network.processes(0..4).len() == 3
        });
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

    /// The command `muster swarm` on the operator's host.
    fn swarm(&self, scenario: &Path) -> Command {
        let mut command = self.network.command(OPERATOR, env!("CARGO_BIN_EXE_muster"));
        command
            .arg("swarm")
            .arg(scenario)
            .arg("--out")
            .arg(self.path("out"));
        command.arg("--hosts").arg(self.path("hosts.toml"));
        command.arg("--musterd").arg(&*MUSTERD);
        command
    }

    /// Waits until no process is left on any host, and asserts that no file is.
    fn wait_until_clean(&self) {
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

/// A hosts file for a network, with one drone per host.
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

/// The report of a flight in which the master was killed and replaced.
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
fn swarm_on_three_hosts_over_ssh_replaces_its_master_and_leaves_nothing() {
    let Some(fleet) = Fleet::new() else { return };
    let mut swarm = fleet.swarm(&scenario("swarm-kill-master.toml"));
    let output = swarm.arg("--json").output().unwrap();
    assert_master_was_replaced(&output);
    fleet.wait_until_clean();
    let log = fs::read_to_string(fleet.path("out/drones/drone-4/log.jsonl")).unwrap();
    assert!(log.contains("\"ready\""), "{log}");
}

#[test]
fn killed_starter_leaves_nothing_on_any_host_even_with_a_stopped_drone() {
    let Some(fleet) = Fleet::new() else { return };
    for signal in ["KILL", "TERM"] {
        let mut swarm = fleet.swarm(&hanging(fleet.folder.path()));
        let mut operator = swarm.stderr(Stdio::null()).spawn().unwrap();
        wait_until("a drone is stopped", || {
            fleet
                .network
                .processes([0])
                .iter()
                .any(|pid| is_stopped(*pid))
        });
        let mut kill = Command::new("kill");
        kill.args([format!("-{signal}"), operator.id().to_string()]);
        assert!(kill.status().unwrap().success());
        operator.wait().unwrap();
        fleet.wait_until_clean();
    }
}

#[test]
fn disconnected_host_ends_the_flight_on_all_hosts() {
    let Some(fleet) = Fleet::new() else { return };
    let mut swarm = fleet.swarm(Path::new(SCENARIO));
    let swarm = swarm.stderr(Stdio::piped()).spawn().unwrap();
    let log = fleet.path("out/drones/drone-3/log.jsonl");
    wait_until("it takes off", || {
        fs::read_to_string(&log).is_ok_and(|log| log.contains("TakingOff"))
    });
    (fleet.network).set_links(|from, to| from != 2 && to != 2);
    let output = swarm.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    let output = String::from_utf8(output.stderr).unwrap();
    let expected = format!(
        "10.77.0.3 env TMPDIR={}` lost",
        fleet.path("host-3").display()
    );
    assert!(output.contains(&expected), "{output}");
    fleet.wait_until_clean();
}

#[test]
fn swarm_in_namespaces_replaces_its_master_over_real_hops() {
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

/// Writes a hosts file with two hosts on this machine, reached by these commands. The first has drones 0 and 1, the second
/// drones 2 to 4.
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
fn slow_host_delays_the_start_without_losing_the_others() {
    let folder = tempfile::tempdir().unwrap();
    // Starts after seven seconds, and takes a quarter of a second for each of the first 80 lines.
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
    wait_until("no process is left", || processes_of(&out).is_empty());
}

#[test]
fn uploaded_files_are_removed_if_another_host_fails() {
    let folder = tempfile::tempdir().unwrap();
    let files = folder.path().join("files");
    fs::create_dir(&files).unwrap();
    let temporary = format!("TMPDIR={}", files.display());
    let fails = format!(
        "until [ -e {}/muster-*/scenario ]; do sleep 0.05; done; echo no route >&2; exit 1",
        files.display()
    );
    let runs: [&[&str]; 2] = [&["env", &temporary], &["sh", "-c", &fails, "--"]];
    let (hosts, _port) = two_hosts(folder.path(), runs);
    let out = folder.path().join("out");
    let mut command = swarm("hardware/swarm-short.toml", &out);
    let (code, output) = run_command(command.arg("--hosts").arg(hosts));
    assert_eq!(code, Some(1), "{output}");
    assert!(output.contains("no route"), "{output}");
    assert_eq!(fs::read_dir(&files).unwrap().count(), 0);
    assert_eq!(processes_of(&out), [0; 0]);
}

#[test]
fn failure_of_a_host_is_reported_with_its_last_line() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("hosts.toml");
    let refused = |run: &str, expected: &str| {
        let local = "[[hosts]]\ndrones = [0, 1]\naddress = \"127.0.0.1:4700\"\n";
        let remote = "[[hosts]]\ndrones = [2, 3, 4]\naddress = \"127.0.0.2:4700\"\n";
        let musterd = format!("musterd = \"{}\"\n", *MUSTERD);
        fs::write(&file, format!("{local}{musterd}{remote}run = {run}\n")).unwrap();
        let mut run = swarm("hardware/swarm-short.toml", &folder.path().join("out"));
        let (code, output) = run_command(run.arg("--hosts").arg(&file));
        assert_eq!(code, Some(1), "{output}");
        assert!(output.contains(expected), "{output}");
    };
    refused(r#"["sh", "-c", "echo no route >&2", "--"]"#, "no route");
    refused(r#"["no-such-program"]"#, "can't start no-such-program");
    let other = r#"["sh", "-c", "echo '{\"Hello\":{\"version\":\"0.0.9\"}}'", "--"]"#;
    refused(other, "runs musterd 0.0.9");
}

#[test]
fn errors_in_a_hosts_file_show_what_is_accepted() {
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
    for (from, to, expected) in [
        ("[0, 1]", "[0, 5]", "drones and relays 0 to 4, found 5"),
        ("[0, 1]", "[0, 2]", "drone 2 is listed twice"),
        ("[0, 1]", "[0]", "drone 1 of the scenario is on no host"),
        ("[0, 1]", "[]", "the host has no drone"),
        (
            "[0, 1]",
            "\"all\"",
            "`hosts.drones` takes a list of numbers",
        ),
        (
            "drones = [0, 1]",
            "",
            "`hosts.drones` takes a list of numbers",
        ),
        ("interface", "port", "unknown field `port`"),
        (
            "[\"ssh\", \"pi@10.0.0.7\"]",
            "\"ssh\"",
            "`hosts.run` takes a list of a command",
        ),
        ("[\"ssh\", \"pi@10.0.0.7\"]", "[]", "the command is empty"),
        (
            "bin/musterd",
            "bin/muster d",
            "the path needs quoting in a shell",
        ),
        (
            "bin/musterd",
            "bin/$HOME",
            "the path needs quoting in a shell",
        ),
        ("239.77", "10.77", "not a multicast group"),
        (":4700", ":0", "needs a fixed port (1–65535), found 0"),
        (
            ":4700\"",
            ":4700\"\nbroadcast = \"10.0.0.255:1\"",
            "exclude each other",
        ),
        (
            "group = \"239.77.0.1:4700\"",
            "",
            "the host needs an `address`",
        ),
        (
            "interface =",
            "address = \"10.0.0.8:1\"\ninterface =",
            "can't be combined with `group` or `broadcast`",
        ),
        ("group", "groups", "unknown field `groups`"),
    ] {
        assert!(right.contains(from));
        fs::write(&file, right.replacen(from, to, 1)).unwrap();
        let out = folder.path().join("out");
        let mut run = swarm("hardware/swarm-short.toml", &out);
        let run = run.arg("--hosts").arg(&file);
        assert_refused(run, expected);
        assert_refused(run, "hosts.toml");
        assert!(!out.exists(), "{from} made {to}");
    }
}
