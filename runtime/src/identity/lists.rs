//! The lists that a fleet's key signs: the roster and the revocation list. A signature covers a list's entries and number,
//! not the text of its file.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::path::Path;

use bytes::Bytes;
use ed25519_dalek::{SigningKey, VerifyingKey};
use muster_machines::identity::{NodeId, NodeSet};
use muster_machines::radio::Revoked;
use muster_machines::wire::PAYLOAD_MAX;
use serde::Deserialize;

use super::FleetKey;
use super::key::{hex, public_key, read_public, sign};
use crate::diagnostic::{BadInput, FileFormat, TomlFile};
use crate::schema::{FieldList, Located};

/// Prefix of a signed roster, so that its signature fits no other message.
const ROSTER: &[u8] = b"muster roster 1\0";
/// Prefix of a signed revocation list.
const REVOCATION_LIST: &[u8] = b"muster revoked 1\0";

const ROSTER_FORMAT: FileFormat = FileFormat {
    fields: FieldList::EMPTY,
    description: "a roster has `number`, `signature` and, for each drone, `[[drones]]` with `id` and `key`, as `muster keys` writes \
         it",
};
const REVOCATION_LIST_FORMAT: FileFormat = FileFormat {
    fields: FieldList::EMPTY,
    description: "a revocation list has `number`, `drones` and `signature`, as `muster keys` writes it",
};

