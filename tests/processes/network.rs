//! A network of hosts that are namespaces of this machine, on one switch whose firewall says who hears whom.

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

/// Where it is set, a test that can't have a network fails and is not skipped.
const REQUIRED: &str = "MUSTER_NAMESPACES_REQUIRED";

/// The multicast group and port that drones talk to, the same in every network: none hears of another.
pub(crate) const GROUP: &str = "239.77.0.1:4700";

/// Hosts with an interface `eth0` each, numbered from 0: host n has the address 10.77.0.(n + 1). They go with this value,
/// or when the test's process is killed, and so does whatever runs in them.
pub(crate) struct Network {
    name: String,
    hosts: u32,
    /// Removes it all when its standard input ends.
    cleaner: Child,
}

impl Network {
    /// A network on which everybody hears everybody; nothing, and a word why, where this machine can't have one.
    pub(crate) fn new(hosts: u32) -> Option<Self> {
        Self::make(hosts).map_or_else(|why| skip(&why), Some)
    }

    /// A network on which each host hears the next ones, and no others.
    pub(crate) fn line(hosts: u32) -> Option<Self> {
        let network = Self::new(hosts)?;
        network.let_hear(next_to);
        Some(network)
    }

    fn make(hosts: u32) -> Result<Self, String> {
        static NEXT: AtomicU32 = AtomicU32::new(0);
        // The first namespace of all makes a place for them, which two must not do at once.
        static ONE_BY_ONE: Mutex<()> = Mutex::new(());
        run(Command::new("nft").arg("--version"), "")?;
        let nth = NEXT.fetch_add(1, Ordering::Relaxed);
        let name = format!("muster-{}-{nth}", std::process::id());
        let all: Vec<_> = (0..hosts).map(|host| format!("{name}-{host}")).collect();
        let switch = format!("{name}-switch");
        let cleaner = clean_in_the_end(all.iter().chain([&switch]))?;
        let network = Self {
            name,
            hosts,
            cleaner,
        };
        let lines = |lines: &mut dyn Iterator<Item = String>| lines.collect::<Vec<_>>().join("\n");
        let _one_by_one = ONE_BY_ONE.lock().unwrap_or_else(|it| it.into_inner());
        let mut made = all
            .iter()
            .chain([&switch])
            .map(|it| format!("netns add {it}"));
        run(ip().args(["-batch", "-"]), &lines(&mut made))?;
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
        network.carry(&|_, _| 0)?;
        Ok(network)
    }

    /// From now on a host hears another where this says so, and does not hear it otherwise.
    pub(crate) fn let_hear(&self, hears: impl Fn(u32, u32) -> bool) {
        self.lose(|from, to| if hears(from, to) { 0 } else { 100 });
    }

    /// From now on so much of what one host sends is lost on its way to another, in percent.
    pub(crate) fn lose(&self, percent: impl Fn(u32, u32) -> u32) {
        self.carry(&percent).unwrap();
    }

    fn carry(&self, lost: &dyn Fn(u32, u32) -> u32) -> Result<(), String> {
        let mut rules = String::new();
        for from in 0..self.hosts {
            for to in (0..self.hosts).filter(|to| *to != from) {
                let way = format!("iifname \"port{from}\" oifname \"port{to}\"");
                match lost(from, to) {
                    0 => rules += &format!("{way} accept\n"),
                    100.. => {}
                    some => rules += &format!("{way} numgen random mod 100 >= {some} accept\n"),
                }
            }
        }
        let air = format!(
            "table bridge air\ndelete table bridge air\ntable bridge air {{ chain forward {{\n\
             type filter hook forward priority 0; policy drop;\n{rules}}}\n}}\n"
        );
        let switch = format!("{}-switch", self.name);
        run(
            ip().args(["netns", "exec", &switch, "nft", "-f", "-"]),
            &air,
        )
    }

    /// A command that runs a program on a host; its arguments are to follow.
    pub(crate) fn command(&self, host: u32, program: &str) -> Command {
        let mut command = ip();
        command.args(["netns", "exec", &self.host(host), program]);
        command
    }

    /// Runs something on a host, in a thread of the test's.
    pub(crate) fn run<T: Send + 'static>(
        &self,
        host: u32,
        what: impl FnOnce() -> T + Send + 'static,
    ) -> JoinHandle<T> {
        let namespace = File::open(format!("/run/netns/{}", self.host(host))).unwrap();
        std::thread::spawn(move || {
            let kind = Some(LinkNameSpaceType::Network);
            move_into_link_name_space(namespace.as_fd(), kind).unwrap();
            what()
        })
    }

    /// The processes on these hosts, by number.
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

    /// What a host is called.
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

/// Whether two hosts are next to each other in a line.
pub(crate) const fn next_to(from: u32, to: u32) -> bool {
    from.abs_diff(to) == 1
}

/// Says why a test is skipped, which it is with what this returns.
pub(crate) fn skip<T>(why: &str) -> Option<T> {
    assert!(
        std::env::var_os(REQUIRED).is_none(),
        "not to be skipped: {why}"
    );
    let test = std::thread::current();
    let test = test.name().unwrap_or_default();
    // Not by a macro, whose words the tests' runner keeps to itself.
    let mut said = io::stderr();
    writeln!(said, "skipped: {test}: {why}").unwrap();
    None
}

fn ip() -> Command {
    Command::new("ip")
}

/// A process that removes namespaces, and kills what runs in them, once its standard input ends, as it does with ours.
fn clean_in_the_end<'a>(names: impl Iterator<Item = &'a String>) -> Result<Child, String> {
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
        // One that has failed reads nothing more, and says why.
        let _ = child.stdin.take().unwrap().write_all(input.as_bytes());
        child.wait_with_output()
    });
    match ran {
        Ok(output) if output.status.success() => Ok(()),
        Ok(output) => {
            let said = String::from_utf8_lossy(&output.stderr);
            Err(format!("{command:?}: {}", said.trim().replace('\n', "; ")))
        }
        Err(error) => Err(format!("{command:?}: {error}")),
    }
}
