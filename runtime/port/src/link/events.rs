//! Events of a link, for the program that owns it.

use std::collections::VecDeque;

use muster_msp::check::Finding;
use muster_msp::{Identity, Telemetry};

/// Length of the queue from which on new telemetry replaces the oldest telemetry, which is counted.
const EVENTS_MAX: usize = 256;

/// What happened.
#[derive(Debug, Clone, PartialEq)]
pub enum Event {
    /// The controller is not fit to fly. Comes before [`Event::Identified`].
    Unfit(Vec<Finding>),
    /// The controller said who it is.
    Identified(Identity),
    /// The port was closed, or could not be opened.
    Closed(String),
    /// The controller told something.
    Telemetry(Telemetry),
}

/// Events that wait to be taken, oldest first.
///
/// Invariant: only telemetry is dropped. A pause between opening and closing the port bounds what says so.
#[derive(Debug, Default)]
pub(super) struct Events {
    waiting: VecDeque<Event>,
    dropped: u64,
}

impl Events {
    pub(super) fn push(&mut self, event: Event) {
        let is_telemetry = |it: &Event| matches!(it, Event::Telemetry(_));
        if self.waiting.len() >= EVENTS_MAX
            && is_telemetry(&event)
            && let Some(oldest) = self.waiting.iter().position(is_telemetry)
        {
            self.waiting.remove(oldest);
            self.dropped += 1;
        }
        self.waiting.push_back(event);
    }

    /// Takes the oldest.
    pub(super) fn pop(&mut self) -> Option<Event> {
        self.waiting.pop_front()
    }

    pub(super) fn is_empty(&self) -> bool {
        self.waiting.is_empty()
    }

    /// How many were dropped since the start.
    pub(super) const fn dropped(&self) -> u64 {
        self.dropped
    }
}

#[cfg(test)]
mod tests {
    use muster_msp::Status;

    use super::*;

    #[test]
    fn only_the_oldest_telemetry_is_dropped() {
        let mut events = Events::default();
        let closed = || Event::Closed("unplugged".to_owned());
        events.push(closed());
        for _ in 0..EVENTS_MAX {
            events.push(Event::Telemetry(Telemetry::Status(Status::default())));
        }
        assert_eq!(events.dropped(), 1);
        events.push(closed());
        assert_eq!(events.dropped(), 1);
        let taken: Vec<_> = std::iter::from_fn(|| events.pop()).collect();
        assert_eq!(taken.len(), EVENTS_MAX + 1);
        assert_eq!(
            (taken.first(), taken.last()),
            (Some(&closed()), Some(&closed()))
        );
    }
}
