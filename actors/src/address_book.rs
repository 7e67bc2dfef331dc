use std::sync::Arc;
use std::sync::Mutex;
use std::sync::PoisonError;
use std::sync::atomic::{AtomicUsize, Ordering};

use muster_machines::node::Address;
use ractor::{ActorId, ActorRef};
use thiserror::Error;

use crate::seat::Message;

/// Where the five actors of one drone are to be found, and how much may wait for each.
///
/// An actor's own mailbox takes any number of messages, so admission happens here, before anything is cast.
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

/// Why a message was not handed to an actor; it is dropped.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum Refused {
    /// The actor is not running.
    #[error("the {0} actor is not running")]
    Down(Address),
    /// As many messages wait for it as may.
    #[error("{waiting} messages wait for the {address} actor already")]
    Full {
        /// Which actor.
        address: Address,
        /// How many wait.
        waiting: usize,
    },
}

impl AddressBook {
    /// An empty book; at most `waiting_max` messages are to wait for any actor.
    #[must_use]
    pub fn new(waiting_max: usize) -> Self {
        Self {
            entries: Arc::new(std::array::from_fn(|_| Mutex::new(None))),
            waiting_max,
        }
    }

    /// Hands a message to an actor.
    ///
    /// # Errors
    /// When the actor is down or has too much to do already; the message is dropped.
    pub fn cast(&self, address: Address, message: Message) -> Result<(), Refused> {
        let entry = self.entry(address);
        let Some(entry) = &*entry else {
            return Err(Refused::Down(address));
        };
        let waiting = entry.waiting.fetch_add(1, Ordering::Relaxed);
        if waiting >= self.waiting_max {
            entry.waiting.fetch_sub(1, Ordering::Relaxed);
            return Err(Refused::Full { address, waiting });
        }
        entry
            .actor
            .cast(message)
            .map_err(|_| Refused::Down(address))
    }

    /// How many messages may wait for any actor.
    #[must_use]
    pub const fn waiting_max(&self) -> usize {
        self.waiting_max
    }

    /// How many messages wait for an actor; nothing for one that is not running.
    #[must_use]
    pub fn waiting(&self, address: Address) -> Option<usize> {
        let entry = self.entry(address);
        Some(entry.as_ref()?.waiting.load(Ordering::Relaxed))
    }

    /// Enters an actor in the place of the one before; `waiting` is what it takes one from for each message.
    pub(crate) fn enter(
        &self,
        address: Address,
        actor: ActorRef<Message>,
        waiting: Arc<AtomicUsize>,
    ) {
        *self.entry(address) = Some(Entry { actor, waiting });
    }

    /// Strikes an actor out; which one it was.
    pub(crate) fn strike_out(&self, id: ActorId) -> Option<Address> {
        Address::ALL.into_iter().find(|address| {
            self.entry(*address)
                .take_if(|entry| entry.actor.get_id() == id)
                .is_some()
        })
    }

    /// Removes the actor at an address, and returns it.
    pub(crate) fn remove(&self, address: Address) -> Option<ActorRef<Message>> {
        Some(self.entry(address).take()?.actor)
    }

    fn entry(&self, address: Address) -> std::sync::MutexGuard<'_, Option<Entry>> {
        self.entries[address as usize]
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
    }
}
