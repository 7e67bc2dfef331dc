//! What people see for each way in which a mission can be wrong.

use super::*;

pub(super) const PLAN: &str = r#"{
  "fileType": "Plan",
  "mission": {
    "items": [
      {"autoContinue":true,"command":22,"frame":3,"params":[0,0,0,null,39.333,-0.3085,25],"type":"SimpleItem"},
      {"autoContinue":true,"command":16,"frame":3,"params":[0,0,0,null,39.336,-0.3085,25],"type":"SimpleItem"},
      {"autoContinue":true,"command":16,"frame":3,"params":[0,0,0,null,39.339,-0.3085,25],"type":"SimpleItem"},
      {"autoContinue":true,"command":20,"frame":2,"params":[0,0,0,0,0,0,0],"type":"SimpleItem"}
    ],
    "plannedHomePosition": [39.333, -0.3085, 2],
    "version": 2
  },
  "version": 1
}
"#;

pub(super) const KML: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<kml xmlns="http://www.opengis.net/kml/2.2"><Document><Placemark>
  <LineString>
    <altitudeMode>relativeToGround</altitudeMode>
    <coordinates>
      -0.3085,39.333,25 -0.3085,39.336,25
      -0.3085,39.339,30
    </coordinates>
  </LineString>
</Placemark></Document></kml>
"#;

/// [`PLAN`] with a fence: out of a circle 1 km east of home, within a polygon that is bent inwards on its east.
pub(super) const FENCED: &str = r#"{
  "fileType": "Plan",
  "geoFence": {
    "circles": [
      {"circle": {"center": [39.333, -0.2969], "radius": 50}, "inclusion": false, "version": 1}
    ],
    "polygons": [
      {"inclusion": true, "polygon": [
        [39.328, -0.3143],
        [39.344, -0.3143],
        [39.344, -0.3027],
        [39.336, -0.3073],
        [39.328, -0.3027]
      ], "version": 1}
    ],
    "version": 2
  },
  "mission": {
    "items": [
      {"autoContinue":true,"command":22,"frame":3,"params":[0,0,0,null,39.333,-0.3085,25],"type":"SimpleItem"},
      {"autoContinue":true,"command":16,"frame":3,"params":[0,0,0,null,39.339,-0.3085,25],"type":"SimpleItem"},
      {"autoContinue":true,"command":20,"frame":2,"params":[0,0,0,0,0,0,0],"type":"SimpleItem"}
    ],
    "plannedHomePosition": [39.333, -0.3085, 2],
    "version": 2
  },
  "version": 1
}
"#;

/// Every case's name and error, as shown, after replacing the first of `from` by `to`.
fn refusals(file: &str, text: &str, cases: &[(&str, &str, &str)]) -> String {
    let mut shown = String::new();
    for (claim, from, to) in cases {
        assert!(text.contains(from), "{claim}: nothing to replace");
        let changed = text.replacen(from, to, 1);
        let Err(error) = parse(Path::new(file), &changed) else {
            panic!("{claim}: accepted");
        };
        writeln!(shown, "# {claim}\n{}", rendered(&error)).unwrap();
    }
    shown
}

#[test]
fn what_is_neither_format_is_refused() {
    let shown = refusals(
        "short.csv",
        SHORT,
        &[
            ("another format", SHORT, "\nlatitude,longitude\n"),
            ("an array", SHORT, "[1, 2]"),
        ],
    );
    insta::assert_snapshot!(shown);
}

