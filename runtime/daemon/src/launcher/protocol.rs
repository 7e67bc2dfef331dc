//! The protocol between `muster swarm` (the starter) and its launcher on a host: one JSON object per line, over the
//! launcher's standard input and output.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

/// A message from the starter to a launcher.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub enum LauncherCommand {
    /// Report the host's time.
    Ping(u64),
    /// Append to a file within the launcher's folder. A new file is readable by its owner only.
    AppendFile { path: PathBuf, text: String },
    /// Start a drone's process. The path of its file is relative to the launcher's folder.
    Start {
        drone: u32,
        config: PathBuf,
        arguments: Vec<String>,
    },
    /// Send a drone's process a signal.
    Signal { drone: u32, signal: ProcessSignal },
    /// Write a line to the standard input of a drone's process.
    WriteStdin { drone: u32, line: String },
}

/// A signal to a drone's process.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum ProcessSignal {
    /// SIGSTOP.
    Stop,
    /// SIGCONT.
    Continue,
    /// SIGKILL.
    Kill,
}

/// A message from a launcher to the starter.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub enum Reply {
    /// The launcher runs, in this version.
    Hello { version: String },
    /// The host's time when the launcher read this ping, in nanoseconds since the Unix epoch.
    Pong { ping: u64, at_ns: u64 },
    /// A line that a drone's process wrote to standard error.
    Output { drone: u32, line: String },
    /// A drone's process has ended or could not be started.
    Ended { drone: u32 },
}

/// Largest part of a file in one order, in bytes. It keeps orders frequent enough for the silence limit on a slow connection.
const PIECE_MAX: usize = 16 * 1_024;

impl LauncherCommand {
    /// The orders that write a file, in pieces.
    pub fn append_file<'a>(path: &'a Path, text: &'a str) -> impl Iterator<Item = Self> + 'a {
        let mut rest = Some(text);
        std::iter::from_fn(move || {
            let text = rest?;
            let mut ends = (0..=text.len().min(PIECE_MAX)).rev();
            let (piece, more) = text.split_at(ends.find(|end| text.is_char_boundary(*end))?);
            rest = Some(more).filter(|more| !more.is_empty());
            Some(Self::AppendFile {
                path: path.to_owned(),
                text: piece.to_owned(),
            })
        })
    }
}

/// Version of the program; both sides must have the same, since the protocol has no stable format.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

/// A message as a line of JSON with its line feed.
pub fn line(message: &impl Serialize) -> String {
    let mut line = serde_json::to_string(message).expect("every message has a form in JSON");
    line.push('\n');
    line
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_line_for_standard_input_survives_encoding() {
        let order = LauncherCommand::WriteStdin {
            drone: 3,
            line: "{\"losses\":{}}\n".to_owned(),
        };
        let written = line(&order);
        assert_eq!(written.matches('\n').count(), 1);
        assert_eq!(
            serde_json::from_str::<LauncherCommand>(&written).unwrap(),
            order
        );
    }

    #[test]
    fn files_are_sent_in_pieces_even_empty_ones() {
        let pieces = |text: &str| {
            let orders: Vec<_> =
                LauncherCommand::append_file(Path::new("drone-1/drone.toml"), text).collect();
            let texts = orders.iter().map(|order| match order {
                LauncherCommand::AppendFile { text, .. } => text.as_str(),
                other => panic!("{other:?}"),
            });
            assert_eq!(texts.collect::<String>(), text);
            orders.len()
        };
        assert_eq!(pieces(""), 1);
        assert_eq!(pieces("id = 1\n"), 1);
        // A piece of the maximum size would end inside a character.
        let long = format!("12345{}", "größe\n".repeat(PIECE_MAX / 4));
        assert!(!long.is_char_boundary(PIECE_MAX));
        assert_eq!(pieces(&long), 3);
    }
}
