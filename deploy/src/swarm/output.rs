//! Parses the standard error of a drone's process, line by line.

use muster_daemon::control::{READY, STARTS};
use muster_machines::msp::FlightCommand;
use muster_machines::node::Observation;
use muster_machines::time::Timestamp;
use muster_scenarios::twin::ProcessReport;
use serde::Deserialize;

/// The fields of a log line that matter to the starter.
#[derive(Debug, Deserialize)]
struct LogLine {
    message: String,
    at_ns: Option<u64>,
    seen: Option<String>,
    commanded: Option<String>,
    news: Option<u64>,
    keep_alives: Option<u64>,
    let_in: Option<u64>,
}

/// A parsed line of output.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum ProcessOutput {
    /// All actors of the drone run.
    Ready,
    /// A report for the twin, at a time of the drone's clock.
    Report(Timestamp, ProcessReport),
    /// Text for people.
    Text(String),
}

/// Parses a line of output. A line that is no log line is text.
pub(super) fn parse(line: &str) -> ProcessOutput {
    let Ok(log_line) = serde_json::from_str::<LogLine>(line) else {
        return ProcessOutput::Text(line.to_owned());
    };
    match (log_line.report(), log_line.at_ns) {
        (Some(report), Some(at_ns)) => ProcessOutput::Report(Timestamp::from_nanos(at_ns), report),
        _ if log_line.message == READY => ProcessOutput::Ready,
        _ => ProcessOutput::Text(log_line.message),
    }
}

impl LogLine {
    /// The report for the twin; `None` for any other line.
    fn report(&self) -> Option<ProcessReport> {
        if self.message == STARTS {
            return Some(ProcessReport::Started);
        }
        if let Some(seen) = &self.seen {
            return Some(ProcessReport::Observed(
                serde_json::from_str::<Observation>(seen).ok()?,
            ));
        }
        if let Some(command) = &self.commanded {
            return Some(ProcessReport::Commanded(
                serde_json::from_str::<FlightCommand>(command).ok()?,
            ));
        }
        Some(ProcessReport::Traffic {
            news: self.news?,
            keep_alives: self.keep_alives?,
            let_in: self.let_in?,
        })
    }
}

#[cfg(test)]
mod tests {
    use muster_machines::mission::{Event, State};

    use super::*;

    #[test]
    fn log_lines_become_reports_and_other_lines_are_text() {
        let seen = Observation::Mission(Event::State(State::SetUp));
        let written = serde_json::json!({
            "level": "INFO", "message": "seen", "drone": 3, "at_ns": 17,
            "seen": serde_json::to_string(&seen).unwrap(),
        });
        let at = Timestamp::from_nanos(17);
        assert_eq!(
            parse(&written.to_string()),
            ProcessOutput::Report(at, ProcessReport::Observed(seen))
        );
        let traffic = r#"{"message":"talked","at_ns":17,"news":1,"keep_alives":2,"let_in":3}"#;
        let (news, keep_alives, let_in) = (1, 2, 3);
        let report = ProcessReport::Traffic {
            news,
            keep_alives,
            let_in,
        };
        assert_eq!(parse(traffic), ProcessOutput::Report(at, report));
        assert_eq!(parse(r#"{"message":"ready"}"#), ProcessOutput::Ready);
        let starts = r#"{"message":"starts","at_ns":17,"incarnation":2}"#;
        let started = ProcessOutput::Report(at, ProcessReport::Started);
        assert_eq!(parse(starts), started);
        for text in ["thread panicked", r#"{"message":"thread panicked"}"#] {
            assert_eq!(
                parse(text),
                ProcessOutput::Text("thread panicked".to_owned())
            );
        }
        let garbled = r#"{"message":"seen","at_ns":17,"seen":"what"}"#;
        assert_eq!(parse(garbled), ProcessOutput::Text("seen".to_owned()));
    }
}
