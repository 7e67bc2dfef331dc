//! Handling of each MAVLink mission command.
//!
//! Sources: `MAV_CMD` and `MAV_FRAME` in MAVLink's `common.xml` and `ardupilotmega.xml`; for the behaviour of copters,
//! ArduPilot's *Mission Commands*.

use super::NoteKind;

/// Handling of a command.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Handling {
    FlightPlan(Manoeuvre),
    /// Skipped, with a note.
    Ignored(NoteKind),
    /// The swarm can't fly it, or it is unknown.
    Refused,
}

/// Manoeuvre of a command that a swarm flies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Manoeuvre {
    TakeOff,
    Waypoint,
    /// A waypoint at the end of a curve.
    Spline,
    /// A waypoint with a hold.
    Loiter,
    /// A waypoint to circle.
    Turns,
    /// A place at which to change the height.
    LoiterToHeight,
    /// A place at which to descend, release a payload, and climb.
    PayloadPlace,
    /// A hold at the current position.
    Delay,
    /// A change of height at the current position.
    ChangeHeight,
    /// A jump to another item.
    Jump,
    Land,
    ReturnToLaunch,
}

/// Handling of a command by its number.
pub(super) fn handling(command: u16) -> Handling {
    match command {
        16 => Handling::FlightPlan(Manoeuvre::Waypoint),
        18 => Handling::FlightPlan(Manoeuvre::Turns),
        19 => Handling::FlightPlan(Manoeuvre::Loiter),
        20 => Handling::FlightPlan(Manoeuvre::ReturnToLaunch),
        21 => Handling::FlightPlan(Manoeuvre::Land),
        22 => Handling::FlightPlan(Manoeuvre::TakeOff),
        30 => Handling::FlightPlan(Manoeuvre::ChangeHeight),
        31 => Handling::FlightPlan(Manoeuvre::LoiterToHeight),
        82 => Handling::FlightPlan(Manoeuvre::Spline),
        93 => Handling::FlightPlan(Manoeuvre::Delay),
        94 => Handling::FlightPlan(Manoeuvre::PayloadPlace),
        113 => Handling::Ignored(NoteKind::HeightConditionIgnored),
        177 => Handling::FlightPlan(Manoeuvre::Jump),
        178 => Handling::Ignored(NoteKind::SpeedIgnored),
        _ => match name_in(IGNORED, command) {
            Some(command) => Handling::Ignored(NoteKind::CommandIgnored { command }),
            None => Handling::Refused,
        },
    }
}

/// Name of a refused command in errors.
pub(super) fn refused_name(command: u16) -> String {
    match name_in(REFUSED, command) {
        Some(name) => format!("the command {command}, {name}"),
        None => format!("the command {command}"),
    }
}

/// Name of a coordinate frame in errors.
pub(super) fn frame_name(frame: u16) -> String {
    match name_in(FRAMES, frame) {
        Some(name) => format!("{frame}, {name}"),
        None => frame.to_string(),
    }
}

