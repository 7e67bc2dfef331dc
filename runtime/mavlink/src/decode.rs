//! Messages as reports to a link.

use mavlink::dialects::common::{
    HEARTBEAT_DATA, MavAutopilot, MavLandedState, MavMessage, MavModeFlag, MavResult,
};
use muster_machines::geodetic::Geodetic;
use muster_machines::geometry::{Ned, Velocity};
use muster_machines::msp::autopilot::{AutopilotReport, Landed, Mode};

/// ArduCopter's mode GUIDED (`copter/mode.h`).
pub(crate) const GUIDED: u32 = 4;
/// ArduCopter's mode LAND.
const LAND: u32 = 9;
/// Farther from its origin an autopilot is in no swarm, in metres; its `float`s would be too coarse.
const PLACE_MAX_M: f32 = 100_000.0;

/// What a message is good for.
#[derive(Debug, PartialEq)]
pub(crate) enum Message {
    /// A report to the link.
    Report(AutopilotReport),
    /// The autopilot refuses a command.
    Refused(String),
    /// Nobody asked for it.
    Other,
    /// Numbers that no autopilot has.
    Bad,
}

/// Reads a message of the autopilot.
pub(crate) fn message(message: &MavMessage) -> Message {
    let report = match message {
        MavMessage::HEARTBEAT(heartbeat) => return self::heartbeat(heartbeat),
        MavMessage::EXTENDED_SYS_STATE(state) => match landed(state.landed_state) {
            Some(landed) => Some(AutopilotReport::Landed(landed)),
            None => return Message::Other,
        },
        MavMessage::GPS_GLOBAL_ORIGIN(origin) => {
            let [latitude, longitude] = [origin.latitude, origin.longitude].map(f64::from);
            let altitude_m = f64::from(origin.altitude) / 1e3;
            (Geodetic::new(latitude / 1e7, longitude / 1e7, altitude_m).ok())
                .map(AutopilotReport::Origin)
        }
        MavMessage::LOCAL_POSITION_NED(it) => place([it.x, it.y, it.z], [it.vx, it.vy, it.vz]),
        // ArduPilot sends it only where sensors and motors are simulated (`AP_SIM_ENABLED`).
        MavMessage::SIM_STATE(_) => Some(AutopilotReport::Simulated),
        // −1: unknown.
        MavMessage::SYS_STATUS(status) if status.battery_remaining == -1 => return Message::Other,
        MavMessage::BATTERY_STATUS(status) if status.battery_remaining == -1 || status.id != 0 => {
            return Message::Other;
        }
        MavMessage::SYS_STATUS(status) => charge(status.battery_remaining),
        MavMessage::BATTERY_STATUS(status) => charge(status.battery_remaining),
        MavMessage::COMMAND_ACK(answer) => {
            return match answer.result {
                MavResult::MAV_RESULT_ACCEPTED | MavResult::MAV_RESULT_IN_PROGRESS => {
                    Message::Other
                }
                result => Message::Refused(format!("{:?}: {result:?}", answer.command)),
            };
        }
        _ => return Message::Other,
    };
    report.map_or(Message::Bad, Message::Report)
}

/// Modes have numbers of their own in each autopilot.
fn heartbeat(heartbeat: &HEARTBEAT_DATA) -> Message {
    if heartbeat.autopilot != MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA {
        return Message::Bad;
    }
    Message::Report(AutopilotReport::Heartbeat {
        armed: (heartbeat.base_mode).contains(MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED),
        mode: match heartbeat.custom_mode {
            GUIDED => Mode::Guided,
            LAND => Mode::Landing,
            _ => Mode::Other,
        },
    })
}

const fn landed(state: MavLandedState) -> Option<Landed> {
    match state {
        MavLandedState::MAV_LANDED_STATE_ON_GROUND => Some(Landed::Ground),
        MavLandedState::MAV_LANDED_STATE_TAKEOFF => Some(Landed::TakingOff),
        MavLandedState::MAV_LANDED_STATE_IN_AIR => Some(Landed::Air),
        MavLandedState::MAV_LANDED_STATE_LANDING => Some(Landed::Landing),
        MavLandedState::MAV_LANDED_STATE_UNDEFINED => None,
    }
}

fn place(position: [f32; 3], velocity: [f32; 3]) -> Option<AutopilotReport> {
    // False for what is no number.
    let is_sound = |it: &f32| it.abs() < PLACE_MAX_M;
    (position.iter().chain(&velocity)).all(is_sound).then(|| {
        let [north, east, down] = velocity.map(f64::from);
        AutopilotReport::Place {
            position: Ned::from(position.map(f64::from)),
            velocity: Velocity::new(north, east, down),
        }
    })
}

fn charge(percent: i8) -> Option<AutopilotReport> {
    let is_sound = (0..=100).contains(&percent);
    is_sound.then(|| AutopilotReport::Charge(f64::from(percent) / 100.0))
}

#[cfg(test)]
mod tests {
    use mavlink::dialects::common::{
        GPS_GLOBAL_ORIGIN_DATA, LOCAL_POSITION_NED_DATA, MavAutopilot, SYS_STATUS_DATA,
    };

    use super::*;

    #[test]
    fn numbers_that_no_autopilot_has_are_bad() {
        let position = LOCAL_POSITION_NED_DATA {
            x: f32::NAN,
            ..Default::default()
        };
        let origin = GPS_GLOBAL_ORIGIN_DATA {
            latitude: i32::MAX,
            ..Default::default()
        };
        let status = SYS_STATUS_DATA {
            battery_remaining: 101,
            ..Default::default()
        };
        let other = HEARTBEAT_DATA {
            autopilot: MavAutopilot::MAV_AUTOPILOT_PX4,
            ..Default::default()
        };
        for bad in [
            MavMessage::LOCAL_POSITION_NED(position),
            MavMessage::GPS_GLOBAL_ORIGIN(origin),
            MavMessage::SYS_STATUS(status),
            MavMessage::HEARTBEAT(other),
        ] {
            assert_eq!(message(&bad), Message::Bad, "{bad:?}");
        }
    }

    #[test]
    fn charge_unknown_to_the_autopilot_is_not_reported() {
        let status = SYS_STATUS_DATA {
            battery_remaining: -1,
            ..Default::default()
        };
        assert_eq!(message(&MavMessage::SYS_STATUS(status)), Message::Other);
    }
}
