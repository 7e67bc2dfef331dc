//! Serves the fleet's operators: accepts files for the next start, and sends the log.

use std::io;
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use muster_runtime::diagnostic::{BadInput, decode_text, read_text};
use muster_runtime::file::replace;
use muster_runtime::plan;
use muster_runtime::plan::file::Source;
use muster_transport::quic::Stream;
use tokio::sync::Semaphore;
use tokio::sync::mpsc::Receiver;
use tokio::time::timeout;

use super::process::Process;
use crate::config::DroneConfig;
use crate::log::Recent;
use crate::operator::{Answer, REQUEST_MAX, Request, Upload};

/// The longest time for an operator to send a request or a file. Enough for a slow radio.
const REQUEST_TIMEOUT: Duration = Duration::from_secs(60);

/// The most operators that are served at once; others are refused.
const OPERATORS_MAX: usize = 4;

/// Answers operators' requests.
pub(super) struct OperatorService {
    /// The drone's file.
    config: PathBuf,
    /// The scenario's file, named in the drone's file.
    scenario: PathBuf,
    /// The latest log lines.
    recent: Recent,
    /// Admits one upload at a time, which bounds the memory.
    uploads: Semaphore,
}

/// Answers operators' streams until the network closes.
pub(super) async fn serve(
    mut streams: Receiver<Stream>,
    service: OperatorService,
    process: Arc<Process>,
) {
    let service = Arc::new(service);
    let room = Arc::new(Semaphore::new(OPERATORS_MAX));
    while let Some(stream) = streams.recv().await {
        let Ok(permit) = Arc::clone(&room).try_acquire_owned() else {
            tracing::debug!("refused an operator: {OPERATORS_MAX} are being served");
            continue;
        };
        let (service, process) = (Arc::clone(&service), Arc::clone(&process));
        tokio::spawn(async move {
            // The operator sees the failure of the connection; the drone ignores it.
            let _ = service.answer(stream, &process).await;
            drop(permit);
        });
    }
}

impl OperatorService {
    /// A service with the paths of the drone's file and of its scenario, and the latest log lines.
    pub(super) fn new(config: PathBuf, scenario: PathBuf, recent: Recent) -> Self {
        Self {
            config,
            scenario,
            recent,
            uploads: Semaphore::new(1),
        }
    }

    async fn answer(&self, mut stream: Stream, process: &Process) -> io::Result<()> {
        let (request, rest) = timeout(REQUEST_TIMEOUT, read_request(&mut stream)).await??;
        match request {
            Request::Upload { what, bytes } => {
                let answer = self
                    .upload(&mut stream, (what, bytes), rest, process)
                    .await?;
                let is_taken = matches!(answer, Answer::Taken(_));
                tracing::info!(?what, bytes, is_taken, "an operator uploaded a file");
                stream.write(&serde_json::to_vec(&answer)?).await?;
            }
            Request::Logs { follow } => self.send_log(&mut stream, follow).await?,
        }
        stream.finish();
        Ok(())
    }

    /// Receives a file, of which `received` has been read already, and stores it if it is usable. A file that is refused for
    /// its length or because the drone flies is not read.
    async fn upload(
        &self,
        stream: &mut Stream,
        (what, bytes): (Upload, usize),
        mut received: Vec<u8>,
        process: &Process,
    ) -> io::Result<Answer> {
        if !process.state().is_idle() {
            return Ok(Answer::Flies);
        }
        let max = what.bytes_max();
        if bytes > max {
            let message = format!("the file has {bytes} bytes, which is too long");
            let help = format!("a drone accepts up to {max} bytes for this file");
            let refused = BadInput::without_excerpt(&self.scenario, message, help);
            return Ok(Answer::Unusable(refused.rendered()));
        }
        let Ok(_permit) = self.uploads.try_acquire() else {
            return Ok(Answer::Busy);
        };
        let missing = bytes.saturating_sub(received.len());
        received.extend(timeout(REQUEST_TIMEOUT, stream.read_to_end(missing)).await??);
        if received.len() != bytes {
            return Err(io::ErrorKind::InvalidData.into());
        }
        // The drone may have got the order to fly meanwhile.
        if !process.state().is_idle() {
            return Ok(Answer::Flies);
        }
        Ok(self.store(what, received))
    }

