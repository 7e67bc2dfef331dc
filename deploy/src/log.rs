//! What a drone's process says of itself, on standard error.

use std::io::{self, IsTerminal};

use tracing_appender::non_blocking::{ErrorCounter, NonBlockingBuilder, WorkerGuard};
use tracing_subscriber::filter::{LevelFilter, filter_fn};
use tracing_subscriber::fmt;
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
    _worker: WorkerGuard,
}

/// Begins to say things, for the whole process. Whoever says something does not wait for whoever reads it: lines wait for a
/// thread of their own to write them, and those for which there is no room are counted. Where somebody else has begun
/// before, nothing is said by this log.
#[must_use]
pub fn start(format: Format, level: Level) -> Log {
    let (filter, handle) = reload::Layer::new(level);
    // Which actor of the library's it was that said something is of no use to anybody.
    let events = filter_fn(|said| said.is_event());
    let registry = tracing_subscriber::registry().with(filter).with(events);
    let (writer, worker) = NonBlockingBuilder::default()
        .buffered_lines_limit(WAITING_MAX)
        .lossy(true)
        .thread_name("log")
        .finish(io::stderr());
    let lost = Lost(writer.error_counter());
    let lines = fmt::layer().with_writer(writer).with_target(false);
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
        _worker: worker,
    }
}
