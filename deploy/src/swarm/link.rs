//! The connection to a launcher on a host. It converts the times of reports to our clock.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Write;
use std::path::Path;
use std::process::Stdio;
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};
use std::time::Duration;

use muster_daemon::clock::Clock;
use muster_daemon::launcher::SILENCE_MAX;
use muster_daemon::launcher::protocol::{LauncherCommand, Reply, VERSION, line};
use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;
use tokio::io::AsyncWriteExt;
use tokio::process::{Child, ChildStdin, ChildStdout, Command};
use tokio::sync::mpsc::{self, UnboundedSender};
use tokio::task::JoinHandle;
use tokio::time::{Instant, MissedTickBehavior, interval, timeout, timeout_at};

use super::lines::HostLines;
use super::offset::Offset;
use super::output::{ProcessOutput, parse};
use super::process::HostEvent;
use super::{START_MAX, SwarmError};
use crate::hosts::Host;

/// Period of the pings, which measure the host's clock.
const PING_PERIOD: Duration = Duration::from_secs(1);

/// Number of pings before the flight starts.
const FIRST_PINGS: u64 = 8;

/// Time for a launcher to end its processes and itself.
const EXIT_MAX: Duration = Duration::from_secs(3);

/// The connection to a launcher.
pub(super) struct HostConnection {
    /// Name of the host.
    name: String,
    child: Child,
    input: ChildStdin,
    lines: HostLines<ChildStdout>,
    /// Reads standard error of the launcher or of the command that runs it; returns the last line.
    errors: JoinHandle<String>,
    clock: Clock,
    /// Whether the host is this machine and has the same clock.
    is_local: bool,
    offset: Offset,
    /// Latest estimate of the offset, shared with [`Launcher`](super::host::Launcher).
    ahead_ns: Arc<AtomicI64>,
    /// Number and send time of the last ping.
    last_ping: (u64, Timestamp),
    last_reply_at: Timestamp,
    /// Largest uncertainty of the host's clock so far.
    uncertainty: Duration,
}

impl HostConnection {
    /// Starts a launcher on a host and waits for its hello.
    ///
    /// # Errors
    /// If the launcher does not start or has another version.
    pub(super) async fn open(host: &Host) -> Result<Self, SwarmError> {
        let mut command = match host.run.split_first() {
            None => Command::new(&host.musterd),
            Some((run, arguments)) => {
                let mut command = Command::new(run);
                command.args(arguments).arg(&host.musterd);
                command
            }
        };
        // An own process group: Ctrl-C goes to the starter only, which ends its launchers in order.
        let spawned = command
            .arg("--launcher")
            .process_group(0)
            .kill_on_drop(true)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn();
        let mut child = spawned.map_err(|source| SwarmError::Start {
            program: host.run.first().map_or(host.musterd.clone(), Into::into),
            source,
        })?;
        let input = child.stdin.take().expect("stdin is piped");
        let output = child.stdout.take().expect("stdout is piped");
        let errors = child.stderr.take().expect("stderr is piped");
        let clock = Clock::start();
        let mut link = Self {
            name: host.name(),
            child,
            input,
            lines: HostLines::new(output),
            errors: tokio::spawn(HostLines::new(errors).last()),
            last_reply_at: clock.now(),
            clock,
            is_local: host.is_local(),
            offset: Offset::default(),
            ahead_ns: Arc::default(),
            last_ping: (0, clock.now()),
            uncertainty: Duration::ZERO,
        };
        match timeout(START_MAX, link.wait_for_hello()).await {
            Ok(Some(version)) if version == VERSION => Ok(link),
            Ok(Some(theirs)) => {
                let host = link.name;
                Err(SwarmError::OtherVersion { host, theirs })
            }
            Ok(None) => {
                let host = link.name.clone();
                let last = link.end().await;
                Err(SwarmError::HostGone { host, last })
            }
            Err(_) => Err(SwarmError::HostLate(link.name)),
        }
    }

    /// Waits for the launcher's hello and returns its version; `None` if it ends before.
    async fn wait_for_hello(&mut self) -> Option<String> {
        loop {
            if let Reply::Hello { version } = self.next_reply().await? {
                return Some(version);
            }
        }
    }

    /// Writes a file in the launcher's folder, piece by piece. A ping confirms each piece, so that neither side exceeds the
    /// silence limit on a slow connection.
    ///
    /// # Errors
    /// If the connection is lost.
    pub(super) async fn upload(mut self, path: &Path, text: &str) -> Result<Self, SwarmError> {
        for order in LauncherCommand::append_file(path, text) {
            let confirmed = match self.send(&order).await {
                Ok(()) => self.round_trip().await,
                failed => failed,
            };
            if let Err(Disconnected) = confirmed {
                return Err(self.lost().await);
            }
        }
        Ok(self)
    }

    /// Measures the offset of the host's clock with a few pings.
    ///
    /// # Errors
    /// If the connection is lost.
    pub(super) async fn measure_offset(mut self) -> Result<Self, SwarmError> {
        self.offset = Offset::default();
        for _ in 0..FIRST_PINGS {
            if let Err(Disconnected) = self.round_trip().await {
                return Err(self.lost().await);
            }
        }
        let now = self.clock.now();
        self.local_time_of(now);
        Ok(self)
    }

