//! As many mailboxes as in a round trip, of actors that only forward.

use std::error::Error;
use std::sync::Arc;

use ractor::{Actor, ActorProcessingErr, ActorRef};
use tokio::sync::Notify;

/// Mailboxes of a round trip: the sender's radio, the receiver's radio and routing; and back.
const MAILBOXES: usize = 6;

/// A chain of actors; the last one notifies.
pub(super) struct Mailboxes {
    first: ActorRef<Forward>,
    finished: Arc<Notify>,
}

/// The forwarded message, boxed like a drone's messages.
#[derive(Debug)]
struct Forward;

/// Where an actor forwards to.
enum Next {
    Actor(ActorRef<Forward>),
    End(Arc<Notify>),
}

struct Mailbox;

impl Actor for Mailbox {
    type Msg = Forward;
    type State = Next;
    type Arguments = Next;

    async fn pre_start(
        &self,
        _myself: ActorRef<Forward>,
        next: Next,
    ) -> Result<Next, ActorProcessingErr> {
        Ok(next)
    }

    async fn handle(
        &self,
        _myself: ActorRef<Forward>,
        message: Forward,
        next: &mut Next,
    ) -> Result<(), ActorProcessingErr> {
        match next {
            Next::Actor(next) => next.cast(message)?,
            Next::End(finished) => finished.notify_one(),
        }
        Ok(())
    }
}

impl Mailboxes {
    /// Starts the actors; they run until the runtime ends.
    pub(super) async fn open() -> Result<Self, Box<dyn Error>> {
        let finished = Arc::new(Notify::new());
        let mut next = Next::End(Arc::clone(&finished));
        for _ in 1..MAILBOXES {
            next = Next::Actor(Actor::spawn(None, Mailbox, next).await?.0);
        }
        let (first, _) = Actor::spawn(None, Mailbox, next).await?;
        Ok(Self { first, finished })
    }

    /// Sends a message to the first actor and waits until the last one has received it.
    pub(super) async fn round_trip(&self) {
        self.first.cast(Forward).expect("it runs");
        self.finished.notified().await;
    }
}
