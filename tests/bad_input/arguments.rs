//! Arguments that can't be used.

use super::{Folder, assert_all, contains};

#[test]
fn wrong_argument_is_refused_with_what_is_accepted() {
    let cases: &[(&[&str], &[&str])] = &[
        (&["--seed", "-1"], &["seed=-1", "a whole number from 0"]),
        (&["--seed", "one"], &["seed=one", "a whole number from 0"]),
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
        (&["drone", "nowhere", "1"], "there is no such file"),
    ] {
        let (code, error) = keys(arguments);
        assert_eq!(code, Some(2), "{error}");
        contains(&error, &[says]).unwrap();
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
