//! Stages above `bench`: what a drone with a pilot's receiver may do with its grant, and without.

use std::path::PathBuf;
use std::process::Command;
use std::thread;
use std::time::Duration;

use muster_controller::Settings;
use muster_daemon::control::{GRANT_ALLOWS, STARTS};
use muster_experiments::chaos::{Request, Search};
use muster_scenarios::scenario::Override;
use serde_json::{Value, json};

use super::controllers::controlled;
use super::fleet::{Fleet, Process, assert_refused, replace, run_command};
use super::receiver::Receiver;
use super::swarm::wait_until;

/// Drones of the scenario.
const DRONES: u32 = 3;

/// Three drones with pilots' receivers, in a stage.
fn piloted(stage: &str, settings: impl Fn(u32) -> Settings) -> (Fleet, Vec<Receiver>) {
    let (fleet, receivers) = controlled(&[], settings);
    for id in 0..DRONES {
        let file = fleet.file(id);
        replace(&file, "stage = \"sim\"", &format!("stage = \"{stage}\""));
        replace(&file, "receiver = \"sole\"", "receiver = \"override\"");
    }
    (fleet, receivers)
}

/// The stages, lowest first, and what each needs for the first time.
const STAGES: [(&str, &[&str]); 3] = [
    ("bench", &["chaos", "simulated", "betaflight"]),
    ("tethered", &["bench"]),
    ("flight", &["tether"]),
];

fn sign(fleet: &Fleet, id: u32, stage: &str, receiver: &Receiver) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_muster"));
    command
        .args(["deploy", "promote"])
        .arg(fleet.path("ours"))
        .args([&id.to_string(), "--to", stage, "--days", "1"])
        .args(["--controller", &receiver.address]);
    command
}

/// What a search of `chaos-controllers` writes, with these fields set in each plan.
fn searched(set: &[Override]) -> Value {
    let search = Search::load(&Request {
        scenario: "chaos-controllers".into(),
        set: set.to_vec(),
        seeds: "0..1000".parse().unwrap(),
        keeps_going: false,
    });
    let search = search.unwrap();
    let (program, content) = search.identity();
    json!({"program": program, "content": content, "tally": {"plans": 1_000, "broken": []}})
}

/// Writes a file of evidence, as the commands that make them do.
fn write_evidence(fleet: &Fleet, id: u32, kind: &str, receiver: &Receiver) -> PathBuf {
    let path = fleet.path(&format!("{kind}-{id}"));
    let flown = |firmware: Option<&str>| {
        let drones = json!([{"port": {"rc_acknowledged": 900}}]);
        json!({"firmware": firmware, "drones": drones, "mission_completed": true, "violations": []})
            .to_string()
    };
    let seen = |event: Value| {
        let seen = json!({"Mission": event}).to_string();
        json!({"message": "seen", "drone": id, "at_ns": 1, "seen": seen}).to_string()
    };
    let text = match kind {
        "chaos" => searched(&[]).to_string(),
        "simulated" => flown(None),
        "betaflight" => flown(Some("betaflight_SITL")),
        "bench" => {
            let mut check = Command::new(env!("CARGO_BIN_EXE_muster"));
            check.args(["fc", "check", &receiver.address, "--json", "--cli"]);
            let output = check.args(["--receiver", "override"]).output().unwrap();
            String::from_utf8(output.stdout).unwrap()
        }
        _ => [
            granted(fleet, id).to_string(),
            seen(json!({"State": "TakingOff"})),
            seen(json!({"State": "NeighbourDiscovery"})),
            seen(json!({"Landing": "MissionOver"})),
            seen(json!({"State": "Finished"})),
        ]
        .join("\n"),
    };
    std::fs::write(&path, text).unwrap();
    path
}

/// The log line of a process with the controller that the drone's grant for `tethered` is for.
fn granted(fleet: &Fleet, id: u32) -> Value {
    let text = std::fs::read_to_string(fleet.path(&format!("ours/drone-{id}.grant"))).unwrap();
    let grant: toml::Table = text.parse().unwrap();
    let field = |name: &str| grant[name].as_str().unwrap();
    json!({
        "message": GRANT_ALLOWS, "stage": "tethered", "chip": field("chip"), "firmware": field("firmware"),
        "settings": field("settings"),
    })
}

