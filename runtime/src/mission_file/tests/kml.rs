//! Paths in KML.

use super::*;

#[test]
fn kml_path_is_flown_from_its_first_point() {
    let path = mission(KML);
    assert_eq!(heights(&path), [25.0, 25.0, 30.0]);
    let legs: Vec<f64> = legs(&path)
        .into_iter()
        .map(|(leg_m, _)| leg_m.round())
        .collect();
    assert_eq!(legs, [333.0, 333.0]);
    assert_eq!(
        notes(&path),
        [
            "altitudeMode: altitudes above ground are used as heights above home; the swarm has no terrain map",
            "point 1: home is this place, for the file has none",
            "point 1: the waypoint is left out; it equals the one before it",
        ]
    );
}

#[test]
fn kml_path_ends_on_the_ground_are_home_and_landing() {
    let drawn = KML
        .replace("-0.3085,39.333,25", "-0.3085,39.333,0.2 -0.3085,39.333,25")
        .replace("39.339,30", "39.339,30 -0.3085,39.340,0");
    let path = mission(&drawn);
    assert_eq!(heights(&path), [25.0, 25.0, 30.0, 30.0]);
    assert_eq!(path.home(), Geodetic::new(39.333, -0.3085, 0.0).unwrap());
    assert_eq!(
        notes(&path)[1..],
        [
            "point 1: home is this place, for the path begins on the ground",
            "point 2: the waypoint is left out; it equals the one before it",
        ]
    );
    let between = drawn.replace("39.336,25", "39.336,0");
    let refused = parse(Path::new("given"), &between).unwrap_err().to_string();
    assert_eq!(refused, "point 3: the height above home is 0 m");
}

#[test]
fn kml_exported_by_qgroundcontrol_begins_at_home() {
    let exported = KML
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
    // A path at the altitude of home is refused.
    let flat = exported.replace("513.74", "488.74");
    let refused = parse(Path::new("given"), &flat).unwrap_err().to_string();
    assert_eq!(refused, "point 2: the height above home is 0 m");
}

#[test]
fn kml_path_goes_on_after_a_comment() {
    let commented = KML.replace("39.336,25\n", "39.336,25 <!-- second leg -->\n");
    assert_eq!(mission(&commented).waypoints(), mission(KML).waypoints());
}
