//! Suggestions for misspelt names.

use std::path::Path;

/// Letters that may differ: one of three, and one of shorter names.
const LETTERS_PER_DIFFERENCE: usize = 3;
/// The shortest part of a name that suggests the whole name.
const PART_MIN: usize = 3;
/// Most names of a folder that are compared.
const NAMES_MAX: usize = 10_000;

/// The candidate that `name` most likely means; `None` if none is similar. Upper and lower case are the same.
#[must_use]
pub fn nearest<S: AsRef<str>>(name: &str, candidates: impl IntoIterator<Item = S>) -> Option<S> {
    let name = name.to_lowercase();
    let differences_max = (name.chars().count() / LETTERS_PER_DIFFERENCE).max(1);
    let ranked = candidates.into_iter().filter_map(|candidate| {
        let other = candidate.as_ref().to_lowercase();
        let differences = strsim::osa_distance(&name, &other);
        let is_part = name.len() >= PART_MIN && other.contains(&name);
        let is_near = differences <= differences_max || is_part;
        is_near.then_some((!is_part, differences, candidate))
    });
    let best = ranked.min_by_key(|(is_no_part, differences, _)| (*differences, *is_no_part));
    best.map(|(_, _, candidate)| candidate)
}

/// A suggestion to end an error message with: "; did you mean `radio.loss`?". Empty if no candidate is similar.
#[must_use]
pub fn did_you_mean<S: AsRef<str>>(name: &str, candidates: impl IntoIterator<Item = S>) -> String {
    nearest(name, candidates).map_or_else(String::new, |candidate| {
        format!("; did you mean `{}`?", candidate.as_ref())
    })
}

/// A suggestion for the path of a missing file, from the names in its folder. Empty if none is similar.
#[must_use]
pub fn did_you_mean_file(path: &Path) -> String {
    let (Some(folder), Some(name)) = (path.parent(), path.file_name()) else {
        return String::new();
    };
    let listed = match folder {
        folder if folder == Path::new("") => Path::new("."),
        folder => folder,
    };
    let entries = std::fs::read_dir(listed).into_iter().flatten().flatten();
    let names = entries.take(NAMES_MAX).map(|entry| entry.file_name());
    let mut names: Vec<String> = names.filter_map(|it| it.into_string().ok()).collect();
    names.sort();
    match nearest(&name.to_string_lossy(), names) {
        Some(near) => format!("; did you mean `{}`?", folder.join(near).display()),
        None => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn misspelt_and_partial_names_suggest_the_nearest() {
        let names = ["range_m", "model", "loss", "latency_us"];
        assert_eq!(nearest("rang_m", names), Some("range_m"));
        assert_eq!(nearest("Modle", names), Some("model"));
        assert_eq!(nearest("latency", names), Some("latency_us"));
        assert_eq!(nearest("altitude", names), None);
        assert_eq!(did_you_mean("los", names), "; did you mean `loss`?");
        assert_eq!(did_you_mean("x", ["loss"]), "");
        assert_eq!(nearest("here", ["share"]), None);
        assert_eq!(nearest("flat.yaml", ["big.yaml"]), None);
    }

    #[test]
    fn missing_file_suggests_a_file_of_its_folder() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("river.waypoints"), "").unwrap();
        let near = did_you_mean_file(&folder.path().join("rivers.waypoint"));
        let expected = folder.path().join("river.waypoints");
        assert_eq!(near, format!("; did you mean `{}`?", expected.display()));
        assert_eq!(did_you_mean_file(&folder.path().join("none/x.plan")), "");
    }
}
