//! How the drone's flight ends.

use muster_machines::mission::{self, LandingReason};

/// Why the drone lands, and whether its process may end.
#[derive(Debug, Default)]
pub(super) struct Outcome {
    /// The first reason to land.
    landing: Option<LandingReason>,
    /// Whether the mission is over and the drone on the ground.
    pub(super) is_finished: bool,
    /// Whether an actor failed too often.
    gave_up: bool,
    /// Whether the process that started this one is gone.
    is_abandoned: bool,
}

impl Outcome {
    /// What the journal says of the flight.
    pub(super) fn of(mission: &mission::Checkpoint) -> Self {
        let is_landing = matches!(
            mission.state,
            mission::State::MovingToLand | mission::State::Landing | mission::State::Finished
        );
        Self {
            // In flight it may have a reason to land once it is in its slot, and complete the mission before.
            landing: mission.landing.reason.filter(|_| is_landing),
            is_finished: mission.state == mission::State::Finished,
            ..Self::default()
        }
    }

    pub(super) const fn landing(&self) -> Option<LandingReason> {
        self.landing
    }

    pub(super) fn lands(&mut self, reason: LandingReason) {
        self.landing.get_or_insert(reason);
    }

    pub(super) const fn gave_up(&self) -> bool {
        self.gave_up
    }

    /// An actor failed too often: the drone lands without its mission.
    pub(super) fn give_up(&mut self) {
        self.gave_up = true;
        self.lands(LandingReason::ActorGivenUp);
    }

    pub(super) const fn is_abandoned(&self) -> bool {
        self.is_abandoned
    }

    /// The process that started this one is gone, and with it the simulation that the drone flies in.
    pub(super) const fn abandon(&mut self) {
        self.is_abandoned = true;
    }

    /// Whether the process may end, given whether the vehicle is armed.
    pub(super) const fn is_done(&self, is_armed: bool) -> bool {
        // A mission that does not know that the drone flies is finished before the vehicle is on the ground.
        let is_over = self.is_finished || self.gave_up;
        self.is_abandoned || (is_over && !is_armed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn process_that_restarts_while_its_drone_lands_knows_why() {
        let mut mission = mission::Checkpoint {
            state: mission::State::Landing,
            ..mission::Checkpoint::default()
        };
        assert_eq!(Outcome::of(&mission).landing(), None);
        mission.landing.reason = Some(LandingReason::FlightTime);
        let outcome = Outcome::of(&mission);
        assert_eq!(outcome.landing(), Some(LandingReason::FlightTime));
        assert!(!outcome.is_done(false));
        mission.state = mission::State::MovingToWaypoint { waypoint: 1 };
        assert_eq!(Outcome::of(&mission).landing(), None, "not yet");
    }
}
