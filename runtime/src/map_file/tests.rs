use std::fs;

use muster_indoor::log;
use tempfile::TempDir;

use super::*;

const GOOD: &str = "image: floor.pgm\nresolution: 0.05\norigin: [0.0, 0.0, 0.0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n";
const IMAGE: &[u8] = b"P2 3 2 255 0 255 255 255 255 0";

fn folder(yaml: &str, image: &[u8]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("map.yaml"), yaml).unwrap();
    fs::write(folder.path().join("floor.pgm"), image).unwrap();
    folder
}

fn load_from(yaml: &str, image: &[u8]) -> Result<Map, String> {
    let folder = folder(yaml, image);
    load(&folder.path().join("map.yaml")).map_err(|error| error.rendered())
}

/// `found` of the good map replaced.
fn without(found: &str, by: &str) -> String {
    assert!(GOOD.contains(found), "{found}");
    GOOD.replace(found, by)
}

#[test]
fn a_map_and_its_image_are_read() {
    let map = load_from(GOOD, IMAGE).unwrap();
    assert_eq!((map.columns(), map.rows()), (3, 2));
}

#[test]
fn broken_maps_are_refused_with_their_place() {
    let plan = |rows: &str| format!("resolution: 0.1\nplan: |\n{rows}");
    let resolution = |value: &str| without("0.05", value);
    // The text that the error shows, which contains the place, and the broken map.
    let texts: [(&str, String); 25] = [
        ("images", without("image:", "images:")),
        (
            "did you mean `resolution`",
            without("resolution", "resolutoin"),
        ),
        ("`image` takes", without("image: floor.pgm\n", "")),
        ("`resolution` takes", without("resolution: 0.05\n", "")),
        ("`origin` takes", without("origin: [0.0, 0.0, 0.0]\n", "")),
        (
            "`occupied_thresh` takes",
            without("occupied_thresh: 0.65\n", ""),
        ),
        ("\"-0.05\"", resolution("-0.05")),
        ("\"0\"", resolution("0")),
        ("\"fine\"", resolution("fine")),
        ("\".nan\"", resolution(".nan")),
        ("\"1e9\"", resolution("1e9")),
        ("given twice", format!("{GOOD}resolution: 0.1\n")),
        ("no pose", without("[0.0, 0.0, 0.0]", "[0.0, 0.0]")),
        ("no pose", without("[0.0, 0.0, 0.0]", "[0.0, x, 0.0]")),
        ("no pose", without("[0.0, 0.0, 0.0]", "[1e300, 0.0, 0.0]")),
        ("\"maybe\"", without("negate: 0", "negate: maybe")),
        ("above `occupied_thresh`", without("0.196", "0.9")),
        ("\"1.5\"", without("0.65", "1.5")),
        ("\"fuzzy\"", format!("{GOOD}mode: fuzzy\n")),
        (
            "both an image and a plan",
            format!("{GOOD}plan: |\n  ###\n"),
        ),
        ("line 2, column 3", plan("  #####\n  #.o.#\n  #####\n")),
        (
            "this is no zone",
            format!("{GOOD}keep_out: [[[0, 0], [1, 1]]]\n"),
        ),
        (
            "this is no corner",
            format!("{GOOD}keep_out: [[[0, 0], [1, 1], [2]]]\n"),
        ),
        (
            "marks no cell",
            format!("{GOOD}keep_out: [[[90, 90], [91, 90], [91, 91]]]\n"),
        ),
        (
            "aliases",
            without("negate: 0", "negate: &a 0").replace("free_thresh: 0.196", "free_thresh: *a"),
        ),
    ];
    for (shown, yaml) in texts {
        let error = load_from(&yaml, IMAGE).expect_err(&yaml);
        assert!(error.contains(shown), "{shown}: {error}");
        assert!(error.contains("map.yaml"), "{error}");
    }
}

#[test]
fn broken_yaml_is_refused_with_its_place() {
    for yaml in [
        "image: [",
        "- a\n- b\n",
        "image: {a: b}\n",
        "\"image",
        "a: b\n---\nc: d\n",
        "image:\n\t- x\n",
    ] {
        let error = load_from(yaml, IMAGE).expect_err(yaml);
        assert!(error.contains("map.yaml"), "{yaml}: {error}");
    }
}

#[test]
fn broken_images_are_refused_by_their_own_name() {
    let images: [(&str, &[u8]); 10] = [
        ("no PGM and no PNG", b"GIF89a"),
        ("it is empty", b""),
        ("the width", b"P5"),
        ("the height", b"P2 3 x 255"),
        ("0 to 65535", b"P2 2 1 255 0"),
        ("the greatest value", b"P2 2 1 0 0 0"),
        ("row 1, column 2", b"P2 2 1 100 0 101"),
        ("the pixels end at byte 12", b"P5 3 2 255\n\x00"),
        ("pixels; accepted are", b"P5 60000 60000 255\n"),
        ("can't be decoded", b"\x89PNG\r\n\x1a\nnothing"),
    ];
    for (shown, image) in images {
        let error = load_from(GOOD, image).expect_err(shown);
        assert!(error.contains(shown), "{shown}: {error}");
        assert!(error.contains("floor.pgm"), "{error}");
    }
    let folder = folder(GOOD, IMAGE);
    fs::remove_file(folder.path().join("floor.pgm")).unwrap();
    let error = load(&folder.path().join("map.yaml")).unwrap_err();
    assert!(error.rendered().contains("no such file"));
}

#[test]
fn broken_logs_are_refused_with_their_place() {
    let logs: [(&str, &str); 12] = [
        ("no scan", "# nothing\n"),
        ("is missing", "0 0.1"),
        ("\"x\"", "0 x 0 0 3.1 2 1 1"),
        ("\"inf\"", "0 inf 0 0 3.1 2 1 1"),
        ("\"1e9\"", "0 0 0 1e9 3.1 2 1 1"),
        ("\"9.9\"", "0 0 0 0 9.9 2 1 1"),
        ("\"1\"", "0 0 0 0 3.1 1 1"),
        ("whole number", "0 0 0 0 3.1 2.5 1 1"),
        ("more than the 2", "0 0 0 0 3.1 2 1 1 1"),
        ("\"-7\"", "0 0 0 0 3.1 2 1 -7"),
        ("no message", "FLASER 2 1 1 0 0 0 0 0 0 1 h 1\n?? 2\n"),
        ("the odometry's pose, x", "FLASER 2 1 1 0 0 0"),
    ];
    for (shown, text) in logs {
        let refusal = log::parse(text).expect_err(text);
        let error = refused(Path::new("drive.log"), text, refusal).rendered();
        assert!(error.contains(shown), "{shown}: {error}");
        assert!(error.contains("drive.log"), "{error}");
    }
}
