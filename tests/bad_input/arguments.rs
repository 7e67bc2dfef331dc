//! Arguments that can't be used.

use super::{Folder, assert_all, contains};

#[test]
fn wrong_argument_is_refused_with_what_is_accepted() {
    let cases: &[(&[&str], &[&str])] = &[
        (&["--seed", "-1"], &["seed=-1", "a whole number from 0"]),
        (&["--seed", "one"], &["seed=one", "a whole number from 0"]),
        (
            &["--seed", "99999999999999999999"],
            &["the number is too large", "a whole number from 0"],
        ),
        (
            &["--set", "radio.range_m=-5"],
            &[
                "range_m=-5",
                "takes a number from 0.01 to 100000, in metres",
            ],
        ),
        (&["--set", "range_m=5"], &["did you mean `radio.range_m`?"]),
        (
            &["--set", "radio.rnge_m=5"],
            &["did you mean `radio.range_m`?"],
        ),
        (&["--set", "radoi.loss=5"], &["did you mean `radio.loss`?"]),
        (&["--set", "radio.los=5"], &["did you mean `radio.loss`?"]),
        (
            &["--set", "protocol.policy=flod"],
            &["did you mean `flood`?"],
        ),
        (
            &["--set", "radio.loss=much"],
            &["found the text \"much\", expected a number"],
        ),
        (
            &["--set", "x.y.z=1"],
            &[
                "there is no field `x.y.z`",
                "accepted are fields of",
                "radio",
            ],
        ),
        (
            &["--set", "radio.power=1"],
            &["the fields of `radio` are range_m"],
        ),
        (&["--set", "relays.north_m=5"], &["relays"]),
        (&["--set", "radio.range_m"], &["key=value"]),
        (
            &["--set", "mission.file=nowhere.plan"],
            &[
                "nowhere.plan",
                "there is no such file",
                "current folder",
                "help:",
            ],
        ),
        (
            &["--set", "mission.file=missions/albufera.pln"],
            &["did you mean `missions/albufera.plan`?"],
        ),
        (
            &["--set", "mission.file=rivers"],
            &["did you mean `river`?", "such as \"river\""],
        ),
        (&["--engine", "steam"], &["actors", "events"]),
        (
            &["--set", "radio.loss=0", "--set", "radio.loss=0.1"],
            &[
                "`radio.loss` is given twice",
                "radio.loss=0 and by --set radio.loss=0.1",
            ],
        ),
        (
            &["--seed", "3", "--set", "seed=4"],
            &["by --seed 3 and by --set seed=4", "leave out one"],
        ),
        (&["--out", "scenario.toml"], &["scenario.toml"]),
    ];
    let results = cases.iter().map(|(arguments, texts)| {
        let result = Folder::new().check_refusal(arguments, texts);
        (arguments.join(" "), result)
    });
    assert_all(results);
}

#[test]
fn keys_are_not_overwritten_and_unknown_drones_not_revoked() {
    let folder = Folder::new();
    let keys = |arguments: &[&str]| {
        let (code, [_, error]) = folder.muster(&[&["keys"], arguments].concat());
        (code, error)
    };
    assert_eq!(keys(&["fleet", "ours"]).0, Some(0));
    assert_eq!(keys(&["drone", "ours", "0", "1"]).0, Some(0));
    for (arguments, says) in [
        (&["fleet", "ours"][..], "not overwritten"),
        (&["drone", "ours", "1"], "not overwritten"),
        (&["revoke", "ours", "7"], "drone 7 is not in the roster"),
        (&["drone", "nowhere", "1"], "`muster keys fleet nowhere`"),
    ] {
        let (code, error) = keys(arguments);
        assert_eq!(code, Some(2), "{error}");
        contains(&error, &[says]).unwrap();
    }
}

#[test]
fn nothing_is_suggested_for_a_name_that_is_like_none() {
    let folder = Folder::new();
    for arguments in [
        &["sim", "thesis-1", "--set", "nothing.here=1"][..],
        &["map", "check", "./plan.yaml"],
    ] {
        let (code, [_, error]) = folder.muster(arguments);
        assert_eq!(code, Some(2), "{error}");
        assert!(!error.contains("did you mean"), "{error}");
    }
}

#[test]
fn maps_are_found_by_name_and_what_is_off_them_is_refused() {
    let folder = Folder::new();
    let (code, [output, error]) = folder.muster(&["map", "check", "flat"]);
    assert_eq!(code, Some(0), "{error}");
    assert!(output.contains("flat: OK: "), "{output}");
    let locate = |argument: &'static str| vec!["map", "locate", "flat", "drive.log", argument];
    for (arguments, says) in [
        (vec!["map", "check", "./scenario.toml"], "is no flat"),
        (locate("--range=nan"), "a number from 0.1 to 1000"),
        (locate("--range=-5"), "a number from 0.1 to 1000"),
        (locate("--start=500,0,0"), "is off the map"),
        (
            vec!["map", "path", "flat", "1,3.9", "500,0"],
            "a drone can't be at",
        ),
        (
            [
                "map",
                "patrol",
                "flat",
                "--seeds",
                "0..1",
                "--fail",
                "0=dead,0=stuck",
            ]
            .to_vec(),
            "sonar 0 twice, 0=dead and 0=stuck",
        ),
    ] {
        let (code, [_, error]) = folder.muster(&arguments);
        assert_eq!(code, Some(2), "{arguments:?}: {error}");
        contains(&error, &[says]).unwrap();
    }
}

