use std::fs;
use std::path::Path;
use std::time::Duration;

use muster_daemon::control::{GRANT_ALLOWS, STAGE_FALLS, STARTS};
use muster_machines::mission::{Event, LandingReason, State};
use muster_machines::node::Observation;
use muster_msp::{Configuration, Uid};
use muster_runtime::identity::{FleetKey, GrantRefusal, hex};
use serde_json::{Value, json};
use tempfile::TempDir;

use super::evidence::Weakness;
use super::*;
use crate::release::{PROCESSORS, PackageRequest, Release, package};

mod tether;

const STAGES: [GrantedStage; 3] = [
    GrantedStage::Bench,
    GrantedStage::Tethered,
    GrantedStage::Flight,
];

fn controller(chip: u32) -> ControllerFacts {
    let uid = Uid { uid: [chip, 2, 3] };
    ControllerFacts::new(&Configuration::default(), &uid)
}

fn expected_search() -> SearchFacts {
    SearchFacts {
        program: "muster 0.1.0".to_owned(),
        content: "5eed".to_owned(),
    }
}

fn chaos(plans: u64, broken: &Value) -> Value {
    let SearchFacts { program, content } = expected_search();
    json!({"program": program, "content": content, "first": 0, "tally": {"plans": plans, "broken": broken}})
}

/// Checks a file for a drone with a flight controller.
fn check(
    kind: EvidenceKind,
    text: &str,
    drone: u32,
    controller: &ControllerFacts,
) -> Result<(), Weakness> {
    let issued = CalendarTime::read("2026-11-26T12:00:00Z").unwrap();
    let request = PromotionRequest {
        drone: NodeId(drone),
        stage: kind.stage(),
        controller: controller.clone(),
        search: expected_search(),
        issued,
        until: issued.after(Duration::from_secs(86_400)),
        files: BTreeMap::new(),
    };
    evidence::check(kind, text, &request)
}

fn flight(firmware: Option<&str>) -> Value {
    json!({
        "firmware": firmware, "mission_completed": true, "violations": [],
        "drones": [{"id": 0, "port": {"rc_acknowledged": 900}}, {"id": 1, "port": {"rc_acknowledged": 800}}],
    })
}

fn bench(chip: u32) -> Value {
    json!({"chip": controller(chip).chip, "receiver": "override", "fit": true, "findings": []})
}

/// Log of drone 1's process, from its start until controller 7 is granted a stage.
fn granted(stage: &str) -> String {
    let controller = controller(7);
    let granted = json!({
        "level": "INFO", "message": GRANT_ALLOWS, "stage": stage, "chip": controller.chip,
        "firmware": controller.firmware, "settings": hex(&controller.settings),
    });
    format!("{}{granted}\n", starts())
}

fn starts() -> String {
    let line =
        json!({"level": "INFO", "message": STARTS, "drone": 1, "at_ns": 1, "incarnation": 1});
    format!("{line}\n")
}

fn seen(event: Event) -> String {
    let seen = serde_json::to_string(&Observation::Mission(event)).unwrap();
    let line = json!({"level": "INFO", "message": "seen", "drone": 1, "at_ns": 5, "seen": seen});
    format!("{line}\n")
}

/// From the place in the air to the landing, which has a reason.
fn completed(reason: LandingReason) -> String {
    [
        seen(Event::State(State::NeighbourDiscovery)),
        seen(Event::Landing(reason)),
        seen(Event::State(State::Landing)),
        seen(Event::State(State::Finished)),
    ]
    .concat()
}

/// Log of a flight from take-off to landing.
fn flown(reason: LandingReason) -> String {
    seen(Event::State(State::TakingOff)) + &completed(reason)
}

/// Log of drone 1's tethered flight with controller 7, which ends for a reason.
fn tether(stage: &str, reason: LandingReason) -> String {
    granted(stage) + &flown(reason)
}

