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
        check(
            "[\"late\", \"apart\", \"both-apart\", \"descends\", \"killed\"]",
            false
        )
        .0,
        Some(0)
    );
    let (code, error) = check(
        "[\"apart\", \"both-apart\", \"descends\", \"killed\"]",
        false,
    );
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
        check(
            "[\"apart\", \"both-apart\", \"descends\", \"killed\"]",
            true
        )
        .0,
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
    let (code, error) = check("[\"apart\", \"descends\", \"killed\"]", true);
    assert_eq!(code, Some(2));
    contains(&error, &["while another does", "\"both-apart\""]).unwrap();
    let (code, error) = check("[\"apart\", \"both-apart\", \"descends\"]", true);
    assert_eq!(code, Some(2));
    contains(&error, &["landed by its flight controller", "\"killed\""]).unwrap();
}

#[test]
fn drones_that_follow_and_share_layers_are_exposed_to_apart() {
    let folder = Folder::new();
    let check = |altitude_max_m: u32, accept: &str| {
        let scenario = SCENARIO.replacen("liveness = \"thesis\"", "kind = \"follow\"", 1)
            + &format!("\n[limits]\naltitude_max_m = {altitude_max_m}\naccept = [{accept}]\n");
        folder.write("scenario.toml", scenario);
        let (code, [_, error]) = folder.muster(&["check", "scenario.toml"]);
        (code, error)
    };
    let all_but_apart = "\"late\", \"both-apart\", \"descends\", \"killed\"";
    let (code, error) = check(30, all_but_apart);
    assert_eq!(code, Some(2));
    contains(
        &error,
        &["off the lines", "add \"apart\" to `limits.accept`"],
    )
    .unwrap();
    let (code, error) = check(
        30,
        "\"late\", \"apart\", \"both-apart\", \"descends\", \"killed\"",
    );
    assert_eq!(code, Some(0), "{error}");
    // With a layer for each drone.
    let (code, error) = check(100, all_but_apart);
    assert_eq!(code, Some(0), "{error}");
}

#[test]
fn drones_out_of_the_masters_reach_need_a_layer_each() {
    let folder = Folder::new();
    let check = |altitude_max_m: u32, protocol: &str, accept: &str| {
        let scenario = SCENARIO
            .replacen("range_m = 300", "range_m = 150", 1)
            .replacen("liveness = \"thesis\"", protocol, 1)
            + &format!("\n[limits]\naltitude_max_m = {altitude_max_m}\n{accept}\n");
        folder.write("scenario.toml", scenario);
        let (code, [_, error]) = folder.muster(&["check", "scenario.toml"]);
        (code, error)
    };
    let (code, error) = check(30, "", "");
    assert_eq!(code, Some(2));
    let says = [
        "drones 0, 1, 3, 4 can't reach the master",
        "`limits.altitude_max_m`",
    ];
    contains(&error, &says).unwrap();
    let all = "accept = [\"late\", \"apart\", \"both-apart\", \"descends\", \"killed\", \"out-of-reach\"]";
    for (altitude_max_m, protocol, accept) in [
        (60, "", ""),
        (30, "succession = \"land\"", ""),
        (30, "", all),
    ] {
        let (code, error) = check(altitude_max_m, protocol, accept);
        assert_eq!(
            code,
            Some(0),
            "{altitude_max_m} m, {protocol} {accept}: {error}"
        );
    }
}
