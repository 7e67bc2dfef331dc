//! A report's way to the disk.

use std::ffi::OsStr;
use std::fs::{self, File};
use std::io::{self, BufWriter, IntoInnerError, Write};
use std::path::{Path, PathBuf};

use serde::Serialize;
use tempfile::NamedTempFile;
use thiserror::Error;

use super::{Flight, Report, page, tracks};

/// The file that holds the figures; once it is there, the others are.
pub const REPORT_JSON: &str = "report.json";
/// The file that holds the page for a browser.
pub const REPORT_HTML: &str = "report.html";
/// The file that holds everyone's positions.
pub const TRACKS_CSV: &str = "tracks.csv";

/// The files of a report.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Written {
    /// The figures, for a program.
    pub json: PathBuf,
    /// The page, for a person.
    pub html: PathBuf,
    /// The positions, for a plot.
    pub tracks: PathBuf,
}

/// Why a report could not be written; the folder holds no part of a file because of it.
#[derive(Debug, Error)]
pub enum WriteError {
    /// The operator named a file; it is untouched.
    #[error("{} is not a folder", path.display())]
    NotAFolder {
        /// What was named.
        path: PathBuf,
    },
    /// The folder can't be made.
    #[error("can't make the folder {}", path.display())]
    Folder {
        /// Which one.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// A file can't be written; the report's other files are either those of before or new.
    #[error("can't write {}", path.display())]
    File {
        /// Which one.
        path: PathBuf,
        /// What the system says.
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

/// Writes the files of a report into the folder `dir`, which is made if need be.
///
/// All of them are complete on the disk, under other names, before the first takes its place, and each takes its
/// place at once: whatever interrupts the run, no file of a report is ever half there. The figures come last.
///
/// # Errors
/// When the system refuses. What was made under other names is removed; a process that is killed can't do that,
/// and leaves files whose names begin with `.muster-`.
pub fn write(dir: &Path, report: &Report, flight: &Flight) -> Result<Written, WriteError> {
    let html = page(report, flight);
    let tracks = tracks(report, flight);
    let json = json(report);

    make_folder(dir)?;
    let html = Complete::new(dir, REPORT_HTML, html.as_bytes())?;
    let tracks = Complete::new(dir, TRACKS_CSV, &tracks)?;
    let json = Complete::new(dir, REPORT_JSON, &json)?;
    Ok(Written {
        html: html.publish()?,
        tracks: tracks.publish()?,
        json: json.publish()?,
    })
}

/// A report as the text of a file.
pub(crate) fn json(report: &impl Serialize) -> Vec<u8> {
    let mut json = serde_json::to_vec_pretty(report).expect("reports hold no fallible values");
    json.push(b'\n');
    json
}

pub(crate) fn make_folder(dir: &Path) -> Result<(), WriteError> {
    let path = dir.to_owned();
    match fs::create_dir_all(dir) {
        Ok(()) => Ok(()),
        Err(_) if dir.exists() && !dir.is_dir() => Err(WriteError::NotAFolder { path }),
        Err(source) => Err(WriteError::Folder { path, source }),
    }
}

/// A file that is being written under another name than its own; dropped, it is removed.
pub(crate) struct Draft {
    writer: BufWriter<NamedTempFile>,
    path: PathBuf,
}

/// How the other names of drafts begin.
const DRAFT_PREFIX: &str = ".muster-";

impl Draft {
    pub(crate) fn create(dir: &Path, name: &str) -> Result<Self, WriteError> {
        let path = dir.join(name);
        // Created by hand: a temporary file of the library's could be read by its owner alone.
        let made = tempfile::Builder::new()
            .prefix(DRAFT_PREFIX)
            .make_in(dir, |path| File::create_new(path));
        match made {
            Ok(file) => Ok(Self {
                writer: BufWriter::new(file),
                path,
            }),
            Err(source) => Err(WriteError::File { path, source }),
        }
    }

    /// Puts what was written on the disk.
    pub(crate) fn complete(self) -> Result<Complete, WriteError> {
        let path = self.path;
        let synced = self
            .writer
            .into_inner()
            .map_err(IntoInnerError::into_error)
            .and_then(|file| file.as_file().sync_all().map(|()| file));
        match synced {
            Ok(file) => Ok(Complete { file, path }),
            Err(source) => Err(WriteError::File { path, source }),
        }
    }

    /// Whether a file is a draft by its name.
    pub(crate) fn is_name(name: &OsStr) -> bool {
        name.as_encoded_bytes().starts_with(DRAFT_PREFIX.as_bytes())
    }
}

impl Write for Draft {
    fn write(&mut self, content: &[u8]) -> io::Result<usize> {
        self.writer.write(content)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.writer.flush()
    }
}

/// A file that is complete and not in its place yet; dropped, it is removed.
pub(crate) struct Complete {
    file: NamedTempFile,
    path: PathBuf,
}

impl Complete {
    /// A file with all its content.
    pub(crate) fn new(dir: &Path, name: &str, content: &[u8]) -> Result<Self, WriteError> {
        let mut draft = Draft::create(dir, name)?;
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
    use crate::report::sample;

    fn names(dir: &Path) -> Vec<String> {
        let entries = fs::read_dir(dir).unwrap();
        let mut names: Vec<_> = entries
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn a_report_is_three_files_and_nothing_else() {
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
    fn a_new_report_replaces_an_old_one() {
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
    fn a_file_in_the_folders_place_is_named_and_left_alone() {
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
    fn a_refused_file_leaves_no_draft_behind() {
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
    fn others_may_read_a_report_as_far_as_files_made_by_hand() {
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
