//! State and position of a drone at any time of its flight.

use muster_machines::geometry::Ned;
use muster_machines::mission::State;
use muster_machines::time::Timestamp;

use super::{Flight, FlightOfDrone, MarkKind};

impl Flight {
    /// Removes what was recorded of links: where every drone hears every other, the radio model does not hold.
    pub fn forget_links(&mut self) {
        self.history.links = None;
        let is_of_links = |kind| matches!(kind, MarkKind::Partition | MarkKind::Merge);
        self.history.marks.retain(|mark| !is_of_links(mark.kind));
    }

    /// Flights of all swarms, the scenario's own first.
    pub fn swarms(&self) -> impl Iterator<Item = &Self> {
        std::iter::once(self).chain(&self.others)
    }
}

impl FlightOfDrone {
    /// State at time `at`.
    #[must_use]
    pub fn state_at(&self, at: Timestamp) -> State {
        let started = self.states.partition_point(|&(since, _)| since <= at);
        let states = self.states.get(..started).unwrap_or_default();
        states.last().map(|&(_, state)| state).unwrap_or_default()
    }

    /// Position at time `at`, interpolated linearly between track points; `None` without a track.
    ///
    /// Before and after the track it is the first and the last point.
    #[must_use]
    pub fn position_at(&self, at: Timestamp) -> Option<Ned> {
        let next = self.track.partition_point(|&(then, _)| then < at);
        let Some(&(to_t, to)) = self.track.get(next) else {
            return self.track.last().map(|&(_, place)| place);
        };
        let Some(&(from_t, from)) = next.checked_sub(1).and_then(|last| self.track.get(last))
        else {
            return Some(to);
        };
        let share = at.since(from_t).as_secs_f64() / to_t.since(from_t).as_secs_f64();
        Some(Ned(from.0.lerp(&to.0, share)))
    }

    /// Time of its first arrival at a waypoint.
    #[must_use]
    pub fn first_waypoint_at(&self) -> Option<Timestamp> {
        let reached = |state: State| matches!(state, State::WaypointReached { .. });
        self.states
            .iter()
            .find(|&&(_, state)| reached(state))
            .map(|&(at, _)| at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(seconds: f64) -> Timestamp {
        Timestamp::from_secs_f64(seconds)
    }

    fn northbound() -> FlightOfDrone {
        FlightOfDrone {
            track: vec![(at(1.0), Ned::HOME), (at(2.0), Ned::new(10.0, 0.0, 0.0))],
            states: vec![
                (at(0.0), State::TakingOff),
                (at(1.5), State::WaypointReached { waypoint: 0 }),
            ],
            died_at: None,
            control: None,
        }
    }

    #[test]
    fn state_holds_until_the_next_one() {
        let drone = northbound();
        assert_eq!(drone.state_at(at(1.4)), State::TakingOff);
        assert_eq!(
            drone.state_at(at(1.5)),
            State::WaypointReached { waypoint: 0 }
        );
        assert_eq!(drone.first_waypoint_at(), Some(at(1.5)));
    }

    #[test]
    fn position_is_interpolated_and_constant_beyond_the_track() {
        let drone = northbound();
        assert_eq!(drone.position_at(at(1.25)), Some(Ned::new(2.5, 0.0, 0.0)));
        assert_eq!(drone.position_at(at(0.0)), Some(Ned::HOME));
        assert_eq!(drone.position_at(at(9.0)), Some(Ned::new(10.0, 0.0, 0.0)));
        let without_track = FlightOfDrone {
            track: vec![],
            states: vec![],
            died_at: None,
            control: None,
        };
        assert_eq!(without_track.position_at(at(1.0)), None);
        assert_eq!(without_track.state_at(at(1.0)), State::Start);
    }
}
