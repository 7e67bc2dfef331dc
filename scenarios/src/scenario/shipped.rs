//! Scenarios and missions that are part of the program, so that it works without the repository.

use std::borrow::Cow;
use std::path::{Component, Path, PathBuf};

use muster_runtime::diagnostic::{BadInput, did_you_mean, read_text};
use muster_runtime::plan::file::is_name;

/// Path, relative to `scenarios/`, and text of each shipped file.
const FILES: &[(&str, &str)] = &include!(concat!(env!("OUT_DIR"), "/shipped.rs"));

/// The list of shipped files for people, which has a line on each.
const LIST: &str = include_str!("../../README.md");

/// Folder under which shipped files appear in errors. No file of a disk is read below it.
const FOLDER: &str = "shipped:";

/// Extension of scenario files.
const SCENARIO: &str = "toml";

/// A shipped scenario or mission.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Shipped {
    /// Its name: `thesis-2`, `river`.
    pub name: String,
    /// One line on it.
    pub about: String,
    /// Whether it is a mission, not a scenario.
    pub is_mission: bool,
}

/// The shipped scenarios and missions, grouped under headings, in the order of `scenarios/README.md`.
#[must_use]
pub fn shipped() -> Vec<(String, Vec<Shipped>)> {
    let mut groups: Vec<(String, Vec<Shipped>)> = Vec::new();
    for line in LIST.lines() {
        if let Some(heading) = line.strip_prefix("## ") {
            groups.push((heading.to_owned(), Vec::new()));
        }
        let row = line
            .strip_prefix("| `")
            .and_then(|row| row.split_once("` | "));
        if let (Some((path, about)), Some((_, group))) = (row, groups.last_mut()) {
            group.push(Shipped {
                name: stem(path),
                about: without_links(about.trim_end_matches('|').trim()),
                is_mission: !is_scenario(path),
            });
        }
    }
    groups.retain(|(_, group)| !group.is_empty());
    groups
}

/// The path that a scenario's name or path stands for: a single word without a dot is the name of a shipped one.
///
/// # Errors
/// If there is no shipped scenario of this name.
pub fn scenario_file(named: &Path) -> Result<Cow<'_, Path>, BadInput> {
    find(named, is_scenario, "scenario")
}

/// Whether this is the name of a shipped scenario.
#[must_use]
pub fn is_shipped(named: &Path) -> bool {
    is_name(named) && scenario_file(named).is_ok()
}

/// As [`scenario_file`], for missions.
///
/// # Errors
/// If there is no shipped mission of this name.
pub fn mission_path(named: &Path) -> Result<Cow<'_, Path>, BadInput> {
    find(named, |path| !is_scenario(path), "mission")
}

/// As [`scenario_file`], for scenarios and missions.
///
/// # Errors
/// If there is neither of this name.
pub fn scenario_or_mission(named: &Path) -> Result<Cow<'_, Path>, BadInput> {
    find(named, |_| true, "scenario or mission")
}

/// The text of a shipped file, or of one on the disk.
///
/// # Errors
/// As [`read_text`], and if there is no shipped file of this name.
pub fn read(path: &Path) -> Result<String, BadInput> {
    let path = mission_path(path)?;
    let Ok(inside) = path.strip_prefix(FOLDER) else {
        return read_text(&path);
    };
    let inside = normal(inside);
    let found = FILES.iter().find(|(name, _)| Path::new(name) == inside);
    found.map(|(_, text)| (*text).to_owned()).ok_or_else(|| {
        let help = "`muster list` shows the shipped scenarios and missions";
        BadInput::without_excerpt(&path, "there is no such shipped file", help)
    })
}

/// A path as the user names it: shipped files by their names.
#[must_use]
pub(super) fn shown(path: &Path) -> Cow<'_, Path> {
    match path.strip_prefix(FOLDER) {
        Ok(inside) => Cow::Owned(stem(&inside.to_string_lossy()).into()),
        Err(_) => Cow::Borrowed(path),
    }
}

/// How names of the user's own scenarios and missions end.
const SUFFIXES: [&str; 4] = [SCENARIO, "waypoints", "plan", "kml"];

