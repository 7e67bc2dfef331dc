//! The connection to an agent on a host: what it says is dated by our clock.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Write;
use std::path::Path;
use std::process::Stdio;
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};
use std::time::Duration;

use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;
use tokio::io::{AsyncBufReadExt, AsyncWriteExt, BufReader, Lines};
use tokio::process::{Child, ChildStderr, ChildStdin, ChildStdout, Command};
use tokio::sync::mpsc::{self, UnboundedSender};
use tokio::task::JoinHandle;
use tokio::time::{Instant, MissedTickBehavior, interval, timeout, timeout_at};

use super::child::News;
use super::hosts::Host;
use super::offset::Offset;
use super::said::{Spoken, read};
use super::{START_MAX, SwarmError};
use muster_daemon::agent::SILENCE_MAX;
use muster_daemon::agent::protocol::{Order, Reply, VERSION, line};
use muster_daemon::clock::Clock;

/// How often a host is asked what time it is.
const PING_EVERY: Duration = Duration::from_secs(1);

/// How often it is asked before anything flies.
const FIRST_PINGS: u64 = 8;

/// How long an agent may take to end what it started, and itself.
const END_MAX: Duration = Duration::from_secs(3);

/// The connection to an agent.
pub(super) struct Link {
    /// What its host is called.
    name: String,
    child: Child,
    input: ChildStdin,
    lines: Lines<BufReader<ChildStdout>>,
    /// What it, or whatever runs it there, said last on standard error.
    last_words: JoinHandle<String>,
    clock: Clock,
    /// Whether that clock is the host's, too.
    is_here: bool,
    offset: Offset,
    /// How far ahead of ours the host's clock is, for whoever else is to know.
    ahead_ns: Arc<AtomicI64>,
    /// The last ping, and when it was sent.
    pinged: (u64, Timestamp),
    heard_at: Timestamp,
    /// How sure the host's clock was when it was least so.
    uncertainty: Duration,
}

