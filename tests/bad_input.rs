//! Whatever is wrong with a file: exit code 2, an error that names the file, shows the place and says what would be
//! accepted, and nothing written.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::fs;
use std::path::PathBuf;

use assert_cmd::Command;
use tempfile::TempDir;

const SCENARIO: &str = include_str!("../scenarios/thesis-1.toml");
const MISSION: &str = include_str!("../scenarios/missions/albufera.plan");
const FENCED_SCENARIO: &str = include_str!("../scenarios/failsafe-plan-fence.toml");
const FENCED_MISSION: &str = include_str!("../scenarios/missions/enclosure.plan");

/// A folder with a scenario and its mission, to be spoilt.
struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        let folder = Self(tempfile::tempdir().unwrap());
        fs::create_dir(folder.path("missions")).unwrap();
        folder.write("scenario.toml", SCENARIO);
        folder.write("missions/albufera.plan", MISSION);
        folder
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        fs::write(self.path(name), content).unwrap();
    }

    /// What `muster sim` says to the scenario, which it must refuse.
    fn refusal(&self, more: &[&str]) -> String {
        let out = self.path("out");
        let run = Command::cargo_bin("muster")
            .unwrap()
            .current_dir(self.0.path())
            .args(["sim", "scenario.toml"])
            .args(if more.contains(&"--out") {
                &[][..]
            } else {
                &["--out", "out"]
            })
            .args(more)
            .output()
            .unwrap();
        let said = String::from_utf8(run.stderr).unwrap();
        assert_eq!(run.status.code(), Some(2), "{said}");
        assert!(run.stdout.is_empty());
        assert!(!out.exists(), "something was written");
        assert!(!said.contains("panicked"), "{said}");
        said
    }
}

fn assert_says(said: &str, words: &[&str]) {
    // The message is wrapped to the width of a terminal.
    let unwrapped = said
        .replace("\n  │ ", " ")
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ");
    for word in words {
        assert!(unwrapped.contains(word), "`{word}` is missing in:\n{said}");
    }
}

