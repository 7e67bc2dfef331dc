//! The process of one drone, as whoever started it holds it: it ends with its starter.

use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::Path;
use std::process::Stdio;

use muster_machines::identity::NodeId;
use muster_scenarios::twin::Standing;
use rustix::process::{Pid, Signal, kill_process};
use tokio::io::{AsyncBufReadExt, AsyncWriteExt, BufReader};
use tokio::process::{Child, ChildStderr, ChildStdin, Command};
use tokio::sync::mpsc::{self, UnboundedSender};

use super::SwarmError;
use super::folder::DroneFolder;
use super::said::{Spoken, read};
use crate::tether::Word;

/// How many words to a process may wait that does not read them, as one that is stopped.
const WAITING_MAX: usize = 64;

/// What comes of a drone's process.
#[derive(Debug)]
pub(super) enum News {
    /// It said something.
    Said(NodeId, Spoken),
    /// It has ended.
    Ended(NodeId),
}

/// As what a process begins.
#[derive(Debug)]
pub(super) enum Begin {
    /// As a drone that waits on the ground.
    Waiting,
    /// As the drone that leads, which is told to fly.
    Leading,
    /// As a drone whose process was ended, with what its vehicle is doing.
    Again(Word),
}

/// A drone's process.
#[derive(Debug)]
pub(super) struct DroneProcess {
    pid: Option<Pid>,
    /// Whether the plan ended it.
    was_ended: bool,
    words: mpsc::Sender<String>,
    standing: Standing,
    is_ready: bool,
}

impl DroneProcess {
    /// Starts a drone's process; `news` gets what comes of it. It is killed when the runtime that it was started in ends,
    /// and ends by itself when its starter does.
    ///
    /// # Errors
    /// When it can't be started, or its log can't be written.
    pub(super) fn start(
        musterd: &Path,
        folder: &DroneFolder,
        begin: Begin,
        news: &UnboundedSender<News>,
    ) -> Result<Self, SwarmError> {
        let mut command = Command::new(musterd);
        command.arg("--config").arg(&folder.config).arg("--tied");
        match begin {
            Begin::Waiting => {}
            Begin::Leading => drop(command.arg("--fly")),
            Begin::Again(_) => drop(command.arg("--resume")),
        }
        // What is typed at the terminal is for the starter, which ends the drones in its own way.
        let started = command
            .process_group(0)
            .kill_on_drop(true)
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn();
        let mut child = started.map_err(|source| SwarmError::Start {
            program: musterd.to_owned(),
            source,
        })?;
        let mut kept = OpenOptions::new();
        match begin {
            Begin::Waiting | Begin::Leading => kept.create(true).write(true).truncate(true),
            Begin::Again(_) => kept.append(true),
        };
        let log = (kept.open(&folder.log)).map_err(|source| SwarmError::Write {
            path: folder.log.clone(),
            source,
        })?;
        let (words, heard) = mpsc::channel(WAITING_MAX);
        let pid = child.id().and_then(|pid| Pid::from_raw(pid.cast_signed()));
        if let Some(stdin) = child.stdin.take() {
            tokio::spawn(tell(stdin, heard));
        }
        let stderr = child.stderr.take();
        tokio::spawn(listen(folder.id, child, stderr, log, news.clone()));
        if let Begin::Again(word) = begin {
            // There is room for the first one.
            let _ = words.try_send(word.line());
        }
        Ok(Self {
            pid,
            was_ended: false,
            words,
            standing: Standing::Runs,
            is_ready: false,
        })
    }

    /// It says that its drone is there.
    pub(super) const fn is_there(&mut self) {
        self.is_ready = true;
    }

    /// Whether its drone is there.
    pub(super) const fn is_ready(&self) -> bool {
        self.is_ready
    }

    /// Makes the process be as it is to be, as long as it is there; whether it goes on after a hang.
    pub(super) fn be(&mut self, standing: Standing) -> bool {
        if self.standing == standing || self.standing == Standing::Ended {
            return false;
        }
        let goes_on = self.standing == Standing::Hangs && standing == Standing::Runs;
        self.was_ended = standing == Standing::Ended;
        self.signal(match standing {
            Standing::Runs => Signal::CONT,
            Standing::Hangs => Signal::STOP,
            Standing::Ended => Signal::KILL,
        });
        self.standing = standing;
        goes_on
    }

    /// Lets the process know something, unless it has too much to read already; whether it will know.
    pub(super) fn tell(&self, word: &Word) -> bool {
        self.words.try_send(word.line()).is_ok()
    }

    /// Whether the plan ended it, and the system is done with it.
    pub(super) const fn can_start_again(&self) -> bool {
        self.was_ended && self.pid.is_none()
    }

    /// It has ended: nothing is sent to whoever has its number now.
    pub(super) const fn has_ended(&mut self) {
        self.pid = None;
        self.standing = Standing::Ended;
    }

    /// Whether it has ended.
    pub(super) const fn is_ended(&self) -> bool {
        self.pid.is_none()
    }

    fn signal(&self, signal: Signal) {
        if let Some(pid) = self.pid {
            // It can only have ended by itself.
            let _ = kill_process(pid, signal);
        }
    }
}

impl Drop for DroneProcess {
    fn drop(&mut self) {
        self.signal(Signal::KILL);
    }
}

/// Hands a process what it is told.
async fn tell(mut stdin: ChildStdin, mut heard: mpsc::Receiver<String>) {
    while let Some(words) = heard.recv().await {
        if stdin.write_all(words.as_bytes()).await.is_err() {
            return;
        }
    }
}

/// Reads and keeps what a process says, until it ends.
async fn listen(
    id: NodeId,
    mut child: Child,
    stderr: Option<ChildStderr>,
    mut log: File,
    news: UnboundedSender<News>,
) {
    if let Some(stderr) = stderr {
        let mut lines = BufReader::new(stderr).lines();
        while let Ok(Some(line)) = lines.next_line().await {
            // A log that can't be kept is no reason to end a flight.
            let _ = writeln!(log, "{line}");
            let _ = news.send(News::Said(id, read(&line)));
        }
    }
    // It can't be told why it ended where the system has lost it.
    let _ = child.wait().await;
    let _ = news.send(News::Ended(id));
}
