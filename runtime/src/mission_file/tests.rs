use std::fmt::Write as _;
use std::path::PathBuf;
use std::time::Duration;

use proptest::prelude::*;

use super::*;
use crate::diagnostic::tests::rendered;

mod refusals;

const ALBUFERA: &str = include_str!("../../../scenarios/missions/albufera.plan");
const RIVER: &str = include_str!("../../../scenarios/missions/river.waypoints");

/// A mission of two waypoints after take-off, in the lines of a waypoints file.
const SHORT: &str = "\
QGC WPL 110
0 1 0 16 0 0 0 0 39.333 -0.3085 2 1
1 0 3 22 0 0 0 0 0 0 25 1
2 0 3 16 0 0 0 0 39.336 -0.3085 25 1
3 0 3 16 0 0 0 0 39.339 -0.3085 30 1
";

fn mission(text: &str) -> Mission {
    parse(Path::new("given"), text).unwrap_or_else(|error| panic!("{}", rendered(&error)))
}

fn short_with(lines: &str) -> Mission {
    mission(&format!("{SHORT}{lines}"))
}

fn heights(mission: &Mission) -> Vec<f64> {
    mission
        .waypoints()
        .iter()
        .map(|point| point.altitude_m())
        .collect()
}

/// Each waypoint at which the swarm waits, and for how many seconds.
fn holds_s(mission: &Mission) -> Vec<(u16, f64)> {
    let holds = mission.holds().iter();
    holds.map(|(at, hold)| (at, hold.as_secs_f64())).collect()
}

fn notes(mission: &Mission) -> Vec<String> {
    mission.notes().iter().map(Note::to_string).collect()
}

/// The same mission in a waypoints file, by no code of this crate's but its dependencies'.
fn as_waypoints(plan: &str) -> String {
    let plan: serde_json::Value = serde_json::from_str(plan).unwrap();
    let mission = &plan["mission"];
    let home = &mission["plannedHomePosition"];
    let mut text = format!(
        "QGC WPL 110\n0\t1\t0\t16\t0\t0\t0\t0\t{}\t{}\t{}\t1\n",
        home[0], home[1], home[2]
    );
    for (index, item) in mission["items"].as_array().unwrap().iter().enumerate() {
        write!(
            text,
            "{}\t0\t{}\t{}",
            index + 1,
            item["frame"],
            item["command"]
        )
        .unwrap();
        for parameter in item["params"].as_array().unwrap() {
            match parameter {
                serde_json::Value::Null => text.push_str("\tnan"),
                number => write!(text, "\t{number}").unwrap(),
            }
        }
        text.push_str("\t1\n");
    }
    text
}

/// Each leg's length over ground in metres, and its heading in degrees east of north.
fn legs(mission: &Mission) -> Vec<(f64, f64)> {
    mission
        .waypoints()
        .windows(2)
        .map(|pair| {
            let leg = pair[1] - pair[0];
            let heading = libm::atan2(leg.east_m(), leg.north_m()).to_degrees();
            (pair[1].horizontal_distance_m(pair[0]), heading)
        })
        .collect()
}

#[test]
fn the_shipped_missions_suit_a_line_abreast() {
    for (text, count, length_m) in [(ALBUFERA, 8, 2_520.0), (RIVER, 7, 1_800.0)] {
        let mission = mission(text);
        assert_eq!(mission.waypoints().len(), count);
        let legs = legs(&mission);
        let total_m: f64 = legs.iter().map(|(leg_m, _)| leg_m).sum();
        assert!((total_m - length_m).abs() < 1.0, "{total_m} m");
        for (leg_m, heading_deg) in legs {
            assert!(leg_m >= 250.0, "a leg of {leg_m} m");
            assert!(heading_deg.abs() <= 35.0, "a leg towards {heading_deg}°");
        }
    }
}

