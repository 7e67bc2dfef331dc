//! The revocation list in force, and its copy on the disk for the next incarnation.
//!
//! A list takes effect and is forwarded before it is on the disk, which may take seconds. If the process ends before, other
//! drones give the list to the next incarnation.

use std::path::PathBuf;
use std::sync::Arc;

use muster_runtime::file;
use muster_runtime::identity::{Ed25519Authenticator, RevocationList};
use tokio::sync::watch;
use tokio::task::{JoinHandle, spawn_blocking};

/// The drone's revocation list.
pub(super) struct Revocations {
    authenticator: Arc<Ed25519Authenticator>,
    /// `None` once the process ends.
    store: Option<Store>,
}

impl Revocations {
    pub(super) const fn new(authenticator: Arc<Ed25519Authenticator>, store: Store) -> Self {
        Self {
            authenticator,
            store: Some(store),
        }
    }

    /// A newer list is in force: stores it. Returns whether this drone itself is on it.
    pub(super) fn store_newest(&self) -> bool {
        let list = self.authenticator.revoked();
        let number = list.number();
        if !list.fits_datagram() {
            tracing::warn!(number, "the revocation list is too long to be forwarded");
        }
        if let Some(store) = &self.store {
            store.replace(list);
        }
        let is_revoked = self.authenticator.is_revoked();
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
