//! Maps, their images, logs of drives, and flats.

use std::fs;

use super::{Folder, assert_all, contains};

const MAP: &str = "image: floor.pgm\nresolution: 0.05\norigin: [0.0, 0.0, 0.0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n";
const IMAGE: &[u8] = b"P2 3 2 255 0 255 255 255 255 0";
const FLAT: &str = include_str!("../../scenarios/indoor/flats/flat.toml");

/// A folder with a map and its image.
fn folder(map: &str, image: &[u8]) -> Folder {
    let folder = Folder::new();
    folder.write("floor.yaml", map);
    folder.write("floor.pgm", image);
    folder
}

fn replaced(whole: &str, found: &str, by: &str) -> String {
    assert!(whole.contains(found), "{found}");
    whole.replacen(found, by, 1)
}

#[test]
fn broken_maps_are_refused_with_the_place() {
    let map = |found: &str, by: &str| replaced(MAP, found, by);
    let plan = |rows: &str| format!("resolution: 0.1\nplan: |\n{rows}");
    let cases: [(String, &[&str]); 17] = [
        (
            map("image:", "images:"),
            &["floor.yaml:1:1", "did you mean"],
        ),
        (
            map("resolution", "resolutoin"),
            &["floor.yaml:2:1", "`resolution`"],
        ),
        (
            map("resolution: 0.05\n", ""),
            &["floor.yaml", "`resolution` takes"],
        ),
        (map("0.05", "-0.05"), &["floor.yaml:2:13", "-0.05"]),
        (map("0.05", ".nan"), &["floor.yaml:2:13", ".nan"]),
        (
            map("[0.0, 0.0, 0.0]", "[0.0, 0.0]"),
            &["floor.yaml:3", "no pose"],
        ),
        (
            map("negate: 0", "negate: maybe"),
            &["floor.yaml:4:9", "maybe"],
        ),
        (
            map("0.196", "0.9"),
            &["floor.yaml:6", "above `occupied_thresh`"],
        ),
        (format!("{MAP}mode: fuzzy\n"), &["floor.yaml:7:7", "fuzzy"]),
        (
            format!("{MAP}resolution: 0.1\n"),
            &["floor.yaml:7:1", "twice"],
        ),
        (
            format!("{MAP}keep_out: [[[0, 0], [1, 1]]]\n"),
            &["floor.yaml:7", "no zone"],
        ),
        (
            plan("  #####\n  #.o.#\n  #####\n"),
            &["floor.yaml:4:5", "line 2, column 3"],
        ),
        (
            plan("\n  #####\n\n  #.o.#\n  #####\n"),
            &["floor.yaml:6:5", "line 4, column 3"],
        ),
        (
            plan("  #####\n  #...#\n#####\n"),
            &["floor.yaml:5:1", "the plan has ended before this line"],
        ),
        (
            plan("#####\n#...#\n#####\n"),
            &["floor.yaml:3:1", "the plan has ended before this line"],
        ),
        ("image: [".to_owned(), &["floor.yaml"]),
        (String::new(), &["floor.yaml", "empty"]),
    ];
    assert_all(cases.iter().map(|(map, texts)| {
        let refused = folder(map, IMAGE).refused(&["map", "check", "floor.yaml"]);
        (
            map,
            refused.and_then(|error| contains(&error.to_lowercase(), texts)),
        )
    }));
}

#[test]
fn broken_images_are_refused_by_their_own_name() {
    let cases: [(&[u8], &str); 11] = [
        (b"GIF89a", "no PGM and no PNG image: it is a GIF image"),
        (b"\xff\xd8\xff\xe0", "it is a JPEG image"),
        (b"a plan\n", "it is a text"),
        (b"\x00\x9f", "it is another kind of file"),
        (b"", "it is empty"),
        (b"P5", "the width"),
        (b"P2 3 x 255", "the height"),
        (b"P2 2 1 100 0 101", "row 1, column 2"),
        (b"P5 3 2 255\n\x00", "the pixels end at byte 12"),
        (b"P5 60000 60000 255\n", "pixels; accepted are"),
        (b"\x89PNG\r\n\x1a\nnothing", "can't be decoded"),
    ];
    assert_all(cases.iter().map(|(image, text)| {
        let refused = folder(MAP, image).refused(&["map", "check", "floor.yaml"]);
        let name = String::from_utf8_lossy(image);
        (
            name,
            refused.and_then(|error| contains(&error, &["floor.pgm", text])),
        )
    }));
    let folder = folder(MAP, IMAGE);
    fs::remove_file(folder.path("floor.pgm")).unwrap();
    let error = folder.refused(&["map", "check", "floor.yaml"]).unwrap();
    contains(&error, &["floor.pgm", "no such file"]).unwrap();
    contains(&error, &["its path starts at the map's folder, ."]).unwrap();
}

