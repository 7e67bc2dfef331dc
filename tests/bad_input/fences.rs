//! Flights that leave the fence of their plan.

use super::{Folder, assert_all};

const FENCED_SCENARIO: &str = include_str!("../../scenarios/failsafe-plan-fence.toml");
const FENCED_MISSION: &str = include_str!("../../scenarios/missions/enclosure.plan");

#[test]
fn flight_outside_the_fence_is_refused_with_the_part_of_the_flight() {
    // 195 m to the north instead of 40: drone 4 passes 15 m west of the circle's centre.
    let farther = ("41.76536014", "41.76675568");
    let change = "--set=changes=[{waypoint=1,kind=\"circular\",spacing_m=60}]";
    type Replaced = (&'static str, &'static str);
    let cases: &[(&[Replaced], &[&str], &[&str])] = &[
        (
            &[],
            &["--set", "formation.spacing_m=80"],
            &[
                "drone 0 leaves the fence, geoFence.polygons[0], during take-off",
                "missions/enclosure.plan",
            ],
        ),
        (
            &[farther],
            &[],
            &[
                "drone 4 leaves the fence, geoFence.circles[0], on the leg from waypoint 0 to waypoint 1",
            ],
        ),
        (
            &[farther, ("\"radius\": 25", "\"radius\": 13.5")],
            &[],
            &[
                "drone 4 comes within 1.5 m of the fence, geoFence.circles[0]",
                "at 10 m/s it must stay more than 2 m inside",
            ],
        ),
        (
            &[
                (
                    "\"center\": [",
                    "\"center\": [41.76563, -0.81518], \"old\": [",
                ),
                ("\"radius\": 25", "\"radius\": 8"),
            ],
            &[
                "--set",
                "formation.drones=3",
                "--set",
                "protocol.kind=muscop",
                change,
            ],
            &[
                "drone 0 leaves the fence, geoFence.circles[0],",
                "in the change of formation at waypoint 1",
            ],
        ),
        (
            &[],
            &["--set", "geofence.radius_m=61"],
            &[
                "the slot of drone 0 at waypoint 0",
                "is 1.0 m inside the fence",
            ],
        ),
        (
            &[("\"radius\": 25", "\"radius\": 0")],
            &[],
            &[
                "geoFence.circles[0]: the radius is 0 m",
                "enclosure.plan",
                "above 0",
            ],
        ),
    ];
    let results = cases.iter().map(|(replaced, fields, texts)| {
        let folder = Folder::new();
        let mut mission = FENCED_MISSION.to_owned();
        for (from, to) in *replaced {
            assert!(mission.contains(from), "{from}");
            mission = mission.replacen(from, to, 1);
        }
        let mut scenario = FENCED_SCENARIO.to_owned();
        if fields.contains(&"protocol.kind=muscop") {
            scenario.truncate(scenario.find("[follow]").unwrap());
        }
        folder.write("scenario.toml", scenario);
        folder.write("missions/enclosure.plan", mission);
        (texts[0], folder.check_refusal(fields, texts))
    });
    assert_all(results);
}
