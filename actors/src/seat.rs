use std::fmt;
use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use muster_machines::machine::Stimulus;
use muster_machines::node::{Address, Blueprint, Envelope, NodeMachine, StepOutput};
use ractor::{Actor, ActorProcessingErr, ActorRef};

use crate::environment::Environment;

/// What one of the five actors is told.
#[derive(Debug)]
pub enum Message {
    /// Step the machine.
    Step(Stimulus<Envelope>),
    /// A fault plan's: panic now.
    Crash,
    /// A fault plan's: do nothing until this is over.
    Stall(Stall),
}

/// For how long an actor does nothing.
pub struct Stall(pub Pin<Box<dyn Future<Output = ()> + Send>>);

impl fmt::Debug for Stall {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Stall")
    }
}

/// What a fault plan makes an actor panic with; no panic hook is called for it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct InjectedCrash;

/// The actor that all five are: it has a machine in its seat and steps it.
pub(crate) struct Seat;

/// What an actor is started with.
pub(crate) struct SeatConfig {
    pub(crate) address: Address,
    pub(crate) blueprint: Arc<Blueprint>,
    pub(crate) environment: Arc<dyn Environment>,
    pub(crate) waiting: Arc<AtomicUsize>,
}

/// What an actor has.
pub(crate) struct Occupied {
    config: SeatConfig,
    machine: NodeMachine,
    output: StepOutput,
}

impl Occupied {
    fn step(&mut self, stimulus: Stimulus<Envelope>) {
        let environment = &self.config.environment;
        self.machine
            .step(environment.now(), stimulus, &mut self.output);
        environment.carry_out(self.config.address, &mut self.output);
    }
}

impl Actor for Seat {
    type Msg = Message;
    type State = Occupied;
    type Arguments = SeatConfig;

    async fn pre_start(
        &self,
        _myself: ActorRef<Message>,
        config: SeatConfig,
    ) -> Result<Occupied, ActorProcessingErr> {
        let environment = &config.environment;
        environment.starting(config.address);
        let machine = config.blueprint.build(
            config.address,
            environment.seed(),
            environment.now(),
            &environment.checkpoints(),
        );
        let mut occupied = Occupied {
            config,
            machine,
            output: StepOutput::default(),
        };
        occupied.step(Stimulus::Timeout);
        Ok(occupied)
    }

    async fn handle(
        &self,
        _myself: ActorRef<Message>,
        message: Message,
        occupied: &mut Occupied,
    ) -> Result<(), ActorProcessingErr> {
        occupied.config.waiting.fetch_sub(1, Ordering::Relaxed);
        match message {
            Message::Step(stimulus) => occupied.step(stimulus),
            Message::Crash => std::panic::resume_unwind(Box::new(InjectedCrash)),
            Message::Stall(stall) => stall.0.await,
        }
        Ok(())
    }
}