/// Promotes a drone with this controller from stage to stage, and names its grant in the drone's file.
fn grant(fleet: &Fleet, id: u32, stage: &str, receiver: &Receiver) {
    let top = STAGES.iter().position(|(name, _)| *name == stage).unwrap();
    for (name, kinds) in &STAGES[..=top] {
        let mut command = sign(fleet, id, name, receiver);
        for kind in *kinds {
            let path = write_evidence(fleet, id, kind, receiver);
            command.arg(format!("--{kind}")).arg(path);
        }
        let (code, output) = run_command(&mut command);
        assert_eq!(code, Some(0), "{output}");
        assert!(output.contains(&format!("stage: {name}")), "{output}");
    }
    let named = format!("[keys]\ngrant = \"ours/drone-{id}.grant\"");
    replace(&fleet.file(id), "[keys]", &named);
}

/// Sticks of a pilot who stands by; ANGLE is always on.
const fn pilot(arm: u16, over: u16) -> [u16; 7] {
    [1_500, 1_500, 1_500, 1_000, arm, 1_800, over]
}

/// The pilot arms, by a switch that must have been low once arming is allowed. `over`: the switch of MSP OVERRIDE.
fn arm(receiver: &Receiver, over: u16) {
    let mut switch = [1_000, 1_800].into_iter().cycle();
    wait_until("the pilot has armed it", || {
        receiver.pilot(pilot(switch.next().unwrap_or(1_000), over));
        thread::sleep(Duration::from_millis(300));
        receiver.truth().is_armed
    });
}

fn changed() -> Settings {
    let mut settings = Settings::fit_overriding();
    settings.failsafe.delay_ds += 1;
    settings
}

fn fault(status: &Value, text: &str) -> bool {
    let faults = status["faults"].as_array().unwrap();
    faults.iter().any(|it| it.as_str().unwrap().contains(text))
}

#[test]
fn no_grant_is_signed_for_a_controller_without_a_pilot_or_a_drone_outside_the_fleet() {
    let (fleet, receivers) = controlled(&[], |_| Settings::fit());
    let (code, output) = run_command(&mut sign(&fleet, 0, "flight", &receivers[0]));
    assert_eq!(code, Some(5), "{output}");
    assert!(output.contains("needs a pilot's receiver"), "{output}");
    assert!(!fleet.path("ours/drone-0.grant").exists());

    let mut endless = Command::new(env!("CARGO_BIN_EXE_muster"));
    endless.args(["deploy", "promote"]).arg(fleet.path("ours"));
    endless.args(["0", "--to", "bench", "--until", "2999-12-24T18:00:00Z"]);
    endless.args(["--controller", &receivers[0].address]);
    assert_refused(&mut endless, "lasts for more than 366 days");

    let (_other, receivers) = controlled(&[], |_| Settings::fit_overriding());
    let mut skipping = sign(&fleet, 0, "flight", &receivers[0]);
    let expected = "needs a grant for \"tethered\"";
    assert_refused(&mut skipping, expected);
    let mut stranger = sign(&fleet, 9, "bench", &receivers[0]);
    for kind in STAGES[0].1 {
        let path = write_evidence(&fleet, 9, kind, &receivers[0]);
        stranger.arg(format!("--{kind}")).arg(path);
    }
    assert_refused(&mut stranger, "drone 9 is not in the roster");
}

#[test]
fn a_search_with_changed_values_earns_no_stage() {
    let (fleet, receivers) = controlled(&[], |_| Settings::fit_overriding());
    let without_loss = "radio.loss=0".parse::<Override>().unwrap();
    std::fs::write(fleet.path("chaos"), searched(&[without_loss]).to_string()).unwrap();
    let mut easier = sign(&fleet, 0, "bench", &receivers[0]);
    easier.arg("--chaos").arg(fleet.path("chaos"));
    assert_refused(&mut easier, "another scenario than `chaos-controllers`");
}

