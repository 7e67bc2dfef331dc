//! The bytes of a release: a tar archive, compressed with gzip. The same files give the same bytes.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufReader, Read, Write};
use std::path::Path;

use flate2::read::GzDecoder;
use flate2::{Compression, GzBuilder};
use muster_runtime::diagnostic::BadInput;
use muster_runtime::identity::{FleetKey, MANIFEST_MAX, Manifest, ReleaseFile};

/// Path of the manifest in an archive.
const MANIFEST: &str = "manifest.toml";

/// A release that was read whole: each file is what the signed manifest says.
#[derive(Debug)]
pub struct Release {
    /// The manifest.
    pub manifest: Manifest,
    /// Its signed text.
    pub manifest_text: String,
    /// Contents by path.
    pub files: BTreeMap<String, Vec<u8>>,
}

/// Writes files as a compressed tar archive, in the order of their paths. Times, owners and the compressing system are left
/// out.
pub(super) fn tar<'a>(
    files: impl IntoIterator<Item = (&'a str, &'a [u8])>,
    out: &mut dyn Write,
) -> io::Result<()> {
    let gzip = GzBuilder::new().mtime(0).operating_system(255);
    let mut archive = tar::Builder::new(gzip.write(out, Compression::default()));
    for (path, content) in files {
        let mut header = tar::Header::new_ustar();
        header.set_size(content.len() as u64);
        header.set_mode(mode(path));
        header.set_mtime(0);
        header.set_uid(0);
        header.set_gid(0);
        archive.append_data(&mut header, path, content)?;
    }
    archive.into_inner()?.finish()?.flush()
}

/// Programs are executable, everything else is not.
fn mode(path: &str) -> u32 {
    match Path::new(path).file_name().and_then(|name| name.to_str()) {
        Some("muster" | "musterd") => 0o755,
        _ => 0o644,
    }
}

/// Writes a release's archive.
pub(super) fn write(
    manifest: &str,
    files: &BTreeMap<String, Vec<u8>>,
    out: &mut dyn Write,
) -> io::Result<()> {
    let all = files.iter().map(|(path, it)| (path.as_str(), &it[..]));
    tar(
        std::iter::once((MANIFEST, manifest.as_bytes())).chain(all),
        out,
    )
}

impl Release {
    /// Reads an archive and verifies it.
    ///
    /// # Errors
    /// If it can't be read, is not signed by the fleet's key, or has other files than its manifest names.
    pub fn load(path: &Path, fleet: &FleetKey) -> Result<Self, BadInput> {
        let refuse = |message: &str| {
            let help = "give an archive that `muster deploy package` wrote with this fleet's keys, unchanged";
            BadInput::without_excerpt(path, message, help)
        };
        let file = File::open(path).map_err(|error| refuse(&error.to_string()))?;
        let broken = |error: io::Error| refuse(&format!("can't be unpacked: {error}"));
        let mut archive = tar::Archive::new(GzDecoder::new(BufReader::new(file)));
        // Raw: the names of entries take no space of their own. What is not signed is not unpacked.
        let mut entries = archive.entries().map_err(broken)?.raw(true);
        let text = first(&mut entries).map_err(broken)?;
        let text = text.ok_or_else(|| refuse("does not begin with a manifest"))?;
        let manifest = Manifest::parse(&path.join(MANIFEST), text.clone(), fleet)?;
        let files = unpack(entries, &manifest).map_err(broken)?;
        let files = files.ok_or_else(|| refuse("has other files than its manifest names"))?;
        // The checksum of all bytes is at the end.
        let mut rest = archive.into_inner().take(TRAILER_MAX);
        let read = io::copy(&mut rest, &mut io::sink());
        if read.map_err(broken)? == TRAILER_MAX {
            return Err(refuse("has data after its last file"));
        }
        Ok(Self {
            manifest,
            manifest_text: text,
            files,
        })
    }

    /// Names of the processors that it has programs for.
    pub fn processors(&self) -> impl Iterator<Item = &str> {
        self.files
            .keys()
            .filter_map(|path| path.strip_suffix("/musterd"))
    }
}

/// The longest end of an archive, in bytes: tar fills its last 10 KiB.
const TRAILER_MAX: u64 = 64 * 1_024;

/// Text of the manifest, if it is the first file.
fn first(entries: &mut tar::Entries<'_, impl Read>) -> io::Result<Option<String>> {
    let Some(entry) = entries.next() else {
        return Ok(None);
    };
    let entry = entry?;
    let is_manifest = entry.path()?.as_ref() == Path::new(MANIFEST);
    if !is_manifest || entry.size() > MANIFEST_MAX as u64 {
        return Ok(None);
    }
    Ok(Some(io::read_to_string(entry)?))
}

/// The files that a manifest names, each with its length and hash. `None` if others are there.
fn unpack(
    entries: tar::Entries<'_, impl Read>,
    manifest: &Manifest,
) -> io::Result<Option<BTreeMap<String, Vec<u8>>>> {
    let mut files = BTreeMap::new();
    for entry in entries {
        let mut entry = entry?;
        let path = entry.path()?.to_string_lossy().into_owned();
        let is_file = entry.header().entry_type().is_file();
        let listed = manifest
            .files
            .get(&path)
            .filter(|it| is_file && it.bytes == entry.size());
        let Some(listed) = listed else {
            return Ok(None);
        };
        let mut content = Vec::new();
        entry.read_to_end(&mut content)?;
        let is_same = ReleaseFile::of(&content) == *listed;
        if !is_same || files.insert(path, content).is_some() {
            return Ok(None);
        }
    }
    Ok((files.len() == manifest.files.len()).then_some(files))
}
