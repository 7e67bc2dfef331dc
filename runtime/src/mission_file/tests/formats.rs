//! Recognition of formats, and their limits.

use std::fmt::Write as _;
use std::path::PathBuf;

use super::*;

#[test]
fn shipped_missions_suit_a_line_abreast() {
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
fn shipped_missions_load_from_their_files() {
    let missions = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../scenarios/missions");
    let albufera = load(&missions.join("albufera.plan")).unwrap();
    assert_eq!(albufera, mission(ALBUFERA));
    assert!(albufera.notes().is_empty());
    assert_eq!(heights(&albufera), [25.0; 8]);
    let river = load(&missions.join("river.waypoints")).unwrap();
    assert_eq!(heights(&river), [30.0, 30.0, 40.0, 40.0, 25.0, 20.0, 30.0]);
    assert_eq!(
        notes(&river),
        ["item 2: DO_CHANGE_SPEED is ignored; the swarm flies at `vehicle.speed_mps`"]
    );
}

#[test]
fn plan_and_waypoints_file_of_a_mission_give_equal_routes() {
    let (plan, text) = (mission(ALBUFERA), mission(&as_waypoints(ALBUFERA)));
    assert_eq!(plan.waypoints(), text.waypoints());
    assert_eq!(plan.home(), text.home());
}

#[test]
fn format_is_recognised_by_content_and_not_by_name() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("mission.txt");
    std::fs::write(&path, format!("\u{feff}\r\n{ALBUFERA}")).unwrap();
    assert_eq!(load(&path).unwrap(), mission(ALBUFERA));
}

#[test]
fn windows_line_ends_and_comments_are_accepted() {
    let windows = RIVER.replace('\n', "\r\n");
    let commented = RIVER.replace("\n1\t", "\n# take-off\n\n1\t");
    assert_eq!(mission(&windows), mission(RIVER));
    assert_eq!(mission(&commented), mission(RIVER));
}

#[test]
fn tabs_and_comments_at_the_header_are_accepted() {
    let tabs = RIVER.replacen("QGC WPL 110", "# of the river\n\nQGC\tWPL\t110", 1);
    assert_eq!(mission(&tabs), mission(RIVER));
}

#[test]
fn items_of_a_survey_are_flown() {
    let survey = r#"{ "type": "ComplexItem", "complexItemType": "survey", "TransectStyleComplexItem": { "Items": [
        {"autoContinue":true,"command":16,"frame":3,"params":[0,0,0,null,39.342,-0.3085,30],"type":"SimpleItem"},
        {"autoContinue":true,"command":206,"frame":2,"params":[25,0,1,0,0,0,0],"type":"SimpleItem"},
        {"autoContinue":true,"command":16,"frame":3,"params":[0,0,0,null,39.342,-0.3070,30],"type":"SimpleItem"}
        ] } },"#;
    let plan = PLAN.replace("\"items\": [", &format!("\"items\": [{survey}"));
    let mission = mission(&plan.replacen("\"command\":22", "\"command\":16", 1));
    assert_eq!(mission.waypoints().len(), 7);
    assert_eq!(
        mission.notes()[0].item(),
        "mission.items[0].TransectStyleComplexItem.Items[1]"
    );
}

#[test]
fn longest_route_is_accepted_and_one_point_more_refused() {
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
fn too_many_items_are_refused_in_both_formats() {
    let mut text = SHORT.to_owned();
    for index in 4..=ITEMS_MAX {
        writeln!(text, "{index} 0 2 178 0 0 0 0 0 0 0 1").unwrap();
    }
    let refused = parse(Path::new("given"), &text).unwrap_err().to_string();
    assert_eq!(refused, "the file has more than 5000 items");
    let items = "0,\n".repeat(ITEMS_MAX + 1);
    let plan = PLAN.replace("\"items\": [", &format!("\"items\": [\n{items}\n"));
    let refused = parse(Path::new("given"), &plan).unwrap_err().to_string();
    assert_eq!(refused, "`mission.items` has 5005 values");
}

#[test]
fn deep_nesting_is_refused() {
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
