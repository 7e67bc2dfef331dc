//! Errors in KML paths.

use super::*;

#[test]
fn errors_in_a_kml_path_show_their_place() {
    let shown = errors_of(
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