#[test]
fn stage_without_a_pilot_or_the_grant_that_it_needs_is_refused() {
    let (fleet, receivers) = piloted("tethered", |_| Settings::fit_overriding());
    assert_refused(&mut fleet.command(0), "needs `keys.grant`");
    let file = fleet.file(1);
    replace(&file, "\"override\"", "\"sole\"");
    assert_refused(&mut fleet.command(1), "needs `receiver = \"override\"`");
    grant(&fleet, 0, "tethered", &receivers[0]);
    let file = fleet.file(0);
    replace(&file, "\"tethered\"", "\"flight\"");
    let expected = "the grant allows the stage \"tethered\" only";
    assert_refused(&mut fleet.command(0), expected);
    grant(&fleet, 2, "flight", &receivers[2]);
    replace(&file, "drone-0.grant", "drone-2.grant");
    assert_refused(&mut fleet.command(0), "the grant is for drone 2");
    let text = std::fs::read_to_string(fleet.path("ours/drone-2.grant")).unwrap();
    let forged = text.replace("drone = 2", "drone = 0");
    std::fs::write(fleet.path("ours/drone-2.grant"), forged).unwrap();
    assert_refused(&mut fleet.command(0), "the signature does not match");
}

/// Drone 0's controller is as it was when its grant was signed. Drone 1's settings have changed since, drone 2's was swapped
/// for one with other firmware.
#[test]
fn changed_controller_falls_to_bench_and_status_gives_the_reason() {
    let (fleet, receivers) = piloted("flight", |_| Settings::fit_overriding());
    let mut newer = Settings::fit_overriding();
    newer.version.minor += 1;
    let (_others, swapped) = controlled(&[], |id| if id == 1 { changed() } else { newer.clone() });
    for (id, receiver) in (0..).zip(&receivers) {
        grant(&fleet, id, "flight", receiver);
        if id > 0 {
            let now = &swapped[id as usize].address;
            replace(&fleet.file(id), &receiver.address, now);
        }
    }
    let mut drones: Vec<_> = (0..DRONES).map(|id| fleet.start(id, &[])).collect();
    drones.iter_mut().for_each(Process::wait_until_ready);
    let is_open = |status: &Value| status["port"]["state"] == "open";
    let status = fleet.wait_for_status(0, "the port is open", is_open);
    assert!(!fault(&status, "bench"), "{status:#}");
    drones[0].wait_for("its grant", |line| line["message"] == GRANT_ALLOWS);
    let log = &drones[0].log;
    let nth = |message: &str| log.iter().position(|line| line["message"] == message);
    let (starts, allows) = (nth(STARTS).unwrap(), nth(GRANT_ALLOWS).unwrap());
    assert!(starts < allows, "evidence is read from the start on");
    let expected = granted(&fleet, 0);
    for name in ["chip", "firmware", "settings"] {
        assert_eq!(log[allows][name], expected[name]);
    }
    for (id, why) in [
        (1, "settings have changed"),
        (2, "the grant is for the firmware"),
    ] {
        let status = fleet.wait_for_status(id, "the port is open", is_open);
        assert!(fault(&status, "the stage falls to bench"), "{status:#}");
        assert!(fault(&status, why), "{status:#}");
        let receiver = &swapped[id as usize];
        wait_until("RC continues", || receiver.received() >= 50);
        receiver.pilot(pilot(1_000, 1_000));
    }
    // Nobody takes the sticks of what these pilots arm.
    for receiver in &swapped[1..] {
        arm(receiver, 1_000);
    }
    for id in [1, 2] {
        let quiet = |status: &Value| status["port"]["rc_per_s"] == 0;
        let armed = |status: &Value| status["vehicle"]["armed"] == true;
        let status = fleet.wait_for_status(id, "RC has stopped", |it| armed(it) && quiet(it));
        assert!(fault(&status, "the stage falls to bench"), "{status:#}");
    }
}