fn good(kind: EvidenceKind) -> String {
    match kind {
        EvidenceKind::Chaos => chaos(1_000, &json!([])).to_string(),
        EvidenceKind::Simulated => flight(None).to_string(),
        EvidenceKind::Betaflight => flight(Some("betaflight_SITL")).to_string(),
        EvidenceKind::Bench => bench(7).to_string(),
        EvidenceKind::Tether => tether("tethered", LandingReason::MissionOver),
    }
}

/// A fleet with drone 1, and good files of each kind.
struct Desk {
    folder: TempDir,
    fleet: Fleet,
}

impl Desk {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let fleet = Fleet::create(&folder.path().join("keys")).unwrap();
        fleet.add_drone(NodeId(1)).unwrap();
        for kind in EvidenceKind::ALL {
            fs::write(folder.path().join(kind.name()), good(kind)).unwrap();
        }
        Self { folder, fleet }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn key(&self) -> FleetKey {
        self.fleet.public()
    }

    fn request(&self, stage: GrantedStage, kinds: &[EvidenceKind]) -> PromotionRequest {
        let issued = CalendarTime::read("2026-11-26T12:00:00Z").unwrap();
        PromotionRequest {
            drone: NodeId(1),
            stage,
            controller: controller(7),
            search: expected_search(),
            issued,
            until: issued.after(Duration::from_secs(86_400)),
            files: kinds.iter().map(|it| (*it, self.path(it.name()))).collect(),
        }
    }

    /// With the evidence that this stage is the first to need.
    fn promote(&self, stage: GrantedStage) -> (Grant, PathBuf) {
        let kinds: Vec<_> = (EvidenceKind::ALL.into_iter())
            .filter(|it| it.stage() == stage)
            .collect();
        promote(&self.fleet, &self.request(stage, &kinds)).unwrap()
    }

    fn refusal(&self, request: &PromotionRequest) -> String {
        promote(&self.fleet, request).unwrap_err().to_string()
    }
}

#[test]
fn drone_earns_each_stage_with_the_evidence_that_is_new_there() {
    let desk = Desk::new();
    for stage in STAGES {
        let (grant, path) = desk.promote(stage);
        assert_eq!(Grant::load(&path, &desk.key()).unwrap(), grant);
        assert_eq!(grant.is_for(NodeId(1), stage), Ok(()));
        let kinds = grant.evidence.hashes().map(|(kind, _)| kind);
        let needed = EvidenceKind::ALL
            .into_iter()
            .filter(|it| it.stage() <= stage);
        assert!(kinds.eq(needed), "{stage}");
    }
    // The same stage for a longer time needs nothing new.
    let again = desk.request(GrantedStage::Flight, &[]);
    promote(&desk.fleet, &again).unwrap();
}

#[test]
fn no_stage_is_skipped_and_no_evidence_left_out() {
    let desk = Desk::new();
    for stage in [GrantedStage::Tethered, GrantedStage::Flight] {
        let skipping = desk.request(stage, &EvidenceKind::ALL);
        let refusal = desk.refusal(&skipping);
        assert!(refusal.contains("first"), "{refusal}");
    }
    for kind in EvidenceKind::ALL {
        let stage = kind.stage();
        if let Some(before) = before(stage) {
            desk.promote(before);
        }
        let others: Vec<_> = (EvidenceKind::ALL.into_iter())
            .filter(|it| *it != kind && it.stage() == stage)
            .collect();
        let refusal = desk.refusal(&desk.request(stage, &others));
        assert!(
            refusal.contains(&format!("needs `--{kind} FILE`")),
            "{refusal}"
        );
        desk.promote(stage);
        if kind.stage() == GrantedStage::Bench {
            fs::remove_file(desk.path("keys/drone-1.grant")).unwrap();
        }
    }
}

