use muster_controller::{Contact, FailsafeSettings, Fault, Procedure, RxFail, Settings, Version};
use muster_msp::{BoxIds, Mode, Rc as Channels, Status};

use crate::companion::{Companion, Rc, exact};

/// Hovering in angle mode at two metres with the throttle at 1,320 µs, which climbs slowly.
fn hovering(settings: Settings) -> Companion {
    let mut companion = Companion::hovering(exact(settings), 2.0);
    companion.rc = Some(Rc::throttle(1_320));
    companion.run_ms(100);
    companion
}

/// Waits for the frame's tick, then falls silent: the last frame was used at most 10 ms ago.
fn fall_silent(companion: &mut Companion) {
    companion.run_until(40, |it| it.ms() % 20 == 0);
    companion.run_ms(10);
    companion.rc = None;
}

fn is_active(companion: &mut Companion, mode: Mode) -> bool {
    let status = companion.ask::<Status>();
    let ids = companion.ask::<BoxIds>();
    ids.is_active(mode, status.modes()).unwrap()
}

#[test]
fn receiver_loss_is_flagged_after_150_ms() {
    let mut companion = Companion::ready(exact(Settings::sole()));
    fall_silent(&mut companion);
    companion.run_ms(120);
    assert_eq!(companion.refusals(), [""; 0]);
    let took_ms = 120 + companion.run_until(200, |it| it.refusals() == ["RXLOSS"]);
    // Last frame to flag is 150 ms; the answer comes up to 20 ms later.
    assert!((140..=190).contains(&took_ms), "{took_ms}");
}

/// Milliseconds from the last frame until the throttle has its `rxfail` value; an answer takes up to 20 ms.
fn throttle_falls_ms(version: Version) -> u64 {
    let mut settings = Settings::sole();
    settings.version = version;
    let mut companion = hovering(settings);
    fall_silent(&mut companion);
    companion.run_ms(270);
    assert_eq!(companion.ask::<Channels>().throttle_us, 1_320);
    companion.run_until(200, |it| it.ask::<Channels>().throttle_us == 885);
    companion.ms()
}

#[test]
fn throttle_falls_300_ms_after_the_last_frame_and_350_ms_in_older_firmware() {
    let older = Version {
        major: 4,
        minor: 5,
        patch: 1,
    };
    let delay_ms = throttle_falls_ms(older) - throttle_falls_ms(Version::V4_6);
    assert_eq!(delay_ms, 50);
    let mut companion = hovering(Settings::sole());
    fall_silent(&mut companion);
    companion.run_ms(310);
    assert_eq!(companion.ask::<Channels>().throttle_us, 885);
}

#[test]
fn channels_take_their_rxfail_values() {
    let mut settings = Settings::sole();
    settings.rxfail[3] = RxFail::Set(1_250);
    settings.rxfail[0] = RxFail::Hold;
    settings.rxfail[5] = RxFail::Set(1_100);
    let mut companion = hovering(settings);
    companion.rc = Some(Rc {
        roll: 1_510,
        pitch: 1_490,
        ..Rc::throttle(1_320)
    });
    companion.run_ms(100);
    companion.rc = None;
    companion.run_ms(500);
    let channels = companion.ask::<Channels>();
    let sticks = [channels.roll_us, channels.pitch_us, channels.throttle_us];
    assert_eq!(sticks, [1_510, 1_500, 1_250]);
    assert_eq!(channels.aux_us[..2], [1_800, 1_100]);
}

#[test]
fn drop_disarms_at_the_configured_delay() {
    for delay_ds in [4, 10, 15, 40] {
        let mut settings = Settings::sole();
        settings.failsafe.delay_ds = delay_ds;
        // Only the procedure may end the flight.
        settings.rxfail[3] = RxFail::Hold;
        let mut companion = hovering(settings);
        fall_silent(&mut companion);
        let took_ms = companion.run_until(6_000, |it| !it.truth().is_armed);
        let expected_ms = u64::from(delay_ds) * 100;
        assert!(
            (expected_ms - 10..=expected_ms + 20).contains(&took_ms),
            "{delay_ds}: {took_ms}"
        );
        assert!(companion.refusals().contains(&"FAILSAFE"));
        assert!(is_active(&mut companion, Mode::Failsafe));
    }
}

fn landing(throttle_us: u16, landing_s: u8) -> Settings {
    let mut settings = Settings::sole();
    settings.failsafe = FailsafeSettings {
        procedure: Procedure::Land,
        throttle_us,
        landing_s,
        delay_ds: 4,
        ..settings.failsafe
    };
    settings
}

