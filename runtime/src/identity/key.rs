//! Key files: one line with the kind of key and the key in hexadecimal. Secret key files must be readable by their owner
//! only, and are never shown in errors.

use std::fmt;
use std::fs::{self, OpenOptions};
use std::io::{self, Write};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::Path;

use ed25519_dalek::{Signature, Signer, SigningKey, VerifyingKey};
use zeroize::Zeroizing;

use super::KeysError;
use crate::diagnostic::{BadInput, read_text};

const SECRET: &str = "muster-ed25519-secret";
const PUBLIC: &str = "muster-ed25519-public";

/// Permission bits of a file's group and of others.
const OTHERS: u32 = 0o077;

/// A drone's secret key. Its memory is wiped on drop.
pub struct DroneKey(pub(super) SigningKey);

impl fmt::Debug for DroneKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("DroneKey(..)")
    }
}

impl DroneKey {
    /// Reads a drone's key.
    ///
    /// # Errors
    /// If the file can't be read, can be read by anyone but its owner, or is not a secret key. The error shows nothing of
    /// its content.
    pub fn load(path: &Path) -> Result<Self, BadInput> {
        load_secret(path).map(Self)
    }
}

/// A fleet's public key, which verifies rosters and revocation lists.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FleetKey(pub(super) VerifyingKey);

impl FleetKey {
    /// Reads a fleet's public key.
    ///
    /// # Errors
    /// If the file can't be read or is not a public key.
    pub fn load(path: &Path) -> Result<Self, BadInput> {
        let text = read_public(path)?;
        let key = (text.trim().strip_prefix(PUBLIC))
            .and_then(|hex| public_key(hex.trim()))
            .ok_or_else(|| {
                let help = format!("a public key is a line `{PUBLIC}` and 64 hexadecimal digits");
                BadInput::new(path, &text, 0..text.len(), "this is not a public key", help)
            })?;
        Ok(Self(key))
    }

    /// The key in RFC 8032 encoding.
    #[must_use]
    pub fn to_bytes(&self) -> [u8; 32] {
        self.0.to_bytes()
    }

    pub(super) fn has_signed(&self, message: &[u8], signature: &[u8; 64]) -> bool {
        let signature = Signature::from_bytes(signature);
        self.0.verify_strict(message, &signature).is_ok()
    }
}

/// Generates a key from the system's random generator.
///
/// # Errors
/// If the random generator fails.
pub(super) fn generate_key() -> Result<SigningKey, KeysError> {
    let mut seed = Zeroizing::new([0; 32]);
    getrandom::fill(&mut *seed).map_err(KeysError::Random)?;
    Ok(SigningKey::from_bytes(&seed))
}

/// Signs a message with a fleet's secret key.
pub(super) fn sign(key: &SigningKey, message: &[u8]) -> [u8; 64] {
    key.sign(message).to_bytes()
}

/// Reads a public file. Refuses a file with a secret key, given by mistake, without showing its content.
pub(super) fn read_public(path: &Path) -> Result<String, BadInput> {
    let text = read_text(path)?;
    if text.contains(SECRET) {
        let _wiped = Zeroizing::new(text);
        let help = "give the public file; the content of this one is not shown";
        return Err(BadInput::without_excerpt(
            path,
            "this is a secret key",
            help,
        ));
    }
    Ok(text)
}

pub(super) fn load_secret(path: &Path) -> Result<SigningKey, BadInput> {
    let text = Zeroizing::new(read_text(path)?);
    let mode = fs::metadata(path).map(|metadata| metadata.mode());
    if !mode.is_ok_and(|mode| mode & OTHERS == 0) {
        let message = "users other than its owner can read this secret key";
        let help = format!(
            "run `chmod 600 {}`; if somebody may have read it, revoke the drone and create a new key",
            path.display()
        );
        return Err(BadInput::without_excerpt(path, message, help));
    }
    let hex = text.trim().strip_prefix(SECRET).map(str::trim);
    let seed = hex.and_then(|hex| bytes::<32>(hex).map(Zeroizing::new));
    let seed = seed.ok_or_else(|| {
        let help = "create keys with `muster keys`; the content of this file is not shown";
        BadInput::without_excerpt(path, "this is not a secret key", help)
    })?;
    Ok(SigningKey::from_bytes(&seed))
}

/// Writes a secret key, readable by its owner only. Fails if the file exists.
pub(super) fn write_secret(path: &Path, key: &SigningKey) -> Result<(), KeysError> {
    let seed = Zeroizing::new(key.to_bytes());
    let digits = Zeroizing::new(hex(&*seed));
    let line = Zeroizing::new(format!("{SECRET} {}\n", *digits));
    create(path, line.as_bytes(), 0o600)
}

/// Writes a public key. Fails if the file exists.
pub(super) fn write_public(path: &Path, key: &VerifyingKey) -> Result<(), KeysError> {
    let line = format!("{PUBLIC} {}\n", hex(key.as_bytes()));
    create(path, line.as_bytes(), 0o644)
}

fn create(path: &Path, content: &[u8], mode: u32) -> Result<(), KeysError> {
    let mut options = OpenOptions::new();
    let opened = options.write(true).create_new(true).mode(mode).open(path);
    let written = opened.and_then(|mut file| {
        let written = file.write_all(content).and_then(|()| file.sync_all());
        if written.is_err() {
            // Half a key would count as one that exists.
            let _ = fs::remove_file(path);
        }
        written
    });
    written.map_err(|source| match source.kind() {
        io::ErrorKind::AlreadyExists => key_exists(path).into(),
        _ => KeysError::Write {
            path: path.to_owned(),
            source,
        },
    })
}

/// The error for a key file that exists: keys are never overwritten.
pub(super) fn key_exists(path: &Path) -> BadInput {
    let message = "this key exists already and is not overwritten";
    let help = "give another folder or number, or remove the file if it is not needed any more";
    BadInput::without_excerpt(path, message, help)
}

/// Parses a public key from 64 hexadecimal digits.
pub(super) fn public_key(digits: &str) -> Option<VerifyingKey> {
    VerifyingKey::from_bytes(&bytes(digits)?).ok()
}

/// Bytes in hexadecimal.
#[must_use]
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Parses `N` bytes from lower-case hexadecimal digits. `None` for any other text.
pub(super) fn bytes<const N: usize>(digits: &str) -> Option<[u8; N]> {
    let (pairs, rest) = digits.as_bytes().as_chunks::<2>();
    if pairs.len() != N || !rest.is_empty() {
        return None;
    }
    let mut bytes = [0; N];
    for (byte, [high, low]) in bytes.iter_mut().zip(pairs) {
        *byte = digit(*high)? << 4 | digit(*low)?;
    }
    Some(bytes)
}

fn digit(character: u8) -> Option<u8> {
    match character {
        b'0'..=b'9' => Some(character - b'0'),
        b'a'..=b'f' => Some(character - b'a' + 10),
        _ => None,
    }
}
