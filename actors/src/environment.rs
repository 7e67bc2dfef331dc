use muster_machines::node::{Address, Checkpoints, StepOutput};
use muster_machines::supervision::RestartDecision;
use muster_machines::time::Timestamp;

/// A drone's connections to its world: clock, random seeds, journal, timers, message delivery, transport, vehicle and
/// observers.
///
/// It is the only difference between a simulation and an aircraft.
pub trait Environment: Send + Sync + 'static {
    /// The current time.
    fn now(&self) -> Timestamp;

    /// The random seed of the next machine that is built.
    fn seed(&self) -> u64;

    /// The newest checkpoints, which machines are rebuilt from.
    fn checkpoints(&self) -> Checkpoints;

    /// Executes a step's effects in order, and sets the machine's timer. Leaves `output` empty, for its memory is reused.
    fn carry_out(&self, from: Address, output: &mut StepOutput);

    /// Called when an actor failed. Drops its queued messages and its timer, and executes the decision. A restart is due when
    /// the back-off has passed: the environment then sends [`SupervisorMessage::Restart`].
    ///
    /// [`SupervisorMessage::Restart`]: crate::SupervisorMessage::Restart
    fn failed(&self, address: Address, decision: RestartDecision);

    /// Called before an actor is started or restarted.
    fn starting(&self, address: Address);
}
