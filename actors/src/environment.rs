use muster_machines::node::{Address, Checkpoints, StepOutput};
use muster_machines::supervision::RestartDecision;
use muster_machines::time::Timestamp;

/// All that a drone's actors have of the world: its clock, its random source, its journal, its timers, the way to
/// each other, to the transport and to the vehicle, and whoever watches.
///
/// A simulation and an aircraft differ in nothing but this.
pub trait Environment: Send + Sync + 'static {
    /// What time it is.
    fn now(&self) -> Timestamp;

    /// What a newly built machine draws its lots from.
    fn seed(&self) -> u64;

    /// What outlived the machines before.
    fn checkpoints(&self) -> Checkpoints;

    /// Does what a step asks for, in order, and sets the machine's one timer; the reaction's memory is used again.
    fn carry_out(&self, from: Address, output: &mut StepOutput);

    /// An actor failed: what it was told and is still waiting is dropped, its timer too; then the verdict is carried
    /// out. A restart is asked for, when its time has come, by [`SupervisorMessage::Restart`].
    ///
    /// [`SupervisorMessage::Restart`]: crate::SupervisorMessage::Restart
    fn failed(&self, address: Address, decision: RestartDecision);

    /// An actor is about to be built anew, or for the first time.
    fn starting(&self, address: Address);
}
