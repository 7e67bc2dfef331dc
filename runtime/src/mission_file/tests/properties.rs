//! Properties of any input.

use std::fmt::Write as _;

use proptest::prelude::*;

use super::*;

/// Replacements for a character of a mission, as a regular expression.
const REPLACEMENTS: &str = "[-0-9.eE\"\\[\\]{},:\tñ ]{0,4}|nan|inf|1e999|null";

/// Parses a text; an error must have a text to show.
fn assert_read_or_refused(text: &str) {
    if let Err(error) = parse(Path::new("given"), text) {
        assert!(!rendered(&error).is_empty());
    }
}

fn shipped_texts() -> impl Strategy<Value = &'static str> {
    prop_oneof![
        Just(ALBUFERA),
        Just(RIVER),
        Just(PLAN),
        Just(FENCED),
        Just(KML),
        Just(SHORT)
    ]
}

proptest! {
    #[test]
    fn reader_never_panics(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        for beginning in ["", "{", "<", "QGC WPL 110\n"] {
            assert_read_or_refused(&format!("{beginning}{}", String::from_utf8_lossy(&bytes)));
        }
    }

    #[test]
    fn truncated_mission_is_read_or_refused(text in shipped_texts(), cut in any::<prop::sample::Index>()) {
        assert_read_or_refused(&text[..cut.index(text.len())]);
    }

    #[test]
    fn changed_mission_is_read_or_refused(
        text in shipped_texts(),
        changes in prop::collection::vec((any::<prop::sample::Index>(), REPLACEMENTS), 1..4),
    ) {
        let mut changed = text.to_owned();
        for (place, replacement) in changes {
            let place = place.index(changed.len());
            if changed.is_char_boundary(place) && changed.is_char_boundary(place + 1) {
                changed.replace_range(place..=place, &replacement);
            }
        }
        assert_read_or_refused(&changed);
    }

    #[test]
    fn accepted_missions_keep_their_invariants(
        places in prop::collection::vec((39.0..40.0_f64, -1.0..1.0_f64, 0.1..1_100.0_f64), 1..20),
    ) {
        let mut text = String::from("QGC WPL 110\n0 1 0 16 0 0 0 0 39.333 -0.3085 2 1\n");
        for (index, (latitude, longitude, height)) in places.iter().enumerate() {
            writeln!(text, "{} 0 3 16 0 0 0 0 {latitude} {longitude} {height}  1", index + 1).unwrap();
        }
        if let Ok(mission) = parse(Path::new("given"), &text) {
            let points = mission.waypoints();
            prop_assert!(points.len() > NAV_WAYPOINTS_MIN, "the take-off point");
            prop_assert_eq!(points[0], Ned::HOME.at_altitude(points[0].altitude_m()));
            prop_assert!(points.windows(2).all(|pair| pair[0] != pair[1]));
            prop_assert!(points.iter().all(|point| point.altitude_m() > 0.0 && point.altitude_m() <= HEIGHT_MAX_M));
        }
    }
}
