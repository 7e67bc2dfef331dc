//! As many mailboxes as a round trip goes through, of actors that do nothing but hand on.

use std::error::Error;
use std::sync::Arc;

use ractor::{Actor, ActorProcessingErr, ActorRef};
use tokio::sync::Notify;

/// A payload goes to its drone's radio, and at the other end to the radio and to the routing; and back.
const HANDED_ON: usize = 6;

/// A row of actors, the last of which tells that a message has come through.
pub(super) struct Mailboxes {
    first: ActorRef<HandOn>,
    came_through: Arc<Notify>,
}

/// What is handed on, boxed as a drone's messages are.
#[derive(Debug)]
struct HandOn;

/// To whom an actor hands on.
enum Next {
    Actor(ActorRef<HandOn>),
    Nobody(Arc<Notify>),
}

struct Mailbox;

impl Actor for Mailbox {
    type Msg = HandOn;
    type State = Next;
    type Arguments = Next;

    async fn pre_start(
        &self,
        _myself: ActorRef<HandOn>,
        next: Next,
    ) -> Result<Next, ActorProcessingErr> {
        Ok(next)
    }

    async fn handle(
        &self,
        _myself: ActorRef<HandOn>,
        message: HandOn,
        next: &mut Next,
    ) -> Result<(), ActorProcessingErr> {
        match next {
            Next::Actor(next) => next.cast(message)?,
            Next::Nobody(came_through) => came_through.notify_one(),
        }
        Ok(())
    }
}

impl Mailboxes {
    /// Starts them; they run as long as their runtime.
    pub(super) async fn open() -> Result<Self, Box<dyn Error>> {
        let came_through = Arc::new(Notify::new());
        let mut next = Next::Nobody(Arc::clone(&came_through));
        for _ in 1..HANDED_ON {
            next = Next::Actor(Actor::spawn(None, Mailbox, next).await?.0);
        }
        let (first, _) = Actor::spawn(None, Mailbox, next).await?;
        Ok(Self {
            first,
            came_through,
        })
    }

    /// Hands a message to the first and waits until it has come through.
    pub(super) async fn round_trip(&self) {
        self.first.cast(HandOn).expect("it runs");
        self.came_through.notified().await;
    }
}