#[test]
fn a_scenario_with_a_wrong_line_is_shown_with_what_would_be_accepted() {
    // The line as it is, the line as it is spoilt, what must be said of it.
    let cases: &[(&str, &str, &[&str])] = &[
        ("seed = 1", "", &["missing field `seed`"]),
        (
            "range_m = 300",
            "",
            &["missing field `range_m`", "`radio.range_m` is metres"],
        ),
        (
            "range_m = 300",
            "rang_m = 300",
            &["unknown field `rang_m`", "`range_m`"],
        ),
        (
            "range_m = 300",
            "range_km = 0.3",
            &["unknown field `range_km`", "`range_m`"],
        ),
        (
            "range_m = 300",
            "range_m = \"300 m\"",
            &["\"300 m\"", "metres, a number from 0.01"],
        ),
        (
            "range_m = 300",
            "range_m = nan",
            &["NaN is not", "metres, a number from 0.01"],
        ),
        (
            "range_m = 300",
            "range_m = inf",
            &["inf is not", "metres, a number from 0.01"],
        ),
        (
            "range_m = 300",
            "range_m = 300\n\n[vehicle]\nsettle_ms = 60001",
            &[
                "60001 is not a whole number from 0 to 60000",
                "`vehicle.settle_ms` is milliseconds, a whole number",
            ],
        ),
        (
            "range_m = 300",
            "range_m = 300\n\n[vehicle]\nendurance_s = 0",
            &["0 is not a time from 0.001", "`vehicle.endurance_s`"],
        ),
        (
            "range_m = 300",
            "range_m = 300\n\n[failsafe]\nalone = \"return\"",
            &["unknown variant `return`", "`carry-on`", "`land`"],
        ),
        (
            "range_m = 300",
            "range_m = 300\n\n[failsafe]\nposition_hold_s = -1",
            &["-1 is not a time", "`failsafe.position_hold_s`"],
        ),
        (
            "range_m = 300",
            "range_m = 300\n\n[failsafe]\nbattery_low = 15",
            &["15 is not a share", "`failsafe.battery_low`"],
        ),
        (
            "range_m = 300",
            "range_m = 300\n\n[failsafe]\nbattery_critical = 0.15",
            &[
                "critical, at 0.15, only when it is emptier than low, at 0.15",
                "below `battery_low`",
            ],
        ),
        (
            "range_m = 300",
            "range_m = 300\n\n[geofence]\naltitude_max_m = 50",
            &["missing field `radius_m`"],
        ),
        (
            "range_m = 300",
            "range_m = 300\n\n[geofence]\nradius_m = 0",
            &["0 is not a length", "`geofence.radius_m`"],
        ),
        (
            "range_m = 300",
            "range_m = 300\n\n[geofence]\nradius_m = 1000",
            &[
                "m within the fence; at 10 m/s that takes more than 2 m",
                "at waypoint 3",
            ],
        ),
        (
            "range_m = 300",
            "range_m = 300\n\n[geofence]\nradius_m = 5000\naltitude_max_m = 26",
            &["at waypoint 0", "m within the fence"],
        ),
        (
            "policy = \"flood\"",
            "policy = \"flood\"\nbarrier = \"none\"",
            &["unknown variant `none`", "`strict`", "`neighbours`"],
        ),
        (
            "policy = \"flood\"",
            "policy = \"flood\"\nkind = \"follow\"\nbarrier = \"neighbours\"",
            &[
                "a master that is followed waits for nobody at a waypoint",
                "`protocol.barrier` is \"strict\", or \"neighbours\"",
            ],
        ),
        (
            "liveness = \"thesis\"",
            "barrier = \"neighbours\"\n\n[[changes]]\nwaypoint = 1\nkind = \"circular\"",
            &[
                "a swarm changes formation only once all have arrived",
                "`protocol.barrier` is \"strict\", or \"neighbours\"",
            ],
        ),
        (
            "range_m = 300",
            "range_m = 300\nmodel = \"friis\"",
            &["unknown variant `friis`", "\"80211a\""],
        ),
        (
            "range_m = 300",
            "range_m = 300\nmodel = \"nakagami\"\nnakagami_m = 0.4",
            &["0.4 is not", "a shape from 0.5 to 100"],
        ),
        (
            "range_m = 300",
            "range_m = 300\nnakagami_m = 1",
            &["only the model \"nakagami\" has a shape", "nakagami_m"],
        ),
        (
            "range_m = 300",
            "range_m = 300\nmedium = \"aloha\"",
            &["unknown variant `aloha`", "\"csma\""],
        ),
        (
            "range_m = 300",
            "range_m = 300\nburst_every_ms = 380",
            &["`burst_ms` is missing", "`radio.burst_every_ms` is"],
        ),
        (
            "range_m = 300",
            "range_m = 300\nburst_ms = 20",
            &["`burst_every_ms` is missing", "`radio.burst_ms` is"],
        ),
        (
            "range_m = 300",
            "range_m = 300\nburst_loss = 0.5",
            &["there are no bursts", "`radio.burst_loss` is"],
        ),
        (
            "range_m = 300",
            "range_m = 300\nburst_every_ms = 0\nburst_ms = 20",
            &["0 is not a whole number", "`radio.burst_every_ms` is"],
        ),
        (
            "range_m = 300",
            "range_m = 300\nmedium = \"csma\"\nlatency_us = 100",
            &["takes its airtime", "latency_us"],
        ),
        (
            "range_m = 300",
            "range_m = 300\nmedium = \"csma\"\nqueue_max = 0",
            &["0 is not", "a whole number from 1 to 1000000"],
        ),
        (
            "range_m = 300",
            "range_m = 300\nqueue_max = 5",
            &["there is no queue", "queue_max"],
        ),
        (
            "spacing_m = 160",
            "spacing_m = -160",
            &["-160 is not", "metres, a number from 0.01"],
        ),
        (
            "spacing_m = 160",
            "spacing_m = 3",
            &["nearer than drones may come", "spacing_m"],
        ),
        (
            "drones = 5",
            "drones = 0",
            &["0 is not", "a whole number from 1 to 100000"],
        ),
        (
            "drones = 5",
            "drones = 2.5",
            &["2.5", "a whole number from 1 to 100000"],
        ),
        (
            "drones = 5",
            "drones = 5000",
            &["policy `flood` lists every member in a datagram"],
        ),
        (
            "seed = 1",
            "seed = -1",
            &["-1 is not", "a whole number from 0"],
        ),
        ("seed = 1", "seed = 99999999999999999999", &["seed = 9999"]),
        (
            "kind = \"linear\"",
            "kind = \"liner\"",
            &["unknown variant `liner`", "\"linear\""],
        ),
        (
            "policy = \"flood\"",
            "policy = \"fld\"",
            &["unknown variant `fld`", "\"flood\""],
        ),
        (
            "kind = \"linear\"",
            "kind = \"hexagonal\"",
            &["unknown variant `hexagonal`", "\"compact-mesh\""],
        ),
        (
            "kind = \"linear\"",
            "kind = \"linear\"\nclusters = 2",
            &["only a formation of the kind \"split-up\" has `clusters`"],
        ),
        (
            "kind = \"linear\"",
            "kind = \"circular\"\ncluster_distance_m = 400",
            &["only a formation of the kind \"split-up\" has `cluster_distance_m`"],
        ),
        (
            "kind = \"linear\"",
            "kind = \"split-up\"\nclusters = 6",
            &["6 is not", "a whole number from 2 to 5"],
        ),
        (
            "kind = \"linear\"",
            "kind = \"split-up\"\nclusters = 5",
            &["5 clusters around a master take 6 drones", "there are 5"],
        ),
        (
            "kind = \"linear\"",
            "kind = \"split-up\"\ncluster_distance_m = 0",
            &["0 is not", "metres, a number from 0.01"],
        ),
        (
            "kind = \"linear\"",
            "kind = \"compact-mesh\"\nseed = 4",
            &["only a formation of the kind \"random\" has `seed`"],
        ),
        (
            "kind = \"linear\"",
            "kind = \"random\"\nseed = -4",
            &["-4 is not", "formation.seed"],
        ),
        (
            "kind = \"linear\"",
            "kind = \"linear\"\nground = \"heap\"",
            &["unknown variant `heap`", "\"grid\""],
        ),
        (
            "kind = \"linear\"",
            "kind = \"linear\"\nassignment = \"optimal\"",
            &["there is nothing to assign", "formation.assignment"],
        ),
        (
            "drones = 5",
            "drones = 301\nground = \"grid\"\nassignment = \"optimal\"",
            &["301 drones are too many to assign optimally, 300 the most"],
        ),
        (
            "kind = \"linear\"",
            "kind = \"linear\"\nground = \"line\"\nassignment = \"best\"",
            &["unknown variant `best`", "\"greedy\""],
        ),
        ("[radio]", "[radoi]", &["unknown field `radoi`", "`radio`"]),
        ("[radio]", "[radio", &["[radio", "key = value"]),
        ("seed = 1", "seed = 1\nseed = 2", &["duplicate key"]),
        (
            "policy = \"flood\"",
            "policy = \"flood\"\nhello_gap_ms = 400",
            &["no two hellos", "hello_gap_ms"],
        ),
        (
            "policy = \"flood\"",
            "policy = \"flood\"\ntime_to_live_ms = 150",
            &["taken for lost"],
        ),
        (
            "liveness = \"thesis\"",
            "liveness = \"thesis\"\n\n[[faults]]\nat_s = 1\ncrash = 5\nactor = \"radio\"",
            &["there is no drone 5 in a swarm of 5", "faults.crash"],
        ),
        (
            "policy = \"flood\"\nliveness = \"thesis\"",
            "policy = \"tree\"\n\n[[relays]]\nnorth_m = 0\neast_m = 100001\naltitude_m = 5",
            &[
                "100001 is not an offset from -100000 to 100000",
                "relays.east_m",
            ],
        ),
        (
            "policy = \"flood\"\nliveness = \"thesis\"",
            "policy = \"tree\"\n\n[[relays]]\nnorth_m = 0\neast_m = 0\naltitude_m = -5",
            &["-5 is not a height from 0 to 100000", "relays.altitude_m"],
        ),
        (
            "policy = \"flood\"\nliveness = \"thesis\"",
            "policy = \"tree\"\n\n[[relays]]\nnorth_m = \"here\"\neast_m = 0\naltitude_m = 5",
            &["invalid type: string", "relays.north_m"],
        ),
        (
            "policy = \"flood\"\nliveness = \"thesis\"",
            "policy = \"tree\"\n\n[[relays]]\nnorth_m = 0\naltitude_m = 5",
            &["missing field `east_m`"],
        ),
        (
            "[radio]",
            "[[swarms]]\nscenario = \"scenario.toml\"\nnorth_m = 50\neast_m = 0\n\n[radio]",
            &["has `swarms` of its own", "`swarms.scenario` is"],
        ),
        (
            "[radio]",
            "[[swarms]]\nscenario = \"nowhere.toml\"\nnorth_m = 50\neast_m = 0\n\n[radio]",
            &["nowhere.toml can't be read", "`swarms.scenario` is"],
        ),
        (
            "[radio]",
            "[limits]\nduration_s = 100\n\n[[swarms]]\nscenario = \"scenario.toml\"\nnorth_m = 50\neast_m = 0\nafter_s = 100\n\n[radio]",
            &["the run is over by then"],
        ),
        (
            "[radio]",
            "[[swarms]]\nscenario = \"scenario.toml\"\nnorth_m = 50\n\n[radio]",
            &["missing field `east_m`"],
        ),
        (
            "[radio]",
            "[[swarms]]\nscenario = \"scenario.toml\"\nnorth_m = 0\neast_m = 0\nafter_s = -1\n\n[radio]",
            &["-1 is not", "swarms.after_s"],
        ),
        (
            "[radio]",
            "[[relays]]\nnorth_m = 0\neast_m = 0\naltitude_m = 5\n\n[radio]",
            &[
                "policy `flood` has no pure relays",
                "where `protocol.policy` is \"tree\"",
            ],
        ),
        (
            "liveness = \"thesis\"",
            "liveness = \"thesis\"\n\n[[faults]]\nat_s = 1\ncrash = 1\nactor = \"wings\"",
            &["unknown variant `wings`", "an actor:"],
        ),
        (
            "seed = 1",
            "seed = 1\nchanges = [{ waypoint = 8, kind = \"circular\" }]",
            &["the mission's last waypoint is 7", "changes.waypoint"],
        ),
        (
            "seed = 1",
            "seed = 1\nchanges = [{ waypoint = 3, kind = \"circular\" }, { waypoint = 2, kind = \"linear\" }]",
            &["the change before this one is made at a later waypoint"],
        ),
        (
            "seed = 1",
            "seed = 1\nchanges = [{ waypoint = 1 }]",
            &["missing field `kind`"],
        ),
        (
            "seed = 1",
            "seed = 1\nchanges = [{ waypoint = 1, kind = \"star\" }]",
            &["unknown variant `star`", "\"compact-mesh\""],
        ),
        (
            "seed = 1",
            "seed = 1\nchanges = [{ waypoint = 1, kind = \"circular\", spacing_m = 9 }]",
            &[
                "nearer than the drones stand on the ground, 10 m",
                "changes.spacing_m",
            ],
        ),
        (
            "seed = 1",
            "seed = 1\nchanges = [{ waypoint = 1, kind = \"circular\", clusters = 2 }]",
            &["only a formation of the kind \"split-up\" has `clusters`"],
        ),
        (
            "seed = 1",
            "seed = 1\nchanges = [{ waypoint = 1, kind = \"split-up\", clusters = 5 }]",
            &["5 clusters around a master take 6 drones"],
        ),
        (
            "seed = 1",
            "seed = 1\nchanges = [{ waypoint = 1, kind = \"circular\", drones = 4 }]",
            &["unknown field `drones`"],
        ),
        (
            "policy = \"flood\"",
            "kind = \"leapfrog\"\npolicy = \"flood\"",
            &["unknown variant `leapfrog`", "\"follow\""],
        ),
        (
            "liveness = \"thesis\"",
            "liveness = \"thesis\"\n\n[follow]\nhold_ms = 500",
            &["only the protocol \"follow\" has a table"],
        ),
        (
            "liveness = \"thesis\"",
            "kind = \"follow\"\n\n[follow]\nhold_ms = 200",
            &[
                "every drone would stop between two orders",
                "follow.hold_ms",
            ],
        ),
        (
            "liveness = \"thesis\"",
            "kind = \"follow\"\n\n[follow]\nspeed_mps = 10.5",
            &[
                "nobody could keep up: the others' is 10",
                "follow.speed_mps",
            ],
        ),
        (
            "liveness = \"thesis\"",
            "kind = \"follow\"\n\n[follow]\nacceleration_mps2 = 3",
            &["nobody could keep up: the others' is 1"],
        ),
        (
            "liveness = \"thesis\"",
            "kind = \"follow\"\n\n[follow]\nland_after_s = 3",
            &[
                "without a pilot the flight ends with the mission",
                "follow.land_after_s",
            ],
        ),
        (
            "liveness = \"thesis\"",
            "kind = \"follow\"\n\n[[follow.pilot]]\nafter_s = 3\nnorth_mps = 5",
            &["missing field `land_after_s`"],
        ),
        (
            "liveness = \"thesis\"",
            "kind = \"follow\"\n\n[follow]\nland_after_s = 2\n[[follow.pilot]]\nafter_s = 3",
            &["the flight would end before the pilot has done all"],
        ),
        (
            "liveness = \"thesis\"",
            "kind = \"follow\"\n\n[follow]\nland_after_s = 20\n[[follow.pilot]]\nafter_s = 3\n[[follow.pilot]]\nafter_s = 2",
            &["the entry before this one is later", "follow.pilot.after_s"],
        ),
        (
            "liveness = \"thesis\"",
            "kind = \"follow\"\n\n[follow]\nland_after_s = 20\n[[follow.pilot]]\nafter_s = 3\nnorth_mps = 8\neast_mps = 8",
            &["the vehicle flies at up to 10 m/s"],
        ),
        (
            "liveness = \"thesis\"",
            "kind = \"follow\"\n\n[follow]\nland_after_s = 20\n[[follow.pilot]]\nafter_s = 3\nclimb_mps = -2",
            &["the vehicle climbs at up to 2.5 m/s and descends at up to 1.5 m/s"],
        ),
        (
            "liveness = \"thesis\"",
            "kind = \"follow\"\n\n[follow]\nland_after_s = 20\n[[follow.pilot]]\nafter_s = 3\nclimb_mps = 101",
            &["101 is not", "m/s upwards"],
        ),
        (
            "liveness = \"thesis\"",
            "kind = \"follow\"\n\n[follow]\nland_after_s = 100\n[[follow.pilot]]\nafter_s = 5\nclimb_mps = -1.5",
            &[
                "the pilot would get to -119.8 m from here on",
                "follow.pilot.after_s",
            ],
        ),
        (
            "liveness = \"thesis\"",
            "kind = \"follow\"\n\n[follow]\nland_after_s = 100\n[[follow.pilot]]\nafter_s = 5\nclimb_mps = 2.5",
            &["the pilot would get to 268.8 m from here on"],
        ),
        (
            "liveness = \"thesis\"",
            "kind = \"follow\"\n\n[follow]\nperiod_ms = 1000",
            &[
                "the hold, 1000 ms, is not above the period, 1000 ms",
                "follow.period_ms",
            ],
        ),
        (
            "liveness = \"thesis\"",
            "kind = \"follow\"\n\n[follow]\nperiod_ms = 1001",
            &["1001 is not", "a whole number from 1 to 1000"],
        ),
        (
            "liveness = \"thesis\"",
            "liveness = \"thesis\"\n\n[[faults]]\nat_s = 1\nkill = 5",
            &["there is no drone 5 in a swarm of 5", "faults.kill"],
        ),
        (
            "liveness = \"thesis\"",
            "liveness = \"thesis\"\n\n[[faults]]\nat_s = 1\nkill = \"slave\"",
            &["\"master\" or the number of a drone"],
        ),
        (
            "liveness = \"thesis\"",
            "liveness = \"thesis\"\n\n[[faults]]\nat_s = 1\ndrone = 1",
            &["unknown field `drone`", "the fields are at_s, at_waypoint"],
        ),
        (
            "liveness = \"thesis\"",
            "liveness = \"thesis\"\n\n[[faults]]\nat_s = 1",
            &["one thing that goes wrong, no more and no less"],
        ),
        (
            "liveness = \"thesis\"",
            "liveness = \"thesis\"\n\n[[faults]]\nat_s = 1\ndrain = 1",
            &["`drain` without the charge `to` which it goes"],
        ),
        (
            "liveness = \"thesis\"",
            "liveness = \"thesis\"\n\n[[faults]]\nat_s = 1\nto = 0.1\nkill = 1",
            &["`to` goes with `drain`"],
        ),
        (
            "liveness = \"thesis\"",
            "liveness = \"thesis\"\n\n[[faults]]\nat_s = 1\ndrain = 1\nto = 15",
            &["15 is not a share from 0 to 1", "`faults.to`"],
        ),
        (
            "liveness = \"thesis\"",
            "liveness = \"thesis\"\n\n[[faults]]\nat_s = 1\nlose_gps = 5",
            &["there is no drone 5 in a swarm of 5", "`faults.lose_gps`"],
        ),
        (
            "liveness = \"thesis\"",
            "liveness = \"thesis\"\n\n[[faults]]\nat_s = 1\nkill = 1\ncrash_aircraft = 2",
            &["one thing that goes wrong, no more and no less"],
        ),
        (
            "liveness = \"thesis\"",
            "liveness = \"thesis\"\n\n[[faults]]\nat_s = 1\ncrash = 1",
            &["`crash` without the `actor` that panics"],
        ),
        (
            "liveness = \"thesis\"",
            "liveness = \"thesis\"\n\n[[faults]]\nat_s = 1\nkill = 1\nactor = \"radio\"",
            &["`actor` goes with `crash` or `hang`"],
        ),
        (
            "liveness = \"thesis\"",
            "liveness = \"thesis\"\n\n[[faults]]\nkill = 1",
            &["either `at_s`, `at_waypoint` or `when`"],
        ),
        (
            "liveness = \"thesis\"",
            "liveness = \"thesis\"\n\n[[faults]]\nat_waypoint = 99\nkill = 1",
            &[
                "the last waypoint that drones get to is 7",
                "`faults.at_waypoint`",
            ],
        ),
        (
            "liveness = \"thesis\"",
            "liveness = \"thesis\"\n\"a\\u001b[31mred\" = 1",
            &["unknown field `a\\u{1b}[31mred`"],
        ),
        (
            "liveness = \"thesis\"",
            "liveness = \"thesis\"\n\n[limits]\nduration_s = 1e-300",
            &["1e-300 is not a time from 0.001 to 604800"],
        ),
        (
            "liveness = \"thesis\"",
            "liveness = \"thesis\"\n\n[limits]\nduration_s = 1e308",
            &["1e308 is not a time from 0.001 to 604800"],
        ),
        (
            "liveness = \"thesis\"",
            "liveness = \"thesis\"\n\n[[faults]]\nat_s = 1\nwhen = \"elected\"\nkill = 1",
            &["either `at_s`, `at_waypoint` or `when`"],
        ),
        (
            "liveness = \"thesis\"",
            "liveness = \"thesis\"\n\n[[faults]]\nwhen = \"never\"\nkill = 1",
            &["unknown variant `never`", "taking-off"],
        ),
        (
            "liveness = \"thesis\"",
            "liveness = \"thesis\"\n\n[[faults]]\nat_s = 1\nafter_s = 1\nkill = 1",
            &["`after_s` goes with"],
        ),
        (
            "liveness = \"thesis\"",
            "liveness = \"thesis\"\n\n[[faults]]\nat_s = 1\nfor_s = 1\nkill = 1",
            &["nothing that lasts"],
        ),
        (
            "liveness = \"thesis\"",
            "liveness = \"thesis\"\n\n[[faults]]\nat_s = 1\ntimes = 3\nkill = 1",
            &["`times` without `every_s`"],
        ),
        (
            "liveness = \"thesis\"",
            "liveness = \"thesis\"\n\n[[faults]]\nat_s = 1\nevery_s = 3\nkill = 1",
            &["`every_s` without `times`"],
        ),
        (
            "liveness = \"thesis\"",
            "liveness = \"thesis\"\n\n[[faults]]\nat_s = 1\ncut = [1, 5]",
            &["there is no drone 5", "`[[0, 1, 2], [3, 4]]`"],
        ),
        (
            "liveness = \"thesis\"",
            "liveness = \"thesis\"\n\n[[faults]]\nat_s = 1\ncut = [[0, 1], [1, 2]]",
            &["drone 1 is on both sides"],
        ),
        (
            "liveness = \"thesis\"",
            "liveness = \"thesis\"\n\n[[faults]]\nat_s = 1\ncut = 1",
            &["two drones or groups of drones"],
        ),
        (
            "liveness = \"thesis\"",
            "liveness = \"thesis\"\n\n[[faults]]\nat_s = 1\ndegrade = [1, 2]",
            &["`degrade` without the `loss`"],
        ),
        (
            "liveness = \"thesis\"",
            "liveness = \"thesis\"\n\n[[faults]]\nat_s = 1\ncut = [1, 2]\nloss = 0.5",
            &["`loss` goes with `degrade`"],
        ),
        (
            "liveness = \"thesis\"",
            "liveness = \"thesis\"\n\n[[faults]]\nat_s = 1\njam = { north_m = 0, east_m = 0 }",
            &["missing field `radius_m`"],
        ),
        (
            "liveness = \"thesis\"",
            "liveness = \"thesis\"\nsuccession = \"inherit\"",
            &["unknown variant `inherit`", "\"elect\""],
        ),
        (
            "liveness = \"thesis\"",
            "liveness = \"thesis\"\nparameters = \"slow\"",
            &["unknown variant `slow`", "\"fast\""],
        ),
        (
            "liveness = \"thesis\"",
            "liveness = \"thesis\"\n\n[limits]\nflight_time_s = 0",
            &["0 is not", "`limits.flight_time_s` is seconds"],
        ),
        (
            "liveness = \"thesis\"",
            "liveness = \"thesis\"\n\n[limits]\ncontroller_s = -1",
            &["-1 is not", "`limits.controller_s` is seconds"],
        ),
        (
            "liveness = \"thesis\"",
            "liveness = \"thesis\"\n\n[chaos]\nfaults_max = 0",
            &["0 is not", "`chaos.faults_max` is a whole number from 1"],
        ),
        (
            "liveness = \"thesis\"",
            "liveness = \"thesis\"\n\n[chaos]\nfaults_min = 1",
            &["unknown field `faults_min`"],
        ),
        (
            "liveness = \"thesis\"",
            "liveness = \"thesis\"\n\n[chaos.vary]\n\"radio.loss\" = 0.1",
            &[
                "expected a sequence",
                "`chaos.vary` is a table of fields and lists",
            ],
        ),
        (
            "liveness = \"thesis\"",
            "liveness = \"thesis\"\n\n[limits]\naltitude_max_m = 20",
            &["over the limit of 20 m", "altitude_max_m"],
        ),
        (
            "liveness = \"thesis\"",
            "liveness = \"thesis\"\n\n[limits]\naccept = [\"late\", \"gone\"]",
            &["unknown variant `gone`", "\"descends\" and \"killed\""],
        ),
        (
            "liveness = \"thesis\"",
            "liveness = \"thesis\"\n\n[limits]\naccept = [\"late\", \"apart\", \"killed\"]",
            &[
                "a drone that comes down on the spot may come too near another",
                "this takes \"descends\" in",
            ],
        ),
        (
            "spacing_m = 160",
            "spacing_m = 160\nheading_deg = 90\ndrones_per_row = 3",
            &["unknown field `drones_per_row`"],
        ),
    ];
    for (line, spoilt, words) in cases {
        let folder = Folder::new();
        assert!(SCENARIO.contains(line), "{line}");
        folder.write("scenario.toml", SCENARIO.replacen(line, spoilt, 1));
        let said = folder.refusal(&[]);
        assert_says(&said, words);
        assert_says(&said, &["scenario.toml", "help:"]);
        let check = Command::cargo_bin("muster")
            .unwrap()
            .arg("check")
            .arg(folder.path("scenario.toml"))
            .output()
            .unwrap();
        assert_eq!(check.status.code(), Some(2), "check takes it: {spoilt}");
    }
}

