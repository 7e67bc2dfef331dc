//! A network of hosts in namespaces of this machine, connected by a switch. Its firewall controls the links.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{self, Write};
use std::os::fd::AsFd;
use std::os::unix::process::CommandExt;
use std::process::{Child, Command, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU32, Ordering};
use std::thread::JoinHandle;

use rustix::thread::{LinkNameSpaceType, move_into_link_name_space};

/// If this variable is set, a test without namespaces fails instead of being skipped.
const REQUIRED: &str = "MUSTER_NAMESPACES_REQUIRED";

/// Multicast group and port of the drones; the same in every network, since the networks are isolated.
pub(crate) const GROUP: &str = "239.77.0.1:4700";

/// Hosts numbered from 0, each with an interface `eth0`. Host n has the address 10.77.0.(n + 1). They and their processes
/// are removed when this value is dropped or the test's process dies.
pub(crate) struct Network {
    name: String,
    hosts: u32,
    /// Removes the namespaces at the end of its standard input.
    cleaner: Child,
}

impl Network {
    /// A fully connected network; `None`, with a message, if this machine can't have one.
    pub(crate) fn new(hosts: u32) -> Option<Self> {
        Self::create(hosts).map_or_else(|reason| skip(&reason), Some)
    }

    /// A network in which each host hears only its neighbours in a line.
    pub(crate) fn line(hosts: u32) -> Option<Self> {
        let network = Self::new(hosts)?;
        network.set_links(are_adjacent);
        Some(network)
    }

    fn create(hosts: u32) -> Result<Self, String> {
        static NEXT: AtomicU32 = AtomicU32::new(0);
        // The first namespace creates /run/netns, which must not happen twice in parallel.
        static ONE_BY_ONE: Mutex<()> = Mutex::new(());
        run(Command::new("nft").arg("--version"), "")?;
        let nth = NEXT.fetch_add(1, Ordering::Relaxed);
        let name = format!("muster-{}-{nth}", std::process::id());
        let all: Vec<_> = (0..hosts).map(|host| format!("{name}-{host}")).collect();
        let switch = format!("{name}-switch");
        let cleaner = start_cleaner(all.iter().chain([&switch]))?;
        let network = Self {
            name,
            hosts,
            cleaner,
        };
        let lines = |lines: &mut dyn Iterator<Item = String>| lines.collect::<Vec<_>>().join("\n");
        let _one_by_one = ONE_BY_ONE.lock().unwrap_or_else(|it| it.into_inner());
        let mut namespaces = all
            .iter()
            .chain([&switch])
            .map(|it| format!("netns add {it}"));
        run(ip().args(["-batch", "-"]), &lines(&mut namespaces))?;
        let bridge = "link add switch type bridge mcast_snooping 0\nlink set switch up\n";
        let mut ports = (0..).zip(&all).map(|(n, host)| {
            format!(
                "link add port{n} type veth peer name eth0 netns {host}\nlink set port{n} master switch up"
            )
        });
        let ports = format!("{bridge}{}", lines(&mut ports));
        run(ip().args(["-n", &switch, "-batch", "-"]), &ports)?;
        for (n, host) in (1..).zip(&all) {
            let set_up = format!(
                "link set lo up\naddr add 10.77.0.{n}/24 brd + dev eth0\nlink set eth0 up\nroute add 224.0.0.0/4 dev eth0"
            );
            run(ip().args(["-n", host, "-batch", "-"]), &set_up)?;
        }
        network.apply_losses(&|_, _| 0)?;
        Ok(network)
    }

    /// Sets which links work, by sender and receiver.
    pub(crate) fn set_links(&self, works: impl Fn(u32, u32) -> bool) {
        self.set_losses(|from, to| if works(from, to) { 0 } else { 100 });
    }

    /// Sets the loss of each link in percent, by sender and receiver.
    pub(crate) fn set_losses(&self, percent: impl Fn(u32, u32) -> u32) {
        self.apply_losses(&percent).unwrap();
    }