#[test]
fn another_controller_or_other_settings_lose_what_was_seen_of_the_last_one() {
    let desk = Desk::new();
    for stage in [GrantedStage::Bench, GrantedStage::Tethered] {
        desk.promote(stage);
    }
    let mut changed = controller(7);
    changed.settings[0] ^= 1;
    for other in [controller(8), changed] {
        let mut request = desk.request(GrantedStage::Flight, &[EvidenceKind::Tether]);
        request.controller = other;
        let refusal = desk.refusal(&request);
        assert!(
            refusal.contains("\"tethered\" with this flight controller first"),
            "{refusal}"
        );
        request.stage = GrantedStage::Tethered;
        request.files.clear();
        let refusal = desk.refusal(&request);
        assert!(refusal.contains("`--bench FILE`"), "{refusal}");
    }
    let mut request = desk.request(GrantedStage::Tethered, &[EvidenceKind::Bench]);
    request.controller = controller(8);
    assert!(desk.refusal(&request).contains("the one here has"));
}

#[test]
fn what_shows_less_than_it_should_is_no_evidence() {
    let judged = |kind, text: &str| check(kind, text, 1, &controller(7)).err();
    for kind in EvidenceKind::ALL {
        assert_eq!(judged(kind, &good(kind)), None, "{kind}");
        assert!(judged(kind, "no JSON").is_some(), "{kind}");
    }
    let broken = json!([{"seed": 66, "rule": 5, "what": "it fell"}]);
    let (search, few) = (chaos(2_000, &broken), chaos(999, &json!([])));
    let weakness = judged(EvidenceKind::Chaos, &search.to_string());
    assert_eq!(
        weakness,
        Some(Weakness::RuleBroken("seed 66: it fell".to_owned()))
    );
    assert_eq!(
        judged(EvidenceKind::Chaos, &few.to_string()),
        Some(Weakness::FewPlans(999))
    );

    let searched = |name: &str, value: Option<Value>| {
        let mut search = chaos(1_000, &json!([]));
        match value {
            Some(value) => search[name] = value,
            None => drop(search.as_object_mut().unwrap().remove(name)),
        }
        judged(EvidenceKind::Chaos, &search.to_string())
    };
    let other = searched("content", Some(json!("of another scenario")));
    assert_eq!(other, Some(Weakness::OtherScenario));
    let older = searched("program", Some(json!("muster 0.0.1"))).unwrap();
    assert!(
        older.to_string().contains("accepted: muster 0.1.0"),
        "{older}"
    );
    for (name, value) in [
        ("program", None),
        ("content", None),
        ("tally", Some(json!({"plans": 1_000}))),
    ] {
        let weakness = searched(name, value);
        assert!(matches!(weakness, Some(Weakness::Unread(_))), "{name}");
    }

    let with = |name: &str, value: Value| {
        let mut report = flight(None);
        report[name] = value;
        judged(EvidenceKind::Simulated, &report.to_string())
    };
    assert_eq!(
        with("mission_completed", json!(false)),
        Some(Weakness::Incomplete)
    );
    assert_eq!(with("unchecked", json!(true)), Some(Weakness::Unchecked));
    let violation = json!([{"rule": 1, "what": "too near"}]);
    assert_eq!(
        with("violations", violation),
        Some(Weakness::RuleBroken("too near".to_owned()))
    );
    assert_eq!(
        with("drones", json!([{"id": 0}])),
        Some(Weakness::NoControllers)
    );
    assert_eq!(with("drones", json!([])), Some(Weakness::NoControllers));
    let swapped = |kind, report: Value| judged(kind, &report.to_string());
    assert!(matches!(
        swapped(EvidenceKind::Betaflight, flight(None)),
        Some(Weakness::OtherControllers { .. })
    ));
    assert!(matches!(
        swapped(EvidenceKind::Simulated, flight(Some("betaflight_SITL"))),
        Some(Weakness::OtherControllers { .. })
    ));

    let mut unfit = bench(7);
    unfit["fit"] = json!(false);
    assert_eq!(swapped(EvidenceKind::Bench, unfit), Some(Weakness::Unfit));
    assert!(matches!(
        swapped(EvidenceKind::Bench, bench(8)),
        Some(Weakness::OtherController { .. })
    ));
}