#[test]
fn numbers_out_of_range_are_refused_with_the_range() {
    let folder = Folder::new();
    let campaign = ["campaign", "scenario.toml", "--seeds", "0..1"];
    let path = ["map", "path", "flat", "1,3.9", "9,7"];
    let cases: [(&[&str], [&str; 2], &str); 11] = [
        (
            &["thesis"],
            ["--runs", "0"],
            "a whole number from 1 to 1000",
        ),
        (
            &["thesis"],
            ["--runs", "-3"],
            "a whole number from 1 to 1000",
        ),
        (&campaign, ["--slurm", "0"], "a whole number from 1 to 1000"),
        (&campaign, ["--jobs", "-1"], "a whole number from 1 to 1024"),
        (
            &campaign,
            ["--run-limit", "-5"],
            "a whole number of seconds",
        ),
        (&path, ["--radius", "-1"], "a number from 0 to 5"),
        (&["map", "cover", "flat"], ["--drones", "0"], "from 1 to 20"),
        (
            &["map", "cover", "flat"],
            ["--range", "-1"],
            "from 0.5 to 20",
        ),
        (
            &["map", "locate", "flat", "x"],
            ["--particles", "0"],
            "a whole number from 1000 to 1000000",
        ),
        (
            &["map", "locate", "flat", "x"],
            ["--seed", "-1"],
            "a whole number from 0",
        ),
        (&["keys", "drone", "ours"], ["1", "-1"], "a whole number"),
    ];
    assert_all(cases.iter().map(|(command, last, accepted)| {
        let arguments = [command, &last[..]].concat();
        let refused = folder.refused(&arguments);
        let result = refused.and_then(|error| contains(&error, &[accepted]));
        (arguments.join(" "), result)
    }));
}

#[test]
fn field_that_is_set_twice_is_refused_by_all_commands() {
    let twice = ["--set", "radio.loss=0", "--set", "radio.loss=0.1"];
    let seeds = ["--seeds", "0..1"];
    let cases = [
        [&["check", "scenario.toml"][..], &twice].concat(),
        [&["campaign", "scenario.toml"][..], &seeds, &twice].concat(),
        [&["chaos", "scenario.toml"][..], &seeds, &twice].concat(),
        [&["swarm", "scenario.toml"][..], &twice].concat(),
    ];
    assert_all(cases.iter().map(|arguments| {
        let refused = Folder::new().refused(arguments);
        let says = ["radio.loss=0 and by --set radio.loss=0.1", "once"];
        (
            arguments.join(" "),
            refused.and_then(|error| contains(&error, &says)),
        )
    }));
}

#[test]
fn unusable_out_is_refused_before_work_starts() {
    let commands: [&[&str]; 8] = [
        &["campaign", "scenario.toml", "--seeds", "0..1"],
        &["campaign-merge", "missions"],
        &["chaos", "scenario.toml", "--seeds", "0..1"],
        &["swarm", "scenario.toml"],
        &["map", "locate", "flat", "drive.log"],
        &["map", "path", "flat", "1,3.9", "9,7"],
        &["map", "cover", "flat"],
        &["map", "patrol", "flat", "--seeds", "0..1"],
    ];
    // A file in the way, and a folder in which not even root can make one.
    let outs = ["scenario.toml/sub/page.html", "/proc/none/page.html"];
    let cases = commands
        .iter()
        .flat_map(|command| outs.map(|out| [*command, &["--out", out]].concat()));
    assert_all(cases.map(|arguments| {
        let folder = Folder::new();
        folder.write("drive.log", "0 0 0 0 3.1 2 1 1");
        let refused = folder.refused(&arguments);
        let result = refused.and_then(|error| contains(&error, &["help: --out takes"]));
        (arguments.join(" "), result)
    }));
}

#[test]
fn page_is_not_written_over_a_folder_or_a_device() {
    let folder = Folder::new();
    for (out, says) in [("missions", "is a folder"), ("/dev/null", "is not a file")] {
        let arguments = ["map", "path", "flat", "1,3.9", "9,7", "--out", out];
        let error = folder.refused(&arguments).unwrap();
        contains(&error, &[out, says, "--out takes the path of a file"]).unwrap();
    }
}

#[test]
fn misspelt_names_of_scenarios_and_files_are_suggested() {
    let folder = Folder::new();
    for (arguments, says) in [
        (&["sim", "thesis2"][..], "did you mean `thesis-2`?"),
        (
            &["check", "./scenaro.toml"],
            "did you mean `./scenario.toml`?",
        ),
        (&["swarm", "swarm-shrt"], "did you mean `swarm-short`?"),
        (
            &["chaos", "chas", "--seeds", "0..1"],
            "did you mean `chaos`?",
        ),
        (
            &["campaign", "thesis1", "--seeds", "0..1"],
            "did you mean `thesis-1`?",
        ),
        (&["simm", "thesis-1"], "'sim'"),
        (&["keys", "drone", "ours", "one"], "a whole number"),
    ] {
        let (code, [output, error]) = folder.muster(arguments);
        assert_eq!((code, output.as_str()), (Some(2), ""), "{error}");
        contains(&error, &[says]).unwrap();
        assert!(!super::names_a_type(&error), "{error}");
    }
}
