//! Files and arguments that can't be used: exit code 2, an error with file, place and accepted values, and no output.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod arguments;
mod exposures;
mod fences;
mod files;
mod maps;
mod scenarios;

use std::fs;
use std::path::PathBuf;

use assert_cmd::Command;
use tempfile::TempDir;

const SCENARIO: &str = include_str!("../../scenarios/thesis-1.toml");
const MISSION: &str = include_str!("../../scenarios/missions/albufera.plan");

/// A folder with a scenario and its mission.
struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        let folder = Self(tempfile::tempdir().unwrap());
        fs::create_dir(folder.path("missions")).unwrap();
        folder.write("scenario.toml", SCENARIO);
        folder.write("missions/albufera.plan", MISSION);
        folder
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        fs::write(self.path(name), content).unwrap();
    }

    /// The exit code of a command in this folder, and what it printed as output and as errors.
    fn muster(&self, arguments: &[&str]) -> (Option<i32>, [String; 2]) {
        let run = Command::cargo_bin("muster")
            .unwrap()
            .current_dir(self.0.path())
            .args(arguments)
            .output()
            .unwrap();
        let printed = [run.stdout, run.stderr].map(|it| String::from_utf8(it).unwrap());
        (run.status.code(), printed)
    }

    /// The error of `muster sim` for the scenario; `Err` with the reason if the scenario is not refused.
    fn refusal(&self, more: &[&str]) -> Result<String, String> {
        let mut arguments = vec!["sim", "scenario.toml"];
        if !more.contains(&"--out") {
            arguments.extend(["--out", "out"]);
        }
        arguments.extend(more);
        self.refused(&arguments)
    }

    /// The error of a command; `Err` with the reason if it doesn't refuse its input as it should.
    fn refused(&self, arguments: &[&str]) -> Result<String, String> {
        let (code, [output, error]) = self.muster(arguments);
        let wrong = match () {
            () if code != Some(2) => "the exit code is not 2",
            () if !output.is_empty() => "there is output",
            () if self.path("out").exists() => "a folder was written",
            () if error.contains("panicked") => "it panicked",
            () if names_a_type(&error) => "it names a type of the program",
            () => return Ok(error),
        };
        Err(format!("{wrong} ({code:?}):\n{output}{error}"))
    }

    /// Checks that `muster sim` refuses the scenario with each of these texts.
    fn check_refusal(&self, more: &[&str], texts: &[impl AsRef<str>]) -> Result<(), String> {
        contains(&self.refusal(more)?, texts)
    }
}

/// Words of the language that muster is written in, which mean nothing to who wrote a file.
const WORDS_OF_RUST: [&str; 24] = [
    "f32", "f64", "i8", "i16", "i32", "i64", "u8", "u16", "u32", "u64", "usize", "isize", "bool",
    "boolean", "struct", "enum", "variant", "tuple", "untagged", "serde", "Vec", "Option",
    "newtype", "spanned",
];

/// Whether an error has a word of [`WORDS_OF_RUST`], or an expression of the parser's.
fn names_a_type(error: &str) -> bool {
    let mut words = error.split(|c: char| !c.is_alphanumeric() && c != '_');
    let expressions = [
        "invalid type",
        "literal string",
        "basic string",
        "invalid digit",
    ];
    words.any(|word| WORDS_OF_RUST.contains(&word))
        || expressions.iter().any(|it| error.contains(it))
}

/// Checks that an error contains each of these texts; it is wrapped to the width of a terminal.
fn contains(error: &str, texts: &[impl AsRef<str>]) -> Result<(), String> {
    let unwrapped = error.replace("\n  │ ", " ");
    let unwrapped: Vec<&str> = unwrapped.split_whitespace().collect();
    let unwrapped = unwrapped.join(" ");
    for text in texts.iter().map(AsRef::as_ref) {
        if !unwrapped.contains(text) {
            return Err(format!("`{text}` is missing in:\n{error}"));
        }
    }
    Ok(())
}

/// Fails with the name and the reason of each case that failed.
fn assert_all<N: AsRef<str>>(cases: impl IntoIterator<Item = (N, Result<(), String>)>) {
    let failed = cases.into_iter().filter_map(|(name, result)| {
        let reason = result.err()?;
        Some(format!("== {}\n{reason}", name.as_ref()))
    });
    let failed: Vec<String> = failed.collect();
    assert!(
        failed.is_empty(),
        "{} failed:\n{}",
        failed.len(),
        failed.join("\n")
    );
}
