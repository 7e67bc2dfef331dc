//! A fleet for tests: its folder, its drones' files and their processes.

use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{Ipv4Addr, TcpStream, UdpSocket};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::LazyLock;
use std::sync::mpsc::{self, Receiver};
use std::time::{Duration, Instant};

use muster_daemon::control::{ControlMessage, READY};
use serde_json::Value;
use tempfile::TempDir;

use super::network::{GROUP, Network};

/// Time limit for a condition that must come true; several times the usual time.
pub(super) const TIMEOUT: Duration = Duration::from_secs(120);
/// Lines of each drone's log that a failed test shows.
const SHOWN: usize = 100;

/// The daemon's program: that of the environment variable `MUSTERD`, or the one that `cargo test --workspace` builds next to
/// `muster`.
pub(crate) static MUSTERD: LazyLock<String> = LazyLock::new(|| {
    let beside = || Path::new(env!("CARGO_BIN_EXE_muster")).with_file_name("musterd");
    let program = std::env::var_os("MUSTERD").map_or_else(beside, PathBuf::from);
    assert!(program.is_file(), "build it with: cargo build --workspace");
    program.to_str().unwrap().to_owned()
});

pub(crate) const SCENARIO: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/scenarios/hardware/swarm-short.toml"
);

/// The first leader in that scenario.
pub(crate) const MASTER: u32 = 2;

/// The keys and files of five drones.
pub(crate) struct Fleet {
    folder: TempDir,
    /// Reserves the port from which the drones' addresses are derived; `None` for drones on a [`Network`].
    _port: Option<UdpSocket>,
}

impl Fleet {
    /// On this machine, with unused addresses, over UDP.
    pub(crate) fn new() -> Self {
        Self::over("udp")
    }

    /// On this machine, with unused addresses, over this transport.
    pub(crate) fn over(transport: &str) -> Self {
        let port = free_port();
        let number = port.local_addr().unwrap().port();
        Self::with(transport, Some(port), |id| {
            let others = (0..5).filter(|peer| *peer != id);
            let peers: Vec<_> = others.map(|peer| address(number, peer)).collect();
            let bind = address(number, id);
            format!("bind = \"{bind}\"\npeers = {peers:?}\n\n[observe]\nhttp = \"{bind}\"")
        })
    }

    /// On the hosts of a [`Network`], one drone per host.
    pub(crate) fn on_hosts() -> Self {
        Self::with("udp", None, |_| {
            format!("group = \"{GROUP}\"\ninterface = \"eth0\"")
        })
    }

