//! A fleet's folder, its drones' files and their processes.

use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{Ipv4Addr, TcpStream, UdpSocket};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::LazyLock;
use std::sync::mpsc::{self, Receiver};
use std::time::{Duration, Instant};

use serde_json::Value;
use tempfile::TempDir;

use super::network::{GROUP, Network};

/// How long a test waits for what must happen: several times what it takes; only a failing one does.
pub(super) const PATIENCE: Duration = Duration::from_secs(120);

/// The daemon's program, which `cargo test --workspace` builds beside the other one.
pub(crate) static MUSTERD: LazyLock<String> = LazyLock::new(|| {
    let program = Path::new(env!("CARGO_BIN_EXE_muster")).with_file_name("musterd");
    assert!(program.is_file(), "is built by: cargo build --workspace");
    program.to_str().unwrap().to_owned()
});

pub(crate) const SCENARIO: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/scenarios/hardware/swarm-short.toml"
);

/// Who leads in that scenario.
pub(crate) const MASTER: u32 = 2;

/// Five drones on paper: keys and files.
pub(crate) struct Fleet {
    folder: TempDir,
    /// Held so that no other test gets it; the drones' addresses are made of it. None where they talk over a network.
    _port: Option<UdpSocket>,
}

impl Fleet {
    /// On this machine, with addresses that nobody else uses.
    pub(crate) fn new() -> Self {
        Self::over("udp")
    }

    /// Likewise, drones that speak over this transport.
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

    /// On the hosts of a network, one each.
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

    /// A drone's own address and port.
    pub(crate) fn address(&self, id: u32) -> String {
        bind_of(&self.file(id))
    }

    /// Runs `muster keys`, which must do what it is asked for.
    pub(crate) fn keys(&self, arguments: &[&str]) {
        let run = Command::new(env!("CARGO_BIN_EXE_muster"))
            .current_dir(self.folder.path())
            .arg("keys")
            .args(arguments)
            .output()
            .unwrap();
        assert!(run.status.success(), "{run:?}");
    }

    /// Gives each drone a list of the expelled of its own, as it is now; where that of a drone is.
    pub(crate) fn divide_lists(&self) -> impl Fn(u32) -> PathBuf {
        let path = |id| format!("revoked-{id}.toml");
        for id in 0..5 {
            fs::copy(self.path("ours/revoked.toml"), self.path(&path(id))).unwrap();
            replace(&self.file(id), "ours/revoked.toml", &path(id));
        }
        let folder = self.folder.path().to_owned();
        move |id| folder.join(path(id))
    }

    pub(crate) fn command(&self, id: u32) -> Command {
        self.told(Command::new(&*MUSTERD), id)
    }

    fn told(&self, mut command: Command, id: u32) -> Command {
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
        let mut command = self.told(command, id);
        command.args(arguments);
        Process::start(id, command)
    }

    /// Starts a drone that can write no file longer than 2 KiB, which is as good as a full disk.
    pub(crate) fn start_with_little_disk(&self, id: u32) -> Process {
        let script = r#"trap "" XFSZ; ulimit -f 4; exec "$0" --config "$1""#;
        let mut command = Command::new("sh");
        command.args(["-c", script, &*MUSTERD]);
        command.arg(self.file(id));
        Process::start(id, command)
    }

    /// Asks a drone for one of its pages; the code and the text of the answer.
    pub(crate) fn ask(&self, id: u32, page: &str) -> (u16, String) {
        let mut stream = TcpStream::connect(self.address(id)).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        write!(stream, "GET {page} HTTP/1.1\r\nHost: drone\r\n\r\n").unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        let code = answer.split(' ').nth(1).unwrap().parse().unwrap();
        let (_, text) = answer.split_once("\r\n\r\n").unwrap();
        (code, text.to_owned())
    }

    /// What a drone tells of itself.
    pub(crate) fn status(&self, id: u32) -> Value {
        let (code, text) = self.ask(id, "/status");
        assert_eq!(code, 200, "{text}");
        serde_json::from_str(&text).unwrap()
    }

