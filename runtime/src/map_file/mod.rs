//! Reader of maps of buildings: a map_server YAML with its image, or a floor plan drawn in it.

#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};

use muster_indoor::map::{Header, IMAGE_SIZE_MAX, Map, MapError};
use muster_indoor::refusal::Refusal;

use crate::diagnostic::{BadInput, did_you_mean_file, read_bytes, read_text};

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
        Some(image_path) if !image_path.exists() => return Err(no_image(path, image_path)),
        Some(image_path) => read_bytes(image_path, IMAGE_SIZE_MAX as u64)?,
        None => Vec::new(),
    };
    Map::parse(&header, &image).map_err(|error| match error {
        MapError::Text(refusal) => refused(path, &text, refusal),
        MapError::Image(error) => BadInput::without_excerpt(
            image_path.as_deref().unwrap_or(path),
            error,
            "`image` takes a whole PGM or PNG image, with one pixel for each cell",
        ),
    })
}

/// Most images of a folder that an error names.
const IMAGES_SHOWN_MAX: usize = 5;

/// The error for an image that does not exist, with names that are near, or all images of its folder.
fn no_image(path: &Path, image_path: &Path) -> BadInput {
    let folder = |path: &Path| match path.parent() {
        None => Path::new(".").to_owned(),
        Some(folder) if folder == Path::new("") => Path::new(".").to_owned(),
        Some(folder) => folder.to_owned(),
    };
    let mut message = format!("there is no such file{}", did_you_mean_file(image_path));
    let searched = folder(image_path);
    if !searched.is_dir() {
        message.push_str(&format!(", and no folder {}", searched.display()));
    } else if !message.contains("did you mean") {
        match images(&searched).as_slice() {
            [] => message.push_str("; its folder has no PGM or PNG"),
            images => message.push_str(&format!("; its folder has {}", images.join(", "))),
        }
    }
    let help = format!(
        "`image` in {} takes a PGM or PNG file; its path starts at the map's folder, {}",
        path.display(),
        folder(path).display()
    );
    BadInput::without_excerpt(image_path, message, help)
}

/// Names of images in a folder, at most [`IMAGES_SHOWN_MAX`].
fn images(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let names = entries.filter_map(|entry| entry.file_name().into_string().ok());
    let is_image = |name: &String| {
        let extension = Path::new(name).extension().unwrap_or_default();
        extension.eq_ignore_ascii_case("pgm") || extension.eq_ignore_ascii_case("png")
    };
    let mut names: Vec<String> = names.filter(is_image).collect();
    names.sort();
    names.truncate(IMAGES_SHOWN_MAX);
    names
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
