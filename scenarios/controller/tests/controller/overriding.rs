use muster_controller::{CHANNELS, Config, ReceiverMode, Settings, Version};
use muster_msp::{BoxIds, Mode, Rc as Channels, Status};

use crate::companion::{Companion, Rc, exact};

const OLD: Version = Version::V4_6;
const NEW: Version = Version {
    major: 26,
    minor: 6,
    patch: 0,
};

/// The pilot's channels: roll, pitch, yaw, throttle, AUX1, ….
fn pilot(throttle: u16, arm: u16, overriding: u16) -> [u16; CHANNELS] {
    let mut channels = [1_500; CHANNELS];
    channels[3] = throttle;
    channels[4] = arm;
    channels[5] = 1_800;
    channels[6] = overriding;
    channels
}

fn config(version: Version) -> Config {
    exact(Settings::overriding(version))
}

/// Armed by the pilot; the companion replaces the sticks.
fn overriding(config: Config) -> Companion {
    let mut companion = Companion::new(config);
    companion
        .controller
        .pilot(companion.now, Some(&pilot(1_000, 1_000, 1_000)));
    companion.run_ms(5_600);
    companion
        .controller
        .pilot(companion.now, Some(&pilot(1_000, 1_800, 1_000)));
    companion.run_ms(100);
    assert!(companion.truth().is_armed);
    companion.rc = Some(Rc {
        roll: 1_600,
        aux1: 1_000,
        ..Rc::throttle(1_200)
    });
    companion.run_ms(100);
    companion
        .controller
        .pilot(companion.now, Some(&pilot(1_000, 1_800, 1_900)));
    companion.run_ms(100);
    companion
}

fn sticks(companion: &mut Companion) -> (u16, u16) {
    let channels = companion.ask::<Channels>();
    (channels.roll_us, channels.throttle_us)
}

#[test]
fn companion_replaces_masked_channels_while_the_switch_is_on() {
    for version in [OLD, NEW] {
        let mut companion = overriding(config(version));
        let channels = companion.ask::<Channels>();
        assert_eq!((channels.roll_us, channels.throttle_us), (1_600, 1_200));
        // ARM is the pilot's, whatever the companion sends.
        assert_eq!(channels.aux_us[0], 1_800);
        assert!(companion.truth().is_armed);
        let status = companion.ask::<Status>();
        let ids = companion.ask::<BoxIds>();
        assert_eq!(ids.is_active(Mode::MspOverride, status.modes()), Some(true));
    }
}

#[test]
fn pilot_takes_over_within_a_tick_by_the_switch() {
    let mut companion = overriding(config(OLD));
    companion
        .controller
        .pilot(companion.now, Some(&pilot(1_100, 1_800, 1_000)));
    companion.run_ms(20);
    assert_eq!(sticks(&mut companion), (1_500, 1_100));
    let status = companion.ask::<Status>();
    let ids = companion.ask::<BoxIds>();
    assert_eq!(
        ids.is_active(Mode::MspOverride, status.modes()),
        Some(false)
    );
}

#[test]
fn older_firmware_holds_a_silent_companions_values_for_ever() {
    let mut companion = overriding(config(OLD));
    companion.rc = None;
    companion.run_ms(60_000);
    assert_eq!(sticks(&mut companion), (1_600, 1_200));
}

#[test]
fn newer_firmware_gives_the_sticks_back_300_ms_after_the_last_frame() {
    let mut companion = overriding(config(NEW));
    companion.rc = None;
    companion.run_ms(250);
    assert_eq!(sticks(&mut companion), (1_600, 1_200));
    companion.run_ms(60);
    assert_eq!(sticks(&mut companion), (1_500, 1_000));
    assert!(companion.truth().is_armed);
}

#[test]
fn lost_pilot_ends_in_the_failsafe_though_the_companion_sends() {
    let mut companion = overriding(config(OLD));
    companion.controller.pilot(companion.now, None);
    let took_ms = companion.run_until(3_000, |it| !it.truth().is_armed);
    assert!((1_490..=1_530).contains(&took_ms), "{took_ms}");
}

#[test]
fn lost_pilot_is_flagged_within_200_ms_though_the_companion_sends() {
    for version in [OLD, NEW] {
        let mut companion = Companion::new(config(version));
        let on = Some(pilot(1_000, 1_000, 1_900));
        companion.controller.pilot(companion.now, on.as_ref());
        companion.rc = Some(Rc::throttle(1_000));
        companion.run_ms(5_600);
        let is_flagged = |it: &mut Companion| it.refusals().contains(&"RXLOSS");
        assert!(!is_flagged(&mut companion));
        companion.controller.pilot(companion.now, None);
        companion.run_ms(100);
        assert!(!is_flagged(&mut companion));
        let took_ms = 100 + companion.run_until(200, is_flagged);
        assert!(took_ms <= 200, "{took_ms}");
    }
}

#[test]
fn companions_frames_count_as_signal_if_so_configured() {
    let mut settings = Settings::overriding(OLD);
    settings.receiver = ReceiverMode::Override {
        channels_mask: 0b1111,
        counts_as_signal: true,
    };
    let mut companion = overriding(exact(settings));
    companion.controller.pilot(companion.now, None);
    companion.run_ms(200);
    assert_eq!(sticks(&mut companion), (1_600, 1_200));
    companion.run_ms(5_000);
    assert!(companion.truth().is_armed);
}