#[test]
fn landing_descends_level_at_the_failsafe_throttle_and_disarms_when_its_time_is_over() {
    let mut companion = hovering(landing(1_290, 15));
    fall_silent(&mut companion);
    let silent_from_ms = companion.ms();
    companion.run_ms(700);
    let channels = companion.ask::<Channels>();
    assert_eq!((channels.roll_us, channels.throttle_us), (1_500, 1_290));
    assert!(is_active(&mut companion, Mode::Failsafe) && is_active(&mut companion, Mode::Angle));
    assert!(companion.truth().is_armed);
    companion.run_until(15_000, |it| it.truth().contact != Contact::Airborne);
    assert_eq!(companion.truth().contact, Contact::Ground);
    assert!(companion.truth().is_armed);
    companion.run_until(15_000, |it| !it.truth().is_armed);
    let since_silence_ms = companion.ms() - silent_from_ms;
    assert!(
        (15_390..=15_430).contains(&since_silence_ms),
        "{since_silence_ms}"
    );
    assert!(companion.refusals().contains(&"FAILSAFE"));
}

#[test]
fn fit_settings_bring_it_down_whole_when_rc_stops() {
    for height_m in [2.0, 8.0, 30.0] {
        let mut companion = Companion::hovering(exact(Settings::fit()), height_m);
        fall_silent(&mut companion);
        companion.run_until(30_000, |it| it.truth().contact != Contact::Airborne);
        let truth = companion.truth();
        assert_eq!(truth.contact, Contact::Ground, "from {height_m} m");
        companion.run_until(60_000, |it| !it.truth().is_armed);
        assert!(!companion.truth().is_armed);
    }
}

#[test]
fn pilot_has_control_again_when_rc_returns_while_landing() {
    let mut companion = hovering(landing(1_315, 60));
    companion.rc = None;
    companion.run_ms(800);
    assert!(is_active(&mut companion, Mode::Failsafe));
    companion.rc = Some(Rc::throttle(1_330));
    companion.run_ms(400);
    assert!(is_active(&mut companion, Mode::Failsafe));
    companion.run_ms(300);
    assert!(!is_active(&mut companion, Mode::Failsafe));
    assert!(companion.truth().is_armed);
    assert_eq!(companion.ask::<Channels>().throttle_us, 1_330);
}

#[test]
fn nothing_arms_when_rc_returns_with_the_switch_on() {
    let mut companion = hovering(Settings::sole());
    companion.rc = None;
    companion.run_ms(3_000);
    assert!(!companion.truth().is_armed);
    companion.rc = Some(Rc::ARM);
    for _ in 0..60 {
        companion.run_ms(1_000);
        assert!(!companion.truth().is_armed);
    }
}

#[test]
fn arming_is_possible_again_a_second_after_rc_returned_with_the_switch_off() {
    let mut companion = hovering(Settings::sole());
    companion.rc = None;
    companion.run_ms(3_000);
    companion.rc = Some(Rc::IDLE);
    let took_ms = companion.run_until(3_000, |it| !it.refusals().contains(&"FAILSAFE"));
    assert!((950..=1_200).contains(&took_ms), "{took_ms}");
}

#[test]
fn throttle_low_for_ten_seconds_before_the_loss_disarms_at_once_instead_of_landing() {
    let mut companion = Companion::armed(exact(landing(1_400, 60)));
    companion.rc = Some(Rc::throttle(1_100));
    companion.run_ms(100);
    companion.rc = Some(Rc::ARM);
    companion.run_ms(10_200);
    assert!(companion.truth().is_armed);
    companion.rc = None;
    companion.run_ms(600);
    assert!(!companion.truth().is_armed);
}

#[test]
fn deaf_receiver_is_a_lost_signal() {
    let mut companion = hovering(Settings::sole());
    companion.controller.fault(companion.now, Fault::Deaf(true));
    let took_ms = companion.run_until(2_000, |it| !it.truth().is_armed);
    assert!((1_480..=1_530).contains(&took_ms), "{took_ms}");
    companion
        .controller
        .fault(companion.now, Fault::Deaf(false));
    companion.rc = Some(Rc::IDLE);
    companion.run_ms(1_500);
    assert!(!companion.refusals().contains(&"RXLOSS"));
}

#[test]
fn frozen_controller_answers_nothing_and_flies_on_blindly() {
    let mut companion = hovering(Settings::sole());
    let before = companion.truth().rotors_rad_s;
    companion
        .controller
        .fault(companion.now, Fault::Frozen(true));
    let sent_from = companion.controller.transmit(companion.now);
    companion.run_ms(500);
    assert!(
        companion.controller.transmit(companion.now).is_empty(),
        "{sent_from:?}"
    );
    let after = companion.truth().rotors_rad_s;
    for (before, after) in before.iter().zip(after) {
        assert!((before - after).abs() < 0.02 * before, "{before} {after}");
    }
    assert!(companion.truth().is_armed);
}
