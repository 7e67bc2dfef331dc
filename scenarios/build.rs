//! Lists the shipped scenarios and missions for `src/scenario/shipped.rs`, which puts them into the program.

use std::env;
use std::error::Error;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

/// Folders with shipped files, relative to the crate.
const FOLDERS: [&str; 4] = ["", "hardware", "scale", "missions"];
/// Extensions of scenarios and missions.
const EXTENSIONS: [&str; 4] = ["toml", "plan", "waypoints", "kml"];

fn main() -> Result<(), Box<dyn Error>> {
    let root = env::var("CARGO_MANIFEST_DIR")?;
    let mut files = Vec::new();
    for folder in FOLDERS {
        let folder = Path::new(&root).join(folder);
        for entry in fs::read_dir(&folder)? {
            let path = entry?.path();
            let extension = path.extension().and_then(|it| it.to_str());
            let is_shipped = extension.is_some_and(|it| EXTENSIONS.contains(&it));
            if is_shipped && path.is_file() && !path.ends_with("Cargo.toml") {
                files.push(path);
            }
        }
        // The root's other files change often, and a new scenario there comes with a row of the README.
        let watched = if folder == Path::new(&root) {
            folder.join("README.md")
        } else {
            folder
        };
        println!("cargo::rerun-if-changed={}", watched.display());
    }
    files.sort();
    let mut list = String::from("[\n");
    for path in files {
        let name = path
            .strip_prefix(&root)?
            .to_str()
            .ok_or("a name is not UTF-8")?;
        let path = path.to_str().ok_or("a name is not UTF-8")?;
        writeln!(list, "    ({name:?}, include_str!({path:?})),")?;
    }
    list.push_str("]\n");
    fs::write(Path::new(&env::var("OUT_DIR")?).join("shipped.rs"), list)?;
    Ok(())
}
