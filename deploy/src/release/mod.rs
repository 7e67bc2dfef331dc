//! Releases: the programs for all processors and their units, in one signed archive.

mod archive;
mod deb;
mod units;

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use muster_machines::wire;
use muster_runtime::diagnostic::BadInput;
use muster_runtime::file::replace;
use muster_runtime::identity::{Fleet, KeysError, Manifest, ReleaseFile};
use muster_runtime::journal;
use thiserror::Error;

pub use self::archive::Release;
use self::deb::Contents;

/// Why no release was written.
#[derive(Debug, Error)]
pub enum PackageError {
    /// A program or a name can't be used.
    #[error(transparent)]
    Refused(#[from] BadInput),
    /// The fleet's key can't be used.
    #[error(transparent)]
    Keys(#[from] KeysError),
    /// A file could not be written.
    #[error("can't write {}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The cause.
        #[source]
        source: io::Error,
    },
}

/// A release to pack.
#[derive(Debug)]
pub struct PackageRequest<'a> {
    /// The folder with a folder for each processor, `x86_64` and `aarch64`, with the programs `muster` and `musterd`.
    pub programs: &'a Path,
    /// The fleet's folder; its key signs the release.
    pub keys: &'a Path,
    /// Version of the release.
    pub version: &'a str,
    /// The folder to write to.
    pub out: &'a Path,
    /// Whether Debian packages are written, too.
    pub deb: bool,
}

/// Packs and signs a release. Returns the paths of what it wrote.
///
/// # Errors
/// If the programs or the fleet's key can't be used, or a file can't be written.
pub fn package(request: &PackageRequest<'_>) -> Result<Vec<PathBuf>, PackageError> {
    let fleet = Fleet::open(request.keys)?;
    let programs = programs(request.programs)?;
    let units = units::of_slots();
    let units = units.map(|(name, text)| (format!("units/{name}"), text.into_bytes()));
    let files: BTreeMap<_, _> = programs.into_iter().chain(units).collect();
    let manifest = Manifest {
        version: request.version.to_owned(),
        wire: vec![wire::VERSION, wire::VERSION_WITH_INTENT],
        journal: vec![journal::VERSION],
        files: files
            .iter()
            .map(|(path, content)| (path.clone(), ReleaseFile::of(content)))
            .collect(),
    };
    let text = fleet.sign_release(&manifest);
    // What no host would take is not written.
    let name = format!("muster-{}.tar.gz", request.version);
    let path = request.out.join(name);
    Manifest::parse(&path, text.clone(), &fleet.public())?;
    let mut bytes = Vec::new();
    archive::write(&text, &files, &mut bytes).map_err(|source| PackageError::Write {
        path: path.clone(),
        source,
    })?;
    let mut written = vec![store(path, &bytes)?];
    if request.deb {
        written.extend(debs(request, &files)?);
    }
    Ok(written)
}

fn store(path: PathBuf, bytes: &[u8]) -> Result<PathBuf, PackageError> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let stored = fs::create_dir_all(folder).and_then(|()| replace(&path, bytes));
    match stored {
        Ok(()) => Ok(path),
        Err(source) => Err(PackageError::Write { path, source }),
    }
}

/// The Debian packages, one a processor.
fn debs(
    request: &PackageRequest<'_>,
    files: &BTreeMap<String, Vec<u8>>,
) -> Result<Vec<PathBuf>, PackageError> {
    let mut written = Vec::new();
    for (processor, program) in PROCESSORS
        .iter()
        .filter_map(|it| Some((it, files.get(&format!("{it}/musterd"))?)))
    {
        let Some(architecture) = deb::architecture(processor) else {
            continue;
        };
        let path = request
            .out
            .join(format!("muster_{}_{architecture}.deb", request.version));
        let mut bytes = Vec::new();
        let contents = Contents {
            version: request.version,
            architecture,
            muster: &files[&format!("{processor}/muster")],
            musterd: program,
            unit: &units::of_package(),
        };
        deb::write(&contents, &mut bytes).map_err(|source| PackageError::Write {
            path: path.clone(),
            source,
        })?;
        written.push(store(path, &bytes)?);
    }
    Ok(written)
}

/// The processors that releases are made for, as Rust names them.
pub(crate) const PROCESSORS: [&str; 2] = ["aarch64", "x86_64"];

/// Reads the programs of all processors that are there.
fn programs(folder: &Path) -> Result<BTreeMap<String, Vec<u8>>, BadInput> {
    let mut programs = BTreeMap::new();
    for processor in PROCESSORS.iter().filter(|it| folder.join(it).is_dir()) {
        for name in ["muster", "musterd"] {
            let path = folder.join(processor).join(name);
            let content = fs::read(&path).map_err(|error| {
                let help = "each processor's folder has the programs muster and musterd";
                BadInput::without_excerpt(&path, error, help)
            })?;
            if content.is_empty() {
                let help = "build it with deploy/cross, or copy it again";
                return Err(BadInput::without_excerpt(&path, "is empty", help));
            }
            programs.insert(format!("{processor}/{name}"), content);
        }
    }
    if programs.is_empty() {
        let message = "has neither a folder x86_64 nor a folder aarch64";
        let help = "build the programs with deploy/cross, or copy them to x86_64/muster and x86_64/musterd";
        return Err(BadInput::without_excerpt(folder, message, help));
    }
    Ok(programs)
}

#[cfg(test)]
mod tests;
