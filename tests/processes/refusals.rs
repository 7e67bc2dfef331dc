//! Drones' files that can't be used: exit code 2, the place is shown, and what would be accepted; nothing is flown.

use std::process::Command;

use super::fleet::{Fleet, replace};

fn check(fleet: &Fleet, id: u32, argument: &str) -> (Option<i32>, String) {
    let run = Command::new(env!("CARGO_BIN_EXE_musterd"))
        .arg("--config")
        .arg(fleet.file(id))
        .arg(argument)
        .output()
        .unwrap();
    let said = [run.stdout, run.stderr].concat();
    // It is wrapped to the width of a terminal.
    let words: Vec<_> = String::from_utf8(said)
        .unwrap()
        .split_whitespace()
        .map(str::to_owned)
        .collect();
    (run.status.code(), words.join(" "))
}

#[test]
fn what_is_wrong_with_a_drones_file_is_shown_with_what_would_be_accepted() {
    let fleet = Fleet::new();
    for (from, to, says) in [
        ("id = 0", "id = 5", "numbers up to 4"),
        ("id = 0", "id = \"two\"", "`id` is the number of a drone"),
        ("id = 0", "id = 0\nname = \"one\"", "unknown field `name`"),
        ("id = 0", "id = 0\nswarm = 0", "numbered from 1"),
        (
            "\"sim\"",
            "\"flight\"",
            "in the stage \"sim\", and in no other",
        ),
        ("\"sim\"", "\"high\"", "`stage` is \"sim\""),
        (
            "\"closed-form\"",
            "\"msp\"",
            "no link to a flight controller yet",
        ),
        ("\"udp\"", "\"quic\"", "needs a table `[quic]`"),
        ("\"udp\"", "\"tcp\"", "`transport` is \"udp\" or \"quic\""),
        ("\"json\"", "\"xml\"", "`log` is \"human\""),
        ("swarm-short", "swarm-none", "there is no such file"),
        ("journal =", "journey =", "unknown field `journey`"),
        ("drone-0.key", "drone-1.key", "has another key for drone 0"),
        ("drone-0.key", "fleet.pub", "others than its owner can read"),
        ("ours/fleet.pub", "ours/roster.toml", "not a public key"),
        (
            "ours/roster.toml",
            "ours/expelled.toml",
            "not the fleet's signature",
        ),
        (
            "bind = \"127.",
            "bind = \"327.",
            "`udp.bind` is the drone's own address",
        ),
        ("peers =", "group = \"239.7.7.7:1\"\npeers =", "one of them"),
        (
            "peers = [",
            "peers = [\"[::1]:4700\", ",
            "reaches no IPv6 address",
        ),
        ("[udp]", "[tcp]", "unknown field `tcp`"),
        ("http = \"", "http = \"x", "`observe.http` is an address"),
        ("http =", "port =", "unknown field `port`"),
        (
            "http = \"127.",
            "http = \"127.0.0.1:0\" # \"127.",
            "port 0 is any",
        ),
        ("[udp]", "[quic]", "needs a table `[udp]`"),
    ] {
        let file = fleet.file(0);
        let before = std::fs::read_to_string(&file).unwrap();
        replace(&file, from, to);
        let (code, said) = check(&fleet, 0, "--check");
        std::fs::write(&file, before).unwrap();
        assert_eq!(code, Some(2), "{from} made {to}: {said}");
        assert!(said.contains(says), "{from} made {to}: {said}");
        assert!(!said.contains("panicked"), "{said}");
    }
    let (code, said) = check(&fleet, 0, "--check");
    assert_eq!(code, Some(0), "{said}");
    assert!(!fleet.path("journal-0").exists(), "something was written");
}

#[test]
fn only_the_drone_that_leads_can_be_told_to_fly() {
    let fleet = Fleet::new();
    let (code, said) = check(&fleet, 0, "--fly");
    assert_eq!(code, Some(2));
    assert!(said.contains("does not lead"), "{said}");
}

#[test]
fn an_expelled_drone_does_not_start() {
    let fleet = Fleet::new();
    fleet.keys(&["expel", "ours", "3"]);
    let (code, said) = check(&fleet, 3, "--check");
    assert_eq!(code, Some(2));
    assert!(said.contains("drone 3 was expelled"), "{said}");
}

#[test]
fn a_list_of_the_expelled_that_was_kept_and_can_not_be_read_is_not_passed_over() {
    let fleet = Fleet::new();
    std::fs::write(fleet.path("expelled-kept-3.toml"), "number = 7").unwrap();
    let (code, said) = check(&fleet, 3, "--check");
    assert_eq!(code, Some(2));
    assert!(
        said.contains("a list of the expelled has `number`"),
        "{said}"
    );
}
