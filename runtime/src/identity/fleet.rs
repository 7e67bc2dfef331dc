//! The operator's folder of a fleet: its keys and signed lists.

use std::collections::BTreeSet;
use std::fs::{DirBuilder, File};
use std::io;
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};

use ed25519_dalek::SigningKey;
use muster_machines::identity::NodeId;
use thiserror::Error;

use super::key::{generate_key, key_exists, load_secret, write_public, write_secret};
use super::{FleetKey, Grant, Manifest, RevocationList, Roster};
use crate::diagnostic::BadInput;
use crate::file::replace;

/// A fleet's keys could not be created, or its lists not changed.
#[derive(Debug, Error)]
pub enum KeysError {
    /// A file in the folder can't be used, or a key exists already; nothing was written.
    #[error(transparent)]
    Refused(#[from] BadInput),
    /// The system's fault: a file could not be written; earlier files were.
    #[error("can't write {}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The system's error.
        #[source]
        source: io::Error,
    },
    /// The system's fault: its random generator failed; nothing was written.
    #[error("the system's random generator failed")]
    Random(#[source] getrandom::Error),
}

/// An open fleet folder, with the fleet's secret key.
pub struct Fleet {
    folder: PathBuf,
    key: SigningKey,
    /// Lock of the folder, so that two commands don't sign different lists with the same number.
    _lock: File,
}

impl std::fmt::Debug for Fleet {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Fleet").field(&self.folder).finish()
    }
}

impl Fleet {
    /// Creates a fleet's key in a folder, and signs an empty roster and an empty revocation list. Creates the folder if
    /// necessary.
    ///
    /// # Errors
    /// If the folder has a fleet's key already, or can't be written to.
    pub fn create(folder: &Path) -> Result<Self, KeysError> {
        let made = DirBuilder::new().recursive(true).mode(0o700).create(folder);
        made.map_err(|source| KeysError::Write {
            path: folder.to_owned(),
            source,
        })?;
        let key = generate_key()?;
        write_secret(&folder.join("fleet.key"), &key)?;
        let lock = lock(folder)?;
        write_public(&folder.join("fleet.pub"), &key.verifying_key())?;
        let folder = folder.to_owned();
        let fleet = Self {
            folder,
            key,
            _lock: lock,
        };
        fleet.write("roster.toml", &Roster::default().to_toml(&fleet.key))?;
        fleet.write("revoked.toml", &RevocationList::new(&fleet.key).to_toml())?;
        Ok(fleet)
    }

    /// Opens a fleet's folder; waits while another command has it locked.
    ///
    /// # Errors
    /// If its secret key can't be used.
    pub fn open(folder: &Path) -> Result<Self, KeysError> {
        let path = folder.join("fleet.key");
        if !path.exists() {
            let help = format!(
                "`muster keys fleet {}` creates a fleet's key",
                folder.display()
            );
            let message = "there is no such file: this folder is not that of a fleet";
            return Err(BadInput::without_excerpt(&path, message, help).into());
        }
        let key = load_secret(&path)?;
        let lock = lock(folder)?;
        let folder = folder.to_owned();
        Ok(Self {
            folder,
            key,
            _lock: lock,
        })
    }

    /// Refuses drones that [`Self::add_drone`] would refuse, so that none of several is added.
    ///
    /// # Errors
    /// If one is in the roster or has a key file already, or the roster can't be used.
    pub fn check_new(&self, ids: &BTreeSet<NodeId>) -> Result<(), KeysError> {
        let roster = Roster::load(&self.folder.join("roster.toml"), &self.public())?;
        ids.iter()
            .try_for_each(|id| self.new_key_path(&roster, *id).map(drop))
    }

    /// Path of the key file of a drone that has none yet.
    fn new_key_path(&self, roster: &Roster, id: NodeId) -> Result<PathBuf, KeysError> {
        let path = self.folder.join(format!("drone-{id}.key"));
        if roster.key(id).is_some() || path.exists() {
            return Err(key_exists(&path).into());
        }
        Ok(path)
    }