#[test]
fn a_formation_along_the_legs_is_refused_where_its_layers_do_not_fit() {
    let folder = Folder::new();
    let fifteen = SCENARIO.replace("drones = 5", "drones = 25").replace(
        "spacing_m = 160",
        "spacing_m = 20
heading_deg = 82",
    );
    folder.write("scenario.toml", fifteen);
    assert_says(
        &folder.refusal(&[]),
        &[
            "needs layers up to",
            "over the limit of 120 m",
            "set `limits.altitude_max_m`",
        ],
    );
}

#[test]
fn a_file_that_is_none_is_told_apart() {
    type Spoil = fn(&Folder, &str);
    let spoil: &[(&str, Spoil, &[&str])] = &[
        (
            "an empty file",
            |folder, name| folder.write(name, ""),
            &["empty"],
        ),
        (
            "a binary file",
            |folder, name| folder.write(name, [0_u8, 159, 146, 150]),
            &["text"],
        ),
        (
            "a folder",
            |folder, name| {
                fs::remove_file(folder.path(name)).unwrap();
                fs::create_dir(folder.path(name)).unwrap();
            },
            &["director"],
        ),
        (
            "nothing",
            |folder, name| fs::remove_file(folder.path(name)).unwrap(),
            &["no such file"],
        ),
    ];
    for name in ["scenario.toml", "missions/albufera.plan"] {
        for (what, spoil, words) in spoil {
            let folder = Folder::new();
            spoil(&folder, name);
            let said = folder.refusal(&[]).to_lowercase();
            assert_says(&said, &[name]);
            assert!(
                words.iter().any(|word| said.contains(word)),
                "{what} in the place of {name}:\n{said}"
            );
        }
    }
}