#[test]
fn a_shipped_mission_is_loaded_from_its_file() {
    let missions = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../scenarios/missions");
    let albufera = load(&missions.join("albufera.plan")).unwrap();
    assert_eq!(albufera, mission(ALBUFERA));
    assert!(albufera.notes().is_empty());
    assert_eq!(heights(&albufera), [25.0; 8]);
    let river = load(&missions.join("river.waypoints")).unwrap();
    assert_eq!(heights(&river), [30.0, 30.0, 40.0, 40.0, 25.0, 20.0, 30.0]);
    assert_eq!(
        notes(&river),
        ["item 2: DO_CHANGE_SPEED is not leader, the swarm flies at `vehicle.speed_mps`"]
    );
}

#[test]
fn both_formats_of_a_mission_give_the_same_waypoints() {
    let (plan, text) = (mission(ALBUFERA), mission(&as_waypoints(ALBUFERA)));
    assert_eq!(plan.waypoints(), text.waypoints());
    assert_eq!(plan.home(), text.home());
}

#[test]
fn the_format_is_told_by_the_content_and_not_by_the_name() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("mission.txt");
    std::fs::write(&path, format!("\u{feff}\r\n{ALBUFERA}")).unwrap();
    assert_eq!(load(&path).unwrap(), mission(ALBUFERA));
}

#[test]
fn windows_line_ends_and_comments_change_nothing() {
    let windows = RIVER.replace('\n', "\r\n");
    let commented = RIVER.replace("\n1\t", "\n# take-off\n\n1\t");
    assert_eq!(mission(&windows), mission(RIVER));
    assert_eq!(mission(&commented), mission(RIVER));
}

#[test]
fn tabs_and_comments_in_and_before_the_header_change_nothing() {
    let tabs = RIVER.replacen("QGC WPL 110", "# of the river\n\nQGC\tWPL\t110", 1);
    assert_eq!(mission(&tabs), mission(RIVER));
}

const IN_LINE_ORDER: &str =
    "index: the numbers are not 0, 1, 2, …, the items are taken in the order of their lines";

#[test]
fn items_are_flown_in_the_order_of_their_lines_whatever_their_indices() {
    for (second, third) in [("4", "9"), ("1", "1"), ("0", "0"), ("3", "2")] {
        let text = SHORT
            .replace("\n2 0", &format!("\n{second} 0"))
            .replace("\n3 0", &format!("\n{third} 0"));
        let numbered = mission(&text);
        assert_eq!(numbered.waypoints(), mission(SHORT).waypoints());
        assert_eq!(notes(&numbered), [IN_LINE_ORDER]);
    }
}

#[test]
fn a_jump_goes_by_indices_that_ascend() {
    let jump = "4 0 3 177 2 2 0 0 0 0 0 1\n";
    let gaps = SHORT.replace("\n3 0", "\n5 0").replace("\n2 0", "\n4 0");
    let jumps = mission(&format!("{gaps}8 0 3 177 4 2 0 0 0 0 0 1\n"));
    assert_eq!(jumps.waypoints(), short_with(jump).waypoints());
}

#[test]
fn a_mission_read_back_from_an_autopilot_has_no_home_line() {
    let text = SHORT.replace("0 1 0 16 0 0 0 0 39.333 -0.3085 2 1\n", "");
    let read_back = mission(&text);
    assert_eq!(heights(&read_back), [25.0, 30.0]);
    assert_eq!(
        notes(&read_back),
        [
            IN_LINE_ORDER,
            "item 2: home is taken to be there, the file does not say where it is",
            "item 2: the waypoint is left out, it is where the one before it is",
        ]
    );
    // Its first item is none that says where home is, even above sea level.
    let refused = parse(Path::new("given"), &text.replace("2 0 3 16", "2 0 0 16"));
    let refused = refused.unwrap_err().to_string();
    assert!(refused.contains("above sea level"), "{refused}");
}

#[test]
fn an_item_without_a_command_says_that_home_is_not_set() {
    let unset = mission(&SHORT.replace(
        "0 1 0 16 0 0 0 0 39.333 -0.3085 2 1",
        "0 1 0 0 0 0 0 0 0 0 0 1",
    ));
    assert_eq!(unset.home(), Geodetic::new(39.336, -0.3085, 0.0).unwrap());
    assert_eq!(unset.notes()[0].kind(), NoteKind::HomeTaken);
}