#[test]
fn every_fault_of_a_plan_shows_its_place() {
    let last = "[0,0,0,null,39.339,-0.3085,25]";
    let shown = refusals(
        "short.plan",
        PLAN,
        &[
            (
                "cut short",
                "\"version\": 2\n  },\n  \"version\": 1\n}\n",
                "",
            ),
            ("not JSON", "39.339", "NaN"),
            ("a comma too many", "0]", "0,]"),
            ("text after it", "1\n}\n", "1\n}\n}\n"),
            ("another file type", "\"Plan\"", "\"Fence\""),
            ("no file type", "fileType", "type"),
            ("another version", "\"version\": 1\n", "\"version\": 3\n"),
            ("an old mission", "\"version\": 2", "\"version\": 1"),
            ("no mission", "\"mission\"", "\"plan\""),
            (
                "a mission that is none",
                "\"mission\": {",
                "\"mission\": [], \"old\": {",
            ),
            (
                "items that are none",
                "\"items\": [",
                "\"items\": 7, \"old\": [",
            ),
            ("no home", "plannedHomePosition", "home"),
            ("half a home", "-0.3085, 2]", "-0.3085]"),
            ("home without altitude", "-0.3085, 2]", "-0.3085, null]"),
            (
                "home twice",
                "\"plannedHomePosition\"",
                "\"plannedHomePosition\": [39, -0.3, 2],\n    \"plannedHomePosition\"",
            ),
            ("home at a pole", "[39.333, -0.3085, 2]", "[90, 0, 0]"),
            ("home in the sky", "-0.3085, 2]", "-0.3085, 20000]"),
            (
                "an item that is none",
                "{\"autoContinue\":true,\"command\":20",
                "null, {\"command\":20",
            ),
            ("an unknown kind of item", "\"SimpleItem\"", "\"Item\""),
            ("no frame", "\"frame\":3,", ""),
            (
                "a command that is text",
                "\"command\":16",
                "\"command\":\"NAV_WAYPOINT\"",
            ),
            ("a negative frame", "\"frame\":3", "\"frame\":-3"),
            ("six parameters", last, "[0,0,0,39.339,-0.3085,25]"),
            (
                "an altitude that is text",
                last,
                "[0,0,0,null,39.339,-0.3085,\"25\"]",
            ),
            (
                "an altitude that is null",
                last,
                "[0,0,0,null,39.339,-0.3085,null]",
            ),
            (
                "a latitude that is null",
                last,
                "[0,0,0,null,null,-0.3085,25]",
            ),
            (
                "an infinite altitude",
                last,
                "[0,0,0,null,39.339,-0.3085,1e999]",
            ),
            (
                "an object for a number",
                last,
                "[0,0,0,{},39.339,-0.3085,25]",
            ),
            ("on the ground", last, "[0,0,0,null,39.339,-0.3085,0]"),
            ("below home", last, "[0,0,0,null,39.339,-0.3085,-5]"),
            ("too high", last, "[0,0,0,null,39.339,-0.3085,1000.5]"),
            (
                "a latitude off the map",
                last,
                "[0,0,0,null,139.339,-0.3085,25]",
            ),
            (
                "a longitude off the map",
                last,
                "[0,0,0,null,39.339,-200,25]",
            ),
            (
                "exchanged coordinates",
                last,
                "[0,0,0,null,-0.3085,39.339,25]",
            ),
            ("above the terrain", "\"frame\":3", "\"frame\":10"),
            (
                "above the terrain, not yet calculated",
                "\"command\":16,\"frame\":3,\"params\":[0,0,0,null,39.336,-0.3085,25]",
                "\"AltitudeMode\":3,\"command\":16,\"frame\":0,\"params\":[0,0,0,null,39.336,-0.3085,null]",
            ),
            ("local coordinates", "\"frame\":3", "\"frame\":1"),
            ("an unknown frame", "\"frame\":3", "\"frame\":99"),
            ("a loiter", "\"command\":20", "\"command\":17"),
            ("a jump", "\"command\":20", "\"command\":177"),
            ("an unknown command", "\"command\":20", "\"command\":31000"),
            ("a second take-off", "\"command\":16", "\"command\":22"),
            (
                "nothing before the return",
                "\"command\":16",
                "\"command\":20",
            ),
            (
                "a waypoint after landing",
                "\"command\":16",
                "\"command\":21",
            ),
            ("no items", "\"items\": [", "\"items\": [], \"old\": ["),
            (
                "a structure scan",
                "\"type\":\"SimpleItem\"",
                "\"type\":\"ComplexItem\",\"complexItemType\":\"StructureScan\"",
            ),
            (
                "a survey without items",
                "\"type\":\"SimpleItem\"",
                "\"type\":\"ComplexItem\",\"complexItemType\":\"survey\",\"TransectStyleComplexItem\":{}",
            ),
            (
                "on one line",
                PLAN,
                &PLAN.replace('\n', "").replace("39.339,", "true,"),
            ),
        ],
    );
    insta::assert_snapshot!(shown);
}

#[test]
fn every_fault_of_a_path_shows_its_place() {
    let shown = refusals(
        "short.kml",
        KML,
        &[
            ("cut short", "</coordinates>", ""),
            ("no path", KML, "<kml></kml>"),
            (
                "no coordinates",
                KML,
                "<kml><LineString></LineString></kml>",
            ),
            ("on the ground", "relativeToGround", "clampToGround"),
            (
                "no mode",
                "<altitudeMode>relativeToGround</altitudeMode>",
                "",
            ),
            ("above sea level", "relativeToGround", "absolute"),
            ("no altitude", "39.336,25", "39.336"),
            ("a space within a point", ",39.336", ", 39.336"),
            ("a point that is text", "39.336", "north"),
            ("four numbers", "39.336,25", "39.336,25,1"),
            ("no points", "-0.3085,39.333,25 -0.3085,39.336,25\n", ""),
            ("on the ground in between", "39.336,25", "39.336,0"),
            (
                "above sea level as QGroundControl exports it, and home alone",
                KML,
                "<kml><Document><name>QGroundControl Plan KML</name><LineString><altitudeMode>absolute</altitudeMode>\
                 <coordinates>-0.3085,39.333,500</coordinates></LineString></Document></kml>",
            ),
        ],
    );
    insta::assert_snapshot!(shown);
}

