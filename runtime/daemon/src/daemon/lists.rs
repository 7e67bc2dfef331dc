//! Keeps the newest list of the expelled for the drone's next life, on a thread of its own: a disk may take seconds to say that
//! something will last, and the drone flies meanwhile.
//!
//! A list is obeyed and passed on before it is kept. Nobody who was expelled is to be believed for as long as a disk takes; and
//! should the process end before the list lasts, those to whom it was passed on give it to the next life.

use std::path::PathBuf;

use muster_runtime::file;
use muster_runtime::identity::RevocationList;
use tokio::sync::watch;
use tokio::task::{JoinHandle, spawn_blocking};

/// Takes lists to be kept; of several that come while one is written the newest counts.
pub(super) struct Keeper(watch::Sender<Option<RevocationList>>);

impl Keeper {
    /// Keeps lists in a file. What is returned with it ends once the keeper is gone and all that it took in was kept, or could
    /// not be. Must be called within a runtime.
    pub(super) fn start(path: PathBuf) -> (Self, JoinHandle<()>) {
        let (sender, lists) = watch::channel(None);
        (Self(sender), tokio::spawn(keep(lists, path)))
    }

    pub(super) fn take(&self, list: RevocationList) {
        self.0.send_replace(Some(list));
    }
}

async fn keep(mut lists: watch::Receiver<Option<RevocationList>>, path: PathBuf) {
    while lists.changed().await.is_ok() {
        let Some(list) = lists.borrow_and_update().clone() else {
            continue;
        };
        let (number, path) = (list.number(), path.clone());
        let written = spawn_blocking(move || file::replace(&path, list.written().as_bytes()));
        let kept = written.await.map_err(std::io::Error::from).flatten();
        match kept {
            Ok(()) => tracing::info!(number, "the list of the revoked is kept"),
            Err(error) => {
                tracing::error!(%error, number, "the list of the revoked can't be kept: the next incarnation must be given it");
            }
        }
    }
}
