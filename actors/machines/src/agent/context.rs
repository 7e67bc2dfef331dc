//! What an agent can read and do.

use std::time::Duration;

use rand_chacha::ChaCha8Rng;

use super::host::State;
use super::{
    ALTITUDE_MIN_M, Destination, MessageId, Reliability, TELEMETRY_MIN, TIMER_MIN, TimerId, TooMuch,
};
use crate::geometry::{Ned, Velocity};
use crate::identity::{NodeId, NodeSet};
use crate::navigation::Goal;
use crate::time::Timestamp;

/// What an agent can read and do. Positions are relative to home: north, east, down, in metres.
///
/// Goals count once the agent's method returns; of several, the last one does.
#[derive(Debug)]
pub struct Context<'a> {
    pub(super) state: &'a mut State,
    pub(super) now: Timestamp,
}

impl Context<'_> {
    /// Time since the start of the run (in a simulation) or of the process.
    #[must_use]
    pub const fn now(&self) -> Timestamp {
        self.now
    }

    /// This drone.
    #[must_use]
    pub const fn id(&self) -> NodeId {
        self.state.config.id
    }

    /// Number of drones of the swarm at take-off; their ids are 0 to `drones - 1`.
    #[must_use]
    pub const fn drones(&self) -> u32 {
        self.state.config.drones
    }

    /// Drones that are on task, as far as is known, this one included. The leader's knowledge, which reaches the others
    /// with a delay; a drone that hears no leader keeps the last one.
    #[must_use]
    pub const fn drones_on_task(&self) -> &NodeSet {
        &self.state.drones_on_task
    }

    /// The current leader.
    #[must_use]
    pub const fn leader(&self) -> NodeId {
        self.state.leader
    }

    /// Whether this drone leads the swarm.
    #[must_use]
    pub fn is_leader(&self) -> bool {
        self.leader() == self.id()
    }

    /// The drone's slot, where it is at the first [`Agent::start`](super::Agent::start).
    #[must_use]
    pub const fn slot(&self) -> Ned {
        self.state.config.slot
    }

    /// Waypoints of the mission file; waypoint 0 is the centre of the slots.
    #[must_use]
    pub fn waypoints(&self) -> &[Ned] {
        &self.state.config.waypoints
    }

    /// Highest altitude that an agent may fly to, in metres above home.
    #[must_use]
    pub const fn altitude_max_m(&self) -> f64 {
        self.state.config.altitude_max_m
    }

    /// Last known position of this drone: as of the last call of [`Agent::telemetry`](super::Agent::telemetry).
    #[must_use]
    pub const fn position(&self) -> Ned {
        self.state.position
    }

    /// The agent's random generator. Seeded anew at each restart.
    pub const fn rng(&mut self) -> &mut ChaCha8Rng {
        &mut self.state.rng
    }

    /// Flies straight to `to` and holds there. Its altitude is limited to [`ALTITUDE_MIN_M`] and
    /// [`Self::altitude_max_m`].
    ///
    /// # Panics
    /// `to` is not finite, which counts as a failure of the agent.
    pub fn go_to(&mut self, to: Ned) {
        let to = self.within_limits(to);
        self.set_goal(Goal::FlyTo {
            to,
            hold_altitude_m: to.altitude_m(),
        });
    }

    /// Follows a place that moves from `at` at `velocity`. Repeat this at least once a second: without news the drone comes
    /// to rest.
    ///
    /// # Panics
    /// As [`Self::go_to`].
    pub fn track(&mut self, at: Ned, velocity: Velocity) {
        let to = self.within_limits(at);
        assert!(
            velocity.0.iter().all(|it| it.is_finite()),
            "the velocity {velocity:?} is not finite"
        );
        self.set_goal(Goal::Track {
            to,
            hold_altitude_m: to.altitude_m(),
            velocity,
            hold: TRACK_HOLD,
        });
    }

    /// Comes to rest.
    pub fn hold(&mut self) {
        self.set_goal(Goal::Hold);
    }

    /// Leaves the swarm: within its time to live this drone follows nobody, leads nobody and sends no heartbeats. The others
    /// count it as lost. Three times in its time to live it still says where it flies, so that drones give way to each other.
    ///
    /// Messages go on: to neighbours, and over several hops through all that hear them. Members reach it once it has sent a
    /// message that way.
    ///
    /// It can't return. [`Self::leader`] and [`Self::drones_on_task`] stay as they are, and [`Agent::swarm`](super::Agent::swarm)
    /// is called for sent messages only. With succession `land`, a leader that leaves brings the others down. An operator's order
    /// to land reaches members only.
    pub const fn leave(&mut self) {
        self.state.requests.leave();
    }

    /// Comes to rest, descends on the spot and disarms. The agent is not called any more. The other drones are told.
    pub const fn land(&mut self) {
        self.state.requests.land();
    }

    /// Sends a message of at most [`MESSAGE_MAX`](super::MESSAGE_MAX) bytes, to neighbours or to all of at most
    /// [`MESSAGE_FRAME_MAX`](super::MESSAGE_FRAME_MAX). A message to all can't be acknowledged: each hop repeats it, whatever
    /// `reliability` says, and no outcome is told.
    ///
    /// # Errors
    /// The message is too long, or this step has sent too many. Nothing is sent.
    pub fn send(
        &mut self,
        to: Destination,
        payload: &[u8],
        reliability: Reliability,
    ) -> Result<MessageId, TooMuch> {
        self.state.requests.send(to, payload, reliability)
    }

    /// Starts a timer, or restarts it. It expires after at least [`TIMER_MIN`].
    ///
    /// # Panics
    /// [`TIMERS_MAX`](super::TIMERS_MAX) other timers run, which counts as a failure of the agent.
    pub fn set_timer(&mut self, timer: TimerId, after: Duration) {
        self.state
            .timers
            .set(timer, self.now + after.max(TIMER_MIN));
    }

    /// Stops a timer. Does nothing if it does not run.
    pub fn cancel_timer(&mut self, timer: TimerId) {
        self.state.timers.cancel(timer);
    }

    /// The running timers, at most [`TIMERS_MAX`](super::TIMERS_MAX). The next to expire comes first.
    pub fn timers(&self) -> impl Iterator<Item = TimerId> {
        self.state.timers.running()
    }

    /// Calls [`Agent::telemetry`](super::Agent::telemetry) once in `period`, at least [`TELEMETRY_MIN`], from now on until a
    /// restart; `None`: on arrival only, which costs nothing in between.
    pub fn set_telemetry(&mut self, period: Option<Duration>) {
        let period = period.map(|it| it.max(TELEMETRY_MIN));
        self.state.requests.set_telemetry(period);
    }

    /// Keeps a state for the case of a restart; it replaces the last one. It is stored before what this step sends
    /// leaves the drone.
    ///
    /// # Errors
    /// It is longer than [`KEPT_MAX`](super::KEPT_MAX). The last one stays.
    pub fn keep(&mut self, kept: &[u8]) -> Result<(), TooMuch> {
        self.state.requests.keep(kept)
    }

    /// The kept state; `None` if there is none.
    #[must_use]
    pub fn kept(&self) -> Option<&[u8]> {
        let kept = self.state.requests.kept();
        kept.or(self.state.durable.kept.as_deref())
    }

    /// Reports a named value to observers: the report, the log and recordings show it. More than
    /// [`OBSERVATIONS_PER_STEP_MAX`](super::OBSERVATIONS_PER_STEP_MAX) in one step are dropped.
    pub fn observe(&mut self, name: &str, value: f64) {
        self.state.requests.observe(name, value);
    }

    fn set_goal(&mut self, goal: Goal) {
        self.state.requests.set_goal(goal);
    }

    fn within_limits(&self, place: Ned) -> Ned {
        assert!(
            place.0.iter().all(|it| it.is_finite()),
            "the destination {place:?} is not finite"
        );
        let highest_m = self.altitude_max_m().max(ALTITUDE_MIN_M);
        place.at_altitude(place.altitude_m().clamp(ALTITUDE_MIN_M, highest_m))
    }
}

/// How long a drone flies on without a new call of [`Context::track`].
const TRACK_HOLD: Duration = Duration::from_secs(1);
