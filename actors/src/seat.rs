use std::fmt;
use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use muster_machines::machine::Stimulus;
use muster_machines::node::{Address, Blueprint, Envelope, NodeMachine, StepOutput};
use ractor::{Actor, ActorProcessingErr, ActorRef};

use crate::environment::Environment;

/// A message to one of the five actors.
#[derive(Debug)]
pub enum Message {
    /// Step the machine.
    Step(Stimulus<Envelope>),
    /// Injected fault: panic.
    Crash,
    /// Injected fault: handle no message until the stall ends.
    Stall(Stall),
}

/// A future that an actor awaits to simulate a hang.
pub struct Stall(pub Pin<Box<dyn Future<Output = ()> + Send>>);

impl fmt::Debug for Stall {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Stall")
    }
}

/// Panic payload of an injected crash. No panic hook is called for it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct InjectedCrash;

/// The actor type of all five actors: it steps its machine.
pub(crate) struct Seat;

/// Arguments of an actor's start.
pub(crate) struct SeatConfig {
    pub(crate) address: Address,
    pub(crate) blueprint: Arc<Blueprint>,
    pub(crate) environment: Arc<dyn Environment>,
    pub(crate) waiting: Arc<AtomicUsize>,
}

/// An actor's state.
pub(crate) struct SeatState {
    config: SeatConfig,
    machine: NodeMachine,
    output: StepOutput,
}

impl SeatState {
    fn step(&mut self, stimulus: Stimulus<Envelope>) {
        let environment = &self.config.environment;
        self.machine
            .step(environment.now(), stimulus, &mut self.output);
        environment.carry_out(self.config.address, &mut self.output);
    }
}

impl Actor for Seat {
    type Msg = Message;
    type State = SeatState;
    type Arguments = SeatConfig;

    async fn pre_start(
        &self,
        _myself: ActorRef<Message>,
        config: SeatConfig,
    ) -> Result<SeatState, ActorProcessingErr> {
        let environment = &config.environment;
        environment.starting(config.address);
        let machine = config.blueprint.build(
            config.address,
            environment.seed(),
            environment.now(),
            &environment.checkpoints(),
        );
        let mut state = SeatState {
            config,
            machine,
            output: StepOutput::default(),
        };
        state.step(Stimulus::Timeout);
        Ok(state)
    }

    async fn handle(
        &self,
        _myself: ActorRef<Message>,
        message: Message,
        state: &mut SeatState,
    ) -> Result<(), ActorProcessingErr> {
        state.config.waiting.fetch_sub(1, Ordering::Relaxed);
        match message {
            Message::Step(stimulus) => state.step(stimulus),
            Message::Crash => std::panic::resume_unwind(Box::new(InjectedCrash)),
            Message::Stall(stall) => stall.0.await,
        }
        Ok(())
    }
}