/// A byte of `content`, changed.
fn altered(content: &[u8], nth: usize, of: usize) -> Vec<u8> {
    let mut altered = content.to_vec();
    let at = nth * (content.len() - 1) / of;
    altered[at] ^= 1 << (nth % 7);
    altered
}

/// A release of the fleet in a folder of its own. Returns its archive.
fn release(folder: &Path, keys: &Path) -> PathBuf {
    for processor in PROCESSORS {
        let programs = folder.join("programs").join(processor);
        fs::create_dir_all(&programs).unwrap();
        for name in ["muster", "musterd"] {
            fs::write(programs.join(name), format!("{name} for {processor}")).unwrap();
        }
    }
    let written = package(&PackageRequest {
        programs: &folder.join("programs"),
        keys,
        version: "0.2.0",
        out: &folder.join("out"),
        deb: false,
    });
    written.unwrap().remove(0)
}

#[test]
fn none_of_a_thousand_forged_or_altered_grants_and_archives_is_accepted() {
    let (desk, other) = (Desk::new(), Desk::new());
    let (grant, path) = desk.promote(GrantedStage::Bench);
    let genuine = fs::read(&path).unwrap();
    let forged = desk.path("forged.grant");
    // A comment may change, or how a time is written; what a grant says may not.
    let is_accepted = |content: &[u8]| {
        fs::write(&forged, content).unwrap();
        Grant::load(&forged, &desk.key()).is_ok_and(|read| read != grant)
    };
    for nth in 0..400 {
        assert!(!is_accepted(&altered(&genuine, nth, 400)), "byte {nth}");
    }
    // Signed by another fleet's key, for each drone and stage.
    for nth in 0..50 {
        other.fleet.add_drone(NodeId(nth + 2)).unwrap();
        let stage = STAGES[nth as usize % 3];
        let drone = NodeId(nth + 2);
        let theirs = Grant {
            drone,
            stage,
            ..grant.clone()
        };
        let content = fs::read(other.fleet.grant(&theirs).unwrap()).unwrap();
        assert!(!is_accepted(&content), "of another fleet, {nth}");
    }
    // Genuine, and without what higher stages need.
    for stage in &STAGES[1..] {
        let skipping = Grant {
            stage: *stage,
            ..grant.clone()
        };
        let read = Grant::load(&desk.fleet.grant(&skipping).unwrap(), &desk.key()).unwrap();
        assert!(matches!(
            read.is_for(NodeId(1), *stage),
            Err(GrantRefusal::SkipsEvidence { .. })
        ));
    }
    // Packing locks a fleet's folder.
    let key = desk.key();
    drop((desk.fleet, other.fleet));
    let keys = |folder: &TempDir| folder.path().join("keys");
    let archive = release(desk.folder.path(), &keys(&desk.folder));
    let genuine = Release::load(&archive, &key).unwrap();
    let content = fs::read(&archive).unwrap();
    let forged = desk.folder.path().join("forged.tar.gz");
    let load = |content: &[u8]| {
        fs::write(&forged, content).unwrap();
        Release::load(&forged, &key)
    };
    for nth in 0..500 {
        // The packing's header has bytes that say nothing; files and manifest stay as they were signed.
        if let Ok(read) = load(&altered(&content, nth, 500)) {
            assert_eq!(read.files, genuine.files, "byte {nth}");
        }
    }
    for nth in 0..50 {
        let cut = content.len() * nth / 50;
        assert!(load(&content[..cut]).is_err(), "cut at {cut}");
    }
    let theirs = release(other.folder.path(), &keys(&other.folder));
    assert!(load(&fs::read(theirs).unwrap()).is_err());
}
