//! The bytes of a release: a tar archive, compressed with gzip. The same files give the same bytes.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufReader, Read, Write};
use std::path::{Path, PathBuf};

use flate2::read::GzDecoder;
use flate2::{Compression, GzBuilder};
use muster_runtime::diagnostic::BadInput;
use muster_runtime::identity::{
    FleetKey, MANIFEST_MAX, Manifest, RELEASE_FILE_MAX, ReleaseFile, is_plain,
};

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
        let mut files =
            unpack(file).map_err(|error| refuse(&format!("can't be unpacked: {error}")))?;
        let text = files
            .remove(MANIFEST)
            .and_then(|it| String::from_utf8(it).ok());
        let text = text.ok_or_else(|| refuse("has no manifest"))?;
        let manifest = Manifest::parse(&path.join(MANIFEST), text.clone(), fleet)?;
        let is: BTreeMap<_, _> = files
            .iter()
            .map(|(path, it)| (path.clone(), ReleaseFile::of(it)))
            .collect();
        if is != manifest.files {
            return Err(refuse("has other files than its manifest names"));
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

/// The most files that are unpacked.
const FILES_MAX: usize = 128;

fn unpack(file: File) -> io::Result<BTreeMap<String, Vec<u8>>> {
    let mut archive = tar::Archive::new(GzDecoder::new(BufReader::new(file)));
    let mut files = BTreeMap::new();
    for entry in archive.entries()? {
        let mut entry = entry?;
        let path: PathBuf = entry.path()?.into_owned();
        let path = path.to_string_lossy().into_owned();
        let max = if path == MANIFEST {
            MANIFEST_MAX as u64
        } else {
            RELEASE_FILE_MAX
        };
        let is_file = entry.header().entry_type().is_file();
        if !is_plain(&path) || !is_file || entry.size() > max || files.len() == FILES_MAX {
            return Err(io::Error::other(format!(
                "\"{path}\" is not a file of a release"
            )));
        }
        let mut content = Vec::new();
        entry.read_to_end(&mut content)?;
        if files.insert(path.clone(), content).is_some() {
            return Err(io::Error::other(format!("\"{path}\" is there twice")));
        }
    }
    // The checksum of all bytes is at the end.
    io::copy(&mut archive.into_inner(), &mut io::sink())?;
    Ok(files)
}