    fn with(transport: &str, port: Option<UdpSocket>, network: impl Fn(u32) -> String) -> Self {
        let fleet = Self {
            folder: tempfile::tempdir().unwrap(),
            _port: port,
        };
        fleet.keys(&["fleet", "ours"]);
        fleet.keys(&["drone", "ours", "0", "1", "2", "3", "4"]);
        for id in 0..5 {
            fs::write(fleet.file(id), drone_file(transport, id, &network(id))).unwrap();
        }
        fleet
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub(crate) fn file(&self, id: u32) -> PathBuf {
        self.path(&format!("drone-{id}.toml"))
    }

    /// Address and port of a drone.
    pub(crate) fn address(&self, id: u32) -> String {
        bind_of(&self.file(id))
    }

    /// Runs `muster keys`, which must succeed.
    pub(crate) fn keys(&self, arguments: &[&str]) {
        let run = Command::new(env!("CARGO_BIN_EXE_muster"))
            .current_dir(self.folder.path())
            .arg("keys")
            .args(arguments)
            .output()
            .unwrap();
        assert!(run.status.success(), "{run:?}");
    }

    /// Gives each drone its own copy of the revocation list. Returns the path of a drone's copy.
    pub(crate) fn separate_revocation_lists(&self) -> impl Fn(u32) -> PathBuf {
        let path = |id| format!("revoked-{id}.toml");
        for id in 0..5 {
            fs::copy(self.path("ours/revoked.toml"), self.path(&path(id))).unwrap();
            replace(&self.file(id), "ours/revoked.toml", &path(id));
        }
        let folder = self.folder.path().to_owned();
        move |id| folder.join(path(id))
    }

    pub(crate) fn command(&self, id: u32) -> Command {
        self.with_config(Command::new(&*MUSTERD), id)
    }

    fn with_config(&self, mut command: Command, id: u32) -> Command {
        command.arg("--config").arg(self.file(id));
        command
    }

    pub(crate) fn start(&self, id: u32, arguments: &[&str]) -> Process {
        let mut command = self.command(id);
        command.args(arguments);
        Process::start(id, command)
    }

    /// Starts a drone on the host of its number.
    pub(crate) fn start_on(&self, network: &Network, id: u32, arguments: &[&str]) -> Process {
        let command = network.command(id, &MUSTERD);
        let mut command = self.with_config(command, id);
        command.args(arguments);
        Process::start(id, command)
    }

    /// Starts a drone that can't write files longer than 2 KiB, which simulates a full disk.
    pub(crate) fn start_with_little_disk(&self, id: u32) -> Process {
        let script = r#"trap "" XFSZ; ulimit -f 4; exec "$0" --config "$1""#;
        let mut command = Command::new("sh");
        command.args(["-c", script, &*MUSTERD]);
        command.arg(self.file(id));
        Process::start(id, command)
    }

    /// Requests a page of a drone over HTTP. Returns the status code and the text.
    pub(crate) fn get(&self, id: u32, page: &str) -> (u16, String) {
        let mut stream = TcpStream::connect(self.address(id)).unwrap();
        stream.set_read_timeout(Some(TIMEOUT)).unwrap();
        write!(stream, "GET {page} HTTP/1.1\r\nHost: drone\r\n\r\n").unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        let code = answer.split(' ').nth(1).unwrap().parse().unwrap();
        let (_, text) = answer.split_once("\r\n\r\n").unwrap();
        (code, text.to_owned())
    }

    /// The status of a drone.
    pub(crate) fn status(&self, id: u32) -> Value {
        let (code, text) = self.get(id, "/status");
        assert_eq!(code, 200, "{text}");
        serde_json::from_str(&text).unwrap()
    }

    /// Waits until a drone's status satisfies a condition.
    pub(crate) fn wait_for_status(
        &self,
        id: u32,
        name: &str,
        condition: impl Fn(&Value) -> bool,
    ) -> Value {
        let began = Instant::now();
        loop {
            let status = self.status(id);
            if condition(&status) {
                return status;
            }
            assert!(
                began.elapsed() < TIMEOUT,
                "drone {id}: never `{name}`: {status:#}"
            );
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Starts all five drones by number and waits until each is ready, so that it answers requests. The leader gets the
    /// order to fly.
    pub(crate) fn fly(&self) -> Vec<Process> {
        let mut drones: Vec<_> = (0..5).map(|id| self.start(id, arguments(id))).collect();
        drones.iter_mut().for_each(Process::wait_until_ready);
        drones
    }

    /// Starts all five drones, each on the host of its number.
    pub(crate) fn fly_on(&self, network: &Network) -> Vec<Process> {
        (0..5)
            .map(|id| self.start_on(network, id, arguments(id)))
            .collect()
    }
}

/// Runs a command. Returns its exit code and its output, with line breaks replaced since messages are wrapped.
pub(crate) fn run_command(command: &mut Command) -> (Option<i32>, String) {
    let run = command.output().unwrap();
    let output = String::from_utf8([run.stdout, run.stderr].concat()).unwrap();
    let words: Vec<_> = output.split_whitespace().collect();
    (run.status.code(), words.join(" "))
}

/// Runs a command that must refuse its input with exit code 2 and this text.
pub(crate) fn assert_refused(command: &mut Command, expected: &str) {
    let (code, output) = run_command(command);
    assert_eq!(code, Some(2), "{command:?}: {output}");
    assert!(output.contains(expected), "{command:?}: {output}");
    assert!(!output.contains("panicked"), "{output}");
}

/// Arguments of a drone's process.
fn arguments(id: u32) -> &'static [&'static str] {
    if id == MASTER { &["--fly"] } else { &[] }
}

/// The address `bind` in a drone's file.
fn bind_of(path: &Path) -> String {
    let text = fs::read_to_string(path).unwrap();
    let line = text.lines().find_map(|line| line.strip_prefix("bind = "));
    line.unwrap().trim_matches('"').to_owned()
}

/// Reserves an unused port while the socket is open.
pub(crate) fn free_port() -> UdpSocket {
    UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap()
}

/// An unused loopback address derived from a reserved port; never in 127.0.0.0/16, which other programs use.
pub(crate) fn address(number: u16, id: u32) -> String {
    let [high, low] = number.to_be_bytes();
    format!("127.{}.{low}.{}:{number}", high.max(1), id + 1)
}

fn drone_file(transport: &str, id: u32, network: &str) -> String {
    format!(
        r#"scenario = "{SCENARIO}"
id = {id}
stage = "sim"
vehicle = "closed-form"
transport = "{transport}"
journal = "journal-{id}"
log = "json"

[keys]
drone = "ours/drone-{id}.key"
fleet = "ours/fleet.pub"
roster = "ours/roster.toml"
revoked = "ours/revoked.toml"

[{transport}]
{network}
"#
    )
}

/// A drone's process and its log. Dropping it kills the process.
pub(crate) struct Process {
    id: u32,
    child: Child,
    lines: Receiver<String>,
    /// The log lines read so far.
    pub(crate) log: Vec<Value>,
}

impl Process {
    pub(crate) fn start(id: u32, mut command: Command) -> Self {
        let mut child = command.stderr(Stdio::piped()).spawn().unwrap();
        let errors = BufReader::new(child.stderr.take().unwrap());
        let (sender, lines) = mpsc::channel();
        std::thread::spawn(move || {
            for line in errors.lines().map_while(Result::ok) {
                // The receiver is gone once the test is over.
                let _ = sender.send(line);
            }
        });
        Self {
            id,
            child,
            lines,
            log: Vec::new(),
        }
    }

    /// Waits for a log line that satisfies a condition.
    pub(crate) fn wait_for(&mut self, name: &str, condition: impl Fn(&Value) -> bool) {
        let began = Instant::now();
        if self.log.iter().any(&condition) {
            return;
        }
        while let Some(left) = TIMEOUT.checked_sub(began.elapsed()) {
            let line = self.lines.recv_timeout(left);
            let Ok(line) = line else { break };
            let line = serde_json::from_str(&line).unwrap();
            let is_found = condition(&line);
            self.log.push(line);
            if is_found {
                return;
            }
        }
        panic!("drone {}: no line `{name}`: {:#?}", self.id, self.log);
    }

    /// Waits until it answers requests.
    pub(crate) fn wait_until_ready(&mut self) {
        self.wait_for("it is ready", |line| line["message"] == READY);
    }

    /// Waits until more than `count` log lines satisfy a condition.
    pub(crate) fn wait_for_more(
        &mut self,
        count: usize,
        name: &str,
        condition: impl Fn(&Value) -> bool,
    ) {
        let found = std::cell::Cell::new(0);
        self.wait_for(name, |line| {
            found.set(found.get() + usize::from(condition(line)));
            found.get() > count
        });
    }

    /// Waits for an event of the mission, for example `{"State":"TakingOff"}`.
    pub(crate) fn wait_for_mission(&mut self, event: &Value) {
        self.wait_for(&event.to_string(), |line| {
            mission(line).as_ref() == Some(event)
        });
    }

    /// Sends a message on the control channel; its command needs `--controlled` and a pipe as standard input.
    pub(crate) fn control(&mut self, message: &ControlMessage) {
        let channel = self.child.stdin.as_mut().unwrap();
        channel.write_all(message.line().as_bytes()).unwrap();
    }

    pub(crate) fn signal(&self, name: &str) {
        let pid = self.child.id();
        let mut kill = Command::new("sh");
        kill.args(["-c", &format!("kill -{name} {pid}")]);
        assert!(kill.status().unwrap().success());
    }

    /// Waits until the process ends. Returns its exit code; `None` if a signal ended it.
    pub(crate) fn end(&mut self) -> Option<i32> {
        let began = Instant::now();
        // Reads the log meanwhile; standard error closes at the end.
        while let Some(left) = TIMEOUT.checked_sub(began.elapsed()) {
            match self.lines.recv_timeout(left) {
                Ok(line) => self.log.push(serde_json::from_str(&line).unwrap()),
                Err(mpsc::RecvTimeoutError::Disconnected) => {
                    return self.child.wait().unwrap().code();
                }
                Err(mpsc::RecvTimeoutError::Timeout) => break,
            }
        }
        panic!("drone {} does not end: {:#?}", self.id, self.log);
    }

    pub(crate) fn nice(&self) -> i32 {
        let pid = rustix::process::Pid::from_child(&self.child);
        rustix::process::getpriority_process(Some(pid)).unwrap()
    }

    /// Memory of the process in KiB: `VmRSS` for the current, `VmHWM` for the peak use.
    pub(crate) fn memory_kib(&self, field: &str) -> u64 {
        let status = fs::read_to_string(format!("/proc/{}/status", self.child.id())).unwrap();
        let line = status.lines().find(|line| line.starts_with(field)).unwrap();
        line.split_whitespace().nth(1).unwrap().parse().unwrap()
    }

    /// Reads the log lines that are available.
    pub(crate) fn read_available(&mut self) {
        let lines = self.lines.try_iter();
        self.log
            .extend(lines.map(|line| serde_json::from_str::<Value>(&line).unwrap()));
    }

    /// Number of frames dropped for a reason, from the last "counted" line. It is logged at the end and on SIGHUP.
    pub(crate) fn dropped(&self, reason: &str) -> u64 {
        let counted = |line: &&Value| line["message"] == "counted";
        let counted = self.log.iter().rfind(counted).unwrap();
        let all = counted["dropped"].as_str().unwrap().split(", ");
        let numbers = all.filter_map(|it| it.strip_prefix(reason)?.trim().parse::<u64>().ok());
        numbers.sum()
    }

    /// All events of the mission.
    pub(crate) fn missions(&self) -> Vec<Value> {
        self.log.iter().filter_map(mission).collect()
    }

    /// The ballots that it has accepted, in order.
    pub(crate) fn ballots(&self) -> Vec<Value> {
        let events = self.missions();
        events
            .iter()
            .filter_map(|event| event.get("Follows").cloned())
            .collect()
    }
}

impl Drop for Process {
    /// A test that fails shows how the log ends.
    #[expect(clippy::print_stderr, reason = "why a test failed")]
    fn drop(&mut self) {
        if std::thread::panicking() {
            let read = self.log.iter().map(ToString::to_string);
            let lines: Vec<_> = read.chain(self.lines.try_iter()).collect();
            for line in &lines[lines.len().saturating_sub(SHOWN)..] {
                eprintln!("drone {}: {line}", self.id);
            }
        }
        // It fails if the process has ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The event of the mission in a log line, if any.
fn mission(line: &Value) -> Option<Value> {
    observation(line)?.get("Mission").cloned()
}

/// The observation in a log line, if any.
pub(crate) fn observation(line: &Value) -> Option<Value> {
    Some(serde_json::from_str(line.get("seen")?.as_str()?).unwrap())
}

/// Waits until a condition on several drones' logs holds.
pub(crate) fn wait_until(
    condition: &str,
    drones: &mut [&mut Process],
    holds: impl Fn(&[&mut Process]) -> bool,
) {
    let began = Instant::now();
    while !holds(drones) {
        let events: Vec<_> = drones.iter().map(|it| it.missions()).collect();
        assert!(
            began.elapsed() < TIMEOUT,
            "never `{condition}`: {events:#?}"
        );
        std::thread::sleep(Duration::from_millis(10));
        drones.iter_mut().for_each(|drone| drone.read_available());
    }
}

/// Replaces a text in a file, which must contain it.
pub(crate) fn replace(path: &Path, from: &str, to: &str) {
    let text = fs::read_to_string(path).unwrap();
    assert!(text.contains(from), "{text}");
    fs::write(path, text.replacen(from, to, 1)).unwrap();
}