#[test]
fn every_fault_of_a_waypoints_file_shows_its_place() {
    let waypoint = "3 0 3 16 0 0 0 0 39.339 -0.3085 30 1";
    let shown = refusals(
        "short.waypoints",
        SHORT,
        &[
            ("another version", "WPL 110", "WPL 120"),
            ("nothing but a header", &SHORT[11..], "\n"),
            ("cut short", " 30 1\n", ""),
            (
                "a column too many",
                waypoint,
                "3 0 3 16 0 0 0 0 39.339 -0.3085 30 1 1",
            ),
            (
                "a waypoint that is text",
                waypoint,
                "3 0 3 16 0 0 0 0 north -0.3085 30 1",
            ),
            ("a long word", "39.339", &"ñ".repeat(50)),
            (
                "a decimal comma",
                waypoint,
                "3 0 3 16 0 0 0 0 39,339 -0.3085 30 1",
            ),
            (
                "a latitude that is NaN",
                waypoint,
                "3 0 3 16 0 0 0 0 nan -0.3085 30 1",
            ),
            (
                "an infinite altitude",
                waypoint,
                "3 0 3 16 0 0 0 0 39.339 -0.3085 inf 1",
            ),
            (
                "an unused parameter that is text",
                waypoint,
                "3 0 3 16 0 0 x 0 39.339 -0.3085 30 1",
            ),
            (
                "an index that is text",
                waypoint,
                "three 0 3 16 0 0 0 0 39.339 -0.3085 30 1",
            ),
            (
                "a jump where an index is there twice",
                waypoint,
                "2 0 3 177 2 1 0 0 0 0 0 1",
            ),
            (
                "a command that is text",
                waypoint,
                "3 0 3 WP 0 0 0 0 39.339 -0.3085 30 1",
            ),
            (
                "a current that is neither",
                waypoint,
                "3 2 3 16 0 0 0 0 39.339 -0.3085 30 1",
            ),
            (
                "an autocontinue that is neither",
                waypoint,
                "3 0 3 16 0 0 0 0 39.339 -0.3085 30 yes",
            ),
            ("too far", waypoint, "3 0 3 16 0 0 0 0 41 -0.3085 30 1"),
            ("no home", "0 1 0 16", "0 1 0 22"),
            ("a place without a command", "0 1 0 16", "0 1 0 0"),
            ("home that is NaN", "39.333 -0.3085 2", "39.333 nan 2"),
            (
                "landing at no number",
                waypoint,
                "3 0 3 21 0 0 0 0 nan nan 0 1",
            ),
            (
                "landing above the terrain",
                waypoint,
                "3 0 10 21 0 0 0 0 39.339 -0.3085 0 1",
            ),
            ("above the terrain", "2 0 3 16", "2 0 10 16"),
            ("a jump to nowhere", waypoint, "3 0 3 177 9 1 0 0 0 0 0 1"),
            (
                "a jump that does not say how often",
                waypoint,
                "3 0 3 177 2 nan 0 0 0 0 0 1",
            ),
            (
                "no height at first",
                "1 0 3 22 0 0 0 0 0 0 25 1\n2 0 3 16 0 0 0 0 39.336 -0.3085 25 1",
                "1 0 3 16 0 0 0 0 39.336 -0.3085 0 1",
            ),
            (
                "as high as home",
                waypoint,
                "3 0 0 16 0 0 0 0 39.339 -0.3085 2 1",
            ),
            ("an arc", waypoint, "3 0 3 36 90 0 0 0 39.339 -0.3085 30 1"),
            (
                "a user's own command",
                waypoint,
                "3 0 0 31010 1 0 0 0 0 0 0 1",
            ),
            ("a payload before the take-off", "1 0 3 22", "1 0 3 94"),
            (
                "loitering down to the ground",
                waypoint,
                "3 0 3 31 0 0 0 0 39.339 -0.3085 0 1",
            ),
            (
                "a jump past the return",
                waypoint,
                "3 0 3 177 6 1 0 0 0 0 0 1\n4 0 3 20 0 0 0 0 0 0 0 1\n5 0 3 16 0 0 0 0 39.34 -0.3085 30 1\n\
                 6 0 3 16 0 0 0 0 39.35 -0.3085 30 1",
            ),
            (
                "an endless jump past the return",
                waypoint,
                "3 0 3 177 5 -1 0 0 0 0 0 1\n4 0 3 20 0 0 0 0 0 0 0 1\n5 0 3 16 0 0 0 0 39.34 -0.3085 30 1",
            ),
            (
                "a take-off after landing",
                waypoint,
                "3 0 3 21 0 0 0 0 0 0 0 1\n4 0 3 183 9 1 0 0 0 0 0 1\n5 0 3 22 0 0 0 0 0 0 25 1",
            ),
            (
                "a hold of less than no time",
                waypoint,
                "3 0 3 16 -2 0 0 0 39.339 -0.3085 30 1",
            ),
            (
                "a hold of more than an hour",
                waypoint,
                "3 0 3 19 3600.5 0 0 0 39.339 -0.3085 30 1",
            ),
            (
                "holds of more than an hour together",
                waypoint,
                "3 0 3 93 3000 0 0 0 0 0 0 1\n4 0 3 93 601 0 0 0 0 0 0 1",
            ),
            ("jumps over jumps", waypoint, "3 0 3 177 2 5000 0 0 0 0 0 1"),
            (
                "nothing but take-off and return",
                "2 0 3 16 0 0 0 0 39.336 -0.3085 25 1\n3 0 3 16 0 0 0 0 39.339 -0.3085 30 1",
                "2 0 3 20 0 0 0 0 0 0 0 1",
            ),
        ],
    );
    insta::assert_snapshot!(shown);
}

