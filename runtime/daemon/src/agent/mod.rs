//! The hand of a starter on a host: it keeps the files that drones need, starts their processes, passes on what they say,
//! signals them, and ends them all when its starter does, or is not heard of any more; a process that is stopped, too.
//!
//! It decides nothing. Its standard input and output are the starter's, over whatever command runs it there.

mod drones;
#[doc(hidden)]
pub mod protocol;

use std::fs::{self, OpenOptions};
use std::io::{self, Write};
use std::os::unix::fs::{DirBuilderExt, OpenOptionsExt, PermissionsExt};
use std::path::{Component, Path, PathBuf};
use std::time::Duration;

use tempfile::TempDir;
use thiserror::Error;
use tokio::signal::unix::{SignalKind, signal};
use tokio::sync::mpsc;
use tokio::time::timeout;

use self::drones::Drones;
use self::protocol::{Order, Reply, VERSION};
use crate::clock::Clock;

/// How long a starter and an agent may not hear of each other before each takes the other for gone. A starter sends a ping
/// each second.
pub const SILENCE_MAX: Duration = Duration::from_secs(10);

/// How many lines may wait to be read by the starter before drones that say more wait, too.
const UNREAD_MAX: usize = 1_024;

/// Why an agent could not do what it is there for. Nothing that it started or wrote is left.
#[derive(Debug, Error)]
pub enum AgentError {
    /// The asynchronous runtime does not start, or does not watch processes or signals.
    #[error("no runtime for the agent")]
    Runtime(#[source] io::Error),
    /// A file could not be written.
    #[error("can't write {}", path.display())]
    Write {
        /// Which one.
        path: PathBuf,
        /// Why.
        #[source]
        source: io::Error,
    },
    /// A file was to be written elsewhere than in the agent's own folder.
    #[error("{} is not within the folder of this flight", .0.display())]
    Outside(PathBuf),
    /// What came from the starter is nothing that an agent is asked for.
    #[error("standard input has a line that is none of a starter's")]
    Garbled(#[source] serde_json::Error),
    /// The starter has not been heard of for too long.
    #[error("whoever started the drones was not heard of for {SILENCE_MAX:?}")]
    Silent,
}

/// Does what the starter at the other end of standard input and output asks for, until it has no more to say.
///
/// # Errors
/// When something can't be done, or the starter falls silent. However it ends: no drone's process is left, and its folder
/// is removed.
pub fn run() -> Result<(), AgentError> {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .map_err(AgentError::Runtime)?;
    let ended = runtime.block_on(serve());
    // A thread may wait for input for ever.
    runtime.shutdown_background();
    ended
}

async fn serve() -> Result<(), AgentError> {
    let called_off = called_off().map_err(AgentError::Runtime)?;
    let (replies, unread) = mpsc::channel(UNREAD_MAX);
    std::thread::spawn(move || write_replies(unread));
    let orders = read_orders();
    let mut agent = Agent {
        clock: Clock::start(),
        drones: Drones::new(replies.clone()),
        folder: None,
        replies,
    };
    let version = VERSION.to_owned();
    agent.reply(Reply::Hello { version });
    let ended = tokio::select! {
        ended = agent.obey_all(orders) => ended,
        () = called_off => Ok(()),
    };
    agent.drones.end().await;
    ended
}

/// Waits for a signal that ends the agent.
fn called_off() -> io::Result<impl Future<Output = ()>> {
    let [mut terminate, mut interrupt, mut hang_up] = [
        signal(SignalKind::terminate())?,
        signal(SignalKind::interrupt())?,
        signal(SignalKind::hangup())?,
    ];
    Ok(async move {
        tokio::select! {
            _ = terminate.recv() => {}
            _ = interrupt.recv() => {}
            _ = hang_up.recv() => {}
        }
    })
}

/// What comes of standard input.
fn read_orders() -> mpsc::UnboundedReceiver<Result<Order, serde_json::Error>> {
    let (sender, receiver) = mpsc::unbounded_channel();
    // Nothing can end a thread that reads, but the end of the process.
    std::thread::spawn(move || {
        for line in io::stdin().lines().map_while(Result::ok) {
            if sender.send(serde_json::from_str(&line)).is_err() {
                return;
            }
        }
    });
    receiver
}

/// Writes to standard output what there is to be said, as long as anybody reads it.
fn write_replies(mut unread: mpsc::Receiver<Reply>) {
    let mut output = io::stdout().lock();
    while let Some(reply) = unread.blocking_recv() {
        let written = output.write_all(protocol::line(&reply).as_bytes());
        if written.and_then(|()| output.flush()).is_err() {
            return;
        }
    }
}

struct Agent {
    clock: Clock,
    drones: Drones,
    /// Made with the first file that is to be kept; removed with this value.
    folder: Option<TempDir>,
    replies: mpsc::Sender<Reply>,
}

impl Agent {
    async fn obey_all(
        &mut self,
        mut orders: mpsc::UnboundedReceiver<Result<Order, serde_json::Error>>,
    ) -> Result<(), AgentError> {
        loop {
            let order = timeout(SILENCE_MAX, orders.recv()).await;
            match order.map_err(|_| AgentError::Silent)? {
                Some(order) => self.obey(order.map_err(AgentError::Garbled)?)?,
                None => return Ok(()),
            }
        }
    }

    fn obey(&mut self, order: Order) -> Result<(), AgentError> {
        match order {
            Order::Ping(ping) => {
                let at_ns = self.clock.now().as_nanos();
                self.reply(Reply::Pong { ping, at_ns });
            }
            Order::AppendFile { path, text } => self.write(&path, &text)?,
            Order::Start {
                drone,
                config,
                arguments,
            } => {
                let own = self.folder.as_ref().map_or(Path::new(""), TempDir::path);
                self.drones.start(drone, &own.join(config), &arguments);
            }
            Order::Signal { drone, signal } => self.drones.signal(drone, signal),
            Order::WriteStdin { drone, line } => self.drones.tell(drone, line),
        }
        Ok(())
    }

    /// Says something of its own; not to a starter that has not read a thousand lines before it.
    fn reply(&self, reply: Reply) {
        let _ = self.replies.try_send(reply);
    }

    fn write(&mut self, path: &Path, text: &str) -> Result<(), AgentError> {
        let is_plain = |it: Component<'_>| matches!(it, Component::Normal(_));
        if path.as_os_str().is_empty() || !path.components().all(is_plain) {
            return Err(AgentError::Outside(path.to_owned()));
        }
        let folder = match self.folder.take() {
            Some(folder) => folder,
            // Nobody else can look into it.
            None => private_folder().map_err(|source| {
                let path = std::env::temp_dir();
                AgentError::Write { path, source }
            })?,
        };
        let path = self.folder.insert(folder).path().join(path);
        write_private(&path, text).map_err(|source| AgentError::Write { path, source })
    }
}

fn private_folder() -> io::Result<TempDir> {
    let mut builder = tempfile::Builder::new();
    let for_its_owner = fs::Permissions::from_mode(0o700);
    builder
        .prefix("muster-")
        .permissions(for_its_owner)
        .tempdir()
}

/// Adds to a file that only its owner can read, and that is made, with its folders, if it is not there.
fn write_private(path: &Path, text: &str) -> io::Result<()> {
    if let Some(folder) = path.parent() {
        let mut maker = fs::DirBuilder::new();
        maker.recursive(true).mode(0o700).create(folder)?;
    }
    let mut options = OpenOptions::new();
    let mut file = options.append(true).create(true).mode(0o600).open(path)?;
    file.write_all(text.as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn agent() -> Agent {
        let (replies, _) = mpsc::channel(1);
        Agent {
            clock: Clock::start(),
            drones: Drones::new(replies.clone()),
            folder: None,
            replies,
        }
    }

    #[test]
    fn files_are_for_their_owner_only_stay_in_the_agents_folder_and_go_with_it() {
        let mut agent = agent();
        agent
            .write(Path::new("fleet/drone-1.key"), "secret")
            .unwrap();
        let config = Path::new("drone-1/drone.toml");
        agent.write(config, "id = ").unwrap();
        agent.write(config, "1").unwrap();
        let folder = agent.folder.as_ref().unwrap().path().to_owned();
        assert_eq!(fs::read_to_string(folder.join(config)).unwrap(), "id = 1");
        let mode = |path: &str| {
            let metadata = fs::metadata(folder.join(path)).unwrap();
            metadata.permissions().mode() & 0o777
        };
        assert_eq!(mode(""), 0o700);
        assert_eq!(mode("fleet"), 0o700);
        assert_eq!(mode("fleet/drone-1.key"), 0o600);
        for outside in ["", "/etc/muster", "../drone.toml", "fleet/../../key"] {
            let written = agent.write(Path::new(outside), "");
            assert!(matches!(written, Err(AgentError::Outside(_))), "{outside}");
        }
        drop(agent);
        assert!(!folder.exists());
    }
}
