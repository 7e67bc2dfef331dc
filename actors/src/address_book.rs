use std::sync::Arc;
use std::sync::Mutex;
use std::sync::PoisonError;
use std::sync::atomic::{AtomicUsize, Ordering};

use muster_machines::node::Address;
use ractor::{ActorId, ActorRef};
use thiserror::Error;

use crate::seat::Message;

/// References to a drone's five actors, with a limit on queued messages.
///
/// ractor's mailboxes are unbounded, so messages are admitted here before they are cast.
#[derive(Debug, Clone)]
pub struct AddressBook {
    entries: Arc<[Mutex<Option<Entry>>; 5]>,
    waiting_max: usize,
}

#[derive(Debug)]
struct Entry {
    actor: ActorRef<Message>,
    waiting: Arc<AtomicUsize>,
}

/// A message was not sent to an actor, and dropped.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum CastError {
    /// The actor is not running.
    #[error("the {0} actor is not running")]
    Down(Address),
    /// The actor's queue is full.
    #[error("the queue of the {address} actor is full, with {waiting} messages")]
    Full {
        /// The actor.
        address: Address,
        /// Messages in its queue.
        waiting: usize,
    },
}

impl AddressBook {
    /// An empty book. At most `waiting_max` messages may wait for each actor.
    #[must_use]
    pub fn new(waiting_max: usize) -> Self {
        Self {
            entries: Arc::new(std::array::from_fn(|_| Mutex::new(None))),
            waiting_max,
        }
    }

    /// Sends a message to an actor.
    ///
    /// # Errors
    /// If the actor is down or its queue is full; the message is dropped.
    pub fn cast(&self, address: Address, message: Message) -> Result<(), CastError> {
        let entry = self.entry(address);
        let Some(entry) = &*entry else {
            return Err(CastError::Down(address));
        };
        let waiting = entry.waiting.fetch_add(1, Ordering::Relaxed);
        if waiting >= self.waiting_max {
            entry.waiting.fetch_sub(1, Ordering::Relaxed);
            return Err(CastError::Full { address, waiting });
        }
        entry
            .actor
            .cast(message)
            .map_err(|_| CastError::Down(address))
    }

    /// The most messages that may wait for each actor.
    #[must_use]
    pub const fn waiting_max(&self) -> usize {
        self.waiting_max
    }

    /// Messages in an actor's queue. `None` if the actor is not running.
    #[must_use]
    pub fn waiting(&self, address: Address) -> Option<usize> {
        let entry = self.entry(address);
        Some(entry.as_ref()?.waiting.load(Ordering::Relaxed))
    }

    /// Registers an actor and replaces the previous one. The actor decrements `waiting` for each message it handles.
    pub(crate) fn register(
        &self,
        address: Address,
        actor: ActorRef<Message>,
        waiting: Arc<AtomicUsize>,
    ) {
        *self.entry(address) = Some(Entry { actor, waiting });
    }

    /// Removes an actor by its id and returns its address. `None` if it is not registered.
    pub(crate) fn remove_by_id(&self, id: ActorId) -> Option<Address> {
        Address::ALL.into_iter().find(|address| {
            self.entry(*address)
                .take_if(|entry| entry.actor.get_id() == id)
                .is_some()
        })
    }

    /// Removes and returns the actor at an address. `None` if there is none.
    pub(crate) fn remove(&self, address: Address) -> Option<ActorRef<Message>> {
        Some(self.entry(address).take()?.actor)
    }

    fn entry(&self, address: Address) -> std::sync::MutexGuard<'_, Option<Entry>> {
        self.entries[address as usize]
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
    }
}
