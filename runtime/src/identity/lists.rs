//! What a fleet signs: who belongs to it, and who does not any more. The signature covers what the lists say, not how
//! their files are written.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::path::Path;

use bytes::Bytes;
use ed25519_dalek::{SigningKey, VerifyingKey};
use muster_machines::identity::{NodeId, NodeSet};
use muster_machines::wire::PAYLOAD_MAX;
use serde::Deserialize;
use toml::Spanned;

use super::FleetKey;
use super::key::{hex, public_key, read_public, sign};
use crate::diagnostic::{BadInput, Form, TomlFile};

/// What the fleet's signature of a roster begins with, so that it stands for nothing else.
const ROSTER: &[u8] = b"muster roster 1\0";
/// Likewise, of a list of the expelled.
const REVOCATION_LIST: &[u8] = b"muster revoked 1\0";

const ROSTER_FORM: Form = Form {
    fields: &[],
    is: "a roster has `number`, `signature` and, for each drone, `[[drones]]` with `id` and `key`, as `muster keys` writes \
         it",
};
const REVOCATION_LIST_FORM: Form = Form {
    fields: &[],
    is: "a list of the revoked has `number`, `drones` and `signature`, as `muster keys` writes it",
};

/// Which drone of a fleet has which key.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Roster {
    number: u64,
    keys: BTreeMap<NodeId, VerifyingKey>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawRoster {
    number: u64,
    signature: Spanned<String>,
    #[serde(default)]
    drones: Vec<RawDrone>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawDrone {
    id: Spanned<u32>,
    key: Spanned<String>,
}

impl Roster {
    /// Reads a roster that the fleet has signed.
    ///
    /// # Errors
    /// When the file can't be used, names a drone twice, has a key that is none, or is not signed by the fleet's key.
    pub fn load(path: &Path, fleet: &FleetKey) -> Result<Self, BadInput> {
        let file = TomlFile::<RawRoster>::of(path, read_public(path)?, ROSTER_FORM)?;
        let mut roster = Self {
            number: file.raw.number,
            keys: BTreeMap::new(),
        };
        for drone in &file.raw.drones {
            let Some(key) = public_key(drone.key.get_ref()) else {
                let message = "this is not a public key";
                let help = "a public key has 64 hexadecimal digits";
                return Err(file.error_with(drone.key.span(), message, help));
            };
            let before = roster.keys.insert(NodeId(*drone.id.get_ref()), key);
            if before.is_some() {
                let message = "this drone is in the roster twice";
                return Err(file.error(drone.id.span(), message));
            }
        }
        check(&file, fleet, &roster.message(), &file.raw.signature)?;
        Ok(roster)
    }

    /// A drone's public key, if it belongs to the fleet.
    #[must_use]
    pub(super) fn key(&self, id: NodeId) -> Option<&VerifyingKey> {
        self.keys.get(&id)
    }

    /// The drone that has a public key, if it belongs to the fleet.
    #[must_use]
    pub(super) fn whose(&self, key: &[u8; 32]) -> Option<NodeId> {
        let found = self.keys.iter().find(|(_, it)| it.as_bytes() == key);
        found.map(|(id, _)| *id)
    }

    /// Who belongs to the fleet.
    pub fn drones(&self) -> impl Iterator<Item = NodeId> + '_ {
        self.keys.keys().copied()
    }

    /// Takes in another drone; the roster changes.
    pub(super) fn add(&mut self, id: NodeId, key: VerifyingKey) {
        self.number += 1;
        self.keys.insert(id, key);
    }

    /// The file that says this.
    pub(super) fn written(&self, fleet: &SigningKey) -> String {
        let mut text = heading("Who belongs to the fleet", self.number, "");
        put_signature(&mut text, &sign(fleet, &self.message()));
        for (id, key) in &self.keys {
            let key = hex(key.as_bytes());
            let written = write!(text, "\n[[drones]]\nid = {id}\nkey = \"{key}\"\n");
            written.expect(NEVER_FAILS);
        }
        text
    }

    fn message(&self) -> Vec<u8> {
        let mut message = [ROSTER, &self.number.to_le_bytes()].concat();
        for (id, key) in &self.keys {
            message.extend_from_slice(&id.0.to_le_bytes());
            message.extend_from_slice(key.as_bytes());
        }
        message
    }
}

/// How many drones are on a list that is passed on from drone to drone, at most: far more than such a list names.
const PASSED_ON_MAX: usize = 10_000;

/// Who is not believed any more.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RevocationList {
    number: u64,
    drones: BTreeSet<NodeId>,
    /// The fleet's, of both.
    signature: [u8; 64],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawRevocationList {
    number: u64,
    drones: Vec<u32>,
    signature: Spanned<String>,
}

