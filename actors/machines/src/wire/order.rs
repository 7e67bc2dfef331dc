//! Orders of the mission, and their bytes.

use std::ops::Range;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::PayloadError;
use crate::geometry::{Ned, Velocity};
use crate::identity::NodeSet;

/// Most waypoints in one [`Order::Plan`], so that it fits a payload beside the sets of members.
pub const PLAN_PART_MAX: usize = 24;

/// Most runs of ids in one [`Order::Task`], so that it fits a payload beside the sets of members.
pub const TASK_RUNS_MAX: usize = 32;

/// Longest hold at one waypoint: longer than multicopters fly.
pub const HOLD_MAX: Duration = Duration::from_secs(3_600);

/// An order of a master to its swarm; one follows the other.
#[derive(Debug, Clone, PartialEq)]
pub enum Order {
    /// A part of the mission; carried out once it is stored.
    Plan {
        /// Index of the part.
        index: u16,
        /// Number of parts.
        count: u16,
        /// Waypoints of the formation's centre.
        waypoints: Vec<Ned>,
        /// Hold at each waypoint once all drones have arrived: whole milliseconds, at most [`HOLD_MAX`]. Empty if there
        /// are no holds.
        holds: Vec<Duration>,
    },
    /// Take off; carried out in the slot at waypoint 0. Drones of later waves acknowledge at once.
    TakeOff {
        /// The wave that takes off, from 0.
        wave: u16,
    },
    /// Fly to a waypoint; carried out on arrival.
    Move {
        /// Index of the waypoint; take-off ends at waypoint 0.
        waypoint: u16,
        /// Whether drones may be separated from the swarm, so that all fly in their altitude layers from now on.
        apart: bool,
    },
    /// Gather beside the master and land; carried out on the ground.
    Land {
        /// Where the centre of the formation lands, at the altitude of the last waypoint.
        at: Ned,
        /// Number of formation changes so far; selects the formation whose landing places are used.
        changes: u16,
        /// The wave that lands, from 0. Drones of later waves acknowledge at once.
        wave: u16,
        /// See [`Self::Move`].
        apart: bool,
    },
    /// Take one step of a formation change; carried out once it is done.
    Reform {
        /// Index of the change, from 0.
        change: u16,
        /// The step.
        step: Step,
        /// The wave that crosses, from 0; 0 in the other steps.
        wave: u16,
        /// See [`Self::Move`].
        apart: bool,
    },
    /// Keep formation on a moving centre. The next such order replaces it; it is never acknowledged.
    Follow {
        /// Position of the formation's centre.
        at: Ned,
        /// Velocity of the formation's centre.
        velocity: Velocity,
    },
    /// Each drone's agent decides where it flies. The next such order replaces it; carried out at once.
    Task {
        /// The drones on task. If they are more than [`TASK_RUNS_MAX`] runs of ids, some others are among them.
        drones: NodeSet,
    },
    /// Stop following: go to the slot around a centre at rest; carried out on arrival.
    Assemble {
        /// Position of the formation's centre.
        at: Ned,
    },
}

/// A step of a formation change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Step {
    /// Climb into the sector.
    Climb,
    /// Fly level to above the new slot.
    Cross,
    /// Descend into the new slot.
    Descend,
}

impl Step {
    /// The next step; `None` after the last.
    #[must_use]
    pub const fn next(self) -> Option<Self> {
        match self {
            Self::Climb => Some(Self::Cross),
            Self::Cross => Some(Self::Descend),
            Self::Descend => None,
        }
    }
}

#[derive(Serialize, Deserialize)]
enum WireOrder {
    Plan {
        index: u16,
        count: u16,
        waypoints: Vec<[i32; 3]>,
    },
    TakeOff,
    Move {
        waypoint: u16,
        apart: bool,
    },
    Land {
        at: [i32; 3],
        changes: u16,
        apart: bool,
    },
    Reform {
        change: u16,
        step: WireStep,
        apart: bool,
    },
    Follow {
        at: [i32; 3],
        velocity: [i32; 3],
    },
    Assemble {
        at: [i32; 3],
    },
    TakeOffInWave {
        wave: u16,
    },
    LandInWave {
        at: [i32; 3],
        changes: u16,
        apart: bool,
        wave: u16,
    },
    CrossInWave {
        change: u16,
        apart: bool,
        wave: u16,
    },
    /// A part of a plan with holds, in milliseconds.
    PlanWithHolds {
        index: u16,
        count: u16,
        waypoints: Vec<([i32; 3], u32)>,
    },
    /// Runs of ids in ascending order: the distance from the end of the run before, and the length.
    Task {
        runs: Vec<(u32, u32)>,
    },
}