#[test]
fn without_take_off_the_first_waypoint_gives_the_height() {
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
fn a_return_adds_a_point_over_home_at_the_last_height() {
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
    let note = "the item is left out, the mission ends with the return to launch";
    assert_eq!(
        notes(&left_out),
        [5, 6, 7, 8].map(|item| format!("item {item}: {note}"))
    );
}

#[test]
fn landing_somewhere_adds_a_point_over_it_at_the_last_height() {
    let mission = short_with("4 0 3 21 0 0 0 0 39.342 -0.3085 0 1\n");
    assert_eq!(mission.waypoints().len(), 4);
    assert!((mission.waypoints()[3].north_m() - 999.3).abs() < 1.0);
    assert_eq!(heights(&mission), [25.0, 25.0, 30.0, 30.0]);
}

#[test]
fn landing_nowhere_or_at_the_last_waypoint_adds_no_point() {
    for coordinates in ["0 0", "39.339 -0.3085"] {
        let mission = short_with(&format!("4 0 3 21 0 0 0 0 {coordinates} 0 1\n"));
        assert_eq!(mission.waypoints().len(), 3);
        assert!(mission.notes().is_empty());
    }
}

#[test]
fn what_the_swarm_leaves_out_is_noted() {
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
fn the_items_of_a_survey_are_flown_in_its_place() {
    let survey = r#"{ "type": "ComplexItem", "complexItemType": "survey", "TransectStyleComplexItem": { "Items": [
        {"autoContinue":true,"command":16,"frame":3,"params":[0,0,0,null,39.342,-0.3085,30],"type":"SimpleItem"},
        {"autoContinue":true,"command":206,"frame":2,"params":[25,0,1,0,0,0,0],"type":"SimpleItem"},
        {"autoContinue":true,"command":16,"frame":3,"params":[0,0,0,null,39.342,-0.3070,30],"type":"SimpleItem"}
        ] } },"#;
    let plan = refusals::PLAN.replace("\"items\": [", &format!("\"items\": [{survey}"));
    let mission = mission(&plan.replacen("\"command\":22", "\"command\":16", 1));
    assert_eq!(mission.waypoints().len(), 7);
    assert_eq!(
        mission.notes()[0].item(),
        "mission.items[0].TransectStyleComplexItem.Items[1]"
    );
}

#[test]
fn the_longest_route_is_read_and_one_point_more_is_not() {
    let with_waypoints = |count: usize| {
        let mut text = String::from("QGC WPL 110\n0 1 0 16 0 0 0 0 39.333 -0.3085 2 1\n");
        for index in 1..=count {
            let latitude = 39.334 + 0.0001 * index as f64;
            writeln!(text, "{index} 0 3 16 0 0 0 0 {latitude:.4} -0.3085 25 1").unwrap();
        }
        parse(Path::new("given"), &text)
    };
    assert_eq!(
        with_waypoints(WAYPOINTS_MAX - 1).unwrap().waypoints().len(),
        WAYPOINTS_MAX
    );
    let refused = with_waypoints(WAYPOINTS_MAX).unwrap_err().to_string();
    assert_eq!(refused, "item 1000: the route has more than 1000 points");
}

#[test]
fn more_items_than_the_limit_are_refused_in_both_formats() {
    let mut text = SHORT.to_owned();
    for index in 4..=ITEMS_MAX {
        writeln!(text, "{index} 0 2 178 0 0 0 0 0 0 0 1").unwrap();
    }
    let refused = parse(Path::new("given"), &text).unwrap_err().to_string();
    assert_eq!(refused, "the file has more than 5000 items");
    let items = "0,\n".repeat(ITEMS_MAX + 1);
    let plan = refusals::PLAN.replace("\"items\": [", &format!("\"items\": [\n{items}\n"));
    let refused = parse(Path::new("given"), &plan).unwrap_err().to_string();
    assert_eq!(refused, "`mission.items` has 5005 values");
}