#[test]
fn no_truncated_file_is_accepted_or_makes_it_panic() {
    for (name, whole) in [
        ("scenario.toml", SCENARIO),
        ("missions/albufera.plan", MISSION),
    ] {
        // The scenario's last lines may be left out without harm, so it is cut within its first.
        for part in [3, 10, 40, 45] {
            let cut = whole.len() * part / 100;
            let folder = Folder::new();
            folder.write(name, &whole[..cut]);
            assert_says(&folder.refusal(&[]), &[name]);
        }
    }
}

#[test]
fn a_mission_that_leads_nowhere_is_refused() {
    let folder = Folder::new();
    folder.write(
        "hover.waypoints",
        "QGC WPL 110\n0 1 0 16 0 0 0 0 39.333 -0.3085 2 1\n1 0 3 16 0 0 0 0 39.333 -0.3085 25 1\n",
    );
    let said = folder.refusal(&["--set", "mission.file=hover.waypoints"]);
    assert_says(&said, &["hover.waypoints", "has no waypoint but", "help:"]);
}

#[test]
fn a_flight_that_leaves_the_fence_of_its_plan_is_refused_with_the_part_that_does() {
    // 195 m north in place of 40: drone 4 passes the circle's centre 15 m to the west.
    let farther = ("41.76536014", "41.76675568");
    let change = "--set=changes=[{waypoint=1,kind=\"circular\",spacing_m=60}]";
    type Replaced = (&'static str, &'static str);
    let cases: &[(&[Replaced], &[&str], &[&str])] = &[
        (
            &[],
            &["--set", "formation.spacing_m=80"],
            &[
                "on its way to its first slot, drone 0 leaves the fence, geoFence.polygons[0]",
                "missions/enclosure.plan",
            ],
        ),
        (
            &[farther],
            &[],
            &[
                "on the way from waypoint 0 to waypoint 1, drone 4 leaves the fence, geoFence.circles[0]",
            ],
        ),
        (
            &[farther, ("\"radius\": 25", "\"radius\": 13.5")],
            &[],
            &[
                "drone 4 comes within 1.5 m of the fence, geoFence.circles[0]",
                "at 10 m/s it is to stay more than 2 m within",
            ],
        ),
        (
            &[
                (
                    "\"center\": [",
                    "\"center\": [41.76563, -0.81518], \"old\": [",
                ),
                ("\"radius\": 25", "\"radius\": 8"),
            ],
            &[
                "--set",
                "formation.drones=3",
                "--set",
                "protocol.kind=muscop",
                change,
            ],
            &[
                "changing formation at waypoint 1, drone 0",
                "leaves the fence, geoFence.circles[0]",
            ],
        ),
        (
            &[],
            &["--set", "geofence.radius_m=61"],
            &[
                "at waypoint 0 the slot of drone 0",
                "is 1.0 m within the fence",
            ],
        ),
        (
            &[("\"radius\": 25", "\"radius\": 0")],
            &[],
            &[
                "geoFence.circles[0]: the radius is 0 m",
                "enclosure.plan",
                "above 0",
            ],
        ),
    ];
    for (replaced, fields, words) in cases {
        let folder = Folder::new();
        let mut mission = FENCED_MISSION.to_owned();
        for (from, to) in *replaced {
            assert!(mission.contains(from), "{from}");
            mission = mission.replacen(from, to, 1);
        }
        let mut scenario = FENCED_SCENARIO.to_owned();
        if fields.contains(&"protocol.kind=muscop") {
            scenario.truncate(scenario.find("[follow]").unwrap());
        }
        folder.write("scenario.toml", scenario);
        folder.write("missions/enclosure.plan", mission);
        assert_says(&folder.refusal(fields), words);
    }
}