    /// Sends a ping and waits for its answer.
    async fn round_trip(&mut self) -> Result<(), Disconnected> {
        self.ping().await?;
        let answer = async {
            loop {
                match self.next_reply().await.ok_or(Disconnected)? {
                    Reply::Pong { ping, .. } if ping == self.last_ping.0 => return Ok(()),
                    _ => {}
                }
            }
        };
        let answered = timeout(SILENCE_MAX, answer).await;
        answered.map_err(|_| Disconnected)?
    }

    async fn lost(self) -> SwarmError {
        let host = self.name.clone();
        let last = self.end().await;
        SwarmError::HostLost { host, last }
    }

    /// The next reply; `None` after the last. Skips other lines, for example the greeting of a shell.
    async fn next_reply(&mut self) -> Option<Reply> {
        loop {
            let line = self.lines.next().await?;
            let Ok(reply) = serde_json::from_str(&line) else {
                continue;
            };
            let now = self.clock.now();
            self.last_reply_at = now;
            if let Reply::Pong { ping, at_ns } = reply
                && ping == self.last_ping.0
            {
                let host_time = Timestamp::from_nanos(at_ns);
                self.offset.add_sample(self.last_ping.1, host_time, now);
                let (ahead_ns, _) = self.offset.ahead_ns(now);
                self.ahead_ns.store(ahead_ns, Ordering::Relaxed);
            }
            return Some(reply);
        }
    }

    /// Converts a time of the host's clock into ours.
    fn local_time_of(&mut self, host_time: Timestamp) -> Timestamp {
        if self.is_local {
            return host_time;
        }
        let (local, uncertainty) = self.offset.local_time_of(host_time, self.clock.now());
        self.uncertainty = self.uncertainty.max(uncertainty);
        local
    }

    /// How far the host's clock is ahead of ours, in nanoseconds; updated with each ping.
    pub(super) fn ahead_ns(&self) -> Arc<AtomicI64> {
        Arc::clone(&self.ahead_ns)
    }

    /// Longest recent round trip plus the uncertainty of the host's clock.
    pub(super) fn lag(&self) -> Duration {
        self.offset.longest_round_trip() + self.uncertainty
    }

    async fn ping(&mut self) -> Result<(), Disconnected> {
        let ping = self.last_ping.0 + 1;
        self.last_ping = (ping, self.clock.now());
        self.send(&LauncherCommand::Ping(ping)).await
    }

    /// Sends an order. A timeout counts as a lost connection, since a part of the line may have been written.
    async fn send(&mut self, order: &LauncherCommand) -> Result<(), Disconnected> {
        let line = line(order);
        let written = timeout(SILENCE_MAX, self.input.write_all(line.as_bytes())).await;
        let written = written.map_err(|_| Disconnected)?;
        written.map_err(|_| Disconnected)
    }

    /// Sends orders and forwards replies until the channel of orders closes or the connection is lost. Returns the largest
    /// uncertainty of the host's clock.
    pub(super) async fn run(
        mut self,
        mut orders: mpsc::Receiver<LauncherCommand>,
        mut logs: BTreeMap<NodeId, File>,
        events: UnboundedSender<HostEvent>,
    ) -> Duration {
        let mut pings = interval(PING_PERIOD);
        pings.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            let sent = tokio::select! {
                order = orders.recv() => match order {
                    Some(order) => self.send(&order).await,
                    None => break,
                },
                reply = self.next_reply() => match reply {
                    Some(reply) => {
                        self.forward(reply, &mut logs, &events);
                        Ok(())
                    }
                    None => break,
                },
                _ = pings.tick() => {
                    if self.clock.now().since(self.last_reply_at) > SILENCE_MAX {
                        break;
                    }
                    self.ping().await
                }
            };
            if let Err(Disconnected) = sent {
                break;
            }
        }
        let (host, uncertainty) = (self.name.clone(), self.uncertainty);
        let last = self.end().await;
        let _ = events.send(HostEvent::Lost { host, last });
        uncertainty
    }

    /// Forwards a reply as an event, and appends output to the log of its drone.
    fn forward(
        &mut self,
        reply: Reply,
        logs: &mut BTreeMap<NodeId, File>,
        events: &UnboundedSender<HostEvent>,
    ) {
        let event = match reply {
            Reply::Hello { .. } | Reply::Pong { .. } => return,
            Reply::Ended { drone } => HostEvent::Ended(NodeId(drone)),
            Reply::Output { drone, line } => {
                let drone = NodeId(drone);
                if let Some(log) = logs.get_mut(&drone) {
                    // A failed write to the log does not end the flight.
                    let _ = writeln!(log, "{line}");
                }
                HostEvent::Output(
                    drone,
                    match parse(&line) {
                        ProcessOutput::Report(at, report) => {
                            ProcessOutput::Report(self.local_time_of(at), report)
                        }
                        other => other,
                    },
                )
            }
        };
        let _ = events.send(event);
    }

    /// Lets the launcher end, and kills the command that runs it after a timeout. Returns the last line on standard error.
    async fn end(mut self) -> String {
        drop(self.input);
        let deadline = Instant::now() + EXIT_MAX;
        while let Ok(Some(_)) = timeout_at(deadline, self.lines.next()).await {}
        if timeout_at(deadline, self.child.wait()).await.is_err() {
            // The launcher ends its drones by itself after the silence limit.
            let _ = self.child.kill().await;
        }
        let last = timeout(EXIT_MAX, self.errors).await;
        last.ok().and_then(Result::ok).unwrap_or_default()
    }
}

/// The connection to a host is lost.
struct Disconnected;
