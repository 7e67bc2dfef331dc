//! The status of a drone's process, as `/status` answers it in JSON.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

/// A drone heard within this time counts as a neighbour, in seconds: a few heartbeats at the longest period.
const NEIGHBOUR_S: f64 = 3.0;

/// The status of a drone's process. Counts are since the start of the process.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Status {
    /// The drone's number.
    pub drone: u32,
    /// Number of its swarm.
    pub swarm: u32,
    /// Version of `musterd`.
    pub version: String,
    /// Number of the process's start on this journal, from 1.
    pub incarnation: u32,
    /// Time since the start of the process, in seconds.
    pub up_s: f64,
    /// Why the drone is unhealthy, in words. Empty if it is healthy.
    pub faults: Vec<String>,
    /// State of the mission.
    pub state: Doing,
    /// Whether the drone is armed or takes part in a flight: from when it has heard of a master until it is on the ground for
    /// good.
    pub in_flight: bool,
    /// Role in the swarm.
    pub role: Role,
    /// Current leader. `None` if the drone has none.
    pub ballot: Option<LeaderEpoch>,
    /// Hops to the master; 0 on the master itself. `None` without a route.
    pub hops: Option<u16>,
    /// Next hop to the master. `None` on the master and without a route.
    pub parent: Option<u32>,
    /// Drones that have proven themselves to this one since its start: they have signed its nonce.
    pub proven: BTreeSet<u32>,
    /// Drones heard since the start, by number.
    pub heard: BTreeMap<u32, Heard>,
    /// Position, battery and motors.
    pub vehicle: VehicleStatus,
    /// Port of the flight controller. `None` with a simulated vehicle.
    pub port: Option<PortStatus>,
    /// The five actors, by name.
    pub actors: BTreeMap<String, ActorStatus>,
    /// The drone's agent. `None` if it has none.
    pub agent: Option<AgentStatus>,
    /// Frames sent and received.
    pub frames: Frames,
    /// Datagrams sent and received.
    pub datagrams: Datagrams,
    /// Messages, without frames, dropped because an actor's queue was full or the actor was down.
    pub messages_refused: u64,
    /// Journal records that could not be written.
    pub journal_unwritten: u64,
    /// Log lines dropped because the log's reader is too slow.
    pub log_lines_lost: u64,
    /// Health of the computer.
    #[serde(default)]
    pub computer: ComputerStatus,
}

/// Health of the drone's computer, looked at every 5 s. What it does not tell is `None`; a Raspberry Pi tells all but the wear
/// of most SD cards.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct ComputerStatus {
    /// Temperature of the processor, in degrees Celsius. A Raspberry Pi slows down from 80 on.
    pub temperature_c: Option<f64>,
    /// Whether the supply is below 4.63 V now.
    pub under_voltage: Option<bool>,
    /// Whether the processor is slowed down now.
    pub throttled: Option<bool>,
    /// Whether the supply was below 4.63 V since the computer started.
    pub had_under_voltage: Option<bool>,
    /// Whether the processor was slowed down since the computer started.
    pub was_throttled: Option<bool>,
    /// Wear of the card, in tenths from 0 to 1; 1.1 if it is worn out.
    pub card_wear: Option<f64>,
    /// Free space for the journal, in bytes.
    pub free_bytes: Option<u64>,
}

/// State of the mission.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Doing {
    /// Name for programs, e.g. `moving_to_waypoint`.
    pub name: String,
    /// Text for people, e.g. "moving to waypoint 2".
    pub words: String,
    /// Waypoint that the drone is at or flies to.
    pub waypoint: Option<u16>,
}

/// Role of a drone in its swarm.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// The drone has no leader yet.
    None,
    /// The drone leads.
    Master,
    /// The drone follows another.
    Member,
    /// The drone only forwards frames.
    Relay,
}

impl Role {
    /// All roles.
    pub const ALL: [Self; 4] = [Self::None, Self::Master, Self::Member, Self::Relay];

    /// Name for programs.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Master => "master",
            Self::Member => "member",
            Self::Relay => "relay",
        }
    }
}

/// The ballot of a leader epoch.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct LeaderEpoch {
    /// Rises with each election.
    pub term: u32,
    /// The master's position in the order of succession.
    pub rank: u32,
    /// The master's number.
    pub master: u32,
}

/// Frames received from another drone.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Heard {
    /// Accepted frames.
    pub frames: u64,
    /// Time since the last one, in seconds.
    pub silent_s: f64,
}

/// Telemetry of the vehicle. Positions are relative to the mission's home.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct VehicleStatus {
    /// North of home, in metres.
    pub north_m: f64,
    /// East of home, in metres.
    pub east_m: f64,
    /// Above home, in metres.
    pub altitude_m: f64,
    /// Time since the drone lost its horizontal position, in seconds. `None` while it has one.
    pub position_lost_s: Option<f64>,
    /// Battery charge, from 0 (empty) to 1 (full).
    pub charge: f64,
    /// Whether the motors are armed.
    pub armed: bool,
}

