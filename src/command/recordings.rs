//! Recordings of a run for other programs, besides its report.

use std::path::{Path, PathBuf};

use clap::Args;
use muster_experiments::output::{REPORT_HTML, REPORT_JSON, Recording, TRACKS_CSV, WriteError};
use muster_runtime::diagnostic::BadInput;
use muster_scenarios::report::{Flight, Report};

#[derive(Debug, Args)]
#[command(next_help_heading = "Recordings")]
pub(crate) struct Recordings {
    /// Also write the run as MCAP, for Foxglove.
    #[arg(long, value_name = "FILE")]
    mcap: Option<PathBuf>,
    /// Also write the run as KML, for Google Earth.
    #[arg(long, value_name = "FILE")]
    kml: Option<PathBuf>,
    /// Also write the run as GeoJSON, for QGIS and others.
    #[arg(long, value_name = "FILE")]
    geojson: Option<PathBuf>,
    /// Also write the run as a picture that moves, in SVG.
    #[arg(long, value_name = "FILE")]
    animation: Option<PathBuf>,
}

impl Recordings {
    fn paths(&self) -> impl Iterator<Item = (Recording, &Path)> {
        let paths = [&self.mcap, &self.kml, &self.geojson, &self.animation];
        let all = Recording::ALL.into_iter().zip(paths);
        all.filter_map(|(recording, path)| Some((recording, path.as_deref()?)))
    }

    /// Refuses files that can't be written, before a run starts, and a file for two recordings, or for one and the report in
    /// the folder `out`.
    pub(crate) fn check(&self, out: &Path) -> Result<(), BadInput> {
        let report = [REPORT_HTML, REPORT_JSON, TRACKS_CSV].map(|name| whole(&out.join(name)));
        let mut seen: Vec<PathBuf> = Vec::new();
        for (recording, path) in self.paths() {
            let help = format!("--{recording} takes the path of a file in an existing folder");
            let refuse = |at: &Path, what: &str| BadInput::without_excerpt(at, what, help.clone());
            if path.is_dir() || path.file_name().is_none() {
                return Err(refuse(path, "is a folder"));
            }
            if path.exists() && !path.is_file() {
                return Err(refuse(path, "is not a file but a device or a pipe"));
            }
            let whole = whole(path);
            if seen.contains(&whole) {
                return Err(refuse(path, "is given for two recordings"));
            }
            if report.contains(&whole) {
                return Err(refuse(path, "is a file of the report in --out"));
            }
            let folder = path.parent().filter(|it| *it != Path::new(""));
            let folder = folder.unwrap_or(Path::new("."));
            if !folder.is_dir() {
                return Err(refuse(folder, "is not an existing folder"));
            }
            tempfile::tempfile_in(folder).map_err(|error| {
                let what = format!("can't be written to: {error}");
                BadInput::without_excerpt(folder, what, help.clone())
            })?;
            seen.push(whole);
        }
        Ok(())
    }

    /// Writes the recordings. Returns their paths.
    pub(crate) fn write(
        &self,
        report: &Report,
        flight: &Flight,
    ) -> Result<Vec<PathBuf>, WriteError> {
        self.paths()
            .map(|(recording, path)| {
                // A link stays, and what it points to is written.
                let target = path.canonicalize();
                recording.write(target.as_deref().unwrap_or(path), report, flight)?;
                Ok(path.to_owned())
            })
            .collect()
    }
}

/// The path of a file without links and dots, as far as it exists.
fn whole(path: &Path) -> PathBuf {
    if let Ok(path) = path.canonicalize() {
        return path;
    }
    let folder = path.parent().filter(|it| *it != Path::new(""));
    let folder = folder.unwrap_or(Path::new(".")).canonicalize();
    match (folder, path.file_name()) {
        (Ok(folder), Some(name)) => folder.join(name),
        _ => path.to_owned(),
    }
}
