//! Routes, heights and holds.

use std::time::Duration;

use super::*;

#[test]
fn without_take_off_the_first_waypoint_sets_the_height() {
    let text = SHORT
        .replace("1 0 3 22 0 0 0 0 0 0 25 1\n", "")
        .replace("\n2 0", "\n1 0")
        .replace("\n3 0", "\n2 0")
        .replace("-0.3085 25 1", "-0.3085 40 1");
    let mission = mission(&text);
    assert_eq!(mission.waypoints()[0], Ned::HOME.at_altitude(40.0));
    assert_eq!(heights(&mission), [40.0, 40.0, 30.0]);
}

#[test]
fn altitudes_above_sea_level_become_heights_above_home() {
    let text = SHORT.replace(
        "3 0 3 16 0 0 0 0 39.339 -0.3085 30",
        "3 0 0 16 0 0 0 0 39.339 -0.3085 47.5",
    );
    assert_eq!(heights(&mission(&text)), [25.0, 25.0, 45.5]);
}

#[test]
fn both_frames_above_home_are_the_same() {
    assert_eq!(mission(&SHORT.replace(" 3 16", " 6 16")), mission(SHORT));
}

#[test]
fn return_adds_a_point_above_home_at_the_last_height() {
    let mission = short_with("4 0 2 20 0 0 0 0 0 0 0 1\n");
    assert_eq!(mission.waypoints().len(), 4);
    assert_eq!(mission.waypoints()[3], Ned::HOME.at_altitude(30.0));
}

#[test]
fn items_after_the_return_are_left_out() {
    let returned = short_with("4 0 3 20 0 0 0 0 0 0 0 1\n");
    let left_out = short_with(
        "4 0 3 20 0 0 0 0 0 0 0 1\n5 0 3 16 0 0 0 0 39.342 -0.3085 0 1\n6 0 3 17 0 0 0 0 39 0 0 1\n\
         7 0 3 177 5 3 0 0 0 0 0 1\n8 0 3 21 0 0 0 0 0 0 0 1\n",
    );
    assert_eq!(left_out.waypoints(), returned.waypoints());
    let note = "the item is left out; the mission ends with the return to launch";
    assert_eq!(
        notes(&left_out),
        [5, 6, 7, 8].map(|item| format!("item {item}: {note}"))
    );
}

#[test]
fn landing_with_coordinates_adds_a_point_at_the_last_height() {
    let mission = short_with("4 0 3 21 0 0 0 0 39.342 -0.3085 0 1\n");
    assert_eq!(mission.waypoints().len(), 4);
    assert!((mission.waypoints()[3].north_m() - 999.3).abs() < 1.0);
    assert_eq!(heights(&mission), [25.0, 25.0, 30.0, 30.0]);
}

#[test]
fn landing_without_coordinates_or_at_the_last_point_adds_none() {
    for coordinates in ["0 0", "39.339 -0.3085"] {
        let mission = short_with(&format!("4 0 3 21 0 0 0 0 {coordinates} 0 1\n"));
        assert_eq!(mission.waypoints().len(), 3);
        assert!(mission.notes().is_empty());
    }
}

#[test]
fn ignored_items_are_noted() {
    let mission = short_with(
        "4 0 3 16 5 0 0 0 39.342 -0.3085 30 0\n\
         5 0 3 16 0 0 0 0 39.342 -0.3085 30 1\n\
         6 0 2 206 20 0 0 0 0 0 0 1\n\
         7 0 2 20 0 0 0 0 0 0 0 1\n\
         8 0 2 2001 0 0 0 0 nan nan nan 1\n",
    );
    insta::assert_snapshot!(notes(&mission).join("\n"));
    assert_eq!(mission.waypoints().len(), 5);
}

#[test]
fn holds_curves_and_height_changes_become_points() {
    let flown = short_with(
        "4 0 3 93 5 0 0 0 0 0 0 1\n5 0 3 30 0 0 0 0 0 0 40 1\n6 0 3 82 0 0 0 0 39.340 -0.3085 40 1\n\
         7 0 3 19 3 0 0 0 39.341 -0.3085 40 1\n8 0 3 16 0 0 0 0 0 0 20 1\n",
    );
    assert_eq!(heights(&flown), [25.0, 25.0, 30.0, 40.0, 40.0, 40.0, 20.0]);
    assert_eq!(
        notes(&flown),
        ["item 6: the curve is flown as a straight leg",]
    );
    assert_eq!(holds_s(&flown), [(2, 5.0), (5, 3.0)]);
    let [.., before, last] = flown.waypoints() else {
        panic!("no waypoints");
    };
    assert!(before.horizontal_distance_m(*last) < 1e-9);
}

#[test]
fn height_of_zero_keeps_the_last_height() {
    let kept = short_with(
        "4 0 3 16 0 0 0 0 39.342 -0.3085 0 1\n5 0 6 19 5 0 0 0 0 0 0 1\n6 0 3 82 0 0 0 0 39.345 -0.3085 0 1\n",
    );
    assert_eq!(heights(&kept), [25.0, 25.0, 30.0, 30.0, 30.0]);
    let note = "an altitude of 0 means none; the swarm keeps its height, 30 m above home";
    assert_eq!(
        notes(&kept),
        [
            format!("item 4: {note}"),
            "item 6: the curve is flown as a straight leg".to_owned(),
            format!("item 6: {note}"),
        ]
    );
    let at_take_off_height = mission(&SHORT.replace("39.336 -0.3085 25", "39.336 -0.3085 0"));
    assert_eq!(heights(&at_take_off_height), [25.0, 25.0, 30.0]);
}

