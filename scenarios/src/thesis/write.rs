//! Writes a comparison's files.

use std::path::{Path, PathBuf};

use super::Comparison;
use super::html::page;
use crate::report::{CompleteFile, WriteError, create_folder, json};

/// File with the page for a browser.
pub const THESIS_HTML: &str = "thesis.html";
/// File with the figures and our runs; written last, so the page exists once it does.
pub const THESIS_JSON: &str = "thesis.json";

/// Writes a comparison into the folder `dir`, which is created if needed. Returns the files, the page first.
///
/// # Errors
/// If the system refuses; see [`crate::report::write`].
pub fn write(dir: &Path, comparison: &Comparison) -> Result<[PathBuf; 2], WriteError> {
    create_folder(dir)?;
    let html = CompleteFile::new(dir, THESIS_HTML, page(comparison).as_bytes())?;
    let json = CompleteFile::new(dir, THESIS_JSON, &json(comparison))?;
    Ok([html.publish()?, json.publish()?])
}