#[derive(Serialize, Deserialize)]
enum WireStep {
    Climb,
    Cross,
    Descend,
}

/// Encodes an order. Positions are rounded to millimetres, velocities to millimetres per second.
#[must_use]
pub fn encode_order(order: &Order) -> Vec<u8> {
    let wire = match order.clone() {
        Order::Plan {
            index,
            count,
            waypoints,
            holds,
        } => encode_plan((index, count), &waypoints, &holds),
        Order::TakeOff { wave: 0 } => WireOrder::TakeOff,
        Order::TakeOff { wave } => WireOrder::TakeOffInWave { wave },
        Order::Move { waypoint, apart } => WireOrder::Move { waypoint, apart },
        Order::Land {
            at,
            changes,
            wave,
            apart,
        } => encode_landing(to_millimetres(at), changes, wave, apart),
        Order::Reform {
            change,
            step,
            wave,
            apart,
        } => encode_step(change, step, wave, apart),
        Order::Follow { at, velocity } => WireOrder::Follow {
            at: to_millimetres(at),
            velocity: to_millimetres(Ned(velocity.0)),
        },
        Order::Assemble { at } => WireOrder::Assemble {
            at: to_millimetres(at),
        },
        Order::Task { drones } => WireOrder::Task {
            runs: encode_runs(&drones),
        },
    };
    write(&wire, Vec::with_capacity(32))
}

fn encode_plan((index, count): (u16, u16), waypoints: &[Ned], holds: &[Duration]) -> WireOrder {
    let positions = waypoints.iter().copied().map(to_millimetres);
    if holds.is_empty() {
        WireOrder::Plan {
            index,
            count,
            waypoints: positions.collect(),
        }
    } else {
        WireOrder::PlanWithHolds {
            index,
            count,
            waypoints: positions.zip(holds.iter().map(to_milliseconds)).collect(),
        }
    }
}

const fn encode_landing(at: [i32; 3], changes: u16, wave: u16, apart: bool) -> WireOrder {
    if wave == 0 {
        WireOrder::Land { at, changes, apart }
    } else {
        WireOrder::LandInWave {
            at,
            changes,
            apart,
            wave,
        }
    }
}

const fn encode_step(change: u16, step: Step, wave: u16, apart: bool) -> WireOrder {
    let step = match step {
        Step::Cross if wave > 0 => {
            return WireOrder::CrossInWave {
                change,
                apart,
                wave,
            };
        }
        Step::Climb => WireStep::Climb,
        Step::Cross => WireStep::Cross,
        Step::Descend => WireStep::Descend,
    };
    WireOrder::Reform {
        change,
        step,
        apart,
    }
}

/// Decodes an order.
///
/// # Errors
/// The bytes are no order, or bytes follow it.
pub fn decode_order(bytes: &[u8]) -> Result<Order, PayloadError> {
    Ok(match read(bytes)? {
        WireOrder::Plan {
            index,
            count,
            waypoints,
        } => decode_plan((index, count), waypoints, Vec::new()),
        WireOrder::TakeOff => Order::TakeOff { wave: 0 },
        WireOrder::TakeOffInWave { wave } => Order::TakeOff { wave },
        WireOrder::Move { waypoint, apart } => Order::Move { waypoint, apart },
        WireOrder::Land { at, changes, apart } => decode_landing(at, changes, 0, apart),
        WireOrder::LandInWave {
            at,
            changes,
            apart,
            wave,
        } => decode_landing(at, changes, wave, apart),
        WireOrder::CrossInWave {
            change,
            apart,
            wave,
        } => Order::Reform {
            change,
            step: Step::Cross,
            wave,
            apart,
        },
        WireOrder::Reform {
            change,
            step,
            apart,
        } => Order::Reform {
            change,
            step: decode_step(&step),
            wave: 0,
            apart,
        },
        WireOrder::Follow { at, velocity } => Order::Follow {
            at: from_millimetres(at),
            velocity: Velocity(from_millimetres(velocity).0),
        },
        WireOrder::Assemble { at } => Order::Assemble {
            at: from_millimetres(at),
        },
        WireOrder::Task { runs } => Order::Task {
            drones: decode_runs(&runs)?,
        },
        WireOrder::PlanWithHolds {
            index,
            count,
            waypoints,
        } => {
            let (positions, holds): (Vec<_>, Vec<_>) = waypoints.into_iter().unzip();
            decode_plan((index, count), positions, from_milliseconds(&holds)?)
        }
    })
}

