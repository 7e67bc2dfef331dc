//! Errors in waypoints files.

use super::*;

#[test]
fn errors_in_a_waypoints_file_show_their_place() {
    let waypoint = "3 0 3 16 0 0 0 0 39.339 -0.3085 30 1";
    let shown = errors_of(
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
                "a jump with a duplicate index",
                waypoint,
                "2 0 3 177 2 1 0 0 0 0 0 1",
            ),
            (
                "a command that is text",
                waypoint,
                "3 0 3 WP 0 0 0 0 39.339 -0.3085 30 1",
            ),
            (
                "an invalid current",
                waypoint,
                "3 2 3 16 0 0 0 0 39.339 -0.3085 30 1",
            ),
            (
                "an invalid autocontinue",
                waypoint,
                "3 0 3 16 0 0 0 0 39.339 -0.3085 30 yes",
            ),
            ("too far", waypoint, "3 0 3 16 0 0 0 0 41 -0.3085 30 1"),
            ("no home", "0 1 0 16", "0 1 0 22"),
            ("item 0 with a place and no command", "0 1 0 16", "0 1 0 0"),
            ("home that is NaN", "39.333 -0.3085 2", "39.333 nan 2"),
            ("landing at NaN", waypoint, "3 0 3 21 0 0 0 0 nan nan 0 1"),
            (
                "landing above the terrain",
                waypoint,
                "3 0 10 21 0 0 0 0 39.339 -0.3085 0 1",
            ),
            ("above the terrain", "2 0 3 16", "2 0 10 16"),
            ("a jump to nowhere", waypoint, "3 0 3 177 9 1 0 0 0 0 0 1"),
            (
                "a jump without repetitions",
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
                "a negative hold",
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
            (
                "too many repetitions",
                waypoint,
                "3 0 3 177 2 5000 0 0 0 0 0 1",
            ),
            (
                "nothing but take-off and return",
                "2 0 3 16 0 0 0 0 39.336 -0.3085 25 1\n3 0 3 16 0 0 0 0 39.339 -0.3085 30 1",
                "2 0 3 20 0 0 0 0 0 0 0 1",
            ),
        ],
    );
    insta::assert_snapshot!(shown);
}