#[test]
fn nesting_however_deep_is_refused() {
    let text = format!("{{\"mission\":{}", "[".repeat(1_000_000));
    let refused = parse(Path::new("given"), &text).unwrap_err().to_string();
    assert!(
        refused.contains("the file ends inside its JSON"),
        "{refused}"
    );
    let closed = format!("{text}{}}}", "]".repeat(1_000_000));
    let refused = parse(Path::new("given"), &closed).unwrap_err().to_string();
    assert!(refused.contains("`fileType` is missing"), "{refused}");
    let text = "<a>".repeat(1_000_000);
    let refused = parse(Path::new("given"), &text).unwrap_err().to_string();
    assert!(refused.contains("this is not XML"), "{refused}");
    let closed = format!("{text}{}", "</a>".repeat(1_000_000));
    assert!(parse(Path::new("given"), &closed).is_err());
}

#[test]
fn home_is_where_a_file_says_in_whichever_way() {
    let given = short_with("");
    for item in [
        "0 1 3 16 0 0 0 0 39.333 -0.3085 0 1",
        "0 1 3 16 0 0 0 0 39.333 -0.3085 2 1",
    ] {
        let mission = mission(&SHORT.replace("0 1 0 16 0 0 0 0 39.333 -0.3085 2 1", item));
        assert!(mission.notes().is_empty());
        assert_eq!(mission.waypoints().len(), given.waypoints().len());
        for (point, same) in mission.waypoints().iter().zip(given.waypoints()) {
            // Two metres nearer to the Earth's centre.
            assert!(point.distance_m(*same) < 0.002);
        }
    }
}

#[test]
fn a_file_without_home_has_it_at_its_first_place() {
    let text = "\
QGC WPL 110
0 1 3 22 0 0 0 0 39.333 -0.3085 25 1
1 0 3 16 0 0 0 0 39.336 -0.3085 25 1
2 0 3 20 0 0 0 0 0 0 0 1
";
    let home = |mission: &Mission| {
        (
            mission.home().latitude_deg(),
            mission.home().longitude_deg(),
        )
    };
    let there_and_back = mission(text);
    assert_eq!(home(&there_and_back), (39.333, -0.3085));
    assert_eq!(heights(&there_and_back), [25.0; 3]);
    let note = "home is taken to be there, the file does not say where it is";
    assert_eq!(notes(&there_and_back), [format!("item 0: {note}")]);
    let plan = mission(&refusals::PLAN.replace("[39.333, -0.3085, 2]", "[0, 0, 0]"));
    assert_eq!(home(&plan), (39.333, -0.3085));
    assert_eq!(notes(&plan), [format!("mission.items[0]: {note}")]);
}

#[test]
fn home_that_an_autopilot_wrote_elsewhere_is_taken_from_the_first_place() {
    let simulated = SHORT.replacen("39.333 -0.3085 2", "-35.363262 149.165237 584", 1);
    let elsewhere = mission(&simulated);
    assert_eq!(
        elsewhere.home(),
        Geodetic::new(39.336, -0.3085, 0.0).unwrap()
    );
    assert_eq!(
        notes(&elsewhere)[0],
        "item 2: home is taken to be there, not in item 0, 12451 km away, which autopilots overwrite"
    );
    // The height of the home that was left behind is that of another place.
    let refused = parse(
        Path::new("given"),
        &simulated.replace("2 0 3 16", "2 0 0 16"),
    );
    let refused = refused.unwrap_err().to_string();
    assert!(refused.contains("that of home is not known"), "{refused}");
}

