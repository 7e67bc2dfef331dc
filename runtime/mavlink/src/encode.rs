//! Orders as messages.

use mavlink::MavHeader;
use mavlink::dialects::common::{
    COMMAND_LONG_DATA, EXTENDED_SYS_STATE_DATA, GPS_GLOBAL_ORIGIN_DATA, HEARTBEAT_DATA,
    LOCAL_POSITION_NED_DATA, MavAutopilot, MavCmd, MavFrame, MavMessage, MavModeFlag, MavState,
    MavType, PositionTargetTypemask, SET_POSITION_TARGET_LOCAL_NED_DATA, SIM_STATE_DATA,
    SYS_STATUS_DATA,
};
use mavlink::{MessageData, write_v2_msg};
use muster_machines::geometry::{Ned, Velocity};
use muster_machines::msp::autopilot::Order;

use crate::decode::GUIDED;

/// Our system: that of a ground station, since an autopilot's failsafe for lost heartbeats watches this one (ArduPilot:
/// `MAV_GCS_SYSID`, before `SYSID_MYGCS`).
const SYSTEM: u8 = 255;
/// `MAV_COMP_ID_ONBOARD_COMPUTER`.
const COMPONENT: u8 = 191;
/// `MAV_COMP_ID_AUTOPILOT1`.
pub(crate) const AUTOPILOT: u8 = 1;

/// Messages that an autopilot is asked for, and the times between two, in milliseconds.
const ASKED: [(u32, u16); 5] = [
    (LOCAL_POSITION_NED_DATA::ID, 100),
    (EXTENDED_SYS_STATE_DATA::ID, 200),
    (SYS_STATUS_DATA::ID, 1_000),
    (GPS_GLOBAL_ORIGIN_DATA::ID, 1_000),
    (SIM_STATE_DATA::ID, 1_000),
];

/// The datagrams of an order to the autopilot of a system. `sequence` counts datagrams.
pub(crate) fn datagrams(order: Order, system: u8, sequence: &mut u8) -> Vec<Vec<u8>> {
    let message = |message: MavMessage| {
        let header = MavHeader {
            system_id: SYSTEM.into(),
            component_id: COMPONENT,
            sequence: *sequence,
        };
        *sequence = sequence.wrapping_add(1);
        let mut datagram = Vec::new();
        write_v2_msg(&mut datagram, header, &message).expect("memory takes what is written");
        datagram
    };
    messages(order, system).into_iter().map(message).collect()
}

fn messages(order: Order, system: u8) -> Vec<MavMessage> {
    use MavCmd as Is;
    let command = |command, parameters| vec![command_long(system, command, parameters)];
    match order {
        Order::Heartbeat => vec![heartbeat()],
        Order::RequestTelemetry => {
            let ask = |(id, period_ms): (u32, u16)| {
                let parameters = [
                    id as f32,
                    f32::from(period_ms) * 1_000.0,
                    0.0,
                    0.0,
                    0.0,
                    0.0,
                    0.0,
                ];
                command_long(system, Is::MAV_CMD_SET_MESSAGE_INTERVAL, parameters)
            };
            ASKED.map(ask).into()
        }
        Order::Guide => {
            let custom = MavModeFlag::MAV_MODE_FLAG_CUSTOM_MODE_ENABLED.bits();
            let parameters = [f32::from(custom), GUIDED as f32, 0.0, 0.0, 0.0, 0.0, 0.0];
            command(Is::MAV_CMD_DO_SET_MODE, parameters)
        }
        Order::Arm => {
            let parameters = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
            command(Is::MAV_CMD_COMPONENT_ARM_DISARM, parameters)
        }
        Order::TakeOff { height_m } => {
            let parameters = [0.0, 0.0, 0.0, f32::NAN, 0.0, 0.0, height_m as f32];
            command(Is::MAV_CMD_NAV_TAKEOFF, parameters)
        }
        Order::Speed {
            over_ground_mps,
            vertical_mps,
        } => speeds(over_ground_mps as f32, vertical_mps as f32)
            .map(|parameters| command_long(system, Is::MAV_CMD_DO_CHANGE_SPEED, parameters))
            .collect(),
        Order::Fly { to, velocity } => vec![position_target(system, to, velocity)],
        Order::Land => {
            let parameters = [0.0, 0.0, 0.0, f32::NAN, 0.0, 0.0, 0.0];
            command(Is::MAV_CMD_NAV_LAND, parameters)
        }
    }
}

