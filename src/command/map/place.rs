//! Arguments and files that the commands on maps share: maps by name or path, places, pages.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use muster_experiments::output;
use muster_indoor::frames::MapXy;
use muster_indoor::map::Map;
use muster_indoor::path::Floor;
use muster_indoor_world::flat::{CELL_M, Flat};
use muster_runtime::diagnostic::BadInput;
use muster_runtime::map_file;

use crate::command::{Failure, folder};

/// Parses a place: `X,Y` in metres.
pub(super) fn place(text: &str) -> Result<MapXy, String> {
    let parsed = text.split_once(',').and_then(|(x, y)| {
        let (x_m, y_m) = (x.trim().parse::<f64>().ok()?, y.trim().parse::<f64>().ok()?);
        (x_m.is_finite() && y_m.is_finite()).then(|| MapXy::new(x_m, y_m))
    });
    parsed.ok_or_else(|| "a place is X,Y in metres, as in 1.5,-2".to_owned())
}

/// A number within limits, for arguments with units.
pub(super) fn within(text: &str, low: f64, high: f64) -> Result<f64, String> {
    let number = text
        .parse()
        .ok()
        .filter(|it: &f64| (low..=high).contains(it));
    number.ok_or_else(|| format!("a number from {low} to {high}"))
}

/// The map of a shipped flat, or of a file.
pub(super) fn map(named: &Path) -> Result<(String, Arc<Map>), BadInput> {
    let is_name = named.to_str().is_some_and(|it| !it.contains(['.', '/']));
    if is_name || named.extension().is_some_and(|it| it == "toml") {
        let flat = Flat::read(named)?;
        return Ok((flat.name, flat.map));
    }
    let name = named.file_stem().unwrap_or_default().to_string_lossy();
    Ok((name.into_owned(), Arc::new(map_file::load(named)?)))
}

/// The floor for a drone that keeps `radius_m` metres from walls. In large cells, doors that are wide enough would be closed.
pub(super) fn floor(map: &Map, radius_m: f64) -> Floor {
    Floor::new(Arc::new(map.split(CELL_M)), radius_m)
}

/// Most numbers that are tried.
const NUMBERS_MAX: u32 = 100_000;

/// The file for a page: the one that was asked for, or the first of `runs/NAME-WHAT.html`, `-2.html`, … that is free.
pub(super) struct PageFile {
    out: Option<PathBuf>,
    stem: String,
}

impl PageFile {
    /// Refuses a file that can't be written.
    pub(super) fn new(out: Option<&Path>, name: &str, what: &str) -> Result<Self, BadInput> {
        let stem = format!("{name}-{what}");
        folder::check_file(out.unwrap_or(&in_runs(&stem)))?;
        let out = out.map(Path::to_path_buf);
        Ok(Self { out, stem })
    }

    /// Writes a page; returns its path. A link stays, and what it points to is written.
    pub(super) fn write(self, page: &str) -> Result<PathBuf, Failure> {
        let file = self.out.unwrap_or_else(|| numbered(&self.stem, page));
        let target = file.canonicalize();
        let target = target.as_deref().unwrap_or(&file);
        output::write_file(target, page.as_bytes())?;
        Ok(file)
    }
}

fn in_runs(stem: &str) -> PathBuf {
    Path::new("runs").join(format!("{stem}.html"))
}

/// The first file of this name, with -2, -3, … appended, that does not exist or has this page.
fn numbered(stem: &str, page: &str) -> PathBuf {
    let names = (2..=NUMBERS_MAX).map(|number| format!("{stem}-{number}"));
    let mut files = std::iter::once(stem.to_owned())
        .chain(names)
        .map(|it| in_runs(&it));
    let is_usable = |file: &PathBuf| match fs::read(file) {
        Ok(existing) => existing == page.as_bytes(),
        Err(_) => file.symlink_metadata().is_err(),
    };
    files.find(is_usable).unwrap_or_else(|| in_runs(stem))
}
