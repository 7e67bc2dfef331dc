//! A scripted autopilot: what ArduCopter says and does in GUIDED and LAND, on simple kinematics.

use std::net::{SocketAddr, UdpSocket};
use std::sync::{Arc, Mutex, MutexGuard};
use std::thread;
use std::time::{Duration, Instant};

use mavlink::dialects::common::{
    COMMAND_ACK_DATA, COMMAND_LONG_DATA, EXTENDED_SYS_STATE_DATA, GPS_GLOBAL_ORIGIN_DATA,
    HEARTBEAT_DATA, LOCAL_POSITION_NED_DATA, MavAutopilot, MavCmd, MavLandedState, MavMessage,
    MavModeFlag, MavResult, MavState, MavType, SIM_STATE_DATA, SYS_STATUS_DATA,
};
use mavlink::{MavHeader, MavlinkReader, MavlinkVersion, MessageData, write_v2_msg};
use muster_machines::geodetic::{Geodetic, latitude_longitude_altitude};
use muster_machines::geometry::{Ned, Velocity};

const TICK: Duration = Duration::from_millis(10);
const GUIDED: u32 = 4;
const LAND: u32 = 9;
/// ArduPilot's default of `FS_GCS_TIMEOUT`.
const FAILSAFE_AFTER: Duration = Duration::from_secs(5);
const ACCELERATION_MPS2: f64 = 4.0;
const LANDING_MPS: f64 = 3.0;

/// What an autopilot knows, and what it was told.
pub(super) struct State {
    pub(super) is_armed: bool,
    pub(super) landed: MavLandedState,
    /// In its own frame, which begins where it starts.
    pub(super) position: Ned,
    pub(super) velocity: Velocity,
    /// Whether its failsafe for lost heartbeats lands it.
    pub(super) has_failed_safe: bool,
    /// Commands received, but for those that ask for messages.
    pub(super) commands: Vec<MavCmd>,
    /// Targets, and how far from the one before it was then, in metres.
    pub(super) targets: Vec<(Ned, f64)>,
    /// While true it neither sends nor hears.
    pub(super) is_silent: bool,
    /// While true it does not say that it is a simulation.
    pub(super) is_real: bool,
    mode: u32,
    origin: [f64; 3],
    target: Option<Ned>,
    speed_mps: f64,
    climb_mps: f64,
    heard_at: Instant,
    /// Messages to send: number, interval, when next.
    asked: Vec<(u32, Duration, Instant)>,
}

/// A scripted autopilot on a thread, which ends with the test's process.
pub(super) struct Autopilot {
    state: Arc<Mutex<State>>,
}

impl Autopilot {
    /// Starts one at a place, which sends to `companion`.
    pub(super) fn start(home: Geodetic, place: Ned, companion: SocketAddr) -> Self {
        let now = Instant::now();
        let state = Arc::new(Mutex::new(State {
            is_armed: false,
            landed: MavLandedState::MAV_LANDED_STATE_ON_GROUND,
            position: Ned::HOME,
            velocity: Velocity::ZERO,
            has_failed_safe: false,
            commands: Vec::new(),
            targets: Vec::new(),
            is_silent: false,
            is_real: false,
            mode: 0,
            origin: latitude_longitude_altitude(home, place),
            target: None,
            speed_mps: 5.0,
            climb_mps: 2.5,
            heard_at: now,
            asked: vec![(HEARTBEAT_DATA::ID, Duration::from_secs(1), now)],
        }));
        let flown = Arc::clone(&state);
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        socket.set_read_timeout(Some(TICK)).unwrap();
        thread::spawn(move || serve(&socket, companion, &flown));
        Self { state }
    }

    pub(super) fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap()
    }
}