#[test]
fn home_far_away_is_refused_unless_all_other_places_are_together() {
    let simulated = SHORT.replacen("39.333 -0.3085 2", "-35.363262 149.165237 584", 1);
    for (from, to) in [
        // One of them is at home, one 110 km from the others, and one alone might be the one that is wrong.
        ("16 0 0 0 0 39.339 -0.3085", "16 0 0 0 0 -35.364 149.165"),
        (
            "3 0 3 16 0 0 0 0 39.339 -0.3085",
            "3 0 3 21 0 0 0 0 -35.364 149.165",
        ),
        ("39.339", "40.339"),
        ("3 0 3 16 0 0 0 0 39.339 -0.3085 30 1\n", ""),
    ] {
        assert!(simulated.contains(from));
        let refused = parse(Path::new("given"), &simulated.replace(from, to)).unwrap_err();
        assert!(refused.to_string().contains("km from home"), "{refused}");
    }
    // A plan's home is where its operator has put it.
    let planned = refusals::PLAN.replace("[39.333, -0.3085, 2]", "[-35.363, 149.165, 584]");
    let refused = parse(Path::new("given"), &planned).unwrap_err().to_string();
    assert!(refused.contains("km from home"), "{refused}");
}

#[test]
fn a_jump_forward_without_end_is_always_made() {
    let skipped = short_with(
        "4 0 3 177 6 -1 0 0 0 0 0 1\n5 0 3 16 0 0 0 0 39.5 -0.3085 30 1\n6 0 3 20 0 0 0 0 0 0 0 1\n",
    );
    assert_eq!(heights(&skipped), [25.0, 25.0, 30.0, 30.0]);
    assert!(skipped.notes().is_empty());
}

#[test]
fn jumps_from_jump_to_jump_have_a_limit() {
    let to_itself =
        |number: usize, times: usize| format!("{number} 0 3 177 {number} {times} 0 0 0 0 0 1\n");
    assert_eq!(
        short_with(&to_itself(4, ITEMS_MAX - 1)).waypoints().len(),
        3
    );
    let jumps: String = (4..ITEMS_MAX)
        .map(|number| to_itself(number, ITEMS_MAX))
        .collect();
    let refused = parse(Path::new("given"), &format!("{SHORT}{jumps}"));
    let refused = refused.unwrap_err().to_string();
    assert!(refused.contains("by its jumps"), "{refused}");
}

#[test]
fn a_path_drawn_on_a_map_is_flown_from_its_first_point() {
    let path = mission(refusals::KML);
    assert_eq!(heights(&path), [25.0, 25.0, 30.0]);
    let legs: Vec<f64> = legs(&path)
        .into_iter()
        .map(|(leg_m, _)| leg_m.round())
        .collect();
    assert_eq!(legs, [333.0, 333.0]);
    assert_eq!(
        notes(&path),
        [
            "altitudeMode: the altitudes, above the ground there, are taken as heights above home, the swarm has no map of the ground",
            "point 1: home is taken to be there, the file does not say where it is",
            "point 1: the waypoint is left out, it is where the one before it is",
        ]
    );
}

#[test]
fn a_path_that_begins_and_ends_on_the_ground_says_where_to_take_off_and_land() {
    let drawn = refusals::KML
        .replace("-0.3085,39.333,25", "-0.3085,39.333,0.2 -0.3085,39.333,25")
        .replace("39.339,30", "39.339,30 -0.3085,39.340,0");
    let path = mission(&drawn);
    assert_eq!(heights(&path), [25.0, 25.0, 30.0, 30.0]);
    assert_eq!(path.home(), Geodetic::new(39.333, -0.3085, 0.0).unwrap());
    assert_eq!(
        notes(&path)[1..],
        [
            "point 1: home is taken to be there, the path begins on the ground",
            "point 2: the waypoint is left out, it is where the one before it is",
        ]
    );
    let between = drawn.replace("39.336,25", "39.336,0");
    let refused = parse(Path::new("given"), &between).unwrap_err().to_string();
    assert_eq!(refused, "point 3: the height above home is 0 m");
}

