//! The processes of drones on one host.

use std::collections::BTreeMap;
use std::os::fd::OwnedFd;
use std::path::Path;
use std::process::Stdio;
use std::time::Duration;

use rustix::process::{Pid, PidfdFlags, Signal, pidfd_open, pidfd_send_signal};
use tokio::io::{AsyncBufReadExt, AsyncWriteExt, BufReader};
use tokio::process::{Child, ChildStderr, ChildStdin, Command};
use tokio::sync::mpsc;
use tokio::task::JoinSet;
use tokio::time::timeout;

use super::protocol::{ProcessSignal, Reply};

/// The most lines that wait for a process that does not read, such as a stopped one. Further lines are dropped.
const UNREAD_MAX: usize = 64;

/// How long killed processes may take to end.
const END_MAX: Duration = Duration::from_secs(2);

/// The processes of drones on one host.
pub(super) struct Drones {
    processes: BTreeMap<u32, Process>,
    readers: JoinSet<()>,
    replies: mpsc::Sender<Reply>,
}

/// A drone's process, which may have ended.
struct Process {
    /// Refers to this process even if the system reuses its number.
    handle: OwnedFd,
    lines: mpsc::Sender<String>,
}

impl Drones {
    pub(super) fn new(replies: mpsc::Sender<Reply>) -> Self {
        Self {
            processes: BTreeMap::new(),
            readers: JoinSet::new(),
            replies,
        }
    }

    /// Starts a drone's process and kills its earlier one. Its output and its end are reported to the starter. The process
    /// is killed with the runtime, and ends by itself when the launcher does.
    pub(super) fn start(&mut self, drone: u32, config: &Path, arguments: &[String]) {
        let spawned = spawn(config, arguments).and_then(|mut child| {
            let pid = child.id().and_then(|pid| Pid::from_raw(pid.cast_signed()));
            let pid = pid.expect("the process was not waited for yet");
            let handle = pidfd_open(pid, PidfdFlags::empty())?;
            let (lines, unread) = mpsc::channel(UNREAD_MAX);
            if let Some(stdin) = child.stdin.take() {
                tokio::spawn(forward_lines(stdin, unread));
            }
            Ok((Process { handle, lines }, child))
        });
        match spawned {
            Ok((process, mut child)) => {
                if let Some(former) = self.processes.insert(drone, process) {
                    former.signal(Signal::KILL);
                }
                let stderr = child.stderr.take();
                let replies = self.replies.clone();
                self.readers
                    .spawn(forward_output(drone, child, stderr, replies));
            }
            Err(error) => {
                let line = format!("can't start the process: {error}");
                let replies = self.replies.clone();
                self.readers.spawn(async move {
                    let _ = replies.send(Reply::Output { drone, line }).await;
                    let _ = replies.send(Reply::Ended { drone }).await;
                });
            }
        }
    }

    pub(super) fn signal(&self, drone: u32, signal: ProcessSignal) {
        if let Some(process) = self.processes.get(&drone) {
            process.signal(match signal {
                ProcessSignal::Stop => Signal::STOP,
                ProcessSignal::Continue => Signal::CONT,
                ProcessSignal::Kill => Signal::KILL,
            });
        }
    }

    pub(super) fn write_stdin(&self, drone: u32, line: String) {
        if let Some(process) = self.processes.get(&drone) {
            let _ = process.lines.try_send(line);
        }
    }

    /// Kills all processes and waits until they have ended.
    pub(super) async fn end(&mut self) {
        for process in self.processes.values() {
            process.signal(Signal::KILL);
        }
        let all = async { while self.readers.join_next().await.is_some() {} };
        // A starter that does not read their output must not block this.
        let _ = timeout(END_MAX, all).await;
    }
}

impl Process {
    fn signal(&self, signal: Signal) {
        // Fails only if the process has ended.
        let _ = pidfd_send_signal(&self.handle, signal);
    }
}

fn spawn(config: &Path, arguments: &[String]) -> std::io::Result<Child> {
    let mut command = Command::new(std::env::current_exe()?);
    command
        .arg("--config")
        .arg(config)
        .arg("--controlled")
        .args(arguments)
        .process_group(0)
        .kill_on_drop(true)
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
}

/// Writes lines to a process's standard input.
async fn forward_lines(mut stdin: ChildStdin, mut lines: mpsc::Receiver<String>) {
    while let Some(line) = lines.recv().await {
        if stdin.write_all(line.as_bytes()).await.is_err() {
            return;
        }
    }
}

/// Forwards a process's output until it ends.
async fn forward_output(
    drone: u32,
    mut child: Child,
    stderr: Option<ChildStderr>,
    replies: mpsc::Sender<Reply>,
) {
    if let Some(stderr) = stderr {
        let mut lines = BufReader::new(stderr).lines();
        while let Ok(Some(line)) = lines.next_line().await {
            // Reads on even if nobody receives the output.
            let _ = replies.send(Reply::Output { drone, line }).await;
        }
    }
    let _ = child.wait().await;
    let _ = replies.send(Reply::Ended { drone }).await;
}