fn serve(socket: &UdpSocket, companion: SocketAddr, state: &Mutex<State>) {
    let mut datagram = [0; 1_024];
    let mut stepped = Instant::now();
    loop {
        let received = socket.recv(&mut datagram).unwrap_or(0);
        let mut state = state.lock().unwrap();
        let mut answers = Vec::new();
        let mut reader = MavlinkReader::new(&datagram[..received]);
        while let Ok((header, message)) = reader.read_message(MavlinkVersion::V2) {
            if !state.is_silent {
                answers.extend(state.take(header, &message));
            }
        }
        let now = Instant::now();
        // However busy the machine is, time passes in small steps.
        while stepped + TICK <= now {
            stepped += TICK;
            state.step(TICK.as_secs_f64());
        }
        answers.extend(state.due(now));
        for answer in answers.iter().filter(|_| !state.is_silent) {
            let header = MavHeader {
                system_id: 1,
                component_id: 1,
                sequence: 0,
            };
            let mut bytes = Vec::new();
            write_v2_msg(&mut bytes, header, answer).unwrap();
            // Refused while nobody listens.
            let _ = socket.send_to(&bytes, companion);
        }
    }
}

impl State {
    fn take(&mut self, header: MavHeader, message: &MavMessage) -> Vec<MavMessage> {
        assert_eq!(header.system_id, 255, "{message:?}");
        match message {
            MavMessage::HEARTBEAT(_) => self.heard_at = Instant::now(),
            MavMessage::COMMAND_LONG(command) => return self.execute(command),
            MavMessage::SET_POSITION_TARGET_LOCAL_NED(it) => {
                let target = Ned::from([it.x, it.y, it.z].map(f64::from));
                assert_eq!((self.mode, self.is_armed), (GUIDED, true));
                if self.target != Some(target) {
                    let before = self.target.unwrap_or(self.position);
                    let left_m = before.distance_m(self.position);
                    self.targets.push((target, left_m));
                }
                self.target = Some(target);
            }
            other => panic!("{other:?}"),
        }
        Vec::new()
    }

    fn execute(&mut self, command: &COMMAND_LONG_DATA) -> Vec<MavMessage> {
        if command.command != MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL {
            self.commands.push(command.command);
        }
        let is_accepted = match command.command {
            MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL => {
                let (id, interval) = (command.param1 as u32, command.param2 / 1e6);
                self.asked.retain(|(asked, ..)| *asked != id);
                let interval = Duration::from_secs_f32(interval);
                self.asked.push((id, interval, Instant::now()));
                true
            }
            MavCmd::MAV_CMD_DO_SET_MODE => {
                self.mode = command.param2 as u32;
                true
            }
            MavCmd::MAV_CMD_COMPONENT_ARM_DISARM => {
                self.is_armed |= self.mode == GUIDED;
                self.is_armed
            }
            MavCmd::MAV_CMD_NAV_TAKEOFF => self.take_off(command.param7.into()),
            MavCmd::MAV_CMD_DO_CHANGE_SPEED => {
                let speed_mps = f64::from(command.param2);
                match command.param1 as u8 {
                    1 => self.speed_mps = speed_mps,
                    _ => self.climb_mps = speed_mps,
                }
                true
            }
            MavCmd::MAV_CMD_NAV_LAND => {
                self.mode = LAND;
                true
            }
            other => panic!("{other:?}"),
        };
        let result = match is_accepted {
            true => MavResult::MAV_RESULT_ACCEPTED,
            false => MavResult::MAV_RESULT_DENIED,
        };
        let command = command.command;
        let answer = MavMessage::COMMAND_ACK(COMMAND_ACK_DATA { command, result });
        vec![answer, self.heartbeat()]
    }

    fn take_off(&mut self, height_m: f64) -> bool {
        let may = self.is_armed && self.landed == MavLandedState::MAV_LANDED_STATE_ON_GROUND;
        if may {
            self.target = Some(self.position.at_altitude(height_m));
            self.landed = MavLandedState::MAV_LANDED_STATE_TAKEOFF;
        }
        may
    }

    fn step(&mut self, seconds: f64) {
        let is_alone = self.heard_at.elapsed() > FAILSAFE_AFTER;
        if self.is_armed && is_alone && self.mode != LAND {
            self.mode = LAND;
            self.has_failed_safe = true;
        }
        let wanted = match self.mode {
            _ if !self.is_armed => Velocity::ZERO,
            LAND => Velocity::new(0.0, 0.0, LANDING_MPS),
            _ => (self.target).map_or(Velocity::ZERO, |to| self.velocity_to(to)),
        };
        let change = wanted.0 - self.velocity.0;
        let most = ACCELERATION_MPS2 * seconds;
        self.velocity.0 += change * (most / change.norm().max(most));
        self.position.0 += self.velocity.0 * seconds;
        self.land_or_lift();
    }

