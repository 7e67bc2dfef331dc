//! Reader of maps of buildings: a map_server YAML with its image, or a floor plan drawn in it.

#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};

use muster_indoor::map::{Header, IMAGE_SIZE_MAX, Map, MapError};
use muster_indoor::refusal::Refusal;

use crate::diagnostic::{BadInput, read_bytes, read_text};

/// Reads a map and the image that it names. The image's path is relative to the map's folder.
///
/// # Errors
/// If the map or its image can't be used; the error names the file at fault.
pub fn load(path: &Path) -> Result<Map, BadInput> {
    let text = read_text(path)?;
    let header = Header::parse(&text).map_err(|refusal| {
        if is_toml(&text) {
            return no_yaml(path);
        }
        refused(path, &text, refusal)
    })?;
    let image_path = image_path(path, &header);
    let image = match &image_path {
        Some(image_path) => read_bytes(image_path, IMAGE_SIZE_MAX as u64)?,
        None => Vec::new(),
    };
    Map::parse(&header, &image).map_err(|error| match error {
        MapError::Text(refusal) => refused(path, &text, refusal),
        MapError::Image(error) => BadInput::without_excerpt(
            image_path.as_deref().unwrap_or(path),
            error,
            "give a whole PGM or PNG image, one pixel a cell",
        ),
    })
}

/// Whether a text is TOML with a field at least.
fn is_toml(text: &str) -> bool {
    let table = text.parse::<toml::Table>();
    table.is_ok_and(|it| !it.is_empty())
}

/// The error for a flat or other TOML in the place of a map.
fn no_yaml(path: &Path) -> BadInput {
    let help = "a map is YAML with `image` or `plan`; a flat's name ends with `.toml`";
    BadInput::without_excerpt(path, "this is TOML, and a map is YAML", help)
}

/// The path of the image that a map names; `None` if the map is drawn as text.
#[must_use]
pub fn image_path(path: &Path, header: &Header) -> Option<PathBuf> {
    let folder = path.parent().unwrap_or(Path::new(""));
    header.image().map(|image| folder.join(image))
}

/// The error for a text that was refused.
#[must_use]
pub fn refused(path: &Path, text: &str, refusal: Refusal) -> BadInput {
    let Refusal {
        span,
        message,
        accepted,
    } = refusal;
    BadInput::new(path, text, span, message, accepted)
}
