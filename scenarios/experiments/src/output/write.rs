//! Writes a report's files.

use std::ffi::OsStr;
use std::fs::{self, File};
use std::io::{self, BufWriter, IntoInnerError, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use muster_scenarios::report::{Flight, Report};
use serde::Serialize;
use tempfile::NamedTempFile;
use thiserror::Error;

use super::{page, tracks};

/// File with the figures; written last, so the other files exist once it does.
pub const REPORT_JSON: &str = "report.json";
/// File with the page for a browser.
pub const REPORT_HTML: &str = "report.html";
/// File with the positions of all drones.
pub const TRACKS_CSV: &str = "tracks.csv";

/// Paths of a report's files.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ReportFiles {
    /// Figures.
    pub json: PathBuf,
    /// Page for a browser.
    pub html: PathBuf,
    /// Positions.
    pub tracks: PathBuf,
}

/// Why a report could not be written. No partly written file remains.
#[derive(Debug, Error)]
pub enum WriteError {
    /// The operator named a file instead of a folder; it is unchanged.
    #[error("{} is not a folder", path.display())]
    NotAFolder {
        /// The named path.
        path: PathBuf,
    },
    /// The folder can't be created.
    #[error("can't create the folder {}", path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
        /// Error of the system.
        source: io::Error,
    },
    /// A file can't be written. Each of the other files is complete, from this report or an earlier one.
    #[error("can't write {}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Error of the system.
        source: io::Error,
    },
}

impl WriteError {
    pub(crate) fn file(path: &Path, source: io::Error) -> Self {
        Self::File {
            path: path.to_owned(),
            source,
        }
    }
}

/// Writes the files of a report into the folder `dir`, which is created if needed.
///
/// All files are written and synced under temporary names, then renamed one by one. So no file is ever partly written.
/// The figures come last.
///
/// # Errors
/// If the system refuses. Temporary files are removed; a killed process leaves files that start with `.muster-`.
pub fn write(dir: &Path, report: &Report, flight: &Flight) -> Result<ReportFiles, WriteError> {
    let html = page(report, flight);
    let tracks = tracks(report, flight);
    let json = json(report);

    create_folder(dir)?;
    let html = CompleteFile::new(dir, REPORT_HTML, html.as_bytes())?;
    let tracks = CompleteFile::new(dir, TRACKS_CSV, &tracks)?;
    let json = CompleteFile::new(dir, REPORT_JSON, &json)?;
    Ok(ReportFiles {
        html: html.publish()?,
        tracks: tracks.publish()?,
        json: json.publish()?,
    })
}

/// Writes a file at `path`; its folder is created if needed. The file is never partly written.
///
/// # Errors
/// If the system refuses. An earlier file stays as it was.
pub fn write_file(path: &Path, content: &[u8]) -> Result<(), WriteError> {
    let folder = path.parent().filter(|folder| *folder != Path::new(""));
    let folder = folder.unwrap_or(Path::new("."));
    let name = path.file_name().ok_or_else(|| {
        let source = io::Error::new(io::ErrorKind::IsADirectory, "this is a folder");
        WriteError::file(path, source)
    })?;
    create_folder(folder)?;
    let complete = CompleteFile::new(folder, &name.to_string_lossy(), content)?;
    complete.publish().map(drop)
}

/// A report as JSON text with a final line feed.
pub(crate) fn json(report: &impl Serialize) -> Vec<u8> {
    let mut json = serde_json::to_vec_pretty(report).expect("reports hold no fallible values");
    json.push(b'\n');
    json
}

pub(crate) fn create_folder(dir: &Path) -> Result<(), WriteError> {
    let path = dir.to_owned();
    match fs::create_dir_all(dir) {
        Ok(()) => Ok(()),
        Err(_) if dir.exists() && !dir.is_dir() => Err(WriteError::NotAFolder { path }),
        Err(source) => Err(WriteError::Folder { path, source }),
    }
}

/// A file being written under a temporary name; removed on drop.
pub(crate) struct DraftFile {
    writer: BufWriter<NamedTempFile>,
    path: PathBuf,
}

/// Prefix of temporary file names.
const DRAFT_PREFIX: &str = ".muster-";

impl DraftFile {
    pub(crate) fn create(dir: &Path, name: &str) -> Result<Self, WriteError> {
        let path = dir.join(name);
        // `File::create_new` gives the usual permissions; `tempfile` would allow the owner only.
        let created = tempfile::Builder::new()
            .prefix(DRAFT_PREFIX)
            .make_in(dir, |path| File::create_new(path));
        match created {
            Ok(file) => Ok(Self {
                writer: BufWriter::new(file),
                path,
            }),
            Err(source) => Err(WriteError::File { path, source }),
        }
    }