    /// Stores a file if the drone could start with it. The next start reads it.
    fn store(&self, what: Upload, bytes: Vec<u8>) -> Answer {
        let (path, text) = match self.check(what, bytes) {
            Ok(checked) => checked,
            Err(refused) => return Answer::Unusable(refused.rendered()),
        };
        match replace(&path, text.as_bytes()) {
            Ok(()) => Answer::Taken(path),
            Err(error) => Answer::Unwritten(format!("{}: {error}", path.display())),
        }
    }

    /// Checks that the drone could start with a file. Returns the path to store it at, and its text. The operator chooses no
    /// path: the drone's file names the scenario, and a scenario may name only a mission in its own folder.
    fn check(&self, what: Upload, bytes: Vec<u8>) -> Result<(PathBuf, String), BadInput> {
        let folder = self.scenario.parent().unwrap_or(Path::new(""));
        let target = match what {
            Upload::Scenario => self.scenario.clone(),
            Upload::Mission => {
                plan::mission_file(&Source::new(&self.scenario, read_text(&self.scenario)?))?
            }
        };
        let text = decode_text(&target, bytes)?;
        DroneConfig::load_from(&self.config, &|path| {
            if path == target {
                return Ok(text.clone());
            }
            if what == Upload::Scenario && !is_within(path, folder) {
                let message = "is not in the folder of the scenario that names it";
                let help = "name a mission in the folder of the scenario or in a subfolder";
                return Err(BadInput::without_excerpt(path, message, help));
            }
            read_text(path)
        })?;
        Ok((target, text))
    }

    /// Sends the latest log lines and, with `follow`, all further ones until the operator stops the stream.
    async fn send_log(&self, stream: &mut Stream, follow: bool) -> io::Result<()> {
        let mut sent = 0;
        loop {
            let (lines, logged) = self.recent.after(sent);
            stream.write(&lines).await?;
            sent = logged;
            if !follow {
                return Ok(());
            }
            tokio::select! {
                () = self.recent.more_than(sent) => {}
                () = stream.stopped() => return Ok(()),
            }
        }
    }
}

/// Whether a path is in a folder or in a subfolder of it. Purely textual: `..` is never within.
fn is_within(path: &Path, folder: &Path) -> bool {
    let within = path.strip_prefix(folder);
    within.is_ok_and(|it| it.components().all(|it| matches!(it, Component::Normal(_))))
}

/// Reads the request line. Returns it with the bytes after it that were received so far.
async fn read_request(stream: &mut Stream) -> io::Result<(Request, Vec<u8>)> {
    let mut received = Vec::new();
    let mut buffer = [0; REQUEST_MAX];
    let end = loop {
        if let Some(end) = received.iter().position(|byte| *byte == b'\n') {
            break end;
        }
        let room = REQUEST_MAX - received.len();
        match stream.read(&mut buffer[..room]).await? {
            0 => return Err(io::ErrorKind::InvalidData.into()),
            read => received.extend_from_slice(&buffer[..read]),
        }
    };
    let rest = received.split_off(end + 1);
    Ok((serde_json::from_slice(&received)?, rest))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_out_of_a_folder_are_not_within_it() {
        let is = |path: &str, folder: &str| is_within(Path::new(path), Path::new(folder));
        assert!(is("fleet/own.waypoints", "fleet") && is("fleet/missions/own.plan", "fleet"));
        assert!(is("own.waypoints", "") && is("/etc/fleet/own.plan", "/etc/fleet"));
        for path in [
            "fleet/../own.plan",
            "/etc/own.plan",
            "other/own.plan",
            "fleet/a/../../b",
        ] {
            assert!(!is(path, "fleet"), "{path}");
        }
        assert!(!is("/etc/own.plan", "") && !is("../own.plan", ""));
    }
}
