//! A folder of its own for each run.

use std::fs;
use std::path::{Path, PathBuf};

use muster_scenarios::report::Report;
use serde_json::Value;

use super::REPORT_JSON;

/// Most numbers that are tried.
const NUMBERS_MAX: u32 = 100_000;

/// The first of `folder`, `folder-2`, `folder-3`, … that is usable: it does not exist, is empty, or `holds_same` says that
/// what it holds is what will be written.
#[must_use]
pub fn numbered(folder: &Path, holds_same: impl Fn(&Path) -> bool) -> PathBuf {
    let named = |number: u32| {
        let mut name = folder.as_os_str().to_owned();
        name.push(format!("-{number}"));
        PathBuf::from(name)
    };
    let mut folders = std::iter::once(folder.to_owned()).chain((2..=NUMBERS_MAX).map(named));
    let usable = folders.find(|folder| is_unused(folder) || holds_same(folder));
    usable.unwrap_or_else(|| folder.to_owned())
}

fn is_unused(folder: &Path) -> bool {
    match fs::read_dir(folder) {
        Ok(mut entries) => entries.next().is_none(),
        Err(_) => folder.symlink_metadata().is_err(),
    }
}

/// Whether a folder holds the report of the same run: the same command with the same trace.
#[must_use]
pub fn holds(folder: &Path, report: &Report) -> bool {
    let text = fs::read(folder.join(REPORT_JSON)).unwrap_or_default();
    let Ok(other) = serde_json::from_slice::<Value>(&text) else {
        return false;
    };
    report.trace.is_some()
        && other["command"].as_str() == Some(&report.command)
        && other["trace"].as_str() == report.trace.as_deref()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::{sample, write};

    #[test]
    fn another_run_gets_another_folder_and_the_same_run_its_own() {
        let home = tempfile::tempdir().unwrap();
        let base = home.path().join("thesis-2-7");
        let (report, flight) = sample::swarm(3);
        let mut other = report.clone();
        other.command.push_str(" --set radio.loss=0.2");
        let folder = |report: &Report| {
            let folder = numbered(&base, |folder| holds(folder, report));
            write(&folder, report, &flight).unwrap();
            folder.file_name().unwrap().to_string_lossy().into_owned()
        };
        let written = [&report, &other, &report, &other].map(folder);
        assert_eq!(
            written,
            ["thesis-2-7", "thesis-2-7-2", "thesis-2-7", "thesis-2-7-2"]
        );
        let kept = fs::read_to_string(base.join(REPORT_JSON)).unwrap();
        assert!(!kept.contains("radio.loss"), "nothing is lost");
        let mut real = report;
        real.trace = None;
        assert_eq!(
            folder(&real),
            "thesis-2-7-3",
            "a flight in real time never repeats"
        );
    }

    #[test]
    fn empty_folder_is_used_and_a_file_is_not() {
        let home = tempfile::tempdir().unwrap();
        let base = home.path().join("run");
        fs::create_dir(&base).unwrap();
        assert_eq!(numbered(&base, |_| false), base);
        fs::remove_dir(&base).unwrap();
        fs::write(&base, "mine").unwrap();
        assert_eq!(numbered(&base, |_| false), home.path().join("run-2"));
    }
}
