//! Writes a comparison's files.

use std::path::{Path, PathBuf};

use serde_json::Value;

use super::Comparison;
use super::html::page;
use crate::output::{CompleteFile, WriteError, create_folder, json};

/// File with the page for a browser.
pub const THESIS_HTML: &str = "thesis.html";
/// Thesis results and the reports of our runs, as JSON. Written last: if it exists, [`THESIS_HTML`] exists.
pub const THESIS_JSON: &str = "thesis.json";

/// Writes a comparison into the folder `dir`, which is created if needed. Returns the files, the page first.
///
/// # Errors
/// If the system refuses; see [`crate::output::write`].
pub fn write(dir: &Path, comparison: &Comparison) -> Result<[PathBuf; 2], WriteError> {
    create_folder(dir)?;
    let html = CompleteFile::new(dir, THESIS_HTML, page(comparison).as_bytes())?;
    let json = CompleteFile::new(dir, THESIS_JSON, &json(comparison))?;
    Ok([html.publish()?, json.publish()?])
}

impl Comparison {
    /// Whether a folder holds this comparison: the same runs with the same flights.
    #[must_use]
    pub fn is_in(&self, dir: &Path) -> bool {
        let text = std::fs::read(dir.join(THESIS_JSON)).unwrap_or_default();
        let Ok(other) = serde_json::from_slice::<Value>(&text) else {
            return false;
        };
        let experiments = other["experiments"].as_array().into_iter().flatten();
        let theirs = experiments.map(|experiment| experiment["report"]["trace"].as_str());
        let ours = self.experiments.iter().map(|it| it.report.trace.as_deref());
        let waits = serde_json::to_value(&self.waits_runs).ok();
        theirs.eq(ours) && waits.as_ref() == other.get("waits_runs")
    }
}
