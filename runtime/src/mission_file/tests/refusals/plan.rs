//! Errors in plans.

use super::*;

#[test]
fn errors_in_a_plan_show_their_place() {
    let last = "[0,0,0,null,39.339,-0.3085,25]";
    let shown = errors_of(
        "short.plan",
        PLAN,
        &[
            (
                "cut short",
                "\"version\": 2\n  },\n  \"version\": 1\n}\n",
                "",
            ),
            ("not JSON", "39.339", "NaN"),
            ("an extra comma", "0]", "0,]"),
            ("text after the end", "1\n}\n", "1\n}\n}\n"),
            ("another file type", "\"Plan\"", "\"Fence\""),
            ("no file type", "fileType", "type"),
            ("another version", "\"version\": 1\n", "\"version\": 3\n"),
            ("an old mission", "\"version\": 2", "\"version\": 1"),
            ("no mission", "\"mission\"", "\"plan\""),
            (
                "a mission that is an array",
                "\"mission\": {",
                "\"mission\": [], \"old\": {",
            ),
            (
                "items that are a number",
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
                "an item that is null",
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