#[test]
fn missing_image_is_refused_with_its_folder_and_the_images_there() {
    let folder = Folder::new();
    folder.write("missions/map.yaml", replaced(MAP, "floor.pgm", "flor.pgm"));
    let check = || {
        folder
            .refused(&["map", "check", "missions/map.yaml"])
            .unwrap()
    };
    let resolved = ["missions/flor.pgm", "starts at the map's folder, missions"];
    contains(&check(), &resolved).unwrap();
    contains(&check(), &["its folder has no PGM or PNG"]).unwrap();
    folder.write("missions/cellar.png", IMAGE);
    contains(&check(), &["its folder has cellar.png"]).unwrap();
    folder.write("missions/floor.pgm", IMAGE);
    contains(&check(), &["did you mean `missions/floor.pgm`?"]).unwrap();
}

#[test]
fn comment_after_a_plan_is_accepted() {
    let plan = "resolution: 0.5\nplan: |\n  #####\n  #...#\n  #####\n# two rooms\n#\n";
    let (code, [output, error]) = folder(plan, IMAGE).muster(&["map", "check", "floor.yaml"]);
    assert_eq!(code, Some(0), "{error}");
    contains(&output, &["5 × 3 cells"]).unwrap();
}

#[test]
fn zones_that_close_the_way_are_named() {
    let plan = |rows: &str| format!("resolution: 0.5\nplan: |\n{rows}");
    let zone = plan("  #########\n  #...x...#\n  #########\n");
    let wall = plan("  #########\n  #.x.#...#\n  #########\n");
    let cases = [
        (&zone, "3.75,0.75", "keep-out zones close the way"),
        (&zone, "2.25,0.75", "a keep-out zone is there"),
        (&wall, "3.75,0.75", "a smaller --radius fits"),
    ];
    assert_all(cases.map(|(plan, to, says)| {
        let folder = folder(plan, IMAGE);
        let path = [
            "map",
            "path",
            "floor.yaml",
            "0.75,0.75",
            to,
            "--radius",
            "0.1",
        ];
        let refused = folder.refused(&path);
        (says, refused.and_then(|error| contains(&error, &[says])))
    }));
}

#[test]
fn drones_without_a_stop_are_counted() {
    let plan = "resolution: 0.5\nplan: |\n  #####\n  #...#\n  #...#\n  #####\n";
    let folder = folder(plan, IMAGE);
    let cover = |drones: &str, name: &str| {
        let cover = ["map", "cover", "floor.yaml", "--drones", drones];
        let (code, [output, error]) = folder.muster(&cover);
        assert_eq!(code, Some(0), "{error}");
        (output, fs::read_to_string(folder.path(name)).unwrap())
    };
    let (output, page) = cover("3", "runs/floor-cover.html");
    let idle = "2 drones have nothing to do; --drones 1 is enough";
    contains(&output, &[idle]).unwrap();
    contains(&page, &["2 drones without a stop: fewer are enough."]).unwrap();
    let first = page;
    let (output, page) = cover("1", "runs/floor-cover-2.html");
    assert!(!output.contains("nothing to do"), "{output}");
    assert!(!page.contains("without a stop"));
    let (_, again) = cover("3", "runs/floor-cover.html");
    assert_eq!(again, first, "the same page keeps its file");
    assert!(!folder.path("runs/floor-cover-3.html").exists());
}

#[test]
fn broken_logs_are_refused_with_the_place() {
    let cases: [(&str, &[&str]); 9] = [
        ("# nothing\n", &["no scan"]),
        ("0 0.1", &["drive.log:1", "missing"]),
        ("0 x 0 0 3.1 2 1 1", &["drive.log:1:3", "\"x\""]),
        ("0 inf 0 0 3.1 2 1 1", &["drive.log:1:3", "inf"]),
        ("0 0 0 0 9.9 2 1 1", &["drive.log:1:9", "9.9"]),
        ("0 0 0 0 3.1 2.5 1 1", &["drive.log:1:13", "whole number"]),
        (
            "0 0 0 0 3.1 2 1 1\n0 0 0 0 3.1 2 1 -7",
            &["drive.log:2", "-7"],
        ),
        (
            "FLASER 2 1 1 0 0 0 0 0 0 1 h 1\n?? 2\n",
            &["drive.log:2:1", "no message"],
        ),
        ("FLASER 2 1 1 0 0 0", &["drive.log:1", "odometry's pose, x"]),
    ];
    let plan = "resolution: 0.5\nplan: |\n  #####\n  #...#\n  #####\n";
    assert_all(cases.iter().map(|(log, texts)| {
        let folder = folder(plan, IMAGE);
        folder.write("drive.log", log);
        let refused = folder.refused(&["map", "locate", "floor.yaml", "drive.log"]);
        (log, refused.and_then(|error| contains(&error, texts)))
    }));
}