    /// Creates a drone's key and adds the drone to the roster. Returns the path of the key file.
    ///
    /// # Errors
    /// If the drone is in the roster or has a key file already, or the folder's files can't be used or written.
    pub fn add_drone(&self, id: NodeId) -> Result<PathBuf, KeysError> {
        let mut roster = Roster::load(&self.folder.join("roster.toml"), &self.public())?;
        let path = self.new_key_path(&roster, id)?;
        let key = generate_key()?;
        write_secret(&path, &key)?;
        roster.add(id, key.verifying_key());
        self.write("roster.toml", &roster.to_toml(&self.key))?;
        Ok(path)
    }

    /// Adds drones to the revocation list and increments its number. Returns the list.
    ///
    /// # Errors
    /// If a drone is not in the roster, or the folder's files can't be used or written.
    pub fn revoke(&self, ids: &[NodeId]) -> Result<RevocationList, KeysError> {
        let roster_path = self.folder.join("roster.toml");
        let roster = Roster::load(&roster_path, &self.public())?;
        if let Some(unlisted) = ids.iter().find(|id| roster.key(**id).is_none()) {
            let message = format!("drone {unlisted} is not in the roster");
            let help = "only drones in the roster can be revoked";
            return Err(BadInput::without_excerpt(&roster_path, message, help).into());
        }
        let mut revoked = RevocationList::load(&self.folder.join("revoked.toml"), &self.public())?;
        revoked.add(ids.iter().copied(), &self.key);
        self.write("revoked.toml", &revoked.to_toml())?;
        Ok(revoked)
    }

    /// Signs a grant. It replaces the drone's last one. Returns its path.
    ///
    /// # Errors
    /// If its drone is not in the roster or revoked, or the folder's files can't be used or written.
    pub fn grant(&self, grant: &Grant) -> Result<PathBuf, KeysError> {
        let roster_path = self.folder.join("roster.toml");
        let roster = Roster::load(&roster_path, &self.public())?;
        let revoked = RevocationList::load(&self.folder.join("revoked.toml"), &self.public())?;
        let id = grant.drone;
        if roster.key(id).is_none() || revoked.has(id) {
            let message = format!("drone {id} is not in the roster, or revoked");
            let help = "only drones of the fleet are granted a stage";
            return Err(BadInput::without_excerpt(&roster_path, message, help).into());
        }
        let name = format!("drone-{id}.grant");
        self.write(&name, &grant.to_toml(&self.key))?;
        Ok(self.folder.join(name))
    }

    /// A drone's last grant. `None` if it has none.
    ///
    /// # Errors
    /// If its file can't be used, or another fleet's key signed it.
    pub fn last_grant(&self, id: NodeId) -> Result<Option<Grant>, BadInput> {
        let path = self.folder.join(format!("drone-{id}.grant"));
        path.exists()
            .then(|| Grant::load(&path, &self.public()))
            .transpose()
    }

    /// Signs a release's manifest. Returns its text.
    #[must_use]
    pub fn sign_release(&self, manifest: &Manifest) -> String {
        manifest.to_toml(&self.key)
    }

    #[cfg(test)]
    pub(super) const fn key(&self) -> &SigningKey {
        &self.key
    }

    /// The fleet's public key.
    #[must_use]
    pub fn public(&self) -> FleetKey {
        FleetKey(self.key.verifying_key())
    }

    fn write(&self, name: &str, text: &str) -> Result<(), KeysError> {
        let path = self.folder.join(name);
        replace(&path, text.as_bytes()).map_err(|source| KeysError::Write { path, source })
    }
}

/// Locks a fleet's folder; waits while another command has it locked.
fn lock(folder: &Path) -> Result<File, KeysError> {
    let locked = File::open(folder).and_then(|folder| folder.lock().map(|()| folder));
    locked.map_err(|source| KeysError::Write {
        path: folder.to_owned(),
        source,
    })
}
