//! Errors for each mistake in a mission file.

mod fence;
mod kml;
mod plan;
mod waypoints;

use super::*;

/// The name and error of each case, in which the first `from` is replaced by `to`.
fn errors_of(file: &str, text: &str, cases: &[(&str, &str, &str)]) -> String {
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
fn unknown_formats_are_refused() {
    let shown = errors_of(
        "short.csv",
        SHORT,
        &[
            ("another format", SHORT, "\nlatitude,longitude\n"),
            ("an array", SHORT, "[1, 2]"),
        ],
    );
    insta::assert_snapshot!(shown);
}
