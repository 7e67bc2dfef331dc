//! What a starter and its agent on a host say to each other: an object a line, over the agent's standard input and output.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

/// What a starter asks of an agent.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub enum Order {
    /// Say what time it is.
    Ping(u64),
    /// Add to the end of a file at a path within the agent's own folder; of one that is not there yet, this is the
    /// beginning, and only its owner can read it.
    Write { path: PathBuf, text: String },
    /// Start a drone's process with its file, as seen from the agent's own folder, and these arguments.
    Start {
        drone: u32,
        config: PathBuf,
        arguments: Vec<String>,
    },
    /// Send a drone's process a signal.
    Signal { drone: u32, signal: Sent },
    /// Hand a drone's process a line on its standard input.
    Tell { drone: u32, line: String },
}

/// A signal that a process may be sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Sent {
    /// SIGSTOP.
    Stop,
    /// SIGCONT.
    Continue,
    /// SIGKILL.
    Kill,
}

/// What an agent tells its starter.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub enum Reply {
    /// It is there, and of this version.
    Here { version: String },
    /// What time it was on its host when it read this ping, in nanoseconds since the Unix epoch.
    Pong { ping: u64, at_ns: u64 },
    /// A drone's process said something on its standard error.
    Said { drone: u32, line: String },
    /// A drone's process has ended, or could not be started.
    Ended { drone: u32 },
}

/// How much of a file is carried at once, in bytes: over a slow connection too, something is heard of the starter in time.
const PIECE_MAX: usize = 16 * 1_024;

impl Order {
    /// What carries a file, piece by piece.
    pub fn to_write<'a>(path: &'a Path, text: &'a str) -> impl Iterator<Item = Self> + 'a {
        let mut rest = Some(text);
        std::iter::from_fn(move || {
            let text = rest?;
            let mut ends = (0..=text.len().min(PIECE_MAX)).rev();
            let (piece, more) = text.split_at(ends.find(|end| text.is_char_boundary(*end))?);
            rest = Some(more).filter(|more| !more.is_empty());
            Some(Self::Write {
                path: path.to_owned(),
                text: piece.to_owned(),
            })
        })
    }
}

/// The version that both must be of: what they say to each other is no format to be kept.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

/// Something said, as a line; it ends with a line feed.
pub fn line(said: &impl Serialize) -> String {
    let mut line = serde_json::to_string(said).expect("what is said has a form in JSON");
    line.push('\n');
    line
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_that_is_told_arrives_as_it_was_whatever_is_in_it() {
        let order = Order::Tell {
            drone: 3,
            line: "{\"losses\":{}}\n".to_owned(),
        };
        let written = line(&order);
        assert_eq!(written.matches('\n').count(), 1);
        assert_eq!(serde_json::from_str::<Order>(&written).unwrap(), order);
    }

    #[test]
    fn a_file_is_carried_in_pieces_and_an_empty_one_too() {
        let carried = |text: &str| {
            let orders: Vec<_> = Order::to_write(Path::new("drone-1/drone.toml"), text).collect();
            let texts = orders.iter().map(|order| match order {
                Order::Write { text, .. } => text.as_str(),
                other => panic!("{other:?}"),
            });
            assert_eq!(texts.collect::<String>(), text);
            orders.len()
        };
        assert_eq!(carried(""), 1);
        assert_eq!(carried("id = 1\n"), 1);
        // The first piece would end in the middle of a letter.
        let long = format!("12345{}", "größe\n".repeat(PIECE_MAX / 4));
        assert!(!long.is_char_boundary(PIECE_MAX));
        assert_eq!(carried(&long), 3);
    }
}
