//! The command `muster list`.

use std::path::Path;

use crate::support::muster;

fn printed(arguments: &[&str]) -> String {
    let run = muster(Path::new("."), arguments);
    assert_eq!(run.status.code(), Some(0), "{arguments:?}");
    String::from_utf8(run.stdout).unwrap()
}

#[test]
fn heights_of_missions_are_those_that_check_finds() {
    let list = printed(&["list"]);
    let (_, missions) = list.split_once("Which missions are there?\n").unwrap();
    let mut compared = 0;
    for line in missions.lines() {
        let (name, about) = line.trim().split_once(' ').unwrap();
        let listed = about.split_once(" m high").map(|(it, _)| it);
        let listed = listed.and_then(|it| it.rsplit(", ").next()).map(str::trim);
        let verdict = printed(&["check", name]);
        let (_, altitude) = verdict.split_once("altitude ").unwrap();
        let checked = altitude.split_once(" m").map(|(it, _)| it);
        assert_eq!(listed, checked, "{line}: {verdict}");
        compared += 1;
    }
    assert_eq!(compared, 18);
}