    fn apply_losses(&self, percent: &dyn Fn(u32, u32) -> u32) -> Result<(), String> {
        let mut rules = String::new();
        for from in 0..self.hosts {
            for to in (0..self.hosts).filter(|to| *to != from) {
                let link = format!("iifname \"port{from}\" oifname \"port{to}\"");
                match percent(from, to) {
                    0 => rules += &format!("{link} accept\n"),
                    100.. => {}
                    loss => rules += &format!("{link} numgen random mod 100 >= {loss} accept\n"),
                }
            }
        }
        let table = format!(
            "table bridge air\ndelete table bridge air\ntable bridge air {{ chain forward {{\n\
             type filter hook forward priority 0; policy drop;\n{rules}}}\n}}\n"
        );
        let switch = format!("{}-switch", self.name);
        run(
            ip().args(["netns", "exec", &switch, "nft", "-f", "-"]),
            &table,
        )
    }

    /// A command that runs a program on a host, without arguments.
    pub(crate) fn command(&self, host: u32, program: &str) -> Command {
        let mut command = ip();
        command.args(["netns", "exec", &self.host(host), program]);
        command
    }

    /// Runs a function in a thread on a host.
    pub(crate) fn run<T: Send + 'static>(
        &self,
        host: u32,
        function: impl FnOnce() -> T + Send + 'static,
    ) -> JoinHandle<T> {
        let namespace = File::open(format!("/run/netns/{}", self.host(host))).unwrap();
        std::thread::spawn(move || {
            let kind = Some(LinkNameSpaceType::Network);
            move_into_link_name_space(namespace.as_fd(), kind).unwrap();
            function()
        })
    }

    /// The process ids on these hosts.
    pub(crate) fn processes(&self, hosts: impl IntoIterator<Item = u32>) -> BTreeSet<u32> {
        let of_host = |host| {
            let listed = ip()
                .args(["netns", "pids", &self.host(host)])
                .output()
                .unwrap();
            let listed = String::from_utf8(listed.stdout).unwrap();
            let numbers = listed.lines().map(|line| line.parse().unwrap());
            numbers.collect::<Vec<u32>>()
        };
        hosts.into_iter().flat_map(of_host).collect()
    }

    /// Name of a host's namespace.
    pub(crate) fn host(&self, host: u32) -> String {
        assert!(host < self.hosts);
        format!("{}-{host}", self.name)
    }
}

impl Drop for Network {
    fn drop(&mut self) {
        drop(self.cleaner.stdin.take());
        self.cleaner.wait().unwrap();
    }
}

/// Whether two hosts are neighbours in a line.
pub(crate) const fn are_adjacent(from: u32, to: u32) -> bool {
    from.abs_diff(to) == 1
}

/// Reports why a test is skipped, and returns `None`.
pub(crate) fn skip<T>(reason: &str) -> Option<T> {
    assert!(
        std::env::var_os(REQUIRED).is_none(),
        "must not be skipped: {reason}"
    );
    let test = std::thread::current();
    let test = test.name().unwrap_or_default();
    // The test runner would capture the output of `eprintln!`.
    let mut output = io::stderr();
    writeln!(output, "skipped: {test}: {reason}").unwrap();
    None
}

fn ip() -> Command {
    Command::new("ip")
}

/// Starts a process that removes namespaces and kills their processes once its standard input ends.
fn start_cleaner<'a>(names: impl Iterator<Item = &'a String>) -> Result<Child, String> {
    let script = "cat >/dev/null
        for name; do ip netns pids $name | xargs -r kill -9; ip netns delete $name; done";
    let mut cleaner = Command::new("sh");
    cleaner.args(["-c", script, "cleaner"]).args(names);
    cleaner
        .process_group(0)
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    cleaner.spawn().map_err(|error| format!("sh: {error}"))
}

/// Runs a command that must succeed.
fn run(command: &mut Command, input: &str) -> Result<(), String> {
    command
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    let ran = command.spawn().and_then(|mut child| {
        // A failed command stops reading and reports its error.
        let _ = child.stdin.take().unwrap().write_all(input.as_bytes());
        child.wait_with_output()
    });
    match ran {
        Ok(output) if output.status.success() => Ok(()),
        Ok(output) => {
            let output = String::from_utf8_lossy(&output.stderr);
            Err(format!(
                "{command:?}: {}",
                output.trim().replace('\n', "; ")
            ))
        }
        Err(error) => Err(format!("{command:?}: {error}")),
    }
}
