use clap::Args;
use muster_msp::check::ReceiverMode;
use muster_msp::{
    Analog, Attitude, BatteryState, BoxNames, Configuration, Mode, Name, Status, Uid, ask,
};
use muster_port::{AskError, Latency, Session};
use serde_json::{Value, json};

use super::{Device, Failure, Outcome, ask_if_known, open, reading};
use crate::command::terminal;

/// Questions that measure the line.
const QUESTIONS: u32 = 50;

/// Show who a flight controller is, what it says, and how good the line is.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    device: Device,
}

/// What a controller told.
struct Portrait {
    configuration: Configuration,
    name: Option<Name>,
    uid: Option<Uid>,
    modes: Option<BoxNames>,
    status: Status,
    battery: Option<BatteryState>,
    analog: Option<Analog>,
    attitude: Attitude,
    /// Delays of [`QUESTIONS`] questions.
    latency: Latency,
    bad_frames: u64,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let Device { address, json } = &arguments.device;
    let portrait = reading(address, Portrait::read(open(address)?))?;
    let text = if *json {
        format!("{}\n", portrait.in_json())
    } else {
        portrait.lines()
    };
    terminal::print(&text)?;
    Ok(Outcome::Success)
}

impl Portrait {
    fn read(mut session: Session) -> Result<Self, AskError> {
        let configuration = Configuration::read(&mut session)?;
        let name = ask_if_known(&mut session)?;
        let uid = ask_if_known(&mut session)?;
        let modes = ask_if_known(&mut session)?;
        let battery = ask_if_known(&mut session)?;
        let analog = ask_if_known(&mut session)?;
        session.reset_latency();
        let mut attitude = Attitude::default();
        for _ in 0..QUESTIONS {
            attitude = ask(&mut session)?;
        }
        Ok(Self {
            configuration,
            name,
            uid,
            modes,
            status: ask(&mut session)?,
            battery,
            analog,
            attitude,
            latency: session.latency(),
            bad_frames: session.counts().bad(),
        })
    }

    fn is_armed(&self) -> Option<bool> {
        let boxes = &self.configuration.identity.boxes;
        boxes.is_active(Mode::Arm, self.status.modes())
    }

    fn lines(&self) -> String {
        let rows = [
            ("firmware", self.firmware()),
            ("board", self.board()),
            ("sensors", list(self.status.head.sensors.names())),
            ("modes", list(self.modes.iter().flat_map(BoxNames::iter))),
            ("receiver", self.receiver()),
            ("state", self.state()),
            ("battery", self.voltage()),
            ("attitude", self.tilt()),
            ("line", self.line()),
        ];
        let row = |(name, value): &(&str, String)| format!("{name:<10}{value}\n");
        rows.iter().map(row).collect()
    }

    fn receiver(&self) -> String {
        let falls_back = self.configuration.identity.override_falls_back();
        format!(
            "{}, map {}, overridden channels fall back: {}",
            ReceiverMode::of(&self.configuration),
            self.configuration.map.letters(),
            if falls_back { "yes" } else { "no" },
        )
    }

    fn state(&self) -> String {
        if self.is_armed() == Some(true) {
            return "armed".to_owned();
        }
        let reasons = list(self.status.flags.arming.names());
        format!("disarmed; reasons not to arm: {reasons}")
    }

    fn voltage(&self) -> String {
        let Some(battery) = &self.battery else {
            return "unknown".to_owned();
        };
        let tenths = f64::from(battery.voltage_dv) / 10.0;
        let volts = battery
            .voltage_cv
            .map_or(tenths, |it| f64::from(it) / 100.0);
        format!("{} cells, {volts:.2} V, {}", battery.cells, battery.level)
    }

    fn tilt(&self) -> String {
        format!(
            "roll {:.1}°, pitch {:.1}°, yaw {}°",
            f64::from(self.attitude.roll_ddeg) / 10.0,
            f64::from(self.attitude.pitch_ddeg) / 10.0,
            self.attitude.yaw_deg
        )
    }

    fn line(&self) -> String {
        format!(
            "{} questions, {:.0} % lost, {:.1} ms mean, {:.1} ms max, {} bad frames",
            self.latency.asked,
            100.0 * self.latency.loss(),
            1e3 * self.latency.mean().as_secs_f64(),
            1e3 * self.latency.max.as_secs_f64(),
            self.bad_frames,
        )
    }

    fn firmware(&self) -> String {
        let identity = &self.configuration.identity;
        let api = &identity.api;
        let name = match &identity.variant.variant.0 {
            b"BTFL" => "Betaflight".to_owned(),
            _ => identity.variant.variant.to_string(),
        };
        format!(
            "{name} {}, MSP API {}.{}",
            identity.version, api.major, api.minor
        )
    }

    fn board(&self) -> String {
        let board = &self.configuration.identity.board;
        let mut text = board.board.to_string();
        if board.is_simulation() {
            text.push_str(" (simulation)");
        }
        for name in [&board.target, &board.name, &board.manufacturer] {
            if let Some(name) = name.as_ref().filter(|it| !it.0.is_empty()) {
                text.push_str(&format!(", {}", name.0));
            }
        }
        if let Some(craft) = self.name.as_ref().filter(|it| !it.name.0.is_empty()) {
            text.push_str(&format!(", craft `{}`", craft.name.0));
        }
        text
    }

    fn in_json(&self) -> Value {
        let identity = &self.configuration.identity;
        let api = &identity.api;
        let uid = self
            .uid
            .as_ref()
            .map(|it| it.uid.map(|word| format!("{word:08x}")).concat());
        json!({
            "variant": identity.variant.variant.to_string(),
            "version": identity.version.to_string(),
            "api": format!("{}.{}", api.major, api.minor),
            "board": identity.board.board.to_string(),
            "target": identity.board.target.as_ref().map(|it| &it.0),
            "simulation": identity.board.is_simulation(),
            "name": self.name.as_ref().map(|it| &it.name.0),
            "uid": uid,
            "sensors": self.status.head.sensors.names().collect::<Vec<_>>(),
            "modes": self.modes.iter().flat_map(BoxNames::iter).collect::<Vec<_>>(),
            "receiver": ReceiverMode::of(&self.configuration).to_string(),
            "override_falls_back": identity.override_falls_back(),
            "map": self.configuration.map.letters().to_string(),
            "armed": self.is_armed(),
            "arming_disabled": self.status.flags.arming.names().collect::<Vec<_>>(),
            "battery": self.battery.as_ref().map(|it| json!({
                "cells": it.cells,
                "level": it.level.to_string(),
                "drawn_mah": it.drawn_mah,
            })),
            "voltage_v": self.analog.as_ref().and_then(|it| it.voltage_cv).map(|it| f64::from(it) / 100.0),
            "attitude_deg": [
                f64::from(self.attitude.roll_ddeg) / 10.0,
                f64::from(self.attitude.pitch_ddeg) / 10.0,
                f64::from(self.attitude.yaw_deg),
            ],
            "line": {
                "asked": self.latency.asked,
                "loss": self.latency.loss(),
                "mean_ms": 1e3 * self.latency.mean().as_secs_f64(),
                "max_ms": 1e3 * self.latency.max.as_secs_f64(),
                "bad_frames": self.bad_frames,
            },
        })
    }
}

fn list<'a>(names: impl Iterator<Item = &'a str>) -> String {
    let names: Vec<_> = names.collect();
    match names[..] {
        [] => "none".to_owned(),
        _ => names.join(", "),
    }
}
