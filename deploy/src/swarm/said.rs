//! What a drone's process says on its standard error, line by line.

use muster_daemon::control::{READY, STARTS};
use muster_machines::msp::FlightCommand;
use muster_machines::node::Observation;
use muster_machines::time::Timestamp;
use muster_scenarios::twin::Said;
use serde::Deserialize;

/// A line of a drone's log, as far as whoever follows it needs it.
#[derive(Debug, Deserialize)]
struct Line {
    message: String,
    at_ns: Option<u64>,
    seen: Option<String>,
    commanded: Option<String>,
    news: Option<u64>,
    keep_alives: Option<u64>,
    let_in: Option<u64>,
}

/// What a line says.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Spoken {
    /// The drone's five actors run.
    Ready,
    /// Something of the drone, at this time of its clock.
    Of(Timestamp, Said),
    /// Something for people.
    Words(String),
}

/// What a line says; a line that is none of a drone's log is for people.
pub(super) fn read(line: &str) -> Spoken {
    let Ok(said) = serde_json::from_str::<Line>(line) else {
        return Spoken::Words(line.to_owned());
    };
    match (said.of_drone(), said.at_ns) {
        (Some(of_drone), Some(at_ns)) => Spoken::Of(Timestamp::from_nanos(at_ns), of_drone),
        _ if said.message == READY => Spoken::Ready,
        _ => Spoken::Words(said.message),
    }
}

impl Line {
    fn of_drone(&self) -> Option<Said> {
        if self.message == STARTS {
            return Some(Said::Started);
        }
        if let Some(seen) = &self.seen {
            return Some(Said::Seen(serde_json::from_str::<Observation>(seen).ok()?));
        }
        if let Some(command) = &self.commanded {
            return Some(Said::Commanded(
                serde_json::from_str::<FlightCommand>(command).ok()?,
            ));
        }
        Some(Said::Talked {
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
    fn lines_are_read_as_they_are_written_and_others_are_for_people() {
        let seen = Observation::Mission(Event::State(State::SetUp));
        let written = serde_json::json!({
            "level": "INFO", "message": "seen", "drone": 3, "at_ns": 17,
            "seen": serde_json::to_string(&seen).unwrap(),
        });
        let at = Timestamp::from_nanos(17);
        assert_eq!(read(&written.to_string()), Spoken::Of(at, Said::Seen(seen)));
        let talked = r#"{"message":"talked","at_ns":17,"news":1,"keep_alives":2,"let_in":3}"#;
        let (news, keep_alives, let_in) = (1, 2, 3);
        let said = Said::Talked {
            news,
            keep_alives,
            let_in,
        };
        assert_eq!(read(talked), Spoken::Of(at, said));
        assert_eq!(read(r#"{"message":"ready"}"#), Spoken::Ready);
        let starts = r#"{"message":"starts","at_ns":17,"incarnation":2}"#;
        assert_eq!(read(starts), Spoken::Of(at, Said::Started));
        for words in ["thread panicked", r#"{"message":"thread panicked"}"#] {
            assert_eq!(read(words), Spoken::Words("thread panicked".to_owned()));
        }
        let garbled = r#"{"message":"seen","at_ns":17,"seen":"what"}"#;
        assert_eq!(read(garbled), Spoken::Words("seen".to_owned()));
    }
}