#[test]
fn what_a_plan_is_exposed_to_is_refused_unless_it_is_accepted_or_the_drones_give_way() {
    let folder = Folder::new();
    // In file, the way of each leads through the slots of others.
    let line = "spacing_m = 160\nheading_deg = 60";
    assert!(SCENARIO.contains("spacing_m = 160"));
    let check = |accept: &str, avoid: bool| {
        let tables = format!("\n[limits]\naccept = {accept}\n\n[safety]\navoid = {avoid}\n");
        let scenario =
            SCENARIO
                .replacen("liveness = \"thesis\"", "", 1)
                .replacen("spacing_m = 160", line, 1)
                + &tables;
        folder.write("scenario.toml", scenario);
        let check = Command::cargo_bin("muster")
            .unwrap()
            .current_dir(folder.0.path())
            .args(["check", "scenario.toml"])
            .output()
            .unwrap();
        let said = String::from_utf8(check.stderr).unwrap();
        (check.status.code(), said)
    };
    assert_eq!(
        check("[\"late\", \"apart\", \"descends\", \"killed\"]", false).0,
        Some(0)
    );
    let (code, said) = check("[\"apart\", \"descends\", \"killed\"]", false);
    assert_eq!(code, Some(2));
    assert_says(
        &said,
        &[
            "a drone that is late",
            "by which they give way to each other",
            "scenario.toml",
        ],
    );
    assert_eq!(
        check("[\"descends\", \"killed\"]", true).0,
        Some(0),
        "they give way"
    );
    let (code, said) = check("[\"descends\"]", true);
    assert_eq!(code, Some(2));
    assert_says(
        &said,
        &["brought down by its flight controller", "\"killed\""],
    );
}

