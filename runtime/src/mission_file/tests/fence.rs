//! Fences of plans.

use super::*;

/// A plan with these circles and polygons.
fn fenced(circles: &str, polygons: &str) -> String {
    let fence = format!(
        "\"version\": 1, \"geoFence\": {{\"circles\": [{circles}], \"polygons\": [{polygons}], \"version\": 2}}\n"
    );
    PLAN.replacen("\"version\": 1\n", &fence, 1)
}

/// An exclusion circle of 50 m radius, 1 km east of home.
const CIRCLE: &str = "{\"circle\": {\"center\": [39.333, -0.2969], \"radius\": 50}, \"inclusion\": false, \"version\": 1}";

/// An inclusion polygon that extends 500 m from the mission, and less in the east.
const POLYGON: &str = "{\"polygon\": [[39.328, -0.3143], [39.344, -0.3143], [39.344, -0.3027], [39.336, -0.3073], \
                       [39.328, -0.3027]], \"inclusion\": true, \"version\": 1}";

#[test]
fn fence_zones_are_placed_about_home() {
    let plan = mission(&fenced(CIRCLE, POLYGON));
    assert_eq!(notes(&plan), Vec::<String>::new());
    let [circle, polygon] = plan.fence() else {
        panic!("two zones: {:?}", plan.fence());
    };
    assert_eq!(circle.name, "geoFence.circles[0]");
    assert!(!circle.zone.is_inclusion && polygon.zone.is_inclusion);
    let from_home_m = circle.zone.clearance_m(Ned::HOME);
    assert!((from_home_m - 950.0).abs() < 2.0, "{from_home_m} m");
    assert_eq!(polygon.name, "geoFence.polygons[0]");
    // At waypoint 1 the nearest corner is 0.0012° of longitude, 103 m, to the east.
    let least_m = polygon.zone.clearance_m(plan.waypoints()[1]);
    assert!((least_m - 103.0).abs() < 1.0, "{least_m} m");
    assert_eq!(mission(&fenced("", "")).fence(), []);
}

#[test]
fn rally_points_and_return_point_are_noted() {
    let rally =
        "\"rallyPoints\": {\"points\": [[1, 2, 3]]}, \"geoFence\": {\"breachReturn\": [1, 2, 3],";
    let plan = fenced(CIRCLE, "").replacen("\"geoFence\": {", rally, 1);
    assert_eq!(
        notes(&mission(&plan)),
        [
            "geoFence: the return point is ignored; a drone that is stopped at the fence lands there",
            "rallyPoints: rally points are ignored",
        ]
    );
}
