//! Files that can't be read or are incomplete.

use std::fs;

use super::{Folder, MISSION, SCENARIO, assert_all, contains};

#[test]
fn unreadable_file_is_refused_with_the_reason() {
    type Damage = fn(&Folder, &str);
    let damages: &[(&str, Damage, &[&str])] = &[
        (
            "an empty file",
            |folder, name| folder.write(name, ""),
            &["empty"],
        ),
        (
            "a binary file",
            |folder, name| folder.write(name, [0_u8, 159, 146, 150]),
            &["text"],
        ),
        (
            "a folder",
            |folder, name| {
                fs::remove_file(folder.path(name)).unwrap();
                fs::create_dir(folder.path(name)).unwrap();
            },
            &["director"],
        ),
        (
            "nothing",
            |folder, name| fs::remove_file(folder.path(name)).unwrap(),
            &["no such file"],
        ),
    ];
    let mut results = Vec::new();
    for name in ["scenario.toml", "missions/albufera.plan"] {
        for (what, damage, reasons) in damages {
            let folder = Folder::new();
            damage(&folder, name);
            let result = folder.refusal(&[]).and_then(|error| {
                let error = error.to_lowercase();
                contains(&error, &[name])?;
                contains(&error, reasons)
            });
            results.push((format!("{what} as {name}"), result));
        }
    }
    assert_all(results);
}

#[test]
fn truncated_file_is_refused() {
    let mut results = Vec::new();
    for (name, whole) in [
        ("scenario.toml", SCENARIO),
        ("missions/albufera.plan", MISSION),
    ] {
        // Without its last lines the scenario is still complete.
        for percent in [3, 10, 40, 45] {
            let folder = Folder::new();
            folder.write(name, &whole[..whole.len() * percent / 100]);
            let result = folder.check_refusal(&[], &[name]);
            results.push((format!("{percent} % of {name}"), result));
        }
    }
    assert_all(results);
}

#[test]
fn check_continues_after_a_wrong_file() {
    let folder = Folder::new();
    folder.write("broken.toml", "seed = ");
    let mission = "missions/albufera.plan";
    let files = [
        "check",
        "broken.toml",
        "scenario.toml",
        mission,
        "none.plan",
    ];
    let (code, [output, error]) = folder.muster(&files);
    assert_eq!(code, Some(2));
    contains(&error, &["broken.toml", "none.plan"]).unwrap();
    let checked: Vec<_> = output
        .lines()
        .filter(|line| !line.starts_with("  "))
        .map(|line| line.split(':').next().unwrap())
        .collect();
    assert_eq!(checked, ["scenario.toml", mission]);
}