#[test]
fn a_plan_that_qgroundcontrol_exports_begins_at_home() {
    let exported = refusals::KML
        .replace(
            "<Document>",
            "<Document><name>QGroundControl Plan KML</name>",
        )
        .replace("relativeToGround", "absolute")
        .replace(
            "-0.3085,39.333,25",
            "-0.3085,39.333,488.74 -0.3085,39.333,513.74",
        )
        .replace("39.336,25", "39.336,513.74")
        .replace("39.339,30", "39.339,518.74 -0.3085,39.340,488.74");
    let plan = mission(&exported);
    assert_eq!(heights(&plan), [25.0, 25.0, 30.0, 30.0]);
    assert_eq!(plan.home(), Geodetic::new(39.333, -0.3085, 488.74).unwrap());
    // What is as high as home all the way is no flight.
    let flat = exported.replace("513.74", "488.74");
    let refused = parse(Path::new("given"), &flat).unwrap_err().to_string();
    assert_eq!(refused, "point 2: the height above home is 0 m");
}

#[test]
fn a_jump_is_made_as_often_as_it_says() {
    let jump = |times: &str| format!("4 0 3 177 2 {times} 0 0 0 0 0 1\n5 0 3 20 0 0 0 0 0 0 0 1\n");
    let twice = short_with(&jump("2"));
    assert_eq!(
        heights(&twice),
        [25.0, 25.0, 30.0, 25.0, 30.0, 25.0, 30.0, 30.0]
    );
    assert_eq!(short_with(&jump("0")).waypoints().len(), 4);
    let endless = short_with(&jump("-1"));
    assert_eq!(endless.waypoints().len(), 4);
    let note = "the jump has no end and is ignored, the swarm goes on with the next item";
    assert_eq!(notes(&endless), [format!("item 4: {note}")]);
    let plan = refusals::PLAN.replacen("\"command\":20,", "\"command\":177,", 1);
    let plan = plan.replacen("[0,0,0,0,0,0,0]", "[7,1,0,0,0,0,0]", 1);
    let plan = plan
        .replacen("{\"autoContinue\"", "{\"doJumpId\":7,\"autoContinue\"", 2)
        .replacen("\"doJumpId\":7,", "", 1);
    assert_eq!(mission(&plan).waypoints().len(), 5);
}

