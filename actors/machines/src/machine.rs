//! The shape of every decision a drone takes.

use crate::time::Timestamp;

/// A state machine that owns no socket, no clock, no task and no random source but its own seeded one.
///
/// Whatever drives it calls [`step`] and nothing else.
pub trait Machine {
    /// What it can be told.
    type Input;
    /// What it sends: to the machines beside it, or out of the drone.
    type Transmit;
    /// What can be seen of it from outside: telemetry, and the checkpoints it is rebuilt from.
    type Event;
    /// Our own fault in an input; a peer's fault is counted as an event instead.
    type Rejection: std::error::Error;

    /// Takes one input at `now`.
    ///
    /// # Errors
    /// When the input breaks one of our own invariants; the state is then unchanged.
    fn handle_input(&mut self, now: Timestamp, input: Self::Input) -> Result<(), Self::Rejection>;

    /// Fires every deadline `<= now`; early or repeated calls do nothing.
    fn handle_timeout(&mut self, now: Timestamp);

    /// What is to be done next; to be called until [`Output::Idle`] before anything else is handled.
    fn poll_output(&mut self) -> Output<Self::Transmit, Self::Event>;
}

/// What a [`Machine`] wants done.
#[derive(Debug, Clone, PartialEq)]
#[must_use]
pub enum Output<T, E> {
    /// Send this.
    Transmit(T),
    /// Let this be seen.
    Event(E),
    /// Nothing now; call [`Machine::handle_timeout`] at the deadline.
    Idle {
        /// When the machine next wants to act by itself.
        deadline: Option<Timestamp>,
    },
}

/// Why a machine is stepped.
#[derive(Debug, Clone, PartialEq)]
pub enum Stimulus<I> {
    /// It was told something.
    Input(I),
    /// Its deadline has come, or it has just been built and may have something to say.
    Timeout,
}

/// Changes the machine once, drains what it has to say into `sink` and returns its next deadline.
///
/// # Errors
/// As [`Machine::handle_input`]; nothing has reached the sink then.
pub fn step<M: Machine + ?Sized>(
    machine: &mut M,
    now: Timestamp,
    stimulus: Stimulus<M::Input>,
    mut sink: impl FnMut(Said<M>),
) -> Result<Option<Timestamp>, M::Rejection> {
    match stimulus {
        Stimulus::Input(input) => machine.handle_input(now, input)?,
        Stimulus::Timeout => machine.handle_timeout(now),
    }
    loop {
        match machine.poll_output() {
            Output::Transmit(transmit) => sink(Said::Transmit(transmit)),
            Output::Event(event) => sink(Said::Event(event)),
            Output::Idle { deadline } => return Ok(deadline),
        }
    }
}

/// One output of a [`step`].
#[derive(Debug)]
pub enum Said<M: Machine + ?Sized> {
    /// As [`Output::Transmit`].
    Transmit(M::Transmit),
    /// As [`Output::Event`].
    Event(M::Event),
}

/// The outputs of a machine that wait to be polled.
#[derive(Debug, Clone)]
pub(crate) struct Outbox<T, E>(std::collections::VecDeque<Output<T, E>>);

impl<T, E> Outbox<T, E> {
    pub(crate) const fn new() -> Self {
        Self(std::collections::VecDeque::new())
    }

    pub(crate) fn transmit(&mut self, transmit: T) {
        self.0.push_back(Output::Transmit(transmit));
    }

    pub(crate) fn event(&mut self, event: E) {
        self.0.push_back(Output::Event(event));
    }

    pub(crate) fn poll(&mut self, deadline: Option<Timestamp>) -> Output<T, E> {
        self.0.pop_front().unwrap_or_else(|| {
            // The next output takes the place of the first one again, which is at hand.
            self.0.clear();
            Output::Idle { deadline }
        })
    }
}
