//! Home from each format.

use super::order::IN_LINE_ORDER;
use super::*;

#[test]
fn mission_read_back_from_an_autopilot_has_no_home() {
    let text = SHORT.replace("0 1 0 16 0 0 0 0 39.333 -0.3085 2 1\n", "");
    let read_back = mission(&text);
    assert_eq!(heights(&read_back), [25.0, 30.0]);
    assert_eq!(
        notes(&read_back),
        [
            IN_LINE_ORDER,
            "item 2: home is this place, for the file has none",
            "item 2: the waypoint is left out; it equals the one before it",
        ]
    );
    // The first item is not home, even above sea level.
    let refused = parse(Path::new("given"), &text.replace("2 0 3 16", "2 0 0 16"));
    let refused = refused.unwrap_err().to_string();
    assert!(refused.contains("above sea level"), "{refused}");
}

#[test]
fn item_0_without_command_means_no_home() {
    let unset = mission(&SHORT.replace(
        "0 1 0 16 0 0 0 0 39.333 -0.3085 2 1",
        "0 1 0 0 0 0 0 0 0 0 0 1",
    ));
    assert_eq!(unset.home(), Geodetic::new(39.336, -0.3085, 0.0).unwrap());
    assert_eq!(unset.notes()[0].kind(), NoteKind::HomeFromFirstPlace);
}

#[test]
fn home_is_read_from_each_form_of_item_0() {
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
fn file_without_home_uses_its_first_place() {
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
    let note = "home is this place, for the file has none";
    assert_eq!(notes(&there_and_back), [format!("item 0: {note}")]);
    let plan = mission(&PLAN.replace("[39.333, -0.3085, 2]", "[0, 0, 0]"));
    assert_eq!(home(&plan), (39.333, -0.3085));
    assert_eq!(notes(&plan), [format!("mission.items[0]: {note}")]);
}

#[test]
fn home_overwritten_by_an_autopilot_is_replaced() {
    let simulated = SHORT.replacen("39.333 -0.3085 2", "-35.363262 149.165237 584", 1);
    let elsewhere = mission(&simulated);
    assert_eq!(
        elsewhere.home(),
        Geodetic::new(39.336, -0.3085, 0.0).unwrap()
    );
    assert_eq!(
        notes(&elsewhere)[0],
        "item 2: home is this place, for item 0 is 12451 km away, overwritten by an autopilot"
    );
    // The replaced home's altitude is of no use.
    let refused = parse(
        Path::new("given"),
        &simulated.replace("2 0 3 16", "2 0 0 16"),
    );
    let refused = refused.unwrap_err().to_string();
    assert!(refused.contains("home's altitude is unknown"), "{refused}");
}

#[test]
fn home_far_away_is_refused_unless_places_are_close_together() {
    let simulated = SHORT.replacen("39.333 -0.3085 2", "-35.363262 149.165237 584", 1);
    for (from, to) in [
        // One place is near home, one lands there, one is 110 km from the others, and one is alone.
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
    // A plan's home was set by the operator, and is kept.
    let planned = PLAN.replace("[39.333, -0.3085, 2]", "[-35.363, 149.165, 584]");
    let refused = parse(Path::new("given"), &planned).unwrap_err().to_string();
    assert!(refused.contains("km from home"), "{refused}");
}
