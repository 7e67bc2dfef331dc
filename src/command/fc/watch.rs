use std::io::{self, IsTerminal};
use std::time::{Duration, Instant};

use clap::Args;
use muster_msp::Telemetry;
use muster_msp::{Altitude, Attitude, BatteryState, Identity, Mode, Rc, Status};
use muster_port::{Event, Link, State, Status as LinkStatus};
use serde_json::json;

use super::{Device, Failure, Outcome};
use crate::command::{numbers, terminal};

/// Between two views on a terminal.
const REPAINT: Duration = Duration::from_millis(200);
/// Between two lines.
const LINE: Duration = Duration::from_secs(1);

/// Show a flight controller's attitude, channels, battery and modes, live.
///
/// On a terminal the view is renewed five times a second; elsewhere there is one line a second. The port is opened again
/// when it is lost.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    device: Device,
    /// Stop after that long; until interrupted if absent
    #[arg(long, value_name = "S", value_parser = numbers::whole::<u64>(1..=u64::from(u32::MAX)), allow_negative_numbers = true)]
    seconds: Option<u64>,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let Device { address, json } = &arguments.device;
    let link = Link::start(address.clone(), None)?;
    let repaints = !json && io::stdout().is_terminal();
    let started = Instant::now();
    let end = arguments.seconds.map(Duration::from_secs);
    let mut view = View::default();
    let mut due = Duration::ZERO;
    while end.is_none_or(|end| started.elapsed() < end) {
        due += if repaints { REPAINT } else { LINE };
        view.take(&link, started + due);
        let status = link.status();
        let text = if *json {
            view.in_json(&status)
        } else if repaints {
            format!("{}{}", terminal::CLEAR, view.lines(&status).join("\n"))
        } else {
            view.lines(&status).join("; ")
        };
        if !terminal::print_to_reader(&format!("{text}\n"))? {
            break;
        }
    }
    Ok(Outcome::Success)
}

/// The newest of what the controller told.
#[derive(Default)]
struct View {
    identity: Identity,
    status: Status,
    attitude: Attitude,
    altitude: Altitude,
    rc: Option<Rc>,
    battery: BatteryState,
}

impl View {
    /// Takes events until a point in time.
    fn take(&mut self, link: &Link, until: Instant) {
        while let Some(left) = until.checked_duration_since(Instant::now()) {
            match link.next_event(left) {
                Some(Event::Identified(identity)) => self.identity = identity,
                Some(Event::Telemetry(telemetry)) => self.take_telemetry(telemetry),
                Some(Event::Closed(_) | Event::Unfit(_)) | None => {}
            }
        }
    }

    fn take_telemetry(&mut self, telemetry: Telemetry) {
        match telemetry {
            Telemetry::Status(status) => self.status = status,
            Telemetry::Attitude(attitude) => self.attitude = attitude,
            Telemetry::Altitude(altitude) => self.altitude = altitude,
            Telemetry::Rc(rc) => self.rc = Some(rc),
            Telemetry::Battery(battery) => self.battery = battery,
            Telemetry::Analog(_)
            | Telemetry::Gps(_)
            | Telemetry::Motor(_)
            | Telemetry::Sonar(_)
            | Telemetry::Acknowledged(_)
            | Telemetry::Late => {}
        }
    }

    fn modes(&self) -> Vec<String> {
        let modes = self.status.modes();
        let is_active = |mode: &&Mode| self.identity.boxes.is_active(**mode, modes) == Some(true);
        let active = self.identity.boxes.modes.iter().filter(is_active);
        active.map(ToString::to_string).collect()
    }

    fn volts(&self) -> f64 {
        let tenths = f64::from(self.battery.voltage_dv) / 10.0;
        self.battery
            .voltage_cv
            .map_or(tenths, |it| f64::from(it) / 100.0)
    }

    fn lines(&self, link: &LinkStatus) -> Vec<String> {
        let line = match (link.state, &link.closed_by) {
            (State::Closed, Some(error)) => return vec![format!("closed: {error}")],
            (State::Closed, None) => return vec!["opening".to_owned()],
            (State::Identifying, _) => return vec!["identifying".to_owned()],
            (State::Silent, _) => "silent",
            (State::Open, _) => "open",
        };
        let rc = self.rc.as_ref().map_or("RC unknown".to_owned(), |it| {
            let aux: Vec<_> = it.aux_us.iter().map(ToString::to_string).collect();
            format!(
                "roll {} pitch {} yaw {} throttle {} aux {}",
                it.roll_us,
                it.pitch_us,
                it.yaw_us,
                it.throttle_us,
                aux.join(" ")
            )
        });
        let arming: Vec<_> = self.status.flags.arming.names().collect();
        vec![
            format!(
                "roll {:+.1}° pitch {:+.1}° yaw {}°",
                f64::from(self.attitude.roll_ddeg) / 10.0,
                f64::from(self.attitude.pitch_ddeg) / 10.0,
                self.attitude.yaw_deg
            ),
            format!("{:+.2} m", f64::from(self.altitude.altitude_cm) / 100.0),
            rc,
            format!("{:.2} V {}", self.volts(), self.battery.level),
            format!("modes {}", self.modes().join(" ")),
            format!("reasons not to arm: {}", arming.join(" ")),
            format!(
                "{line}, {:.1} ms, {:.0} % lost, {} frames/s",
                1e3 * link.latency.mean().as_secs_f64(),
                100.0 * link.latency.loss(),
                link.frames_per_second
            ),
        ]
    }

    fn in_json(&self, link: &LinkStatus) -> String {
        let rc = self.rc.as_ref();
        json!({
            "state": format!("{:?}", link.state).to_lowercase(),
            "closed_by": link.closed_by,
            "roll_deg": f64::from(self.attitude.roll_ddeg) / 10.0,
            "pitch_deg": f64::from(self.attitude.pitch_ddeg) / 10.0,
            "yaw_deg": self.attitude.yaw_deg,
            "altitude_m": f64::from(self.altitude.altitude_cm) / 100.0,
            "rc_us": rc.map(|it| json!({
                "roll": it.roll_us,
                "pitch": it.pitch_us,
                "yaw": it.yaw_us,
                "throttle": it.throttle_us,
                "aux": it.aux_us,
            })),
            "voltage_v": self.volts(),
            "battery": self.battery.level.to_string(),
            "modes": self.modes(),
            "arming_disabled": self.status.flags.arming.names().collect::<Vec<_>>(),
            "latency_ms": 1e3 * link.latency.mean().as_secs_f64(),
            "loss": link.latency.loss(),
            "frames_per_second": link.frames_per_second,
        })
        .to_string()
    }
}