/// Port of a flight controller or an autopilot. An autopilot's has neither questions nor RC; what counts them is 0.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PortStatus {
    /// Whether there is a controller.
    pub state: PortState,
    /// What makes the controller unfit to fly, in words. Empty if it is fit. Above the stage `bench` such a drone sends no RC.
    pub unfit: Vec<String>,
    /// Why the port was closed last. `None` if it never was.
    pub closed_by: Option<String>,
    /// How often the port was opened.
    pub opened: u64,
    /// Mean delay of an answer since the port was opened last, in seconds.
    pub latency_s: f64,
    /// Longest delay of an answer since the port was opened last, in seconds.
    pub latency_max_s: f64,
    /// Share of questions without an answer since the port was opened last, 0 to 1.
    pub loss: f64,
    /// Bad frames read since the port was opened last.
    pub bad_frames: u64,
    /// RC frames written.
    pub rc_sent: u64,
    /// RC frames that the controller acknowledged.
    pub rc_acknowledged: u64,
    /// RC frames written in the last whole second.
    pub rc_per_s: u64,
    /// Longest time between two RC frames while sticks were given, in seconds.
    pub rc_gap_max_s: f64,
    /// Whether the system grants the thread that writes RC real-time priority.
    pub is_realtime: bool,
}

impl From<muster_port::Status> for PortStatus {
    fn from(status: muster_port::Status) -> Self {
        Self {
            state: match status.state {
                muster_port::State::Closed => PortState::Closed,
                muster_port::State::Identifying => PortState::Identifying,
                muster_port::State::Open => PortState::Open,
                muster_port::State::Silent => PortState::Silent,
            },
            unfit: status.unfit.iter().map(ToString::to_string).collect(),
            closed_by: status.closed_by,
            opened: status.opened,
            latency_s: status.latency.mean().as_secs_f64(),
            latency_max_s: status.latency.max.as_secs_f64(),
            loss: status.latency.loss(),
            bad_frames: status.counts.bad(),
            rc_sent: status.rc_sent,
            rc_acknowledged: status.rc_acknowledged,
            rc_per_s: status.rc_per_second,
            rc_gap_max_s: status.rc_gap_max.as_secs_f64(),
            is_realtime: status.is_realtime,
        }
    }
}

/// Whether a port has a flight controller.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PortState {
    /// The port can't be opened, or was lost; it is tried again.
    Closed,
    /// The port is open; the controller has not said yet who it is.
    Identifying,
    /// The controller answers.
    Open,
    /// The controller has not answered for half a second.
    Silent,
}

impl PortState {
    /// All states.
    pub const ALL: [Self; 4] = [Self::Closed, Self::Identifying, Self::Open, Self::Silent];

    /// Name for programs and people.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Closed => "closed",
            Self::Identifying => "identifying",
            Self::Open => "open",
            Self::Silent => "silent",
        }
    }
}

/// State and counters of an actor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct ActorStatus {
    /// Whether the actor runs.
    pub up: bool,
    /// Messages in its queue.
    pub waiting: u32,
    /// Size of its queue.
    pub waiting_max: u32,
    /// Failures.
    pub failures: u64,
    /// Restarts.
    pub restarts: u64,
    /// Timeouts after which its deadline was still in the past. A defect if above 0.
    pub overdue: u64,
}

/// Calls of a drone's agent.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct AgentStatus {
    /// Calls that took longer than 50 ms. They held up the drone.
    pub slow_calls: u64,
    /// Duration of the longest call, in seconds.
    pub longest_call_s: f64,
}

/// Counters of frames at the radio.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Frames {
    /// Sent, by kind of packet.
    pub sent: BTreeMap<String, Sent>,
    /// Accepted, by kind of packet.
    pub let_in: BTreeMap<String, u64>,
    /// Dropped, by reason.
    pub dropped: BTreeMap<String, u64>,
    /// Accepted by the radio and ignored by the routing: not a member's packet, or of an older leader epoch.
    pub ignored: u64,
    /// Orders that the mission could not read or execute.
    pub orders_refused: u64,
}

/// Sent frames, by cause.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Sent {
    /// Sent because of a change or a repair.
    pub news: u64,
    /// Sent only because a period had passed.
    pub keep_alives: u64,
}

/// Counters of datagrams at the transport.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Datagrams {
    /// Given to the system, one for each peer.
    pub sent: u64,
    /// Refused by the system.
    pub unsent: u64,
    /// Received.
    pub received: u64,
    /// Dropped because they were too long.
    pub too_long: u64,
    /// Dropped by the system because its buffers were full. `None` if the system does not report it.
    pub overflowed: Option<u64>,
}

impl Status {
    /// Numbers of the drones heard within the last 3 s.
    pub fn neighbours(&self) -> impl Iterator<Item = u32> {
        let recent = self
            .heard
            .iter()
            .filter(|(_, it)| it.silent_s < NEIGHBOUR_S);
        recent.map(|(id, _)| *id)
    }

    /// Dropped frames and received datagrams, for all reasons.
    #[must_use]
    pub fn dropped(&self) -> u64 {
        let overflowed = self.datagrams.overflowed.unwrap_or_default();
        self.frames.dropped.values().sum::<u64>() + self.datagrams.too_long + overflowed
    }

    /// Restarts of all actors.
    #[must_use]
    pub fn restarts(&self) -> u64 {
        self.actors.values().map(|actor| actor.restarts).sum()
    }
}
