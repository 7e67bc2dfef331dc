use std::path::{Path, PathBuf};

use super::Comparison;
use super::html::page;
use crate::report::{Complete, WriteError, json, make_folder};

/// The page for a browser.
pub const THESIS_HTML: &str = "thesis.html";
/// The figures and our runs, for a program; once it is there, the page is.
pub const THESIS_JSON: &str = "thesis.json";

/// Writes a comparison into the folder `dir`, which is made if need be; the files, for a person first.
///
/// # Errors
/// As for the report of a run.
pub fn write(dir: &Path, comparison: &Comparison) -> Result<[PathBuf; 2], WriteError> {
    make_folder(dir)?;
    let html = Complete::new(dir, THESIS_HTML, page(comparison).as_bytes())?;
    let json = Complete::new(dir, THESIS_JSON, &json(comparison))?;
    Ok([html.publish()?, json.publish()?])
}
