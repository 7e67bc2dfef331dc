//! Recordings of a run for other programs: Foxglove, Google Earth, geographic information systems, a picture that moves.

mod animation;
mod colours;
mod geojson;
mod kml;
mod mcap;
mod place;
#[cfg(test)]
mod tests;

use std::fmt;
use std::io::{self, Write};
use std::path::Path;

use muster_scenarios::report::{Flight, Report};

use super::write::{DraftFile, WriteError};

/// A kind of recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Recording {
    /// MCAP with Foxglove's schemas.
    Mcap,
    /// KML with a track of each drone.
    Kml,
    /// GeoJSON with a line of each drone, and points for what happened.
    GeoJson,
    /// SVG that plays by itself.
    Animation,
}

impl Recording {
    /// All kinds.
    pub const ALL: [Self; 4] = [Self::Mcap, Self::Kml, Self::GeoJson, Self::Animation];

    /// Writes the recording of a run to `path`. It is written and synced under a temporary name, then renamed.
    ///
    /// # Errors
    /// If the system refuses, or the folder of `path` does not exist. A file that was there before is kept.
    pub fn write(self, path: &Path, report: &Report, flight: &Flight) -> Result<(), WriteError> {
        let folder = path.parent().filter(|folder| *folder != Path::new(""));
        let name = path.file_name().ok_or_else(|| {
            let source = io::Error::new(io::ErrorKind::IsADirectory, "this is a folder");
            WriteError::file(path, source)
        })?;
        let mut draft =
            DraftFile::create(folder.unwrap_or(Path::new(".")), &name.to_string_lossy())?;
        let written = match self {
            Self::Mcap => mcap::write(&mut draft, report, flight),
            Self::Kml => draft.write_all(kml::kml(report, flight).as_bytes()),
            Self::GeoJson => draft.write_all(&geojson::geojson(report, flight)),
            Self::Animation => draft.write_all(animation::svg(report, flight).as_bytes()),
        };
        written.map_err(|source| WriteError::file(path, source))?;
        draft.complete()?.publish().map(drop)
    }
}

impl fmt::Display for Recording {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Mcap => "mcap",
            Self::Kml => "kml",
            Self::GeoJson => "geojson",
            Self::Animation => "animation",
        })
    }
}