    /// Flushes and syncs the file.
    pub(crate) fn complete(self) -> Result<CompleteFile, WriteError> {
        let path = self.path;
        let synced = self
            .writer
            .into_inner()
            .map_err(IntoInnerError::into_error)
            .and_then(|file| file.as_file().sync_all().map(|()| file));
        match synced {
            Ok(file) => Ok(CompleteFile { file, path }),
            Err(source) => Err(WriteError::File { path, source }),
        }
    }

    /// Whether a file name is that of a draft.
    pub(crate) fn is_name(name: &OsStr) -> bool {
        name.as_encoded_bytes().starts_with(DRAFT_PREFIX.as_bytes())
    }
}

impl Write for DraftFile {
    fn write(&mut self, content: &[u8]) -> io::Result<usize> {
        self.writer.write(content)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.writer.flush()
    }
}

impl Seek for DraftFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.writer.seek(to)
    }
}

/// A complete file that still has its temporary name; removed on drop.
pub(crate) struct CompleteFile {
    file: NamedTempFile,
    path: PathBuf,
}

impl CompleteFile {
    /// Writes and syncs a file with this content.
    pub(crate) fn new(dir: &Path, name: &str, content: &[u8]) -> Result<Self, WriteError> {
        let mut draft = DraftFile::create(dir, name)?;
        match draft.write_all(content) {
            Ok(()) => draft.complete(),
            Err(error) => Err(WriteError::file(&draft.path, error)),
        }
    }

    pub(crate) fn publish(self) -> Result<PathBuf, WriteError> {
        match self.file.persist(&self.path) {
            Ok(_) => Ok(self.path),
            Err(refused) => Err(WriteError::File {
                path: self.path,
                source: refused.error,
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::sample;

    fn names(dir: &Path) -> Vec<String> {
        let entries = fs::read_dir(dir).unwrap();
        let mut names: Vec<_> = entries
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn report_consists_of_three_files() {
        let home = tempfile::tempdir().unwrap();
        let dir = home.path().join("runs/thesis-2-7");
        let (report, flight) = sample::swarm(3);
        let written = write(&dir, &report, &flight).unwrap();
        assert_eq!(names(&dir), [REPORT_HTML, REPORT_JSON, TRACKS_CSV]);
        let read: serde_json::Value =
            serde_json::from_slice(&fs::read(written.json).unwrap()).unwrap();
        assert_eq!(read["drones"].as_array().map(Vec::len), Some(3));
        assert_eq!(fs::read(written.tracks).unwrap(), tracks(&report, &flight));
        assert_eq!(
            fs::read_to_string(written.html).unwrap(),
            page(&report, &flight)
        );
    }

    #[test]
    fn new_report_replaces_the_old_one() {
        let dir = tempfile::tempdir().unwrap();
        let (report, flight) = sample::swarm(3);
        write(dir.path(), &report, &flight).unwrap();
        let (report, flight) = sample::swarm(2);
        write(dir.path(), &report, &flight).unwrap();
        assert_eq!(names(dir.path()), [REPORT_HTML, REPORT_JSON, TRACKS_CSV]);
        assert_eq!(
            fs::read(dir.path().join(REPORT_JSON)).unwrap(),
            json(&report)
        );
    }

    #[test]
    fn file_in_place_of_the_folder_is_refused_and_kept() {
        let home = tempfile::tempdir().unwrap();
        let dir = home.path().join("results");
        fs::write(&dir, "mine").unwrap();
        let (report, flight) = sample::swarm(2);
        let refusal = write(&dir, &report, &flight).unwrap_err();
        assert!(
            matches!(refusal, WriteError::NotAFolder { .. }),
            "{refusal:?}"
        );
        assert!(refusal.to_string().ends_with("results is not a folder"));
        assert_eq!(fs::read_to_string(&dir).unwrap(), "mine");
        assert_eq!(names(home.path()), ["results"]);
    }

    #[test]
    fn failed_write_leaves_no_temporary_file() {
        let (report, flight) = sample::swarm(2);
        for taken in [REPORT_HTML, TRACKS_CSV, REPORT_JSON] {
            let dir = tempfile::tempdir().unwrap();
            fs::create_dir(dir.path().join(taken)).unwrap();
            let refusal = write(dir.path(), &report, &flight).unwrap_err();
            assert!(matches!(&refusal, WriteError::File { path, .. } if path.ends_with(taken)));
            assert!(
                names(dir.path()).iter().all(|name| !name.starts_with('.')),
                "{taken}"
            );
        }
    }

    #[cfg(unix)]
    #[test]
    fn report_has_default_file_permissions() {
        use std::os::unix::fs::PermissionsExt as _;
        let dir = tempfile::tempdir().unwrap();
        let (report, flight) = sample::swarm(2);
        let written = write(dir.path(), &report, &flight).unwrap();
        let by_hand = dir.path().join("by-hand");
        fs::write(&by_hand, "").unwrap();
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode();
        assert_eq!(mode(&written.html), mode(&by_hand));
    }
}