impl RevocationList {
    /// Reads a list that the fleet has signed.
    ///
    /// # Errors
    /// When the file can't be used, or is not signed by the fleet's key.
    pub fn load(path: &Path, fleet: &FleetKey) -> Result<Self, BadInput> {
        let file =
            TomlFile::<RawRevocationList>::of(path, read_public(path)?, REVOCATION_LIST_FORM)?;
        let mut revoked = Self {
            number: file.raw.number,
            drones: file.raw.drones.iter().copied().map(NodeId).collect(),
            signature: [0; 64],
        };
        revoked.signature = check(&file, fleet, &revoked.message(), &file.raw.signature)?;
        Ok(revoked)
    }

    /// A list of nobody, the first that a fleet has.
    pub(super) fn new(fleet: &SigningKey) -> Self {
        let mut revoked = Self {
            number: 0,
            drones: BTreeSet::new(),
            signature: [0; 64],
        };
        revoked.add([], fleet);
        revoked
    }

    /// Reads a list that another drone has passed on; nothing if the fleet has not signed it.
    pub(super) fn from_bytes(passed_on: &[u8], fleet: &FleetKey) -> Option<Self> {
        let (signature, list) = passed_on.split_first_chunk::<64>()?;
        let (number, drones): (u64, NodeSet) = postcard::from_bytes(list).ok()?;
        if drones.len() > PASSED_ON_MAX {
            return None;
        }
        let revoked = Self {
            number,
            drones: drones.iter().collect(),
            signature: *signature,
        };
        let is_signed = fleet.has_signed(&revoked.message(), signature);
        is_signed.then_some(revoked)
    }

    /// The list as it is passed on from drone to drone; nothing if it would not fit a datagram.
    pub(super) fn to_bytes(&self) -> Option<Bytes> {
        let drones: NodeSet = self.drones.iter().copied().collect();
        if drones.len() > PASSED_ON_MAX {
            return None;
        }
        let list = postcard::to_stdvec(&(self.number, drones)).expect("a list has a binary form");
        let passed_on = [&self.signature[..], &list].concat();
        // A packet begins with its kind.
        (passed_on.len() < PAYLOAD_MAX).then(|| passed_on.into())
    }

    /// Whether it can be passed on from drone to drone: it fits a datagram.
    #[must_use]
    pub fn can_be_passed_on(&self) -> bool {
        self.to_bytes().is_some()
    }

    /// A number that rises with each change of the list, from 1.
    #[must_use]
    pub const fn number(&self) -> u64 {
        self.number
    }

    /// Whether a drone is on it.
    #[must_use]
    pub fn has(&self, id: NodeId) -> bool {
        self.drones.contains(&id)
    }

    /// Who is on it.
    pub fn drones(&self) -> impl Iterator<Item = NodeId> + '_ {
        self.drones.iter().copied()
    }

    /// Puts other drones on it, or nobody; the list changes, and is signed.
    pub(super) fn add(&mut self, ids: impl IntoIterator<Item = NodeId>, fleet: &SigningKey) {
        self.number += 1;
        self.drones.extend(ids);
        self.signature = sign(fleet, &self.message());
    }

    /// The file that says this.
    #[must_use]
    pub fn written(&self) -> String {
        let ids: Vec<_> = self.drones.iter().map(ToString::to_string).collect();
        let drones = format!("drones = [{}]\n", ids.join(", "));
        let mut text = heading("Who was revoked from the fleet", self.number, &drones);
        put_signature(&mut text, &self.signature);
        text
    }

    fn message(&self) -> Vec<u8> {
        let mut message = [REVOCATION_LIST, &self.number.to_le_bytes()].concat();
        for id in &self.drones {
            message.extend_from_slice(&id.0.to_le_bytes());
        }
        message
    }
}

const NEVER_FAILS: &str = "writing to a string can't fail";

fn heading(what: &str, number: u64, more: &str) -> String {
    format!(
        "# {what}, signed by its key: `muster keys` writes this file.\nnumber = {number}\n{more}"
    )
}

fn put_signature(text: &mut String, signature: &[u8; 64]) {
    let signature = hex(signature);
    writeln!(text, "signature = \"{signature}\"").expect(NEVER_FAILS);
}

/// The signature, if it is the fleet's.
fn check<T>(
    file: &TomlFile<T>,
    fleet: &FleetKey,
    message: &[u8],
    signature: &Spanned<String>,
) -> Result<[u8; 64], BadInput> {
    let bytes = super::key::bytes::<64>(signature.get_ref());
    if let Some(bytes) = bytes.filter(|it| fleet.has_signed(message, it)) {
        return Ok(bytes);
    }
    let message = "this is not the fleet's signature of what is listed here";
    let help = "take the files as `muster keys` wrote them, all from one fleet's folder, and change nothing in them";
    Err(file.error_with(signature.span(), message, help))
}
