//! The launcher of `muster swarm` on a host: it stores the drones' files, starts their processes, forwards their output and
//! signals them. When the starter ends or falls silent, the launcher ends all processes, stopped ones too.
//!
//! The launcher decides nothing. The starter runs it with a command, such as ssh, and uses its standard input and output.

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
use self::protocol::{LauncherCommand, Reply, VERSION};
use crate::clock::Clock;

/// The longest silence before the starter and the launcher take each other for gone. The starter sends a ping each second.
pub const SILENCE_MAX: Duration = Duration::from_secs(10);

/// The most lines that wait for the starter. The drones' output waits beyond that.
const UNREAD_MAX: usize = 1_024;

/// Why a launcher failed. Its processes are ended and its files removed.
#[derive(Debug, Error)]
pub enum LauncherError {
    /// The asynchronous runtime does not start, or can't watch processes or signals.
    #[error("can't start the asynchronous runtime")]
    Runtime(#[source] io::Error),
    /// A file could not be written.
    #[error("can't write {}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The system's error.
        #[source]
        source: io::Error,
    },
    /// A path leads out of the launcher's folder.
    #[error("{} is outside of the flight's folder", .0.display())]
    Outside(PathBuf),
    /// A line on standard input is no order.
    #[error("standard input has a line that is no order")]
    Garbled(#[source] serde_json::Error),
    /// The starter is silent.
    #[error("the starter was silent for {SILENCE_MAX:?}")]
    Silent,
}

/// Executes the starter's orders until standard input closes.
///
/// # Errors
/// If an order fails, or the starter falls silent. In any case no drone's process is left, and the folder is removed.
pub fn run() -> Result<(), LauncherError> {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .map_err(LauncherError::Runtime)?;
    let result = runtime.block_on(serve());
    // The reading thread may block for ever.
    runtime.shutdown_background();
    result
}

async fn serve() -> Result<(), LauncherError> {
    let end_signal = end_signal().map_err(LauncherError::Runtime)?;
    let (replies, unread) = mpsc::channel(UNREAD_MAX);
    std::thread::spawn(move || write_replies(unread));
    let orders = read_orders();
    let mut launcher = Launcher {
        clock: Clock::start(),
        drones: Drones::new(replies.clone()),
        folder: None,
        replies,
    };
    let version = VERSION.to_owned();
    launcher.reply(Reply::Hello { version });
    let result = tokio::select! {
        result = launcher.execute_all(orders) => result,
        () = end_signal => Ok(()),
    };
    launcher.drones.end().await;
    result
}

/// Waits for a signal that ends the launcher.
fn end_signal() -> io::Result<impl Future<Output = ()>> {
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

/// The orders on standard input.
fn read_orders() -> mpsc::UnboundedReceiver<Result<LauncherCommand, serde_json::Error>> {
    let (sender, receiver) = mpsc::unbounded_channel();
    // The thread blocks in reads until the process ends.
    std::thread::spawn(move || {
        for line in io::stdin().lines().map_while(Result::ok) {
            if sender.send(serde_json::from_str(&line)).is_err() {
                return;
            }
        }
    });
    receiver
}

/// Writes replies to standard output until nobody reads them.
fn write_replies(mut unread: mpsc::Receiver<Reply>) {
    let mut output = io::stdout().lock();
    while let Some(reply) = unread.blocking_recv() {
        let written = output.write_all(protocol::line(&reply).as_bytes());
        if written.and_then(|()| output.flush()).is_err() {
            return;
        }
    }
}

struct Launcher {
    clock: Clock,
    drones: Drones,
    /// Created with the first file; removed when this value is dropped.
    folder: Option<TempDir>,
    replies: mpsc::Sender<Reply>,
}

impl Launcher {
    async fn execute_all(
        &mut self,
        mut orders: mpsc::UnboundedReceiver<Result<LauncherCommand, serde_json::Error>>,
    ) -> Result<(), LauncherError> {
        loop {
            let order = timeout(SILENCE_MAX, orders.recv()).await;
            match order.map_err(|_| LauncherError::Silent)? {
                Some(order) => self.execute(order.map_err(LauncherError::Garbled)?)?,
                None => return Ok(()),
            }
        }
    }

    fn execute(&mut self, order: LauncherCommand) -> Result<(), LauncherError> {
        match order {
            LauncherCommand::Ping(ping) => {
                let at_ns = self.clock.now().as_nanos();
                self.reply(Reply::Pong { ping, at_ns });
            }
            LauncherCommand::AppendFile { path, text } => self.write(&path, &text)?,
            LauncherCommand::Start {
                drone,
                config,
                arguments,
            } => {
                let own = self.folder.as_ref().map_or(Path::new(""), TempDir::path);
                self.drones.start(drone, &own.join(config), &arguments);
            }
            LauncherCommand::Signal { drone, signal } => self.drones.signal(drone, signal),
            LauncherCommand::WriteStdin { drone, line } => self.drones.write_stdin(drone, line),
        }
        Ok(())
    }

    /// Sends a reply, unless the queue is full.
    fn reply(&self, reply: Reply) {
        let _ = self.replies.try_send(reply);
    }

    fn write(&mut self, path: &Path, text: &str) -> Result<(), LauncherError> {
        let is_plain = |it: Component<'_>| matches!(it, Component::Normal(_));
        if path.as_os_str().is_empty() || !path.components().all(is_plain) {
            return Err(LauncherError::Outside(path.to_owned()));
        }
        let folder = match self.folder.take() {
            Some(folder) => folder,
            None => private_folder().map_err(|source| {
                let path = std::env::temp_dir();
                LauncherError::Write { path, source }
            })?,
        };
        let path = self.folder.insert(folder).path().join(path);
        write_private(&path, text).map_err(|source| LauncherError::Write { path, source })
    }
}

fn private_folder() -> io::Result<TempDir> {
    let mut builder = tempfile::Builder::new();
    let owner_only = fs::Permissions::from_mode(0o700);
    builder.prefix("muster-").permissions(owner_only).tempdir()
}

/// Appends to a file that only its owner can read; creates it and its folders if necessary.
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

    fn launcher() -> Launcher {
        let (replies, _) = mpsc::channel(1);
        Launcher {
            clock: Clock::start(),
            drones: Drones::new(replies.clone()),
            folder: None,
            replies,
        }
    }

    #[test]
    fn files_are_private_stay_in_the_folder_and_are_removed_with_it() {
        let mut launcher = launcher();
        launcher
            .write(Path::new("fleet/drone-1.key"), "secret")
            .unwrap();
        let config = Path::new("drone-1/drone.toml");
        launcher.write(config, "id = ").unwrap();
        launcher.write(config, "1").unwrap();
        let folder = launcher.folder.as_ref().unwrap().path().to_owned();
        assert_eq!(fs::read_to_string(folder.join(config)).unwrap(), "id = 1");
        let mode = |path: &str| {
            let metadata = fs::metadata(folder.join(path)).unwrap();
            metadata.permissions().mode() & 0o777
        };
        assert_eq!(mode(""), 0o700);
        assert_eq!(mode("fleet"), 0o700);
        assert_eq!(mode("fleet/drone-1.key"), 0o600);
        for outside in ["", "/etc/muster", "../drone.toml", "fleet/../../key"] {
            let written = launcher.write(Path::new(outside), "");
            assert!(
                matches!(written, Err(LauncherError::Outside(_))),
                "{outside}"
            );
        }
        drop(launcher);
        assert!(!folder.exists());
    }
}