    /// Asks a drone until what it tells of itself is as is said.
    pub(crate) fn wait_for_status(
        &self,
        id: u32,
        what: &str,
        is_it: impl Fn(&Value) -> bool,
    ) -> Value {
        let began = Instant::now();
        loop {
            let status = self.status(id);
            if is_it(&status) {
                return status;
            }
            assert!(
                began.elapsed() < PATIENCE,
                "drone {id} is never {what}: {status:#}"
            );
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// All five, in the order of their numbers; the one that leads is told to fly.
    pub(crate) fn fly(&self) -> Vec<Process> {
        (0..5).map(|id| self.start(id, told(id))).collect()
    }

    /// Likewise, each on the host of its number.
    pub(crate) fn fly_on(&self, network: &Network) -> Vec<Process> {
        (0..5)
            .map(|id| self.start_on(network, id, told(id)))
            .collect()
    }
}

/// Runs a command to its end: its exit code, and what it says, without the ends of lines at which that is wrapped for a
/// terminal.
pub(crate) fn said_by(command: &mut Command) -> (Option<i32>, String) {
    let run = command.output().unwrap();
    let said = String::from_utf8([run.stdout, run.stderr].concat()).unwrap();
    let words: Vec<_> = said.split_whitespace().collect();
    (run.status.code(), words.join(" "))
}

/// Runs a command that is given something that can't be used: it says so, and what would be accepted, and does nothing.
pub(crate) fn assert_refused(command: &mut Command, says: &str) {
    let (code, said) = said_by(command);
    assert_eq!(code, Some(2), "{command:?}: {said}");
    assert!(said.contains(says), "{command:?}: {said}");
    assert!(!said.contains("panicked"), "{said}");
}

/// What a drone is told at its start.
fn told(id: u32) -> &'static [&'static str] {
    if id == MASTER { &["--fly"] } else { &[] }
}

/// What a file of a drone has as its own address.
fn bind_of(path: &Path) -> String {
    let text = fs::read_to_string(path).unwrap();
    let line = text.lines().find_map(|line| line.strip_prefix("bind = "));
    line.unwrap().trim_matches('"').to_owned()
}

/// A port of a test of its own, as long as it is held.
pub(crate) fn free_port() -> UdpSocket {
    UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap()
}

/// An address of a test of its own: 127.0.0.0/16 is for others.
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

/// A drone's process, and what it has said so far. It ends with this value.
pub(crate) struct Process {
    id: u32,
    child: Child,
    lines: Receiver<String>,
    pub(crate) said: Vec<Value>,
}

impl Process {
    pub(crate) fn start(id: u32, mut command: Command) -> Self {
        let mut child = command.stderr(Stdio::piped()).spawn().unwrap();
        let errors = BufReader::new(child.stderr.take().unwrap());
        let (sender, lines) = mpsc::channel();
        std::thread::spawn(move || {
            for line in errors.lines().map_while(Result::ok) {
                // Nobody listens any more once the test is over.
                let _ = sender.send(line);
            }
        });
        Self {
            id,
            child,
            lines,
            said: Vec::new(),
        }
    }

    /// Waits until the process says something of this kind.
    pub(crate) fn wait_for(&mut self, what: &str, is_it: impl Fn(&Value) -> bool) {
        let began = Instant::now();
        if self.said.iter().any(&is_it) {
            return;
        }
        while let Some(left) = PATIENCE.checked_sub(began.elapsed()) {
            let line = self.lines.recv_timeout(left);
            let Ok(line) = line else { break };
            let line = serde_json::from_str(&line).unwrap();
            let is_found = is_it(&line);
            self.said.push(line);
            if is_found {
                return;
            }
        }
        panic!("drone {} never says {what}: {:#?}", self.id, self.said);
    }

    /// Waits until the process says something of this kind once more than so many times.
    pub(crate) fn wait_for_more(
        &mut self,
        times: usize,
        what: &str,
        is_it: impl Fn(&Value) -> bool,
    ) {
        let seen = std::cell::Cell::new(0);
        self.wait_for(what, |line| {
            seen.set(seen.get() + usize::from(is_it(line)));
            seen.get() > times
        });
    }