    fn land_or_lift(&mut self) {
        use MavLandedState as Is;
        if self.mode == LAND && self.is_armed {
            self.landed = Is::MAV_LANDED_STATE_LANDING;
            if self.position.altitude_m() <= 0.0 {
                (self.is_armed, self.landed) = (false, Is::MAV_LANDED_STATE_ON_GROUND);
                self.position = self.position.at_altitude(0.0);
                self.velocity = Velocity::ZERO;
            }
        } else if self.landed == Is::MAV_LANDED_STATE_TAKEOFF
            && (self.target).is_some_and(|to| to.distance_m(self.position) < 0.3)
        {
            self.landed = Is::MAV_LANDED_STATE_IN_AIR;
        }
    }

    /// Straight, no faster than allowed over ground and up or down, and so that it can brake.
    fn velocity_to(&self, to: Ned) -> Velocity {
        let offset = to - self.position;
        let length_m = offset.0.norm().max(1e-9);
        let over_ground = self.position.horizontal_distance_m(to) / length_m;
        let vertical = self.position.vertical_distance_m(to) / length_m;
        let fastest_mps = (self.speed_mps / over_ground.max(1e-9))
            .min(self.climb_mps / vertical.max(1e-9))
            .min((ACCELERATION_MPS2 * length_m).sqrt())
            .min(length_m / 0.1);
        Velocity(offset.0 * (fastest_mps / length_m))
    }

    fn due(&mut self, now: Instant) -> Vec<MavMessage> {
        let mut due = Vec::new();
        for (id, interval, next) in &mut self.asked {
            if *next <= now {
                *next = now + *interval;
                due.push(*id);
            }
        }
        due.retain(|id| !self.is_real || *id != SIM_STATE_DATA::ID);
        due.into_iter().map(|id| self.message(id)).collect()
    }

    fn message(&self, id: u32) -> MavMessage {
        let [latitude, longitude, altitude_m] = self.origin;
        let [x, y, z] = <[f64; 3]>::from(self.position.0).map(|it| it as f32);
        let [vx, vy, vz] = <[f64; 3]>::from(self.velocity.0).map(|it| it as f32);
        match id {
            HEARTBEAT_DATA::ID => self.heartbeat(),
            LOCAL_POSITION_NED_DATA::ID => {
                MavMessage::LOCAL_POSITION_NED(LOCAL_POSITION_NED_DATA {
                    time_boot_ms: 0,
                    x,
                    y,
                    z,
                    vx,
                    vy,
                    vz,
                })
            }
            EXTENDED_SYS_STATE_DATA::ID => {
                MavMessage::EXTENDED_SYS_STATE(EXTENDED_SYS_STATE_DATA {
                    landed_state: self.landed,
                    ..Default::default()
                })
            }
            SYS_STATUS_DATA::ID => MavMessage::SYS_STATUS(SYS_STATUS_DATA {
                battery_remaining: 90,
                ..Default::default()
            }),
            SIM_STATE_DATA::ID => MavMessage::SIM_STATE(SIM_STATE_DATA::default()),
            GPS_GLOBAL_ORIGIN_DATA::ID => MavMessage::GPS_GLOBAL_ORIGIN(GPS_GLOBAL_ORIGIN_DATA {
                latitude: (latitude * 1e7).round() as i32,
                longitude: (longitude * 1e7).round() as i32,
                altitude: (altitude_m * 1e3).round() as i32,
            }),
            other => panic!("message {other}"),
        }
    }

    fn heartbeat(&self) -> MavMessage {
        let armed = match self.is_armed {
            true => MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED,
            false => MavModeFlag::empty(),
        };
        MavMessage::HEARTBEAT(HEARTBEAT_DATA {
            custom_mode: self.mode,
            mavtype: MavType::MAV_TYPE_QUADROTOR,
            autopilot: MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
            base_mode: MavModeFlag::MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | armed,
            system_status: MavState::MAV_STATE_ACTIVE,
            mavlink_version: 3,
        })
    }
}
