//! What a drone does for its fleet's operators: it takes files for its next start, and tells what it has said.

use std::io;
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use muster_runtime::diagnostic::{BadInput, read_text, text_of};
use muster_runtime::file::replace;
use muster_runtime::plan;
use muster_transport::quic::Stream;
use tokio::sync::Semaphore;
use tokio::sync::mpsc::Receiver;
use tokio::time::timeout;

use super::process::Process;
use crate::config::DroneConfig;
use crate::log::Recent;
use crate::operator::{Answer, REQUEST_MAX, Request, Upload};

/// How long an operator may take to say what it wants, and to hand over a file, over a slow radio.
const REQUEST_LASTS: Duration = Duration::from_secs(60);

/// How many operators are answered at once; more are sent away.
const ANSWERED_MAX: usize = 4;

/// What operators may ask about.
pub(super) struct Desk {
    /// The drone's file.
    config: PathBuf,
    /// The scenario that it names.
    scenario: PathBuf,
    recent: Recent,
    /// One file at a time is taken in and looked at: what that takes of memory is bounded.
    file: Semaphore,
}

/// Answers operators, as long as any may come.
pub(super) async fn serve(mut streams: Receiver<Stream>, desk: Desk, process: Arc<Process>) {
    let desk = Arc::new(desk);
    let room = Arc::new(Semaphore::new(ANSWERED_MAX));
    while let Some(stream) = streams.recv().await {
        let Ok(place) = Arc::clone(&room).try_acquire_owned() else {
            tracing::debug!("an operator is sent away: there are too many already");
            continue;
        };
        let (desk, process) = (Arc::clone(&desk), Arc::clone(&process));
        tokio::spawn(async move {
            // Whoever asked sees that the connection is gone; the drone has no use for that.
            let _ = desk.answer(stream, &process).await;
            drop(place);
        });
    }
}

impl Desk {
    /// For a drone with this file, which names this scenario; `recent` is what it has said.
    pub(super) fn new(config: PathBuf, scenario: PathBuf, recent: Recent) -> Self {
        Self {
            config,
            scenario,
            recent,
            file: Semaphore::new(1),
        }
    }

    async fn answer(&self, mut stream: Stream, process: &Process) -> io::Result<()> {
        let (request, rest) = timeout(REQUEST_LASTS, request(&mut stream)).await??;
        match request {
            Request::Upload { what, bytes } => {
                let answer = self
                    .upload(&mut stream, (what, bytes), rest, process)
                    .await?;
                let is_taken = matches!(answer, Answer::Taken(_));
                tracing::info!(?what, bytes, is_taken, "an operator hands over a file");
                stream.write(&serde_json::to_vec(&answer)?).await?;
            }
            Request::Logs { follow } => self.tell(&mut stream, follow).await?,
        }
        stream.finish();
        Ok(())
    }

    /// Takes a file in, of which `first` has been read already. What is refused for its length, or for the time, is not
    /// read.
    async fn upload(
        &self,
        stream: &mut Stream,
        (what, bytes): (Upload, usize),
        mut first: Vec<u8>,
        process: &Process,
    ) -> io::Result<Answer> {
        if !process.state().rests() {
            return Ok(Answer::Flies);
        }
        let max = what.bytes_max();
        if bytes > max {
            let message = format!("{bytes} bytes are too many");
            let help = format!("a drone takes up to {max} bytes for this file");
            let refused = BadInput::without_excerpt(&self.scenario, message, help);
            return Ok(Answer::Unusable(refused.rendered()));
        }
        let Ok(_one) = self.file.try_acquire() else {
            return Ok(Answer::Busy);
        };
        let missing = bytes.saturating_sub(first.len());
        first.extend(timeout(REQUEST_LASTS, stream.read_to_end(missing)).await??);
        if first.len() != bytes {
            return Err(io::ErrorKind::InvalidData.into());
        }
        // It may have been told to fly meanwhile.
        if !process.state().rests() {
            return Ok(Answer::Flies);
        }
        Ok(self.take(what, first))
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
    /// operator's choice, nor are those of other files than are beside the scenario.
    fn check(&self, what: Upload, bytes: Vec<u8>) -> Result<(PathBuf, String), BadInput> {
        let folder = self.scenario.parent().unwrap_or(Path::new(""));
        let place = match what {
            Upload::Scenario => self.scenario.clone(),
            Upload::Mission => {
                let text = read_text(&self.scenario)?;
                folder.join(plan::mission_file((&self.scenario, &text), &[])?)
            }
        };
        let text = text_of(&place, bytes)?;
        DroneConfig::load_from(&self.config, &|path| {
            if path == place {
                return Ok(text.clone());
            }
            if what == Upload::Scenario && !is_within(path, folder) {
                let message = "is not in the folder of the scenario that names it";
                let help = "a scenario that is handed over names a mission in its own folder, or in one within that";
                return Err(BadInput::without_excerpt(path, message, help));
            }
            read_text(path)
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
            tokio::select! {
                () = self.recent.more_than(told) => {}
                () = stream.given_up() => return Ok(()),
            }
        }
    }
}

/// Whether a path leads into a folder, or into one within it.
fn is_within(path: &Path, folder: &Path) -> bool {
    let within = path.strip_prefix(folder);
    within.is_ok_and(|it| it.components().all(|it| matches!(it, Component::Normal(_))))
}

/// What an operator wants, and what it has said beyond that so far.
async fn request(stream: &mut Stream) -> io::Result<(Request, Vec<u8>)> {
    let mut said = Vec::new();
    let mut buffer = [0; REQUEST_MAX];
    let end = loop {
        if let Some(end) = said.iter().position(|byte| *byte == b'\n') {
            break end;
        }
        let room = REQUEST_MAX - said.len();
        match stream.read(&mut buffer[..room]).await? {
            0 => return Err(io::ErrorKind::InvalidData.into()),
            read => said.extend_from_slice(&buffer[..read]),
        }
    };
    let rest = said.split_off(end + 1);
    Ok((serde_json::from_slice(&said)?, rest))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_leads_out_of_a_folder_is_not_within_it() {
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