#[test]
fn an_argument_that_cannot_be_used_is_refused_with_what_could() {
    let cases: &[(&[&str], &[&str])] = &[
        (&["--seed", "-1"], &["seed=-1", "a whole number from 0"]),
        (&["--seed", "one"], &["seed=one", "a whole number from 0"]),
        (
            &["--set", "radio.range_m=-5"],
            &["range_m=-5", "metres, a number from 0.01"],
        ),
        (&["--set", "range_m=5"], &["did you mean `radio.range_m`?"]),
        (&["--set", "relays.north_m=5"], &["relays"]),
        (&["--set", "radio.range_m"], &["key=value"]),
        (
            &["--set", "mission.file=nowhere.plan"],
            &["nowhere.plan", "help:"],
        ),
        (&["--engine", "steam"], &["actors", "events"]),
        (&["--out", "scenario.toml"], &["scenario.toml"]),
    ];
    for (arguments, words) in cases {
        assert_says(&Folder::new().refusal(arguments), words);
    }
}

#[test]
fn check_looks_at_all_files_whatever_is_wrong_with_one() {
    let folder = Folder::new();
    folder.write("broken.toml", "seed = ");
    let run = Command::cargo_bin("muster")
        .unwrap()
        .current_dir(folder.0.path())
        .args([
            "check",
            "broken.toml",
            "scenario.toml",
            "missions/albufera.plan",
            "none.plan",
        ])
        .output()
        .unwrap();
    assert_eq!(run.status.code(), Some(2));
    let said = String::from_utf8(run.stderr).unwrap();
    assert_says(&said, &["broken.toml", "none.plan"]);
    let printed = String::from_utf8(run.stdout).unwrap();
    let checked: Vec<_> = printed
        .lines()
        .filter(|line| !line.starts_with("  "))
        .map(|line| line.split(':').next().unwrap())
        .collect();
    assert_eq!(checked, ["scenario.toml", "missions/albufera.plan"]);
}

#[test]
fn keys_are_not_written_over_and_strangers_not_expelled() {
    let folder = Folder::new();
    let keys = |arguments: &[&str]| {
        let run = Command::cargo_bin("muster")
            .unwrap()
            .current_dir(folder.0.path())
            .arg("keys")
            .args(arguments)
            .output()
            .unwrap();
        (run.status.code(), String::from_utf8(run.stderr).unwrap())
    };
    assert_eq!(keys(&["fleet", "ours"]).0, Some(0));
    assert_eq!(keys(&["drone", "ours", "0", "1"]).0, Some(0));
    for (arguments, says) in [
        (&["fleet", "ours"][..], "not written over"),
        (&["drone", "ours", "1"], "not written over"),
        (&["revoke", "ours", "7"], "drone 7 is not in the roster"),
        (&["drone", "nowhere", "1"], "there is no such file"),
    ] {
        let (code, said) = keys(arguments);
        assert_eq!(code, Some(2), "{said}");
        assert_says(&said, &[says]);
    }
}