fn find<'a>(
    named: &'a Path,
    is_one: fn(&str) -> bool,
    kind: &str,
) -> Result<Cow<'a, Path>, BadInput> {
    if !is_name(named) {
        return Ok(Cow::Borrowed(named));
    }
    let name = named.to_string_lossy();
    let mut paths = FILES
        .iter()
        .map(|(path, _)| *path)
        .filter(|path| is_one(path));
    match paths.clone().find(|path| stem(path) == name) {
        Some(path) => Ok(Cow::Owned(Path::new(FOLDER).join(path))),
        None => {
            let all = || FILES.iter().map(|(path, _)| *path);
            let mut here = SUFFIXES.iter().map(|suffix| format!("{name}.{suffix}"));
            let here = here.find(|file| is_one(file) && Path::new(file).is_file());
            let suggestion = match (all().find(|path| stem(path) == name), here) {
                (_, Some(file)) => format!("; the file here is named {file}"),
                (Some(path), None) if is_scenario(path) => "; a scenario has it".to_owned(),
                (Some(_), None) => "; a mission has it".to_owned(),
                (None, None) => {
                    let near = did_you_mean(&name, paths.by_ref().map(stem));
                    if near.is_empty() {
                        did_you_mean(&name, all().map(stem))
                    } else {
                        near
                    }
                }
            };
            let message = format!("there is no shipped {kind} of this name{suggestion}");
            let help = format!(
                "`muster list` shows the names; the path of a file has a `/` or a `.`, as in ./{name}"
            );
            Err(BadInput::without_excerpt(named, message, help))
        }
    }
}

fn is_scenario(path: &str) -> bool {
    Path::new(path).extension().is_some_and(|it| it == SCENARIO)
}

fn stem(path: &str) -> String {
    let stem = Path::new(path).file_stem().unwrap_or_default();
    stem.to_string_lossy().into_owned()
}

/// A relative path without `..`.
fn normal(path: &Path) -> PathBuf {
    let mut normal = PathBuf::new();
    for component in path.components() {
        match component {
            Component::ParentDir => drop(normal.pop()),
            other => normal.push(other),
        }
    }
    normal
}

/// Markdown without the targets of its links and without backticks.
fn without_links(text: &str) -> String {
    let mut plain = String::new();
    let mut rest = text;
    while let Some((before, after)) = rest.split_once("](") {
        plain.push_str(&before.replacen('[', "", 1));
        rest = after.split_once(')').map_or("", |(_, rest)| rest);
    }
    plain.push_str(rest);
    plain.replace('`', "")
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn names_are_unique_and_all_listed() {
        let listed: Vec<_> = shipped().into_iter().flat_map(|(_, group)| group).collect();
        let names: BTreeSet<_> = listed
            .iter()
            .map(|it| (it.is_mission, it.name.clone()))
            .collect();
        let files: BTreeSet<_> = FILES
            .iter()
            .map(|(path, _)| (!is_scenario(path), stem(path)))
            .collect();
        assert_eq!((names.len(), files.len()), (listed.len(), FILES.len()));
        assert_eq!(names, files);
        assert!(listed.iter().all(|it| is_name(Path::new(&it.name))));
        assert!(
            listed
                .iter()
                .all(|it| it.about.len() > 10 && !it.about.contains(['[', '`', '…']))
        );
    }

    #[test]
    fn single_word_is_a_shipped_file_and_a_path_is_not() {
        let path = |named: &str| scenario_file(Path::new(named)).unwrap().into_owned();
        assert_eq!(
            path("swarm-short"),
            Path::new("shipped:/hardware/swarm-short.toml")
        );
        assert_eq!(shown(&path("swarm-short")), Path::new("swarm-short"));
        for file in ["./thesis-2", "thesis-2.toml", "scenarios/thesis-2.toml"] {
            assert_eq!(path(file), Path::new(file));
        }
    }

    #[test]
    fn unknown_name_is_refused_with_a_similar_one() {
        let refused = scenario_file(Path::new("thesis2")).unwrap_err().to_string();
        assert!(refused.contains("did you mean `thesis-2`?"), "{refused}");
        let refused = read(Path::new("rivr")).unwrap_err().to_string();
        assert!(refused.contains("did you mean `river`?"), "{refused}");
    }

    #[test]
    fn missions_are_read_through_the_folders_of_scenarios() {
        let through = read(Path::new("shipped:/hardware/../missions/hop.waypoints")).unwrap();
        assert_eq!(through, read(Path::new("hop")).unwrap());
        assert!(read(Path::new("shipped:/Cargo.toml")).is_err());
    }
}
