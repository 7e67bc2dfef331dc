//! Errors in fences.

use super::*;

#[test]
fn errors_in_a_fence_show_their_place() {
    let corner = "[39.336, -0.3073]";
    let shown = errors_of(
        "fenced.plan",
        FENCED,
        &[
            ("a radius of zero", "\"radius\": 50", "\"radius\": 0"),
            ("a negative radius", "\"radius\": 50", "\"radius\": -50"),
            ("no radius", "\"radius\": 50", "\"radius\": null"),
            ("a radius too large", "\"radius\": 50", "\"radius\": 1e6"),
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
            (
                "neither inclusion nor exclusion",
                "\"inclusion\": false, ",
                "",
            ),
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
                "home inside of an exclusion zone",
                "39.333, -0.2969",
                "39.333, -0.3084",
            ),
            (
                "a waypoint inside of it",
                "39.333, -0.2969",
                "39.339, -0.3084",
            ),
            ("a leg through it", "39.333, -0.2969", "39.336, -0.3084"),
            (
                "a leg across a corner of the fence",
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
fn fence_size_is_limited() {
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