#[test]
fn every_fault_of_a_fence_shows_its_place() {
    let corner = "[39.336, -0.3073]";
    let shown = refusals(
        "fenced.plan",
        FENCED,
        &[
            ("a radius of nothing", "\"radius\": 50", "\"radius\": 0"),
            ("a negative radius", "\"radius\": 50", "\"radius\": -50"),
            ("no radius", "\"radius\": 50", "\"radius\": null"),
            (
                "a radius beyond all missions",
                "\"radius\": 50",
                "\"radius\": 1e6",
            ),
            (
                "a radius that is text",
                "\"radius\": 50",
                "\"radius\": \"50\"",
            ),
            ("a centre of three numbers", "-0.2969]", "-0.2969, 0]"),
            (
                "a centre too far away",
                "39.333, -0.2969",
                "41.333, -0.2969",
            ),
            ("neither within nor out of", "\"inclusion\": false, ", ""),
            ("no circle in it", "\"circle\": {", "\"round\": {"),
            (
                "two corners",
                "[39.344, -0.3143],\n        [39.344, -0.3027],\n        [39.336, -0.3073],\n",
                "",
            ),
            ("sides that cross", corner, "[39.336, -0.3153]"),
            ("sides that touch", corner, "[39.328, -0.3143]"),
            ("a corner without a longitude", corner, "[39.336, null]"),
            ("a corner at a pole", corner, "[90, -0.3073]"),
            (
                "home within what to stay out of",
                "39.333, -0.2969",
                "39.333, -0.3084",
            ),
            ("a waypoint within it", "39.333, -0.2969", "39.339, -0.3084"),
            ("a way through it", "39.333, -0.2969", "39.336, -0.3084"),
            (
                "a way around a corner of the fence",
                corner,
                "[39.336, -0.3095]",
            ),
            ("home outside", "[39.328, -0.3143]", "[39.342, -0.3143]"),
            (
                "another version",
                "\"version\": 2\n  },\n  \"mission\"",
                "\"version\": 1\n  },\n  \"mission\"",
            ),
            ("no list", "\"circles\": [", "\"circles\": 7, \"old\": ["),
        ],
    );
    insta::assert_snapshot!(shown);
}

#[test]
fn a_fence_has_a_limit() {
    let with_zones = |zones: usize| {
        let zone =
            "{\"circle\": {\"center\": [39.333, -0.2969], \"radius\": 50}, \"inclusion\": false},";
        FENCED.replacen(
            "\"circles\": [",
            &format!("\"circles\": [{}", zone.repeat(zones)),
            1,
        )
    };
    let read = |text: &str| parse(Path::new("given"), text);
    assert_eq!(
        read(&with_zones(FENCE_ZONES_MAX - 2))
            .unwrap()
            .fence()
            .len(),
        FENCE_ZONES_MAX
    );
    let refused = read(&with_zones(FENCE_ZONES_MAX - 1))
        .unwrap_err()
        .to_string();
    assert_eq!(refused, "the fence has more than 100 circles and polygons");
    let many = "[39.336, -0.3073],".repeat(FENCE_CORNERS_MAX - 3);
    let many = FENCED.replacen("[39.336, -0.3073],", &many, 1);
    let refused = read(&many).unwrap_err().to_string();
    assert_eq!(refused, "`geoFence.polygons[0].polygon` has 1001 values");
}
