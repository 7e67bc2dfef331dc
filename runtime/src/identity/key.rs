//! Key files: a line that says what it is, and the key in hexadecimal. Secret ones are for nobody but their owner, and
//! never shown in an error.

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

/// What others may do to a file, in its mode.
const OTHERS: u32 = 0o077;

/// A drone's secret key. Its memory is wiped when it goes.
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
    /// When the file can't be read, when anyone but its owner can, or when it is no secret key. Nothing of what is in
    /// it is told.
    pub fn load(path: &Path) -> Result<Self, BadInput> {
        load_secret(path).map(Self)
    }
}

/// A fleet's public key: what it has signed is believed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FleetKey(pub(super) VerifyingKey);

impl FleetKey {
    /// Reads a fleet's public key.
    ///
    /// # Errors
    /// When the file can't be read or is no public key.
    pub fn load(path: &Path) -> Result<Self, BadInput> {
        let text = read_public(path)?;
        let key = (text.trim().strip_prefix(PUBLIC))
            .and_then(|hex| public_key(hex.trim()))
            .ok_or_else(|| {
                let help = format!("a public key is a line `{PUBLIC}` with 64 hexadecimal digits");
                BadInput::new(path, &text, 0..text.len(), "this is not a public key", help)
            })?;
        Ok(Self(key))
    }

    /// The key as RFC 8032 writes it.
    #[must_use]
    pub fn to_bytes(&self) -> [u8; 32] {
        self.0.to_bytes()
    }

    pub(super) fn has_signed(&self, message: &[u8], signature: &[u8; 64]) -> bool {
        let signature = Signature::from_bytes(signature);
        self.0.verify_strict(message, &signature).is_ok()
    }
}

/// A key that was never used before.
///
/// # Errors
/// When the system has no random numbers.
pub(super) fn fresh() -> Result<SigningKey, KeysError> {
    let mut seed = Zeroizing::new([0; 32]);
    getrandom::fill(&mut *seed).map_err(KeysError::Random)?;
    Ok(SigningKey::from_bytes(&seed))
}

/// Signs what a fleet says.
pub(super) fn sign(key: &SigningKey, message: &[u8]) -> [u8; 64] {
    key.sign(message).to_bytes()
}

/// What a file says that anyone may read; one with a secret key was taken for another, and is not shown.
pub(super) fn read_public(path: &Path) -> Result<String, BadInput> {
    let text = read_text(path)?;
    if text.contains(SECRET) {
        let _wiped = Zeroizing::new(text);
        let help = "name the file that anyone may read; what is in this one is not shown";
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
        let message = "others than its owner can read this secret key";
        let help = format!(
            "chmod 600 {}; if anyone may have read it, revoke the drone and give it another key",
            path.display()
        );
        return Err(BadInput::without_excerpt(path, message, help));
    }
    let hex = text.trim().strip_prefix(SECRET).map(str::trim);
    let seed = hex.and_then(|hex| bytes::<32>(hex).map(Zeroizing::new));
    let seed = seed.ok_or_else(|| {
        let help = "`muster keys` makes keys; what is in this file is not shown";
        BadInput::without_excerpt(path, "this is not a secret key", help)
    })?;
    Ok(SigningKey::from_bytes(&seed))
}

/// Writes a secret key that its owner alone can read; a file that is there already is left as it is.
pub(super) fn write_secret(path: &Path, key: &SigningKey) -> Result<(), KeysError> {
    let seed = Zeroizing::new(key.to_bytes());
    let digits = Zeroizing::new(hex(&*seed));
    let line = Zeroizing::new(format!("{SECRET} {}\n", *digits));
    create(path, line.as_bytes(), 0o600)
}

/// Writes a public key; a file that is there already is left as it is.
pub(super) fn write_public(path: &Path, key: &VerifyingKey) -> Result<(), KeysError> {
    let line = format!("{PUBLIC} {}\n", hex(key.as_bytes()));
    create(path, line.as_bytes(), 0o644)
}

fn create(path: &Path, content: &[u8], mode: u32) -> Result<(), KeysError> {
    let mut options = OpenOptions::new();
    let opened = options.write(true).create_new(true).mode(mode).open(path);
    let written = opened.and_then(|mut file| {
        file.write_all(content)?;
        file.sync_all()
    });
    written.map_err(|source| match source.kind() {
        io::ErrorKind::AlreadyExists => is_there(path).into(),
        _ => KeysError::Write {
            path: path.to_owned(),
            source,
        },
    })
}

/// A key is there already, which is never written over.
pub(super) fn is_there(path: &Path) -> BadInput {
    let message = "there is a key already, and it is not written over";
    let help = "take another folder or number, or move the file away if nothing needs it any more";
    BadInput::without_excerpt(path, message, help)
}

/// A public key from its digits.
pub(super) fn public_key(digits: &str) -> Option<VerifyingKey> {
    VerifyingKey::from_bytes(&bytes(digits)?).ok()
}

pub(super) fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// So many bytes from two lower-case digits each, and nothing else.
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
