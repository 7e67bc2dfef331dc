//! The revocation list in force, and its copy on the disk for the next incarnation.
//!
//! A list takes effect and is forwarded before it is on the disk, which may take seconds. If the process ends before, other
//! drones give the list to the next incarnation.

use std::path::PathBuf;

use muster_machines::identity::NodeId;
use muster_machines::radio::Revoked;
use muster_runtime::file;
use muster_runtime::identity::{FleetKey, RevocationList};
use thiserror::Error;
use tokio::sync::watch;
use tokio::task::{JoinHandle, spawn_blocking};

/// The drone's revocation list. The radio has its own copy, which is given to it as an input.
///
/// Invariant: the number of the list in force never falls.
pub(super) struct Revocations {
    /// The drone itself.
    id: NodeId,
    fleet: FleetKey,
    /// The list in force, which the network watches.
    in_force: watch::Sender<RevocationList>,
    /// Whether the radio has yet to get the list in force.
    is_due: bool,
    /// `None` once the process ends.
    store: Option<Store>,
}

/// An offered revocation list is older than the known one, which is kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error("revocation list {offered} is older than the known list {known}")]
pub(super) struct OutdatedList {
    known: u64,
    offered: u64,
}

impl Revocations {
    /// For drone `id` of a fleet.
    pub(super) const fn new(
        (id, fleet): (NodeId, FleetKey),
        in_force: watch::Sender<RevocationList>,
        store: Store,
    ) -> Self {
        Self {
            id,
            fleet,
            in_force,
            is_due: false,
            store: Some(store),
        }
    }

    /// The list in force, as the radio applies it.
    pub(super) fn revoked(&self) -> Revoked {
        self.in_force.borrow().revoked()
    }

    /// Puts the operator's list in force, if it is newer or the same one. Returns whether this drone itself is on it.
    ///
    /// # Errors
    /// If the list is older than the known one, which is kept.
    pub(super) fn replace(&mut self, list: RevocationList) -> Result<bool, OutdatedList> {
        let (known, offered) = (self.in_force.borrow().number(), list.number());
        if offered < known {
            return Err(OutdatedList { known, offered });
        }
        self.is_due = true;
        Ok(self.put_in_force(list))
    }

    /// Keeps a newer list that the radio has from another drone, in the form in which drones forward it. Returns whether
    /// this drone itself is on it.
    pub(super) fn keep(&mut self, forwarded: &[u8]) -> bool {
        let list = RevocationList::from_bytes(forwarded, &self.fleet);
        let known = self.in_force.borrow().number();
        let newer = list.filter(|it| it.number() > known);
        newer.is_some_and(|list| self.put_in_force(list))
    }

    /// The list that the radio has yet to get, for `deliver`, which returns whether the radio had room.
    pub(super) fn deliver(&mut self, deliver: impl FnOnce(Revoked) -> bool) {
        if self.is_due && deliver(self.revoked()) {
            self.is_due = false;
        }
    }

    fn put_in_force(&self, list: RevocationList) -> bool {
        let number = list.number();
        if !list.fits_datagram() {
            tracing::warn!(number, "the revocation list is too long to be forwarded");
        }
        let is_revoked = list.has(self.id);
        if let Some(store) = &self.store {
            store.replace(list.clone());
        }
        self.in_force.send_replace(list);
        if is_revoked {
            tracing::error!(number, "the key of this drone is revoked: it lands");
        }
        is_revoked
    }

    /// Stores no further lists.
    pub(super) fn close(&mut self) {
        self.store = None;
    }
}

/// Writes revocation lists to a file, on another thread. Of several that arrive during a write only the newest is written.
pub(super) struct Store(watch::Sender<Option<RevocationList>>);

impl Store {
    /// A store for a file. The returned task ends after the store is dropped and its last list is written, or could not be.
    /// Must be called within a runtime.
    pub(super) fn start(path: PathBuf) -> (Self, JoinHandle<()>) {
        let (sender, lists) = watch::channel(None);
        (Self(sender), tokio::spawn(write_all(lists, path)))
    }

    fn replace(&self, list: RevocationList) {
        self.0.send_replace(Some(list));
    }
}

async fn write_all(mut lists: watch::Receiver<Option<RevocationList>>, path: PathBuf) {
    while lists.changed().await.is_ok() {
        let Some(list) = lists.borrow_and_update().clone() else {
            continue;
        };
        let (number, path) = (list.number(), path.clone());
        let write = spawn_blocking(move || file::replace(&path, list.to_toml().as_bytes()));
        match write.await.map_err(std::io::Error::from).flatten() {
            Ok(()) => tracing::info!(number, "the revocation list is stored"),
            Err(error) => tracing::error!(
                %error,
                number,
                "the revocation list can't be stored: other drones must give it to the next incarnation"
            ),
        }
    }
}
