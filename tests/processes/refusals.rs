//! Drones' files that can't be used: exit code 2, the place is shown, and what would be accepted; nothing is flown.

use super::fleet::{Fleet, assert_refused, replace, said_by};

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
            "ours/revoked.toml",
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
        assert_refused(fleet.command(0).arg("--check"), says);
        std::fs::write(&file, before).unwrap();
    }
    let (code, said) = said_by(fleet.command(0).arg("--check"));
    assert_eq!(code, Some(0), "{said}");
    assert!(!fleet.path("journal-0").exists(), "something was written");
}

#[test]
fn only_the_drone_that_leads_can_be_told_to_fly() {
    let fleet = Fleet::new();
    assert_refused(fleet.command(0).arg("--fly"), "does not lead");
}

#[test]
fn an_expelled_drone_does_not_start() {
    let fleet = Fleet::new();
    fleet.keys(&["revoke", "ours", "3"]);
    assert_refused(fleet.command(3).arg("--check"), "drone 3 was revoked");
}

#[test]
fn a_list_of_the_expelled_that_was_kept_and_can_not_be_read_is_not_passed_over() {
    let fleet = Fleet::new();
    std::fs::write(fleet.path("revoked-kept-3.toml"), "number = 7").unwrap();
    let says = "a list of the revoked has `number`";
    assert_refused(fleet.command(3).arg("--check"), says);
}
