//! What a drone's process says of itself, on standard error; the last of it is kept for operators who ask.

use std::collections::VecDeque;
use std::io::{self, IsTerminal, Write};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::sync::watch;
use tracing_appender::non_blocking::{ErrorCounter, NonBlocking, NonBlockingBuilder, WorkerGuard};
use tracing_subscriber::filter::{LevelFilter, filter_fn};
use tracing_subscriber::fmt::{self, MakeWriter};
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::registry::Registry;
use tracing_subscriber::reload;

/// How much is said.
pub type Level = LevelFilter;

/// How it is said.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// For people; in colours on a terminal whose user wants them.
    Human,
    /// An object a line, for programs.
    Json,
}

/// Changes how much is said from now on.
#[derive(Debug, Clone)]
pub struct Volume(reload::Handle<LevelFilter, Registry>);

impl Volume {
    /// From now on so much.
    pub fn set(&self, level: Level) {
        // It can only fail once nothing is said at all any more.
        let _ = self.0.reload(level);
    }
}

/// How many lines may wait to be read; some hundred bytes each.
const WAITING_MAX: usize = 4_096;

/// How many lines were lost because nobody read them.
#[derive(Debug, Clone)]
pub struct Lost(ErrorCounter);

impl Lost {
    /// So many until now.
    #[must_use]
    pub fn lines(&self) -> u64 {
        self.0.dropped_lines() as u64
    }
}

/// A process's log. What was said last is still written when this value goes, for a second at most.
#[derive(Debug)]
pub struct Log {
    /// Changes how much is said.
    pub volume: Volume,
    /// What was said to nobody.
    pub lost: Lost,
    /// The last that was said.
    pub recent: Recent,
    _worker: WorkerGuard,
}

/// How much of what was said is kept, in bytes.
const RECENT_MAX: usize = 256 * 1_024;

/// The last that was said.
#[derive(Debug, Clone, Default)]
pub struct Recent(Arc<Ring>);

#[derive(Debug, Default)]
struct Ring {
    lines: Mutex<Lines>,
    /// How many lines were said.
    said: watch::Sender<u64>,
}

#[derive(Debug, Default)]
struct Lines {
    /// The oldest first.
    kept: VecDeque<Box<[u8]>>,
    bytes: usize,
    said: u64,
}

impl Recent {
    fn keep(&self, line: &[u8]) {
        let mut lines = self.lock();
        lines.bytes += line.len();
        lines.kept.push_back(line.into());
        while lines.bytes > RECENT_MAX
            && let Some(oldest) = lines.kept.pop_front()
        {
            lines.bytes -= oldest.len();
        }
        lines.said += 1;
        let said = lines.said;
        drop(lines);
        self.0.said.send_replace(said);
    }

    /// All that is kept of what was said after so many lines, and how many lines were said by its end.
    pub(crate) fn after(&self, lines: u64) -> (Vec<u8>, u64) {
        let known = self.lock();
        let oldest = known.said - known.kept.len() as u64;
        let passed = usize::try_from(lines.saturating_sub(oldest)).unwrap_or(usize::MAX);
        let kept: Vec<_> = known.kept.iter().skip(passed).cloned().collect();
        (kept.concat(), known.said)
    }

    /// Returns once more than so many lines were said.
    pub(crate) async fn more_than(&self, lines: u64) {
        // Whoever says things is this very value.
        let _ = (self.0.said.subscribe())
            .wait_for(|said| *said > lines)
            .await;
    }

    fn lock(&self) -> MutexGuard<'_, Lines> {
        self.0.lines.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Hands a line on to whoever writes it, and keeps it.
#[derive(Debug)]
struct Kept<'a> {
    recent: &'a Recent,
    writer: NonBlocking,
}

impl Write for Kept<'_> {
    fn write(&mut self, line: &[u8]) -> io::Result<usize> {
        self.recent.keep(line);
        self.writer.write(line)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.writer.flush()
    }
}

#[derive(Debug)]
struct Keeping {
    recent: Recent,
    writer: NonBlocking,
}

impl<'a> MakeWriter<'a> for Keeping {
    type Writer = Kept<'a>;

    fn make_writer(&'a self) -> Kept<'a> {
        Kept {
            recent: &self.recent,
            writer: self.writer.clone(),
        }
    }
}

/// Begins to say things, for the whole process. Whoever says something does not wait for whoever reads it: lines wait for a
/// thread of their own to write them, and those for which there is no room are counted. Where somebody else has begun
/// before, nothing is said by this log.
#[must_use]
pub fn start(format: Format, level: Level) -> Log {
    let (filter, handle) = reload::Layer::new(level);
    // Only what is our own: what libraries say of each packet would fill the log, and one that is sent over the network
    // would feed itself.
    let events = filter_fn(|said| said.is_event() && said.target().starts_with("muster"));
    let registry = tracing_subscriber::registry().with(filter).with(events);
    let (writer, worker) = NonBlockingBuilder::default()
        .buffered_lines_limit(WAITING_MAX)
        .lossy(true)
        .thread_name("log")
        .finish(io::stderr());
    let recent = Recent::default();
    let lost = Lost(writer.error_counter());
    let lines = fmt::layer()
        .with_writer(Keeping {
            recent: recent.clone(),
            writer,
        })
        .with_target(false);
    let begun = match format {
        Format::Human => {
            let wants_colour = std::env::var_os("NO_COLOR").is_none_or(|it| it.is_empty());
            let lines = lines.with_ansi(io::stderr().is_terminal() && wants_colour);
            tracing::subscriber::set_global_default(registry.with(lines))
        }
        Format::Json => {
            let lines = lines.json().flatten_event(true).with_current_span(false);
            let lines = lines.with_span_list(false);
            tracing::subscriber::set_global_default(registry.with(lines))
        }
    };
    // Tests begin more than once.
    let _ = begun;
    Log {
        volume: Volume(handle),
        lost,
        recent,
        _worker: worker,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_that_was_said_is_kept_and_no_more() {
        let recent = Recent::default();
        let line = |number: usize| format!("{number:0>1023}\n").into_bytes();
        (0..300).for_each(|number| recent.keep(&line(number)));
        let (kept, said) = recent.after(0);
        assert_eq!(said, 300);
        assert_eq!(kept.len(), RECENT_MAX);
        assert!(kept.ends_with(&line(299)));
        assert_eq!(recent.after(298).0, [line(298), line(299)].concat());
        assert_eq!(recent.after(300), (Vec::new(), 300));
        assert_eq!(recent.after(17).0, kept, "what is gone is gone");
    }
}
