//! The manifest of a release: which files it has, by their hashes, signed with the fleet's key.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

use ed25519_dalek::SigningKey;
use serde::Deserialize;
use sha2::{Digest, Sha256};

use super::FleetKey;
use super::key::{bytes, hex, sign};
use super::lists::{NEVER_FAILS, append_signature, verify};
use crate::diagnostic::{BadInput, FileFormat, TomlFile};
use crate::schema::{FieldList, Located};

/// Prefix of a signed manifest, so that its signature fits no other message.
const RELEASE: &[u8] = b"muster release 1\0";

/// The most files of a release.
const FILES_MAX: usize = 64;

/// The longest manifest that is read, in bytes.
pub const MANIFEST_MAX: usize = 64 * 1_024;

/// The longest file of a release, in bytes.
pub const RELEASE_FILE_MAX: u64 = 512 * 1_024 * 1_024;

const FORMAT: FileFormat = FileFormat {
    fields: FieldList::EMPTY,
    description: "a manifest has `version`, `wire`, `journal`, `signature` and, for each file, `[[files]]` with `path`, `bytes` and \
         `sha256`, as `muster deploy package` writes it",
};

/// A file of a release.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ReleaseFile {
    /// Its length, in bytes.
    pub bytes: u64,
    /// SHA-256 of its content.
    pub sha256: [u8; 32],
}

impl ReleaseFile {
    /// Of a file with this content.
    #[must_use]
    pub fn of(content: &[u8]) -> Self {
        Self {
            bytes: content.len() as u64,
            sha256: Sha256::digest(content).into(),
        }
    }
}

/// What a release consists of.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Manifest {
    /// Version of the programs.
    pub version: String,
    /// Versions of frames that they read.
    pub wire: Vec<u8>,
    /// Versions of journals that they read.
    pub journal: Vec<u8>,
    /// The files by their paths in the archive.
    pub files: BTreeMap<String, ReleaseFile>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Raw {
    version: Located<String>,
    wire: Vec<u8>,
    journal: Vec<u8>,
    signature: Located<String>,
    files: Vec<RawFile>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawFile {
    path: Located<String>,
    bytes: Located<u64>,
    sha256: Located<String>,
}

impl Manifest {
    /// Reads a manifest's text and verifies its signature. Errors name `path`.
    ///
    /// # Errors
    /// If it can't be used, names a path twice or one that leads out of its folder, or is not signed by the fleet's key.
    pub fn parse(path: &Path, text: String, fleet: &FleetKey) -> Result<Self, BadInput> {
        let file = TomlFile::<Raw>::parse(path, text, FORMAT)?;
        let version = file.raw.version.get_ref();
        if !is_plain(version) || version.contains('/') {
            let help = "a version has letters, digits and `.+-`";
            return Err(file.error_with(file.raw.version.span(), "this is not a version", help));
        }
        let mut files = BTreeMap::new();
        for raw in &file.raw.files {
            let name = raw.path.get_ref();
            let (Some(sha256), true, true) = (
                bytes::<32>(raw.sha256.get_ref()),
                is_plain(name),
                *raw.bytes.get_ref() <= RELEASE_FILE_MAX,
            ) else {
                let message = "a file needs a relative path of letters, digits and `/._@+-`, at most 512 MiB, and SHA-256";
                return Err(file.error(raw.path.span(), message));
            };
            let bytes = *raw.bytes.get_ref();
            let before = files.insert(name.clone(), ReleaseFile { bytes, sha256 });
            if before.is_some() || files.len() > FILES_MAX {
                let message = "this path is listed twice, or there are more than 64 files";
                return Err(file.error(raw.path.span(), message));
            }
        }
        let manifest = Self {
            version: version.clone(),
            wire: file.raw.wire.clone(),
            journal: file.raw.journal.clone(),
            files,
        };
        verify(&file, fleet, &manifest.message(), &file.raw.signature)?;
        Ok(manifest)
    }

    /// SHA-256 of what the manifest says; two releases with the same files have the same.
    #[must_use]
    pub fn digest(&self) -> [u8; 32] {
        Sha256::digest(self.message()).into()
    }

    /// The manifest as a signed TOML file.
    pub(super) fn to_toml(&self, fleet: &SigningKey) -> String {
        let mut text = String::from(
            "# A release of muster, signed with the fleet's key. Written by `muster deploy package`.\n",
        );
        let Self { wire, journal, .. } = self;
        let version = &self.version;
        writeln!(
            text,
            "version = \"{version}\"\nwire = {wire:?}\njournal = {journal:?}"
        )
        .expect(NEVER_FAILS);
        append_signature(&mut text, &sign(fleet, &self.message()));
        for (path, ReleaseFile { bytes, sha256 }) in &self.files {
            let sha256 = hex(sha256);
            write!(
                text,
                "\n[[files]]\npath = \"{path}\"\nbytes = {bytes}\nsha256 = \"{sha256}\"\n"
            )
            .expect(NEVER_FAILS);
        }
        text
    }

    /// Each part is preceded by its length, so that no two manifests have one message.
    fn message(&self) -> Vec<u8> {
        let mut message = RELEASE.to_vec();
        let mut append = |part: &[u8]| {
            message.extend_from_slice(&(part.len() as u64).to_le_bytes());
            message.extend_from_slice(part);
        };
        append(self.version.as_bytes());
        append(&self.wire);
        append(&self.journal);
        for (path, file) in &self.files {
            append(path.as_bytes());
            append(&file.bytes.to_le_bytes());
            append(&file.sha256);
        }
        message
    }
}

/// Whether a text is a relative path within its folder that no shell or systemd reads as more than that.
#[must_use]
pub fn is_plain(path: &str) -> bool {
    let is_part = |part: &str| {
        let plain = |c: char| c.is_ascii_alphanumeric() || "._@+-".contains(c);
        !part.is_empty()
            && !part.starts_with('.')
            && !part.starts_with('-')
            && part.chars().all(plain)
    };
    path.len() <= 200 && path.split('/').all(is_part)
}