#[test]
fn height_of_zero_means_none_only_in_plans_for_ardupilot() {
    let zero = PLAN.replace("39.339,-0.3085,25", "39.339,-0.3085,0");
    let for_firmware = |firmware: u16| {
        let plan = format!("\"mission\": {{ \"firmwareType\": {firmware},");
        parse(Path::new("given"), &zero.replace("\"mission\": {", &plan))
    };
    assert_eq!(heights(&for_firmware(3).unwrap()), [25.0; 4]);
    let refused = for_firmware(12).unwrap_err().to_string();
    assert_eq!(refused, "mission.items[2]: the height above home is 0 m");
}

#[test]
fn turns_and_payload_places_are_flown_over() {
    let flown = short_with(
        "4 0 3 18 2 0 5 0 39.340 -0.3085 40 1\n5 0 3 18 1 0 5 0 0 0 0 1\n6 0 3 94 0 0 0 0 39.341 -0.3085 20 1\n\
         7 0 3 94 0 0 0 0 0 0 0 1\n",
    );
    assert_eq!(heights(&flown), [25.0, 25.0, 30.0, 40.0, 40.0]);
    let turns = "the turns are not flown; the swarm flies on";
    let payload = "the payload is not placed; the swarm flies over the place and does not descend";
    assert_eq!(
        notes(&flown),
        [
            format!("item 4: {turns}"),
            format!("item 5: {turns}"),
            "item 5: the waypoint is left out; it equals the one before it".to_owned(),
            format!("item 6: {payload}"),
            format!("item 7: {payload}"),
        ]
    );
}

#[test]
fn loiter_to_altitude_is_flown_vertically() {
    let flown = short_with(
        "4 0 3 31 0 0 0 0 39.341 -0.3085 50 1\n5 0 3 31 1 0 0 0 0 0 20 1\n6 0 3 31 1 0 0 0 0 0 20 1\n",
    );
    assert_eq!(heights(&flown), [25.0, 25.0, 30.0, 30.0, 50.0, 20.0]);
    let over = &flown.waypoints()[3..];
    assert!(
        over.iter()
            .all(|it| it.horizontal_distance_m(over[0]) < 1e-9)
    );
    assert_eq!(
        notes(&flown),
        ["item 6: the waypoint is left out; it equals the one before it"]
    );
}

#[test]
fn conditions_and_commands_of_the_user_are_ignored() {
    let condition = |command: u16| format!("4 0 3 {command} 9 0 0 0 39.5 -0.3085 22222 1\n");
    let noted = |command| notes(&short_with(&condition(command)));
    for (command, name) in [
        (112, "DELAY"),
        (114, "DISTANCE"),
        (115, "YAW"),
        (116, "LOCATION"),
    ] {
        let note = "is ignored; it does not move the swarm";
        assert_eq!(noted(command), [format!("item 4: CONDITION_{name} {note}")]);
    }
    let users = "item 4: USER_1 is ignored; it does not move the swarm";
    assert_eq!(noted(31010), [users]);
    let height = "item 4: CONDITION_CHANGE_ALT is ignored, as ArduCopter ignores it";
    assert_eq!(noted(113), [height]);
    assert_eq!(short_with(&condition(113)).waypoints().len(), 3);
}

#[test]
fn mission_may_take_off_hover_and_land() {
    let hover = "1 0 3 22 0 0 0 0 0 0 25 1\n2 0 3 16 30 0 0 0 39.333 -0.3085 25 1\n3 0 3 21 0 0 0 0 0 0 0 1\n";
    let home = "QGC WPL 110\n0 1 0 16 0 0 0 0 39.333 -0.3085 2 1\n";
    let hovering = mission(&format!("{home}{hover}"));
    assert_eq!(hovering.waypoints(), [Ned::HOME.at_altitude(25.0)]);
    assert_eq!(
        notes(&hovering),
        Vec::<String>::new(),
        "the waypoint at the take-off point has a hold"
    );
    assert_eq!(holds_s(&hovering), [(0, 30.0)]);
}

#[test]
fn holds_at_the_same_place_add_up() {
    let held = short_with(
        "4 0 3 93 0.25 -1 -1 -1 0 0 0 1\n5 0 3 19 1.5 0 0 0 39.339 -0.3085 30 1\n6 0 3 177 5 2 0 0 0 0 0 1\n\
         7 0 3 82 2 0 0 0 39.345 -0.3085 30 1\n8 0 3 16 nan 0 0 0 39.346 -0.3085 30 1\n",
    );
    assert_eq!(holds_s(&held), [(2, 4.75), (3, 2.0)]);
    assert_eq!(held.holds().total(), Duration::from_millis(6_750));
    let a_day = format!("4 0 3 93 {} 0 0 0 0 0 0 1\n", Holds::MAX.as_secs());
    assert_eq!(holds_s(&short_with(&a_day)), [(2, 3_600.0)]);
}

#[test]
fn holds_on_the_ground_and_for_a_time_of_day_are_noted() {
    let on_the_ground = SHORT.replace("1 0 3 22", "9 0 3 93 20 0 0 0 0 0 0 1\n1 0 3 22");
    assert_eq!(
        notes(&mission(&on_the_ground))[1..],
        ["item 1: the hold of 20 s is ignored; it is before the take-off"]
    );
    let at_noon = short_with("4 0 3 93 -1 12 0 0 0 0 0 1\n");
    assert_eq!(
        notes(&at_noon),
        ["item 4: the wait for a time of day is ignored; the swarm flies on"]
    );
    for mission in [mission(&on_the_ground), at_noon] {
        assert_eq!(holds_s(&mission), []);
    }
}