#[test]
fn waits_curves_and_heights_are_flown_as_far_as_a_swarm_can() {
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
fn a_height_of_zero_is_the_height_of_the_point_before() {
    let kept = short_with(
        "4 0 3 16 0 0 0 0 39.342 -0.3085 0 1\n5 0 6 19 5 0 0 0 0 0 0 1\n6 0 3 82 0 0 0 0 39.345 -0.3085 0 1\n",
    );
    assert_eq!(heights(&kept), [25.0, 25.0, 30.0, 30.0, 30.0]);
    let note = "a height of 0 says none, the swarm keeps its 30 m above home";
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
fn only_plans_for_ardupilot_have_a_height_of_zero_for_none() {
    let zero = refusals::PLAN.replace("39.339,-0.3085,25", "39.339,-0.3085,0");
    let for_firmware = |firmware: u16| {
        let plan = format!("\"mission\": {{ \"firmwareType\": {firmware},");
        parse(Path::new("given"), &zero.replace("\"mission\": {", &plan))
    };
    assert_eq!(heights(&for_firmware(3).unwrap()), [25.0; 4]);
    let refused = for_firmware(12).unwrap_err().to_string();
    assert_eq!(refused, "mission.items[2]: the height above home is 0 m");
}

#[test]
fn turns_and_payloads_are_places_to_fly_over() {
    let flown = short_with(
        "4 0 3 18 2 0 5 0 39.340 -0.3085 40 1\n5 0 3 18 1 0 5 0 0 0 0 1\n6 0 3 94 0 0 0 0 39.341 -0.3085 20 1\n\
         7 0 3 94 0 0 0 0 0 0 0 1\n",
    );
    assert_eq!(heights(&flown), [25.0, 25.0, 30.0, 40.0, 40.0]);
    let turns = "the turns are not flown, the swarm flies on";
    let payload =
        "the payload is not set down, the swarm flies over the place and does not descend";
    assert_eq!(
        notes(&flown),
        [
            format!("item 4: {turns}"),
            format!("item 5: {turns}"),
            "item 5: the waypoint is left out, it is where the one before it is".to_owned(),
            format!("item 6: {payload}"),
            format!("item 7: {payload}"),
        ]
    );
}

#[test]
fn a_change_of_height_over_a_place_is_flown_straight_up_or_down() {
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
        ["item 6: the waypoint is left out, it is where the one before it is"]
    );
}

#[test]
fn conditions_are_passed_over_as_copters_pass_over_them() {
    let condition = |command: u16| format!("4 0 3 {command} 9 0 0 0 39.5 -0.3085 22222 1\n");
    let noted = |command| notes(&short_with(&condition(command)));
    for (command, name) in [
        (112, "DELAY"),
        (114, "DISTANCE"),
        (115, "YAW"),
        (116, "LOCATION"),
    ] {
        let note = "is ignored, it moves no drone of the swarm";
        assert_eq!(noted(command), [format!("item 4: CONDITION_{name} {note}")]);
    }
    let height = "item 4: CONDITION_CHANGE_ALT is ignored, as ArduCopter ignores it";
    assert_eq!(noted(113), [height]);
    assert_eq!(short_with(&condition(113)).waypoints().len(), 3);
}

#[test]
fn a_swarm_may_take_off_to_hover_and_land() {
    let hover = "1 0 3 22 0 0 0 0 0 0 25 1\n2 0 3 16 30 0 0 0 39.333 -0.3085 25 1\n3 0 3 21 0 0 0 0 0 0 0 1\n";
    let home = "QGC WPL 110\n0 1 0 16 0 0 0 0 39.333 -0.3085 2 1\n";
    let hovering = mission(&format!("{home}{hover}"));
    assert_eq!(hovering.waypoints(), [Ned::HOME.at_altitude(25.0)]);
    assert_eq!(
        notes(&hovering),
        Vec::<String>::new(),
        "the waypoint is where the take-off leads to, and says how long"
    );
    assert_eq!(holds_s(&hovering), [(0, 30.0)]);
}

#[test]
fn the_swarm_waits_as_long_as_items_at_the_same_place_say_together() {
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
fn waits_on_the_ground_and_for_a_time_of_day_are_told_of() {
    let on_the_ground = SHORT.replace("1 0 3 22", "9 0 3 93 20 0 0 0 0 0 0 1\n1 0 3 22");
    assert_eq!(
        notes(&mission(&on_the_ground))[1..],
        ["item 1: the hold of 20 s is ignored, the swarm has not taken off by then"]
    );
    let at_noon = short_with("4 0 3 93 -1 12 0 0 0 0 0 1\n");
    assert_eq!(
        notes(&at_noon),
        ["item 4: the wait for a time of day is ignored, the swarm flies on"]
    );
    for mission in [mission(&on_the_ground), at_noon] {
        assert_eq!(holds_s(&mission), []);
    }
}

/// A plan with these circles and polygons.
fn fenced(circles: &str, polygons: &str) -> String {
    let fence = format!(
        "\"version\": 1, \"geoFence\": {{\"circles\": [{circles}], \"polygons\": [{polygons}], \"version\": 2}}\n"
    );
    refusals::PLAN.replacen("\"version\": 1\n", &fence, 1)
}

/// Of 50 m, 1 km east of home.
const CIRCLE: &str = "{\"circle\": {\"center\": [39.333, -0.2969], \"radius\": 50}, \"inclusion\": false, \"version\": 1}";

/// Half a kilometre to each side of the mission, which is bent inwards on its east.
const POLYGON: &str = "{\"polygon\": [[39.328, -0.3143], [39.344, -0.3143], [39.344, -0.3027], [39.336, -0.3073], \
                       [39.328, -0.3027]], \"inclusion\": true, \"version\": 1}";

#[test]
fn a_fence_is_where_its_circles_and_polygons_are_about_home() {
    let plan = mission(&fenced(CIRCLE, POLYGON));
    assert_eq!(notes(&plan), Vec::<String>::new());
    let [circle, polygon] = plan.fence() else {
        panic!("two zones: {:?}", plan.fence());
    };
    assert_eq!(circle.name, "geoFence.circles[0]");
    assert!(!circle.zone.is_inclusion && polygon.zone.is_inclusion);
    let from_home_m = circle.zone.room_m(Ned::HOME);
    assert!((from_home_m - 950.0).abs() < 2.0, "{from_home_m} m");
    assert_eq!(polygon.name, "geoFence.polygons[0]");
    // Half-way up the mission's way the fence is 0.0012° of longitude, 103 m, to the east; its corner at the closest.
    let least_m = polygon.zone.room_m(plan.waypoints()[1]);
    assert!((least_m - 103.0).abs() < 1.0, "{least_m} m");
    assert_eq!(mission(&fenced("", "")).fence(), []);
}

#[test]
fn rally_points_and_a_place_to_return_to_are_told_of() {
    let rally =
        "\"rallyPoints\": {\"points\": [[1, 2, 3]]}, \"geoFence\": {\"breachReturn\": [1, 2, 3],";
    let plan = fenced(CIRCLE, "").replacen("\"geoFence\": {", rally, 1);
    assert_eq!(
        notes(&mission(&plan)),
        [
            "geoFence: the place to return to is ignored, a drone that is stopped at the fence lands there",
            "rallyPoints: rally points are ignored",
        ]
    );
}

/// What changes a mission into something near to one, as a regular expression.
const REPLACEMENTS: &str = "[-0-9.eE\"\\[\\]{},:\tñ ]{0,4}|nan|inf|1e999|null";

/// Nothing to check but that it ends: an error must be one that can be shown.
fn is_read_or_refused(text: &str) {
    if let Err(error) = parse(Path::new("given"), text) {
        assert!(!rendered(&error).is_empty());
    }
}

fn shipped() -> impl Strategy<Value = &'static str> {
    prop_oneof![
        Just(ALBUFERA),
        Just(RIVER),
        Just(refusals::PLAN),
        Just(refusals::FENCED),
        Just(refusals::KML),
        Just(SHORT)
    ]
}

proptest! {
    #[test]
    fn no_bytes_make_the_reader_panic(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        for beginning in ["", "{", "<", "QGC WPL 110\n"] {
            is_read_or_refused(&format!("{beginning}{}", String::from_utf8_lossy(&bytes)));
        }
    }

    #[test]
    fn a_mission_cut_anywhere_is_read_or_refused(text in shipped(), cut in any::<prop::sample::Index>()) {
        is_read_or_refused(&text[..cut.index(text.len())]);
    }

    #[test]
    fn a_mission_with_anything_changed_is_read_or_refused(
        text in shipped(),
        changes in prop::collection::vec((any::<prop::sample::Index>(), REPLACEMENTS), 1..4),
    ) {
        let mut changed = text.to_owned();
        for (place, replacement) in changes {
            let place = place.index(changed.len());
            if changed.is_char_boundary(place) && changed.is_char_boundary(place + 1) {
                changed.replace_range(place..=place, &replacement);
            }
        }
        is_read_or_refused(&changed);
    }

    #[test]
    fn every_mission_that_is_read_keeps_its_promises(
        places in prop::collection::vec((39.0..40.0_f64, -1.0..1.0_f64, 0.1..1_100.0_f64), 1..20),
    ) {
        let mut text = String::from("QGC WPL 110\n0 1 0 16 0 0 0 0 39.333 -0.3085 2 1\n");
        for (index, (latitude, longitude, height)) in places.iter().enumerate() {
            writeln!(text, "{} 0 3 16 0 0 0 0 {latitude} {longitude} {height}  1", index + 1).unwrap();
        }
        if let Ok(mission) = parse(Path::new("given"), &text) {
            let points = mission.waypoints();
            prop_assert!(points.len() > NAV_WAYPOINTS_MIN, "there is no take-off");
            prop_assert_eq!(points[0], Ned::HOME.at_altitude(points[0].altitude_m()));
            prop_assert!(points.windows(2).all(|pair| pair[0] != pair[1]));
            prop_assert!(points.iter().all(|point| point.altitude_m() > 0.0 && point.altitude_m() <= HEIGHT_MAX_M));
        }
    }
}