const fn decode_step(step: &WireStep) -> Step {
    match step {
        WireStep::Climb => Step::Climb,
        WireStep::Cross => Step::Cross,
        WireStep::Descend => Step::Descend,
    }
}

fn decode_plan(
    (index, count): (u16, u16),
    positions: Vec<[i32; 3]>,
    holds: Vec<Duration>,
) -> Order {
    Order::Plan {
        index,
        count,
        waypoints: positions.into_iter().map(from_millimetres).collect(),
        holds,
    }
}

fn decode_landing(at: [i32; 3], changes: u16, wave: u16, apart: bool) -> Order {
    Order::Land {
        at: from_millimetres(at),
        changes,
        wave,
        apart,
    }
}

/// Runs of ids; the closest ones are joined until they are at most [`TASK_RUNS_MAX`].
fn encode_runs(drones: &NodeSet) -> Vec<(u32, u32)> {
    let mut runs: Vec<_> = drones.runs().collect();
    while runs.len() > TASK_RUNS_MAX {
        let gaps = runs.windows(2).map(|pair| pair[1].start - pair[0].end);
        let narrowest = gaps.enumerate().min_by_key(|(_, gap)| *gap);
        let Some((at, _)) = narrowest else { break };
        runs[at].end = runs[at + 1].end;
        runs.remove(at + 1);
    }
    let mut end = 0;
    let relative = |run: Range<u32>| {
        let gap = run.start - end;
        end = run.end;
        (gap, run.end - run.start)
    };
    runs.into_iter().map(relative).collect()
}

fn decode_runs(runs: &[(u32, u32)]) -> Result<NodeSet, PayloadError> {
    if runs.len() > TASK_RUNS_MAX {
        return Err(PayloadError);
    }
    let mut drones = NodeSet::new();
    let mut end = 0_u32;
    for (gap, len) in runs {
        let start = end.checked_add(*gap).ok_or(PayloadError)?;
        end = start.checked_add(*len).ok_or(PayloadError)?;
        drones.extend_from(&NodeSet::from(start..end));
    }
    Ok(drones)
}

fn to_milliseconds(hold: &Duration) -> u32 {
    u32::try_from(hold.as_millis()).unwrap_or(u32::MAX)
}

/// Holds at waypoints. Rejects those above [`HOLD_MAX`].
fn from_milliseconds(holds: &[u32]) -> Result<Vec<Duration>, PayloadError> {
    let holds = holds
        .iter()
        .map(|hold| Duration::from_millis((*hold).into()));
    let holds = holds.map(|hold| (hold <= HOLD_MAX).then_some(hold).ok_or(PayloadError));
    holds.collect()
}

fn write<T: Serialize>(value: &T, out: Vec<u8>) -> Vec<u8> {
    postcard::to_extend(value, out)
        .expect("these types always serialise, and a vector takes any length")
}

fn read<'a, T: Deserialize<'a>>(bytes: &'a [u8]) -> Result<T, PayloadError> {
    match postcard::take_from_bytes(bytes) {
        Ok((value, [])) => Ok(value),
        _ => Err(PayloadError),
    }
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "saturates 2,147 km from home, beyond any mission that loads"
)]
fn to_millimetres(position: Ned) -> [i32; 3] {
    [position.0.x, position.0.y, position.0.z].map(|metres| (metres * 1_000.0).round() as i32)
}

fn from_millimetres(millimetres: [i32; 3]) -> Ned {
    let [north, east, down] = millimetres.map(|value| f64::from(value) / 1_000.0);
    Ned::new(north, east, down)
}