/// Signed list of a fleet's drones and their public keys.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Roster {
    number: u64,
    keys: BTreeMap<NodeId, VerifyingKey>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawRoster {
    number: u64,
    signature: Located<String>,
    #[serde(default)]
    drones: Vec<RawDrone>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawDrone {
    id: Located<u32>,
    key: Located<String>,
}

impl Roster {
    /// Reads a roster and verifies its signature.
    ///
    /// # Errors
    /// If the file can't be used, lists a drone twice, has an invalid key, or is not signed by the fleet's key.
    pub fn load(path: &Path, fleet: &FleetKey) -> Result<Self, BadInput> {
        let file = TomlFile::<RawRoster>::parse(path, read_public(path)?, ROSTER_FORMAT)?;
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
        verify(&file, fleet, &roster.message(), &file.raw.signature)?;
        Ok(roster)
    }

    /// A drone's public key. `None` if the drone is not in the roster.
    #[must_use]
    pub(super) fn key(&self, id: NodeId) -> Option<&VerifyingKey> {
        self.keys.get(&id)
    }

    /// The drone with this public key. `None` if no drone has it.
    #[must_use]
    pub(super) fn drone_with_key(&self, key: &[u8; 32]) -> Option<NodeId> {
        let found = self.keys.iter().find(|(_, it)| it.as_bytes() == key);
        found.map(|(id, _)| *id)
    }

    /// The drones of the fleet, in rising order.
    pub fn drones(&self) -> impl Iterator<Item = NodeId> + '_ {
        self.keys.keys().copied()
    }

    /// Adds a drone and increments the roster's number.
    pub(super) fn add(&mut self, id: NodeId, key: VerifyingKey) {
        self.number += 1;
        self.keys.insert(id, key);
    }

    /// The list as a TOML file.
    pub(super) fn to_toml(&self, fleet: &SigningKey) -> String {
        let mut text = heading("The fleet's roster", self.number, "");
        append_signature(&mut text, &sign(fleet, &self.message()));
        for (id, key) in &self.keys {
            let key = hex(key.as_bytes());
            write!(text, "\n[[drones]]\nid = {id}\nkey = \"{key}\"\n").expect(NEVER_FAILS);
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

/// The most drones on a revocation list that drones forward to each other.
const FORWARDED_MAX: usize = 10_000;

/// Signed list of drones whose keys are not trusted any more.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RevocationList {
    number: u64,
    drones: BTreeSet<NodeId>,
    /// The fleet's signature of number and drones.
    signature: [u8; 64],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawRevocationList {
    number: u64,
    drones: Vec<u32>,
    signature: Located<String>,
}

impl RevocationList {
    /// Reads a list and verifies its signature.
    ///
    /// # Errors
    /// If the file can't be used, or is not signed by the fleet's key.
    pub fn load(path: &Path, fleet: &FleetKey) -> Result<Self, BadInput> {
        let file =
            TomlFile::<RawRevocationList>::parse(path, read_public(path)?, REVOCATION_LIST_FORMAT)?;
        let mut revoked = Self {
            number: file.raw.number,
            drones: file.raw.drones.iter().copied().map(NodeId).collect(),
            signature: [0; 64],
        };
        revoked.signature = verify(&file, fleet, &revoked.message(), &file.raw.signature)?;
        Ok(revoked)
    }

    /// A fleet's first list: number 1, without drones.
    pub(super) fn new(fleet: &SigningKey) -> Self {
        let mut revoked = Self {
            number: 0,
            drones: BTreeSet::new(),
            signature: [0; 64],
        };
        revoked.add([], fleet);
        revoked
    }

    /// Decodes a list that another drone forwarded. `None` if it is malformed or not signed by the fleet's key.
    #[must_use]
    pub fn from_bytes(forwarded: &[u8], fleet: &FleetKey) -> Option<Self> {
        let (signature, list) = forwarded.split_first_chunk::<64>()?;
        let (number, drones): (u64, NodeSet) = postcard::from_bytes(list).ok()?;
        if drones.len() > FORWARDED_MAX {
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

    /// Encodes the list for forwarding between drones. `None` if it would not fit into a datagram.
    pub(super) fn to_bytes(&self) -> Option<Bytes> {
        let drones: NodeSet = self.drones.iter().copied().collect();
        if drones.len() > FORWARDED_MAX {
            return None;
        }
        let list = postcard::to_stdvec(&(self.number, drones)).expect("a list has a binary form");
        let forwarded = [&self.signature[..], &list].concat();
        // Not equal: a packet begins with a byte for its kind.
        (forwarded.len() < PAYLOAD_MAX).then(|| forwarded.into())
    }

    /// Whether the list fits into a datagram, so that drones can forward it to each other.
    #[must_use]
    pub fn fits_datagram(&self) -> bool {
        self.to_bytes().is_some()
    }

    /// The list's number: from 1, incremented at each change.
    #[must_use]
    pub const fn number(&self) -> u64 {
        self.number
    }

    /// The list as a radio applies it and passes it on.
    #[must_use]
    pub fn revoked(&self) -> Revoked {
        Revoked {
            number: self.number,
            drones: self.drones.iter().copied().collect(),
            signed: self.to_bytes(),
        }
    }

    /// Whether a drone is revoked.
    #[must_use]
    pub fn has(&self, id: NodeId) -> bool {
        self.drones.contains(&id)
    }

    /// The revoked drones, in rising order.
    pub fn drones(&self) -> impl Iterator<Item = NodeId> + '_ {
        self.drones.iter().copied()
    }

    /// Adds drones, increments the number and signs the list.
    pub(super) fn add(&mut self, ids: impl IntoIterator<Item = NodeId>, fleet: &SigningKey) {
        self.number += 1;
        self.drones.extend(ids);
        self.signature = sign(fleet, &self.message());
    }

    /// The list as a TOML file.
    #[must_use]
    pub fn to_toml(&self) -> String {
        let ids: Vec<_> = self.drones.iter().map(ToString::to_string).collect();
        let drones = format!("drones = [{}]\n", ids.join(", "));
        let mut text = heading("The fleet's revocation list", self.number, &drones);
        append_signature(&mut text, &self.signature);
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

pub(super) const NEVER_FAILS: &str = "writing to a string can't fail";

fn heading(title: &str, number: u64, fields: &str) -> String {
    format!(
        "# {title}, signed with the fleet's key. Written by `muster keys`.\nnumber = {number}\n{fields}"
    )
}

pub(super) fn append_signature(text: &mut String, signature: &[u8; 64]) {
    let signature = hex(signature);
    writeln!(text, "signature = \"{signature}\"").expect(NEVER_FAILS);
}

/// The signature, verified with the fleet's key.
pub(super) fn verify<T>(
    file: &TomlFile<T>,
    fleet: &FleetKey,
    message: &[u8],
    signature: &Located<String>,
) -> Result<[u8; 64], BadInput> {
    let bytes = super::key::bytes::<64>(signature.get_ref());
    if let Some(bytes) = bytes.filter(|it| fleet.has_signed(message, it)) {
        return Ok(bytes);
    }
    let message = "the signature does not match the fleet's key and the entries of this file";
    let help = "give the files of one fleet's folder, unchanged, as `muster keys` wrote them";
    Err(file.error_with(signature.span(), message, help))
}
