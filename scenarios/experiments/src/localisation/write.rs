//! Writes a track's files.

use std::path::{Path, PathBuf};

use muster_indoor::map::Map;

use super::Track;
use super::html::page;
use crate::output::{CompleteFile, WriteError, create_folder, json};

/// File with the page for a browser.
pub const LOCATED_HTML: &str = "located.html";
/// File with the track; written last, so the page exists once it does.
pub const LOCATED_JSON: &str = "located.json";

/// Writes a track into the folder `dir`, which is created if needed. Returns the files, the page first.
///
/// # Errors
/// If the system refuses; see [`crate::output::write`].
pub fn write(dir: &Path, track: &Track, map: &Map) -> Result<[PathBuf; 2], WriteError> {
    create_folder(dir)?;
    let html = CompleteFile::new(dir, LOCATED_HTML, page(track, map).as_bytes())?;
    let json = CompleteFile::new(dir, LOCATED_JSON, &json(track))?;
    Ok([html.publish()?, json.publish()?])
}

impl Track {
    /// Whether a folder holds this track.
    #[must_use]
    pub fn is_in(&self, dir: &Path) -> bool {
        std::fs::read(dir.join(LOCATED_JSON)).is_ok_and(|held| held == json(self))
    }
}
