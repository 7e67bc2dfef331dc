//! Logs of tethered flights.

use super::*;

#[test]
fn a_record_of_a_tether_shows_a_whole_flight_of_this_drone_in_that_stage() {
    let judged = |text: &str| check(EvidenceKind::Tether, text, 1, &controller(7)).err();
    let whole = tether("tethered", LandingReason::MissionOver);
    assert_eq!(judged(&whole), None);
    assert_eq!(
        judged(&tether("flight", LandingReason::MissionOver)),
        Some(Weakness::NoFlight)
    );
    let lost = tether("tethered", LandingReason::PositionLost);
    assert_eq!(
        judged(&lost),
        Some(Weakness::Aborted(LandingReason::PositionLost))
    );
    // The newest flight counts.
    assert_eq!(judged(&format!("{lost}{whole}")), None);
    assert!(judged(&format!("{whole}{lost}")).is_some());
    let without = |text: &str, state: &str| -> String {
        let lines = text.lines().filter(|line| !line.contains(state));
        lines.map(|line| format!("{line}\n")).collect()
    };
    let unfinished = without(&whole, "Finished");
    assert_eq!(judged(&unfinished), Some(Weakness::NoFlight));
    // The pilot has not armed, and the operator recalls the drone, or the mission ends without it.
    let never_up = without(&whole, "NeighbourDiscovery");
    assert_eq!(judged(&never_up), Some(Weakness::NoFlight));
    let recalled = tether("tethered", LandingReason::Recalled);
    assert_eq!(judged(&recalled), None);
    let never_up = without(&recalled, "NeighbourDiscovery");
    assert_eq!(
        judged(&never_up),
        Some(Weakness::Aborted(LandingReason::Recalled))
    );
    let other = whole.replace("\"drone\":1", "\"drone\":2");
    assert_eq!(judged(&other), Some(Weakness::OtherDrone(2)));
}

#[test]
fn a_log_counts_only_for_the_flight_controller_that_it_names() {
    let of =
        |found: &ControllerFacts, text: &str| check(EvidenceKind::Tether, text, 1, found).err();
    let whole = tether("tethered", LandingReason::MissionOver);
    let (mut newer, mut changed) = (controller(7), controller(7));
    newer.firmware = "BTFL 2027.1.0".to_owned();
    changed.settings[0] ^= 1;
    for (what, other) in [
        ("chip", controller(8)),
        ("firmware", newer),
        ("settings", changed),
    ] {
        let weakness = of(&other, &whole).unwrap().to_string();
        assert!(
            weakness.contains(&format!("with the {what} ")),
            "{weakness}"
        );
        // A flight with it after that counts.
        assert_eq!(of(&controller(7), &whole), None);
    }
    let of_another = whole.replace(&controller(7).chip, &controller(8).chip);
    assert_eq!(of(&controller(7), &format!("{of_another}{whole}")), None);
    assert!(of(&controller(7), &format!("{whole}{of_another}")).is_some());
    let unnamed = whole.replace("\"settings\"", "\"other\"");
    assert_eq!(of(&controller(7), &unnamed), Some(Weakness::NoController));
}

#[test]
fn an_old_log_of_a_replaced_controller_earns_no_flight() {
    let desk = Desk::new();
    for stage in STAGES {
        desk.promote(stage);
    }
    fs::write(desk.path("bench"), bench(8).to_string()).unwrap();
    let mut request = desk.request(GrantedStage::Tethered, &[EvidenceKind::Bench]);
    request.controller = controller(8);
    promote(&desk.fleet, &request).unwrap();
    let mut request = desk.request(GrantedStage::Flight, &[EvidenceKind::Tether]);
    request.controller = controller(8);
    let refusal = desk.refusal(&request);
    assert!(refusal.contains("the one here has"), "{refusal}");
}

#[test]
fn a_simulated_flight_after_a_tethered_start_is_no_tethered_flight() {
    let judged = |text: &str| check(EvidenceKind::Tether, text, 1, &controller(7)).err();
    let over = LandingReason::MissionOver;
    // A process without a grant logs no stage.
    let simulated = granted("tethered") + &starts() + &flown(over);
    assert_eq!(judged(&simulated), Some(Weakness::NoFlight));
    // A restart in flight: the drone may have been dropped meanwhile.
    let order = seen(Event::State(State::TakingOff));
    let interrupted = granted("tethered") + &order + &granted("tethered") + &completed(over);
    assert_eq!(judged(&interrupted), Some(Weakness::NoFlight));
}

#[test]
fn a_stage_that_falls_to_bench_after_the_order_is_no_tethered_flight() {
    let judged = |text: &str| check(EvidenceKind::Tether, text, 1, &controller(7)).err();
    let fallen = json!({"level": "WARN", "message": format!("{STAGE_FALLS}: the grant ended")});
    let order = seen(Event::State(State::TakingOff));
    let over = completed(LandingReason::MissionOver);
    let before_it_is_up = granted("tethered") + &order + &format!("{fallen}\n") + &over;
    assert_eq!(judged(&before_it_is_up), Some(Weakness::NoFlight));
    let up = seen(Event::State(State::NeighbourDiscovery));
    let landed = seen(Event::State(State::Finished));
    let in_flight = granted("tethered") + &order + &up + &format!("{fallen}\n") + &landed;
    assert_eq!(judged(&in_flight), Some(Weakness::NoFlight));
    let after_it = tether("tethered", LandingReason::MissionOver) + &format!("{fallen}\n");
    assert_eq!(judged(&after_it), None);
}
