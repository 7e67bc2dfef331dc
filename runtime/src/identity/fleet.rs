//! A fleet's folder, as its operator keeps it.

use std::fs::{DirBuilder, File};
use std::io;
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};

use ed25519_dalek::SigningKey;
use muster_machines::identity::NodeId;
use thiserror::Error;

use super::key::{fresh, is_there, load_secret, write_public, write_secret};
use super::{FleetKey, RevocationList, Roster};
use crate::diagnostic::BadInput;
use crate::file::replace;

/// Why a fleet's keys could not be made or its lists changed.
#[derive(Debug, Error)]
pub enum KeysError {
    /// A file of the folder can't be used, or a key is there already; nothing was written.
    #[error(transparent)]
    Refused(#[from] BadInput),
    /// The machine's fault: a file could not be written, and those before it were.
    #[error("can't write {}", path.display())]
    Write {
        /// Which file.
        path: PathBuf,
        /// What the system says.
        #[source]
        source: io::Error,
    },
    /// The machine's fault: there are no random numbers; nothing was written.
    #[error("the system has no random numbers")]
    Random(#[source] getrandom::Error),
}

/// A fleet's folder, with its secret key.
pub struct Fleet {
    folder: PathBuf,
    key: SigningKey,
    /// Held so that two commands don't sign two different lists with one number.
    _lock: File,
}

impl std::fmt::Debug for Fleet {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Fleet").field(&self.folder).finish()
    }
}

impl Fleet {
    /// Makes a fleet's key in a folder, which is made if it is not there, and signs an empty roster and an empty list of
    /// the expelled.
    ///
    /// # Errors
    /// When the folder has a fleet's key already, or can't be written to.
    pub fn create(folder: &Path) -> Result<Self, KeysError> {
        let made = DirBuilder::new().recursive(true).mode(0o700).create(folder);
        made.map_err(|source| KeysError::Write {
            path: folder.to_owned(),
            source,
        })?;
        let key = fresh()?;
        write_secret(&folder.join("fleet.key"), &key)?;
        let lock = lock(folder)?;
        write_public(&folder.join("fleet.pub"), &key.verifying_key())?;
        let folder = folder.to_owned();
        let fleet = Self {
            folder,
            key,
            _lock: lock,
        };
        fleet.write("roster.toml", &Roster::default().written(&fleet.key))?;
        fleet.write("revoked.toml", &RevocationList::new(&fleet.key).written())?;
        Ok(fleet)
    }

    /// Opens a fleet's folder.
    ///
    /// # Errors
    /// When its secret key can't be used.
    pub fn open(folder: &Path) -> Result<Self, KeysError> {
        let key = load_secret(&folder.join("fleet.key"))?;
        let lock = lock(folder)?;
        let folder = folder.to_owned();
        Ok(Self {
            folder,
            key,
            _lock: lock,
        })
    }

    /// Makes a drone's key and takes the drone into the roster; the key's file.
    ///
    /// # Errors
    /// When the drone is in the roster already, there is a key for it, or the folder's files can't be used or written.
    pub fn add_drone(&self, id: NodeId) -> Result<PathBuf, KeysError> {
        let mut roster = Roster::load(&self.folder.join("roster.toml"), &self.public())?;
        let path = self.folder.join(format!("drone-{id}.key"));
        if roster.key(id).is_some() {
            return Err(is_there(&path).into());
        }
        let key = fresh()?;
        write_secret(&path, &key)?;
        roster.add(id, key.verifying_key());
        self.write("roster.toml", &roster.written(&self.key))?;
        Ok(path)
    }

    /// Expels drones: puts them on the list, whose number rises; the list.
    ///
    /// # Errors
    /// When a drone is not in the roster, or the folder's files can't be used or written.
    pub fn revoke(&self, ids: &[NodeId]) -> Result<RevocationList, KeysError> {
        let roster_path = self.folder.join("roster.toml");
        let roster = Roster::load(&roster_path, &self.public())?;
        if let Some(stranger) = ids.iter().find(|id| roster.key(**id).is_none()) {
            let message = format!("drone {stranger} is not in the roster");
            let help = "only a drone of the fleet can be revoked from it";
            return Err(BadInput::without_excerpt(&roster_path, message, help).into());
        }
        let mut revoked = RevocationList::load(&self.folder.join("revoked.toml"), &self.public())?;
        revoked.add(ids.iter().copied(), &self.key);
        self.write("revoked.toml", &revoked.written())?;
        Ok(revoked)
    }

    #[cfg(test)]
    pub(super) const fn key(&self) -> &SigningKey {
        &self.key
    }

    fn public(&self) -> FleetKey {
        FleetKey(self.key.verifying_key())
    }

    fn write(&self, name: &str, text: &str) -> Result<(), KeysError> {
        let path = self.folder.join(name);
        replace(&path, text.as_bytes()).map_err(|source| KeysError::Write { path, source })
    }
}

/// Waits until no other command has a fleet's folder, and has it.
fn lock(folder: &Path) -> Result<File, KeysError> {
    let locked = File::open(folder).and_then(|folder| folder.lock().map(|()| folder));
    locked.map_err(|source| KeysError::Write {
        path: folder.to_owned(),
        source,
    })
}