fn name_in(names: &[(u16, &'static str)], number: u16) -> Option<&'static str> {
    names
        .iter()
        .find(|(named, _)| *named == number)
        .map(|(_, name)| *name)
}

/// Commands that change neither the route nor its order: payload, gimbal, camera, markers for failsafes, and those that only
/// their user knows, which MAVLink's common messages define as no place to fly to.
const IGNORED: &[(u16, &str)] = &[
    (112, "CONDITION_DELAY"),
    (114, "CONDITION_DISTANCE"),
    (115, "CONDITION_YAW"),
    (116, "CONDITION_LOCATION"),
    (180, "DO_SET_PARAMETER"),
    (181, "DO_SET_RELAY"),
    (182, "DO_REPEAT_RELAY"),
    (183, "DO_SET_SERVO"),
    (184, "DO_REPEAT_SERVO"),
    (187, "DO_SET_ACTUATOR"),
    (188, "DO_RETURN_PATH_START"),
    (189, "DO_LAND_START"),
    (195, "DO_SET_ROI_LOCATION"),
    (196, "DO_SET_ROI_WPNEXT_OFFSET"),
    (197, "DO_SET_ROI_NONE"),
    (198, "DO_SET_ROI_SYSID"),
    (200, "DO_CONTROL_VIDEO"),
    (201, "DO_SET_ROI"),
    (202, "DO_DIGICAM_CONFIGURE"),
    (203, "DO_DIGICAM_CONTROL"),
    (204, "DO_MOUNT_CONFIGURE"),
    (205, "DO_MOUNT_CONTROL"),
    (206, "DO_SET_CAM_TRIGG_DIST"),
    (207, "DO_FENCE_ENABLE"),
    (211, "DO_GRIPPER"),
    (212, "DO_AUTOTUNE_ENABLE"),
    (214, "DO_SET_CAM_TRIGG_INTERVAL"),
    (215, "DO_SET_RESUME_REPEAT_DIST"),
    (216, "DO_SPRAYER"),
    (217, "DO_SEND_SCRIPT_MESSAGE"),
    (218, "DO_AUX_FUNCTION"),
    (220, "DO_MOUNT_CONTROL_QUAT"),
    (405, "ILLUMINATOR_ON_OFF"),
    (530, "SET_CAMERA_MODE"),
    (531, "SET_CAMERA_ZOOM"),
    (532, "SET_CAMERA_FOCUS"),
    (534, "SET_CAMERA_SOURCE"),
    (1000, "DO_GIMBAL_MANAGER_PITCHYAW"),
    (1001, "DO_GIMBAL_MANAGER_CONFIGURE"),
    (2000, "IMAGE_START_CAPTURE"),
    (2001, "IMAGE_STOP_CAPTURE"),
    (2003, "DO_TRIGGER_CONTROL"),
    (2500, "VIDEO_START_CAPTURE"),
    (2501, "VIDEO_STOP_CAPTURE"),
    (31010, "USER_1"),
    (31011, "USER_2"),
    (31012, "USER_3"),
    (31013, "USER_4"),
    (31014, "USER_5"),
];

/// Known commands that a swarm can't fly: they loiter without end, change the route in flight, or end the flight.
const REFUSED: &[(u16, &str)] = &[
    (17, "NAV_LOITER_UNLIM"),
    (23, "NAV_LAND_LOCAL"),
    (24, "NAV_TAKEOFF_LOCAL"),
    (25, "NAV_FOLLOW"),
    (32, "DO_FOLLOW"),
    (33, "DO_FOLLOW_REPOSITION"),
    (34, "DO_ORBIT"),
    (35, "DO_FIGURE_EIGHT"),
    (36, "NAV_ARC_WAYPOINT"),
    (80, "NAV_ROI"),
    (81, "NAV_PATHPLANNING"),
    (83, "NAV_ALTITUDE_WAIT"),
    (84, "NAV_VTOL_TAKEOFF"),
    (85, "NAV_VTOL_LAND"),
    (92, "NAV_GUIDED_ENABLE"),
    (176, "DO_SET_MODE"),
    (179, "DO_SET_HOME"),
    (185, "DO_FLIGHTTERMINATION"),
    (186, "DO_CHANGE_ALTITUDE"),
    (190, "DO_RALLY_LAND"),
    (191, "DO_GO_AROUND"),
    (192, "DO_REPOSITION"),
    (193, "DO_PAUSE_CONTINUE"),
    (194, "DO_SET_REVERSE"),
    (208, "DO_PARACHUTE"),
    (209, "DO_MOTOR_TEST"),
    (210, "DO_INVERTED_FLIGHT"),
    (213, "NAV_SET_YAW_SPEED"),
    (221, "DO_GUIDED_MASTER"),
    (222, "DO_GUIDED_LIMITS"),
    (223, "DO_ENGINE_CONTROL"),
    (224, "DO_SET_MISSION_CURRENT"),
    (400, "COMPONENT_ARM_DISARM"),
    (600, "JUMP_TAG"),
    (601, "DO_JUMP_TAG"),
    (3000, "DO_VTOL_TRANSITION"),
];

const FRAMES: &[(u16, &str)] = &[
    (1, "LOCAL_NED"),
    (2, "MISSION"),
    (4, "LOCAL_ENU"),
    (5, "GLOBAL_INT"),
    (7, "LOCAL_OFFSET_NED"),
    (8, "BODY_NED"),
    (9, "BODY_OFFSET_NED"),
    (10, "GLOBAL_TERRAIN_ALT"),
    (11, "GLOBAL_TERRAIN_ALT_INT"),
    (12, "BODY_FRD"),
    (20, "LOCAL_FRD"),
    (21, "LOCAL_FLU"),
];
