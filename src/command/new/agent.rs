//! `muster new agent`: a crate to start from.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use muster_runtime::diagnostic::BadInput;

use super::{Failure, Outcome, terminal, write};

/// Files of the crate: path and text. `NAME` stands for the crate's name, `CRATE` for its name in Rust, `MUSTER` for the
/// dependency on muster.
const FILES: [(&str, &str); 8] = [
    ("Cargo.toml", include_str!("agent/Cargo.toml.txt")),
    ("src/lib.rs", include_str!("agent/lib.rs.txt")),
    ("src/main.rs", include_str!("agent/main.rs.txt")),
    ("src/bin/NAMEd.rs", include_str!("agent/daemon.rs.txt")),
    ("tests/flight.rs", include_str!("agent/test.rs.txt")),
    ("NAME.toml", include_str!("agent/scenario.toml.txt")),
    ("place.waypoints", include_str!("agent/place.waypoints.txt")),
    (".gitignore", "/target\n/runs\n"),
];

/// Names that cargo or the compiler refuses, cargo's folders among them, or that hide a crate which the written one uses.
/// Keywords: the Rust Reference, "Keywords", of the 2024 edition.
const TAKEN: [&str; 63] = [
    "abstract",
    "alloc",
    "as",
    "async",
    "await",
    "become",
    "box",
    "build",
    "break",
    "const",
    "continue",
    "core",
    "crate",
    "deps",
    "do",
    "dyn",
    "else",
    "enum",
    "examples",
    "extern",
    "false",
    "final",
    "fn",
    "for",
    "gen",
    "if",
    "impl",
    "in",
    "incremental",
    "let",
    "loop",
    "macro",
    "match",
    "mod",
    "move",
    "mut",
    "muster",
    "override",
    "priv",
    "proc-macro",
    "proc_macro",
    "pub",
    "ref",
    "return",
    "self",
    "serde",
    "static",
    "std",
    "struct",
    "super",
    "test",
    "trait",
    "true",
    "try",
    "type",
    "typeof",
    "union",
    "unsafe",
    "unsized",
    "use",
    "virtual",
    "where",
    "while",
];

/// Writes the crate into a new folder of this name.
pub(super) fn run(folder: &Path, muster: Option<&Path>) -> Result<Outcome, Failure> {
    let name = folder.file_name().unwrap_or_default().to_string_lossy();
    let is_letter = |c: char| c.is_ascii_lowercase();
    let fits = name.starts_with(is_letter)
        && (name.chars()).all(|c| is_letter(c) || c.is_ascii_digit() || "-_".contains(c));
    if !fits || TAKEN.contains(&&*name) {
        let help = "a crate's name has lower-case letters, digits, - and _, and begins with a letter; words of Rust, names of \
                    crates that it uses and of folders of cargo are taken";
        let message = "can't be the name of a crate";
        return Err(BadInput::without_excerpt(folder, message, help).into());
    }
    if folder.symlink_metadata().is_ok() {
        let help = "give another name";
        return Err(BadInput::without_excerpt(folder, "exists and is not touched", help).into());
    }
    let dependency = dependency(muster)?;
    let fill = |text: &str| {
        text.replace("NAME", &name)
            .replace("CRATE", &name.replace('-', "_"))
            .replace("MUSTER", &dependency)
    };
    for (path, text) in FILES {
        let path = folder.join(fill(path));
        let parent = path.parent().unwrap_or(folder);
        fs::create_dir_all(parent).map_err(|source| Failure::Create {
            path: parent.to_owned(),
            source,
        })?;
        write(&path, &fill(text))?;
    }
    let shown = folder.display();
    terminal::print(&format!(
        "wrote {shown}\n\nTest it: cd {shown} && cargo test --release\nFly it:  cd {shown} && cargo run --release -- sim {name}.toml\n"
    ))?;
    Ok(Outcome::Success)
}

/// The dependency on muster: its sources.
fn dependency(muster: Option<&Path>) -> Result<String, Failure> {
    let built_from = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder = muster.unwrap_or(built_from);
    let is_muster = |folder: &Path| folder.join("src/simulation.rs").is_file();
    let found: io::Result<PathBuf> = fs::canonicalize(folder);
    match found {
        Ok(folder) if is_muster(&folder) => {
            Ok(format!("{{ path = {:?} }}", folder.display().to_string()))
        }
        _ => {
            let help = "give the folder of muster's sources: `muster new agent NAME --muster DIR`";
            Err(BadInput::without_excerpt(folder, "has no sources of muster", help).into())
        }
    }
}
