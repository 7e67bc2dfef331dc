//! What a drone does for its fleet's operators: it takes files for its next start, and tells what it has said.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use muster_runtime::diagnostic::{BadInput, read_text, text_of};
use muster_runtime::file::replace;
use muster_scenarios::scenario;
use muster_transport::quic::Stream;
use tokio::sync::mpsc::Receiver;
use tokio::time::timeout;

use super::process::Process;
use crate::config::DroneConfig;
use crate::log::Recent;
use crate::operator::{Answer, REQUEST_MAX, Request, Upload};

/// How long an operator may take to say what it wants, over a slow radio.
const REQUEST_LASTS: Duration = Duration::from_secs(60);

/// What operators may ask about.
pub(super) struct Desk {
    /// The drone's file, and the scenario that it names.
    pub(super) config: PathBuf,
    pub(super) scenario: PathBuf,
    pub(super) recent: Recent,
}

/// Answers operators, as long as any may come. How many there are at once is bounded by the transport.
pub(super) async fn serve(mut streams: Receiver<Stream>, desk: Arc<Desk>, process: Arc<Process>) {
    while let Some(stream) = streams.recv().await {
        let (desk, process) = (Arc::clone(&desk), Arc::clone(&process));
        tokio::spawn(async move {
            // Whoever asked sees that the connection is gone; the drone has no use for that.
            let _ = desk.answer(stream, &process).await;
        });
    }
}

impl Desk {
    async fn answer(&self, mut stream: Stream, process: &Process) -> io::Result<()> {
        let asked = timeout(REQUEST_LASTS, stream.read_to_end(REQUEST_MAX)).await??;
        let end = asked.iter().position(|byte| *byte == b'\n');
        let (line, rest) = asked.split_at(end.unwrap_or(asked.len()));
        match serde_json::from_slice(line)? {
            Request::Upload(what) => {
                let text = rest.get(1..).unwrap_or_default();
                let answer = if process.state().rests() {
                    self.take(what, text.to_vec())
                } else {
                    Answer::Flies
                };
                let is_taken = matches!(answer, Answer::Taken(_));
                tracing::info!(?what, is_taken, "an operator hands over a file");
                stream.write(&serde_json::to_vec(&answer)?).await?;
            }
            Request::Logs { follow } => self.tell(&mut stream, follow).await?,
        }
        stream.finish();
        Ok(())
    }

    /// Puts a file into its place if the drone could start with it there. It is read at the next start.
    fn take(&self, what: Upload, bytes: Vec<u8>) -> Answer {
        let (place, text) = match self.check(what, bytes) {
            Ok(checked) => checked,
            Err(refused) => return Answer::Unusable(refused.rendered()),
        };
        match replace(&place, text.as_bytes()) {
            Ok(()) => Answer::Taken(place),
            Err(error) => Answer::Unwritten(format!("{}: {error}", place.display())),
        }
    }

    /// Where a file's place is, and what it says, if the drone could start with it there. Its name is none of the
    /// operator's choice.
    fn check(&self, what: Upload, bytes: Vec<u8>) -> Result<(PathBuf, String), BadInput> {
        let place = match what {
            Upload::Scenario => self.scenario.clone(),
            Upload::Mission => {
                let text = read_text(&self.scenario)?;
                let mission = scenario::mission_file((&self.scenario, &text), &[])?;
                let folder = self.scenario.parent().unwrap_or(Path::new(""));
                folder.join(mission)
            }
        };
        let text = text_of(&place, bytes)?;
        DroneConfig::load_from(&self.config, &|path| {
            if path == place {
                Ok(text.clone())
            } else {
                read_text(path)
            }
        })?;
        Ok((place, text))
    }

    async fn tell(&self, stream: &mut Stream, follow: bool) -> io::Result<()> {
        let mut told = 0;
        loop {
            let (lines, said) = self.recent.after(told);
            stream.write(&lines).await?;
            told = said;
            if !follow {
                return Ok(());
            }
            self.recent.more_than(told).await;
        }
    }
}
