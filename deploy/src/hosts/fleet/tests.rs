use super::*;

const HOSTS: &str = "[[hosts]]\nrun = [\"ssh\", \"pi@10.0.0.7\"]\ndrones = [0, 1]\n\
                     [[hosts]]\nname = \"tail\"\nrun = [\"ssh\", \"pi@10.0.0.8\"]\ndrones = [2]\n\
                     [[hosts]]\nrun = [\"ssh\", \"b.local\"]\ndrones = [3, 4]\n";

/// The fleet of a file with these lines before and after its hosts.
fn fleet(before: &str, after: &str) -> Result<Fleet, BadInput> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("fleet.toml");
    let text = format!("group = \"239.77.0.1:4700\"\n{before}\n{HOSTS}{after}");
    std::fs::write(&path, text).unwrap();
    Fleet::load(&path)
}

const NEEDED: &str = "scenario = \"swarm-short\"\nkeys = \"keys\"\n";

#[test]
fn first_host_is_the_canary_by_default() {
    let fleet = fleet(NEEDED, "").unwrap();
    let names: Vec<_> = fleet.hosts.iter().map(|it| it.name.as_str()).collect();
    assert_eq!(names, ["10.0.0.7", "tail", "b.local"]);
    let waves: Vec<_> = fleet.waves.iter().map(|it| it.hosts.clone()).collect();
    assert_eq!(waves, [vec![0], vec![1, 2]]);
    let unknown = fleet.host(Path::new("fleet.toml"), "tial").unwrap_err();
    assert!(
        unknown.rendered().contains("did you mean `tail`?"),
        "{unknown}"
    );
}

#[test]
fn rollout_waves_match_the_hosts_file() {
    let waves = "[[waves]]\nhosts = [\"tail\"]\nsoak_s = 60\n\
                 [[waves]]\nhosts = [\"b.local\", \"10.0.0.7\"]\nat_once = 1\n";
    let fleet = fleet(NEEDED, waves).unwrap();
    assert_eq!(fleet.waves[0].soak, Duration::from_secs(60));
    assert_eq!(fleet.waves[1].hosts, [2, 0]);
    assert_eq!(fleet.waves[1].at_once, 1);
}

#[test]
fn fleet_that_cannot_be_deployed_is_refused_with_the_reason() {
    let wave = |hosts: &str| format!("[[waves]]\nhosts = [{hosts}]\n");
    let table = [
        (
            "keys = \"keys\"",
            String::new(),
            "`muster deploy` needs `scenario`",
        ),
        (
            "scenario = \"swarm-short\"",
            String::new(),
            "`muster deploy` needs `keys`",
        ),
        (NEEDED, wave("\"tial\""), "did you mean `tail`?"),
        (NEEDED, wave("\"tail\", \"tail\""), "is in two waves"),
        (
            NEEDED,
            wave("\"tail\", \"b.local\""),
            "\"10.0.0.7\" is in no wave",
        ),
        (NEEDED, wave(""), "the wave has no host"),
        (
            NEEDED,
            "stage = \"flight\"\n".to_owned(),
            "others need `controller`",
        ),
        (
            NEEDED,
            "receiver = \"sole\"\n".to_owned(),
            "`receiver` needs `controller`",
        ),
        (
            NEEDED,
            "controller = \"serial:/dev/ttyACM0\"\n".to_owned(),
            "`controller` needs `receiver`",
        ),
        (
            NEEDED,
            "controller = \"serial:/dev/ttyACM0\"\nreceiver = \"override\"\n".to_owned(),
            "a host with a controller has one drone",
        ),
        (
            NEEDED,
            "name = \"tail\"\n".to_owned(),
            "two hosts have the name \"tail\"",
        ),
        (
            NEEDED,
            "name = \"../x\"\n".to_owned(),
            "a host's name has letters",
        ),
        (
            NEEDED,
            format!(
                "{}at_once = 0\n",
                wave("\"tail\", \"b.local\", \"10.0.0.7\"")
            ),
            "a whole number from 1 to 10000",
        ),
        (
            NEEDED,
            format!(
                "{}dropped_per_s_max = -1.0\n",
                wave("\"tail\", \"b.local\", \"10.0.0.7\"")
            ),
            "a number from 0 to 1000000",
        ),
    ];
    for (before, after, why) in table {
        let refused = fleet(before, &after).unwrap_err().rendered();
        assert!(refused.contains(why), "{after}: {refused}");
    }
}

#[test]
fn gate_has_limits() {
    let gate = |text: &str| fleet(NEEDED, &format!("[gate]\n{text}\n"));
    let default = fleet(NEEDED, "").unwrap().gate;
    assert_eq!((default.within_s, default.hold_s), (60, 10));
    let given = gate("within_s = 3600\nhold_s = 0").unwrap().gate;
    assert_eq!((given.within_s, given.hold_s), (3_600, 0));
    for (text, why) in [
        ("within_s = 0", "a whole number from 1 to 3600"),
        ("within_s = 3601", "a whole number from 1 to 3600"),
        ("hold_s = 4294967295", "a whole number from 0 to 3600"),
    ] {
        let refused = gate(text).unwrap_err().rendered();
        assert!(refused.contains(why), "{refused}");
    }
}
