//! The process's log: on standard error, and its latest lines in memory for operators.

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

/// The lowest level that is logged.
pub type Level = LevelFilter;

/// Format of log lines.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// For people; coloured on a terminal unless `NO_COLOR` is set.
    Human,
    /// One JSON object a line, for programs.
    Json,
}

/// Handle to change the log level.
#[derive(Debug, Clone)]
pub struct Volume(reload::Handle<LevelFilter, Registry>);

impl Volume {
    /// Sets the level.
    pub fn set(&self, level: Level) {
        // Fails only after the log has ended.
        let _ = self.0.reload(level);
    }
}

/// The most lines that wait to be written; some hundred bytes each.
const WAITING_MAX: usize = 1_024;

/// Counts lines that were dropped because the queue was full.
#[derive(Debug, Clone)]
pub struct Lost(ErrorCounter);

impl Lost {
    /// Lines dropped so far.
    #[must_use]
    pub fn lines(&self) -> u64 {
        self.0.dropped_lines() as u64
    }
}

/// A process's log. Dropping it writes the queued lines, for at most a second.
#[derive(Debug)]
pub struct Log {
    /// Changes the level.
    pub volume: Volume,
    /// Counts dropped lines.
    pub lost: Lost,
    /// The latest lines.
    pub recent: Recent,
    _worker: WorkerGuard,
}

/// The most bytes of lines that are kept in memory.
const RECENT_MAX: usize = 256 * 1_024;

/// The latest log lines.
#[derive(Debug, Clone, Default)]
pub struct Recent(Arc<Ring>);

#[derive(Debug, Default)]
struct Ring {
    lines: Mutex<Lines>,
    /// Number of lines logged so far.
    logged: watch::Sender<u64>,
}

#[derive(Debug, Default)]
struct Lines {
    /// The oldest first.
    kept: VecDeque<Box<[u8]>>,
    bytes: usize,
    logged: u64,
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
        lines.logged += 1;
        let logged = lines.logged;
        drop(lines);
        self.0.logged.send_replace(logged);
    }

    /// The kept lines after the first `lines` ones, and the number of lines logged so far.
    pub(crate) fn after(&self, lines: u64) -> (Vec<u8>, u64) {
        let known = self.lock();
        let oldest = known.logged - known.kept.len() as u64;
        let passed = usize::try_from(lines.saturating_sub(oldest)).unwrap_or(usize::MAX);
        let kept: Vec<_> = known.kept.iter().skip(passed).cloned().collect();
        (kept.concat(), known.logged)
    }

    /// Returns after more than `lines` lines were logged.
    pub(crate) async fn more_than(&self, lines: u64) {
        // Can't fail: this value owns the sender.
        let _ = (self.0.logged.subscribe())
            .wait_for(|logged| *logged > lines)
            .await;
    }

    fn lock(&self) -> MutexGuard<'_, Lines> {
        self.0.lines.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Writes lines to standard error and keeps the latest.
#[derive(Debug)]
struct Tee<'a> {
    recent: &'a Recent,
    writer: NonBlocking,
}

impl Write for Tee<'_> {
    fn write(&mut self, line: &[u8]) -> io::Result<usize> {
        self.recent.keep(line);
        self.writer.write(line)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.writer.flush()
    }
}

#[derive(Debug)]
struct MakeTee {
    recent: Recent,
    writer: NonBlocking,
}

impl<'a> MakeWriter<'a> for MakeTee {
    type Writer = Tee<'a>;

    fn make_writer(&'a self) -> Tee<'a> {
        Tee {
            recent: &self.recent,
            writer: self.writer.clone(),
        }
    }
}

/// Starts the log of the process. Logging never blocks: a thread writes the lines, and lines without room in its queue are
/// dropped and counted. If the process has a log already, this one stays empty.
#[must_use]
pub fn start(format: Format, level: Level) -> Log {
    let (filter, handle) = reload::Layer::new(level);
    // Only muster's own events: libraries log each packet, which would fill the log and feed a log read over the network.
    let events = filter_fn(|event| event.is_event() && event.target().starts_with("muster"));
    let registry = tracing_subscriber::registry().with(filter).with(events);
    let (writer, worker) = NonBlockingBuilder::default()
        .buffered_lines_limit(WAITING_MAX)
        .lossy(true)
        .thread_name("log")
        .finish(io::stderr());
    let recent = Recent::default();
    let lost = Lost(writer.error_counter());
    let lines = fmt::layer()
        .with_writer(MakeTee {
            recent: recent.clone(),
            writer,
        })
        .with_target(false);
    let started = match format {
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
    // Fails in tests, which start several logs.
    let _ = started;
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
    fn latest_lines_are_kept_up_to_the_limit() {
        let recent = Recent::default();
        let line = |number: usize| format!("{number:0>1023}\n").into_bytes();
        (0..300).for_each(|number| recent.keep(&line(number)));
        let (kept, logged) = recent.after(0);
        assert_eq!(logged, 300);
        assert_eq!(kept.len(), RECENT_MAX);
        assert!(kept.ends_with(&line(299)));
        assert_eq!(recent.after(298).0, [line(298), line(299)].concat());
        assert_eq!(recent.after(300), (Vec::new(), 300));
        assert_eq!(recent.after(17).0, kept, "older lines are dropped");
    }
}