/// `SPEED_TYPE_GROUNDSPEED` is 1, `SPEED_TYPE_CLIMB_SPEED` 2, `SPEED_TYPE_DESCENT_SPEED` 3.
fn speeds(over_ground_mps: f32, vertical_mps: f32) -> impl Iterator<Item = [f32; 7]> {
    let all = [
        (1.0, over_ground_mps),
        (2.0, vertical_mps),
        (3.0, vertical_mps),
    ];
    let set = all.into_iter().filter(|(_, speed_mps)| *speed_mps > 0.0);
    // No change of the throttle.
    set.map(|(kind, speed_mps)| [kind, speed_mps, -1.0, 0.0, 0.0, 0.0, 0.0])
}

fn heartbeat() -> MavMessage {
    MavMessage::HEARTBEAT(HEARTBEAT_DATA {
        custom_mode: 0,
        mavtype: MavType::MAV_TYPE_ONBOARD_CONTROLLER,
        autopilot: MavAutopilot::MAV_AUTOPILOT_INVALID,
        base_mode: MavModeFlag::empty(),
        system_status: MavState::MAV_STATE_ACTIVE,
        mavlink_version: 3,
    })
}

fn command_long(system: u8, command: MavCmd, parameters: [f32; 7]) -> MavMessage {
    let [param1, param2, param3, param4, param5, param6, param7] = parameters;
    MavMessage::COMMAND_LONG(COMMAND_LONG_DATA {
        param1,
        param2,
        param3,
        param4,
        param5,
        param6,
        param7,
        command,
        target_system: system,
        target_component: AUTOPILOT,
        confirmation: 0,
    })
}

/// A position, with the velocity of a place that moves. Acceleration, yaw and its rate are left to the autopilot.
fn position_target(system: u8, to: Ned, velocity: Velocity) -> MavMessage {
    use PositionTargetTypemask as Ignore;
    let mut ignored = Ignore::POSITION_TARGET_TYPEMASK_AX_IGNORE
        | Ignore::POSITION_TARGET_TYPEMASK_AY_IGNORE
        | Ignore::POSITION_TARGET_TYPEMASK_AZ_IGNORE
        | Ignore::POSITION_TARGET_TYPEMASK_YAW_IGNORE
        | Ignore::POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE;
    if velocity == Velocity::ZERO {
        ignored |= Ignore::POSITION_TARGET_TYPEMASK_VX_IGNORE
            | Ignore::POSITION_TARGET_TYPEMASK_VY_IGNORE
            | Ignore::POSITION_TARGET_TYPEMASK_VZ_IGNORE;
    }
    let [x, y, z] = <[f64; 3]>::from(to.0).map(|it| it as f32);
    let [vx, vy, vz] = <[f64; 3]>::from(velocity.0).map(|it| it as f32);
    MavMessage::SET_POSITION_TARGET_LOCAL_NED(SET_POSITION_TARGET_LOCAL_NED_DATA {
        time_boot_ms: 0,
        x,
        y,
        z,
        vx,
        vy,
        vz,
        afx: 0.0,
        afy: 0.0,
        afz: 0.0,
        yaw: 0.0,
        yaw_rate: 0.0,
        type_mask: ignored,
        target_system: system,
        target_component: AUTOPILOT,
        coordinate_frame: MavFrame::MAV_FRAME_LOCAL_NED,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_leg_sets_the_speeds_of_its_directions_only() {
        let speed = Order::Speed {
            over_ground_mps: 5.0,
            vertical_mps: 0.0,
        };
        let [MavMessage::COMMAND_LONG(command)] = &messages(speed, 1)[..] else {
            panic!("one command");
        };
        assert_eq!(command.command, MavCmd::MAV_CMD_DO_CHANGE_SPEED);
        assert!((command.param1, command.param2) == (1.0, 5.0));
    }

    #[test]
    fn datagrams_are_numbered_and_begin_as_mavlink_2() {
        let mut sequence = 254;
        let datagrams = datagrams(Order::RequestTelemetry, 1, &mut sequence);
        let numbers: Vec<_> = datagrams.iter().map(|it| (it[0], it[4])).collect();
        assert_eq!(
            numbers,
            [(0xFD, 254), (0xFD, 255), (0xFD, 0), (0xFD, 1), (0xFD, 2)]
        );
    }
}
