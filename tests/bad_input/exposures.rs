//! Plans that a single fault exposes to what they don't accept.

use super::{Folder, SCENARIO, contains};

#[test]
fn exposure_is_refused_unless_accepted_or_resolved_by_avoidance() {
    let folder = Folder::new();
    // In single file, each path leads through the slots of others.
    let line = "spacing_m = 160\nheading_deg = 60";
    assert!(SCENARIO.contains("spacing_m = 160"));
    let check = |accept: &str, avoid: bool| {
        let tables = format!("\n[limits]\naccept = {accept}\n\n[safety]\navoid = {avoid}\n");
        let scenario =
            SCENARIO
                .replacen("liveness = \"thesis\"", "", 1)
                .replacen("spacing_m = 160", line, 1)
                + &tables;
        folder.write("scenario.toml", scenario);
        let (code, [_, error]) = folder.muster(&["check", "scenario.toml"]);
        (code, error)
    };
    assert_eq!(
        check("[\"late\", \"apart\", \"descends\", \"killed\"]", false).0,
        Some(0)
    );
    let (code, error) = check("[\"apart\", \"descends\", \"killed\"]", false);
    assert_eq!(code, Some(2));
    contains(
        &error,
        &[
            "a drone that is late",
            "so that drones give way to each other",
            "scenario.toml",
        ],
    )
    .unwrap();
    assert_eq!(
        check("[\"apart\", \"descends\", \"killed\"]", true).0,
        Some(0),
        "drones give way to a late one"
    );
    let (code, error) = check("[\"descends\", \"killed\"]", true);
    assert_eq!(code, Some(2));
    contains(
        &error,
        &[
            "a drone that flies alone in its altitude layer",
            "\"apart\"",
        ],
    )
    .unwrap();
    let (code, error) = check("[\"apart\", \"descends\"]", true);
    assert_eq!(code, Some(2));
    contains(&error, &["landed by its flight controller", "\"killed\""]).unwrap();
}