#[test]
fn broken_flats_are_refused_with_the_place() {
    let flat = |found: &str, by: &str| replaced(FLAT, found, by);
    let person = "\n[[people]]\nspeed_mps = 1.0\npath = [[1.0, 3.9], [2.0, 3.9]]\n";
    let cases: [(String, &[&str]); 17] = [
        (flat("about =", "abuot ="), &["flat.toml:2:1", "abuot"]),
        (
            flat("about = \"three rooms and a corridor, two people\"\n", ""),
            &["flat.toml", "about"],
        ),
        (
            flat("cell_m = 0.25", "cell_m = 0.01"),
            &["flat.toml:3:10", "0.05 to 2"],
        ),
        (
            flat("cell_m = 0.25", "cell_m = nan"),
            &["flat.toml:3:10", "NaN"],
        ),
        (
            flat("cell_m = 0.25", "cell_m = 0.07"),
            &["flat.toml:3:10", "can't be 0.07", "multiples of 0.05"],
        ),
        (
            flat("heading_deg = 0.0", "heading_deg = nan"),
            &["flat.toml:38", "`heading_deg` can't be NaN", "finite"],
        ),
        (
            flat("heading_deg = 0.0", "heading_deg = -inf"),
            &["flat.toml:38", "`heading_deg` can't be -inf", "finite"],
        ),
        (
            flat("cell_m = 0.25", "cell_m = \"wide\""),
            &["flat.toml:3:10", "wide"],
        ),
        (
            flat(
                "#...............#........................#",
                "#.......o.......#........................#",
            ),
            &["flat.toml:6:9", "line 2, column 9"],
        ),
        (
            flat("plan = '''", "plan = ''''''\nother = '''"),
            &["flat.toml"],
        ),
        (
            flat("x_m = 1.0", "x_m = 0.0"),
            &["flat.toml:38", "start in a wall"],
        ),
        (
            flat("x_m = 1.0", "x_m = 1e300"),
            &["flat.toml:38", "start in a wall"],
        ),
        (
            flat("range_m = 4.0", "range_m = 0.0"),
            &["flat.toml:39", "no such camera"],
        ),
        (
            flat("cone_deg = 60.0", "cone_deg = 400.0"),
            &["flat.toml:39", "`cone_deg` from 20 to 360"],
        ),
        (
            flat("speed_mps = 0.6", "speed_mps = 9.0"),
            &["flat.toml:4", "no person can walk so"],
        ),
        (
            flat(
                "[[1.5, 3.9], [5.6, 3.9], [5.6, 6.0], [8.9, 5.8]]",
                "[[1.5, 3.9]]",
            ),
            &["flat.toml:4", "two places inside"],
        ),
        (
            format!("{FLAT}{}", person.repeat(49)),
            &["flat.toml", "at most 50 people"],
        ),
    ];
    assert_all(cases.iter().map(|(flat, texts)| {
        let folder = Folder::new();
        folder.write("flat.toml", flat);
        let refused = folder.refused(&["map", "patrol", "./flat.toml", "--seeds", "0..1"]);
        let name = &flat[..flat.len().min(120)];
        (name, refused.and_then(|error| contains(&error, texts)))
    }));
}

#[test]
fn other_kinds_of_files_are_named_with_what_is_accepted() {
    let scenario = include_str!("../../scenarios/barriers.toml");
    let cases: [(&str, &str, &[&str]); 4] = [
        (
            "scenario.toml",
            scenario,
            &["scenario.toml", "no flat", "`plan`", "YAML"],
        ),
        ("empty.toml", "", &["empty.toml", "the file is empty"]),
        (
            "flat.yaml",
            FLAT,
            &["flat.yaml", "this is TOML", "`image`", "`.toml`"],
        ),
        (
            "scenario.yaml",
            scenario,
            &["scenario.yaml", "this is TOML", "`image`", "`.toml`"],
        ),
    ];
    assert_all(cases.iter().map(|(name, text, texts)| {
        let folder = Folder::new();
        folder.write(name, text);
        let refused = folder.refused(&["map", "check", &format!("./{name}")]);
        (name, refused.and_then(|error| contains(&error, texts)))
    }));
}