impl Link {
    /// Starts an agent on a host and waits until it answers.
    ///
    /// # Errors
    /// When there is none, or another version of it.
    pub(super) async fn open(host: &Host) -> Result<Self, SwarmError> {
        let mut command = match host.run.split_first() {
            None => Command::new(&host.musterd),
            Some((run, arguments)) => {
                let mut command = Command::new(run);
                command.args(arguments).arg(&host.musterd);
                command
            }
        };
        // What is typed at the terminal is for the starter, which ends its agents in its own way.
        let spawned = command
            .arg("--agent")
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
        let input = child.stdin.take().expect("it was asked for");
        let output = child.stdout.take().expect("it was asked for");
        let errors = child.stderr.take().expect("it was asked for");
        let clock = Clock::start();
        let mut link = Self {
            name: host.name(),
            child,
            input,
            lines: BufReader::new(output).lines(),
            last_words: tokio::spawn(last_words(errors)),
            heard_at: clock.now(),
            clock,
            is_here: host.is_here(),
            offset: Offset::default(),
            ahead_ns: Arc::default(),
            pinged: (0, clock.now()),
            uncertainty: Duration::ZERO,
        };
        match timeout(START_MAX, link.greet()).await {
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

    /// Waits until the agent is there; of which version it is.
    async fn greet(&mut self) -> Option<String> {
        loop {
            if let Reply::Here { version } = self.hear().await? {
                return Some(version);
            }
        }
    }

    /// Hands the agent a file, a piece once the one before is there: so each hears of the other in time, however slow the
    /// connection is.
    ///
    /// # Errors
    /// When the host is lost.
    pub(super) async fn carry(mut self, path: &Path, text: &str) -> Result<Self, SwarmError> {
        for order in Order::to_write(path, text) {
            let there = match self.say(&order).await {
                Ok(()) => self.round_trip().await,
                gone => gone,
            };
            if let Err(Gone) = there {
                return Err(self.lost().await);
            }
        }
        Ok(self)
    }

    /// Asks the agent a few times what time it is.
    ///
    /// # Errors
    /// When the host is lost.
    pub(super) async fn measure(mut self) -> Result<Self, SwarmError> {
        self.offset = Offset::default();
        for _ in 0..FIRST_PINGS {
            if let Err(Gone) = self.round_trip().await {
                return Err(self.lost().await);
            }
        }
        let now = self.clock.now();
        self.ours(now);
        Ok(self)
    }

    /// Asks what time it is, and waits until that is told.
    async fn round_trip(&mut self) -> Result<(), Gone> {
        self.ping().await?;
        let is_told = async {
            loop {
                match self.hear().await.ok_or(Gone)? {
                    Reply::Pong { ping, .. } if ping == self.pinged.0 => return Ok(()),
                    _ => {}
                }
            }
        };
        timeout(SILENCE_MAX, is_told).await.map_err(|_| Gone)?
    }

    async fn lost(self) -> SwarmError {
        let host = self.name.clone();
        let last = self.end().await;
        SwarmError::HostLost { host, last }
    }

    /// The next reply; what is none, a shell's greeting say, is passed over. Nothing once there are no more.
    async fn hear(&mut self) -> Option<Reply> {
        loop {
            let line = self.lines.next_line().await.ok().flatten()?;
            let Ok(reply) = serde_json::from_str(&line) else {
                continue;
            };
            let now = self.clock.now();
            self.heard_at = now;
            if let Reply::Pong { ping, at_ns } = reply
                && ping == self.pinged.0
            {
                (self.offset).heard(self.pinged.1, Timestamp::from_nanos(at_ns), now);
                let (ahead_ns, _) = self.offset.ahead_ns(now);
                self.ahead_ns.store(ahead_ns, Ordering::Relaxed);
            }
            return Some(reply);
        }
    }

    /// What our clock said when the host's did.
    fn ours(&mut self, theirs: Timestamp) -> Timestamp {
        if self.is_here {
            return theirs;
        }
        let (ours, uncertainty) = self.offset.ours(theirs, self.clock.now());
        self.uncertainty = self.uncertainty.max(uncertainty);
        ours
    }

    /// How far ahead of ours the host's clock is, in nanoseconds, from now on.
    pub(super) fn ahead_ns(&self) -> Arc<AtomicI64> {
        Arc::clone(&self.ahead_ns)
    }

    /// How long it takes to hear of its host, and how sure the clock there is.
    pub(super) fn lag(&self) -> Duration {
        self.offset.longest_round_trip() + self.uncertainty
    }

    async fn ping(&mut self) -> Result<(), Gone> {
        let ping = self.pinged.0 + 1;
        self.pinged = (ping, self.clock.now());
        self.say(&Order::Ping(ping)).await
    }

    /// Asks for something. A host that does not take it in time is gone: it may have got a part of it.
    async fn say(&mut self, order: &Order) -> Result<(), Gone> {
        let line = line(order);
        let said = timeout(SILENCE_MAX, self.input.write_all(line.as_bytes())).await;
        said.map_err(|_| Gone)?.map_err(|_| Gone)
    }

    /// Passes on what is to be done there and what comes of it, until there are no more orders or the host is gone.
    pub(super) async fn attend(
        mut self,
        mut orders: mpsc::Receiver<Order>,
        mut logs: BTreeMap<NodeId, File>,
        news: UnboundedSender<News>,
    ) -> Duration {
        let mut pings = interval(PING_EVERY);
        pings.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            let said = tokio::select! {
                order = orders.recv() => match order {
                    Some(order) => self.say(&order).await,
                    None => break,
                },
                reply = self.hear() => match reply {
                    Some(reply) => {
                        self.pass_on(reply, &mut logs, &news);
                        Ok(())
                    }
                    None => break,
                },
                _ = pings.tick() => {
                    if self.clock.now().since(self.heard_at) > SILENCE_MAX {
                        break;
                    }
                    self.ping().await
                }
            };
            if let Err(Gone) = said {
                break;
            }
        }
        let (host, uncertainty) = (self.name.clone(), self.uncertainty);
        let last = self.end().await;
        let _ = news.send(News::Lost { host, last });
        uncertainty
    }

    fn pass_on(
        &mut self,
        reply: Reply,
        logs: &mut BTreeMap<NodeId, File>,
        news: &UnboundedSender<News>,
    ) {
        let said = match reply {
            Reply::Here { .. } | Reply::Pong { .. } => return,
            Reply::Ended { drone } => News::Ended(NodeId(drone)),
            Reply::Said { drone, line } => {
                let drone = NodeId(drone);
                if let Some(log) = logs.get_mut(&drone) {
                    // A log that can't be kept is no reason to end a flight.
                    let _ = writeln!(log, "{line}");
                }
                News::Said(
                    drone,
                    match read(&line) {
                        Spoken::Of(at, said) => Spoken::Of(self.ours(at), said),
                        spoken => spoken,
                    },
                )
            }
        };
        let _ = news.send(said);
    }

    /// Lets the agent end, or whatever runs it there be ended; what was said last on standard error.
    async fn end(mut self) -> String {
        drop(self.input);
        let deadline = Instant::now() + END_MAX;
        while let Ok(Ok(Some(_))) = timeout_at(deadline, self.lines.next_line()).await {}
        if timeout_at(deadline, self.child.wait()).await.is_err() {
            // It ends its drones itself once it notices.
            let _ = self.child.kill().await;
        }
        let last_words = timeout(END_MAX, self.last_words).await;
        last_words.ok().and_then(Result::ok).unwrap_or_default()
    }
}

/// A host takes nothing any more.
struct Gone;

/// The last line that is said.
async fn last_words(errors: ChildStderr) -> String {
    let mut lines = BufReader::new(errors).lines();
    let mut last = String::new();
    while let Ok(Some(line)) = lines.next_line().await {
        if !line.trim().is_empty() {
            last = line;
        }
    }
    last
}
