//! Unusable drone files: exit code 2, and an error with the place and the accepted values.

use super::fleet::{Fleet, assert_refused, replace, run_command};

#[test]
fn errors_in_a_drone_file_show_what_is_accepted() {
    let fleet = Fleet::new();
    for (from, to, expected) in [
        ("id = 0", "id = 5", "numbers up to 4"),
        ("id = 0", "id = \"two\"", "`id` takes the number of a drone"),
        ("id = 0", "id = 0\nname = \"one\"", "unknown field `name`"),
        (
            "id = 0",
            "id = 0\nswarm = 0",
            "a whole number from 1 to 4294967295",
        ),
        ("\"sim\"", "\"flight\"", "`stage` needs \"sim\""),
        ("\"sim\"", "\"high\"", "`stage` takes \"sim\""),
        ("\"closed-form\"", "\"msp\"", "needs `port`"),
        ("\"udp\"", "\"quic\"", "needs a table `[quic]`"),
        (
            "\"udp\"",
            "\"tcp\"",
            "`transport` takes \"udp\" or \"quic\"",
        ),
        ("\"json\"", "\"xml\"", "`log` takes \"human\""),
        ("swarm-short", "swarm-none", "there is no such file"),
        ("journal =", "journey =", "unknown field `journey`"),
        ("drone-0.key", "drone-1.key", "has another key for drone 0"),
        (
            "drone-0.key",
            "fleet.pub",
            "users other than its owner can read",
        ),
        ("ours/fleet.pub", "ours/roster.toml", "not a public key"),
        (
            "ours/roster.toml",
            "ours/revoked.toml",
            "the signature does not match",
        ),
        (
            "bind = \"127.",
            "bind = \"327.",
            "`udp.bind` takes an address and port",
        ),
        (
            "peers =",
            "group = \"239.7.7.7:1\"\npeers =",
            "exactly one of `group`",
        ),
        (
            "peers = [",
            "peers = [\"[::1]:4700\", ",
            "need the same address family",
        ),
        ("[udp]", "[tcp]", "unknown field `tcp`"),
        ("http = \"", "http = \"x", "`observe.http` takes an address"),
        ("http =", "port =", "unknown field `port`"),
        (
            "http = \"127.",
            "http = \"127.0.0.1:0\" # \"127.",
            "`observe.http` needs a fixed port (1–65535), found 0",
        ),
        ("[udp]", "[quic]", "needs a table `[udp]`"),
    ] {
        let file = fleet.file(0);
        let before = std::fs::read_to_string(&file).unwrap();
        replace(&file, from, to);
        assert_refused(fleet.command(0).arg("--check"), expected);
        std::fs::write(&file, before).unwrap();
    }
    let (code, output) = run_command(fleet.command(0).arg("--check"));
    assert_eq!(code, Some(0), "{output}");
    assert!(!fleet.path("journal-0").exists(), "something was written");
}

#[test]
fn only_the_leader_accepts_the_order_to_fly() {
    let fleet = Fleet::new();
    assert_refused(fleet.command(0).arg("--fly"), "does not lead");
}

#[test]
fn revoked_drone_does_not_start() {
    let fleet = Fleet::new();
    fleet.keys(&["revoke", "ours", "3"]);
    assert_refused(
        fleet.command(3).arg("--check"),
        "the key of drone 3 is revoked",
    );
}

#[test]
fn unreadable_kept_revocation_list_is_an_error() {
    let fleet = Fleet::new();
    std::fs::write(fleet.path("revoked-kept-3.toml"), "number = 7").unwrap();
    let expected = "a revocation list has `number`";
    assert_refused(fleet.command(3).arg("--check"), expected);
}