    /// Waits until its mission is seen to do something, as in `{"State":"TakingOff"}`.
    pub(crate) fn wait_for_mission(&mut self, event: &Value) {
        self.wait_for(&event.to_string(), |line| {
            mission(line).as_ref() == Some(event)
        });
    }

    pub(crate) fn signal(&self, name: &str) {
        let pid = self.child.id();
        let mut kill = Command::new("sh");
        kill.args(["-c", &format!("kill -{name} {pid}")]);
        assert!(kill.status().unwrap().success());
    }

    /// Waits until it has ended by itself; its exit code, if no signal ended it.
    pub(crate) fn end(&mut self) -> Option<i32> {
        let began = Instant::now();
        // What it says is read meanwhile; its standard error closes when it ends.
        while let Some(left) = PATIENCE.checked_sub(began.elapsed()) {
            match self.lines.recv_timeout(left) {
                Ok(line) => self.said.push(serde_json::from_str(&line).unwrap()),
                Err(mpsc::RecvTimeoutError::Disconnected) => {
                    return self.child.wait().unwrap().code();
                }
                Err(mpsc::RecvTimeoutError::Timeout) => break,
            }
        }
        panic!("drone {} does not end: {:#?}", self.id, self.said);
    }

    /// So much of its memory as the system tells, in KiB: `VmRSS` now, `VmHWM` at the most until now.
    pub(crate) fn memory_kib(&self, what: &str) -> u64 {
        let status = fs::read_to_string(format!("/proc/{}/status", self.child.id())).unwrap();
        let line = status.lines().find(|line| line.starts_with(what)).unwrap();
        line.split_whitespace().nth(1).unwrap().parse().unwrap()
    }

    /// Takes in what it has said meanwhile.
    pub(crate) fn take_in(&mut self) {
        let lines = self.lines.try_iter();
        self.said
            .extend(lines.map(|line| serde_json::from_str::<Value>(&line).unwrap()));
    }

    /// How many frames its radio has dropped for this reason, as it says at its end and at each HUP.
    pub(crate) fn dropped(&self, reason: &str) -> u64 {
        let counted = |line: &&Value| line["message"] == "counted";
        let counted = self.said.iter().rfind(counted).unwrap();
        let all = counted["dropped"].as_str().unwrap().split(", ");
        let numbers = all.filter_map(|it| it.strip_prefix(reason)?.trim().parse::<u64>().ok());
        numbers.sum()
    }

    /// All that its mission was seen to do.
    pub(crate) fn missions(&self) -> Vec<Value> {
        self.said.iter().filter_map(mission).collect()
    }

    /// The ballots that it has obeyed, in order.
    pub(crate) fn leader(&self) -> Vec<Value> {
        let events = self.missions();
        events
            .iter()
            .filter_map(|event| event.get("Obeys").cloned())
            .collect()
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // It has ended by itself otherwise.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// What a line of a log says of the drone's mission.
fn mission(line: &Value) -> Option<Value> {
    seen(line)?.get("Mission").cloned()
}

/// What a line of a log says that was seen of the drone.
pub(crate) fn seen(line: &Value) -> Option<Value> {
    Some(serde_json::from_str(line.get("seen")?.as_str()?).unwrap())
}

/// Waits until what drones say together comes true.
pub(crate) fn wait_until(
    what: &str,
    drones: &mut [&mut Process],
    holds: impl Fn(&[&mut Process]) -> bool,
) {
    let began = Instant::now();
    while !holds(drones) {
        let said: Vec<_> = drones.iter().map(|it| it.missions()).collect();
        assert!(
            began.elapsed() < PATIENCE,
            "it never comes true that {what}: {said:#?}"
        );
        std::thread::sleep(Duration::from_millis(10));
        drones.iter_mut().for_each(|drone| drone.take_in());
    }
}

/// A file's text with something in it replaced, which must be there.
pub(crate) fn replace(path: &Path, from: &str, to: &str) {
    let text = fs::read_to_string(path).unwrap();
    assert!(text.contains(from), "{text}");
    fs::write(path, text.replacen(from, to, 1)).unwrap();
}
