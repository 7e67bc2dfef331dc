//! Builds a flight plan from a scenario file's fields and its mission.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use muster_machines::formation::{Change, Exposure, FlightPlan, Layout, Separation};
use muster_machines::geometry::Ned;
use muster_machines::identity::NodeId;
use muster_machines::mission::{Barrier, Holds};
use muster_machines::motion::Landing;
use muster_machines::msp::controller::{FlowModule, Gains, Receiver};
use muster_machines::navigation::{self, Failsafe};
use muster_machines::routing::{Flood, Member, Packet};
use muster_machines::wire;

use super::agent::{EXPECTED, agent};
use super::avoid::avoid;
use super::failsafe::failsafe;
use super::fence::Fenced;
use super::file::Source;
use super::follow::{Heights, follow};
use super::layering::{Headroom, Swarm, assign_layers};
use super::limits::{Course, altitude_max_m, check_layers, highest_layer_m, limits};
use super::raw::{self, PolicyName, ProtocolKind, Raw, VehicleKindName};
use super::separation::check_separation;
use super::{FlowSensor, Follow, Plan, PlanParts, PoseSensor, Protocol};
use crate::agents::{Agents, PlannedAgent};
use crate::diagnostic::BadInput;
use crate::mission_file::{self, Mission};
use crate::schema::Located;
use crate::vehicle::VehicleKind;

/// Reads the plan of a scenario and its mission; `read` returns a file's text. The fields of the scenario's world are parsed
/// and ignored.
///
/// # Errors
/// If a file can't be used. The error shows file, place and what is accepted.
pub fn load_with(
    path: &Path,
    read: &dyn Fn(&Path) -> Result<String, BadInput>,
) -> Result<Plan, BadInput> {
    let source = Source::new(path, read(path)?);
    let raw = source.parse()?;
    build_plan((&source, &raw), read, Some(Agents::installed()))
}

/// The path of a scenario's mission file.
///
/// # Errors
/// If the scenario file can't be used.
pub fn mission_file(source: &Source) -> Result<PathBuf, BadInput> {
    let raw = source.parse()?;
    Ok(source.resolve(MISSION_FILE, raw.mission.file.get_ref()))
}

/// Builds the plan from a scenario's parsed fields. Its agent is one of `agents`; `None` accepts any name, and the agent is
/// given later.
///
/// # Errors
/// As [`load_with`].
pub fn build_plan(
    (source, raw): (&Source, &Raw),
    read: &dyn Fn(&Path) -> Result<String, BadInput>,
    agents: Option<&Agents>,
) -> Result<Plan, BadInput> {
    let mission = read_mission((source, raw), read)?;
    check_datagrams(source, raw, mission.holds())?;
    let (waypoints, agent) = waypoints_and_agent((source, raw), &mission, agents)?;
    let fenced = Fenced::of(raw, altitude_max_m(raw), mission.fence());
    let protocol = protocol(source, raw)?;
    let planned = planned_separation(raw);
    let failsafe = failsafe(source, raw, fenced.as_ref().map(Fenced::fence))?;
    let mut vehicle = vehicle(raw, failsafe);
    let landing = landing(raw, &vehicle);
    if raw.safety.avoid || agent.is_some() {
        vehicle.avoid = Some(avoid(raw, planned, landing, (&vehicle, &protocol)));
    }
    let settle = Duration::from_millis(raw.vehicle.settle_ms.0);
    let relays = relays(source, raw)?;
    let ceiling_m = fenced.as_ref().and_then(Fenced::ceiling_m);
    let ceiling_m = ceiling_m.unwrap_or(altitude_max_m(raw));
    let swarm = Swarm {
        waypoints: &waypoints,
        headroom: Headroom::new(raw, planned, &waypoints, ceiling_m),
        vehicle: &vehicle,
        settle,
        protocol: &protocol,
        relays: &relays,
    };
    let (layout, changes) = assign_layers((source, raw), &swarm)?;
    let (layout, changes) = (Arc::new(layout), Arc::<[Change]>::from(changes));
    if let Some(avoid) = vehicle.avoid.as_mut().filter(|_| agent.is_none()) {
        let flight = FlightPlan {
            layout: &layout,
            changes: &changes,
            waypoints: &waypoints,
        };
        avoid.landing_places = Some(flight.landing_places().collect());
    }
    let heights = heights(raw, &layout, &changes, &waypoints);
    let follow = follow(source, raw, &vehicle, heights)?;
    let course = Course {
        layout: &layout,
        changes: &changes,
        waypoints: &waypoints,
        holds: mission.holds(),
        vehicle: follow.as_ref().map_or(&vehicle, |follow| &follow.master),
        landing,
        settle,
        land_after: land_after(agent.as_ref(), follow.as_ref()),
    };
    let fence = check_flight(source, raw, &course, fenced.as_ref(), vehicle.speed_mps)?;
    let limits = limits(raw, separation(raw), &course);
    Ok(Plan(PlanParts {
        notes: notes(&mission, &layout),
        layout,
        relays,
        changes,
        home: mission.home(),
        waypoints,
        holds: mission.holds().clone(),
        protocol,
        follow,
        agent,
        vehicle,
        landing,
        settle,
        vehicle_kind: raw.vehicle.kind.into(),
        receiver: receiver(source, raw)?,
        endurance: (raw.vehicle.endurance_s).map(|it| Duration::from_secs_f64(it.0)),
        pose: pose(source, raw)?,
        flow: flow(source, raw)?,
        gains: gains(source, raw)?,
        alone: raw.failsafe.alone.into(),
        limits,
        accepted: (Exposure::ALL.into_iter())
            .filter(|it| raw.limits.accepts(*it))
            .collect(),
        fence,
    }))
}

/// When the swarm lands, counted from when all are in their slots, as far as is known. `None` for a mission.
fn land_after(agent: Option<&PlannedAgent>, follow: Option<&Follow>) -> Option<Duration> {
    match agent {
        Some(_) => Some(EXPECTED),
        None => follow?.land_after,
    }
}

/// Where a followed master may fly.
fn heights(raw: &Raw, layout: &Layout, changes: &[Change], waypoints: &[Ned]) -> Heights {
    Heights {
        begin_m: waypoints[0].altitude_m(),
        highest_m: altitude_max_m(raw) - highest_layer_m(layout, changes, waypoints),
    }
}

/// The waypoints to fly in lockstep, and the agents that decide after them.
fn waypoints_and_agent(
    (source, raw): (&Source, &Raw),
    mission: &Mission,
    agents: Option<&Agents>,
) -> Result<(Arc<[Ned]>, Option<PlannedAgent>), BadInput> {
    let waypoints: Arc<[Ned]> = mission.waypoints().into();
    let agent = agent(source, raw, &waypoints, altitude_max_m(raw), agents)?;
    // The swarm assembles at waypoint 0; from there on agents decide.
    let waypoints = if agent.is_some() {
        [waypoints[0]].into()
    } else {
        waypoints
    };
    Ok((waypoints, agent))
}

fn pose(source: &Source, raw: &Raw) -> Result<Option<PoseSensor>, BadInput> {
    let message = "only a `vehicle.kind = \"msp\"` has a pose sensor";
    let pose = only_with_msp(source, raw, &raw.vehicle.pose, message)?;
    Ok(pose.map(|pose| PoseSensor {
        sigma_m: pose.sigma_m.0,
        period: Duration::from_millis(pose.period_ms.0),
        delay: Duration::from_millis(pose.delay_ms.0),
        outliers: pose.outliers.0,
    }))
}

fn flow(source: &Source, raw: &Raw) -> Result<Option<FlowSensor>, BadInput> {
    let message = "only a `vehicle.kind = \"msp\"` has an optical flow module";
    let flow = only_with_msp(source, raw, &raw.vehicle.flow, message)?;
    Ok(flow.map(|flow| FlowSensor {
        module: FlowModule {
            level_floor: flow.level_floor,
        },
        sigma_radps: flow.sigma_radps.0,
        range_max_m: flow.range_max_m.0,
        period: Duration::from_millis(flow.period_ms.0),
    }))
}

fn gains(source: &Source, raw: &Raw) -> Result<Gains, BadInput> {
    let message = "only a `vehicle.kind = \"msp\"` is flown by sticks, with gains";
    let gains = only_with_msp(source, raw, &raw.vehicle.gains, message)?;
    Ok(gains.map_or_else(|| (&raw::Gains::default()).into(), Gains::from))
}

/// A table that only a vehicle with a flight controller has; another one is refused with this message.
fn only_with_msp<'a, T>(
    source: &Source,
    raw: &Raw,
    table: &'a Option<Located<T>>,
    message: &str,
) -> Result<Option<&'a T>, BadInput> {
    match table {
        Some(table) if VehicleKind::from(raw.vehicle.kind) != VehicleKind::Msp => {
            Err(source.error(table.span(), message))
        }
        table => Ok(table.as_ref().map(Located::get_ref)),
    }
}

fn receiver(source: &Source, raw: &Raw) -> Result<Receiver, BadInput> {
    match (&raw.vehicle.receiver, raw.vehicle.kind) {
        (Some(receiver), VehicleKindName::ClosedForm) => {
            let message = "`vehicle.receiver` needs `vehicle.kind` = \"msp\"";
            Err(source.error(receiver.span(), message))
        }
        (Some(receiver), VehicleKindName::Msp) => Ok((*receiver.get_ref()).into()),
        (None, _) => Ok(Receiver::Sole),
    }
}

fn separation(raw: &Raw) -> Separation {
    Separation {
        horizontal_m: raw.limits.separation_horizontal_m.0,
        vertical_m: raw.limits.separation_vertical_m.0,
    }
}

/// How far an aircraft that is flown by sticks strays from its path, in metres. Two may stray towards each other.
fn strays(raw: &Raw) -> Separation {
    match (raw.vehicle.kind, &raw.vehicle.pose) {
        (VehicleKindName::ClosedForm, _) => Separation {
            horizontal_m: 0.0,
            vertical_m: 0.0,
        },
        // One and a half and two standard deviations of its GPS and its barometer (1.3 and 0.4 m), as far as the default gap
        // on the ground has room.
        (VehicleKindName::Msp, None) => Separation {
            horizontal_m: 2.0,
            vertical_m: 0.75,
        },
        // What its control leaves, and three standard deviations of its pose.
        (VehicleKindName::Msp, Some(pose)) => {
            let strays_m = 0.5 + 3.0 * pose.get_ref().sigma_m.0;
            Separation {
                horizontal_m: strays_m,
                vertical_m: strays_m,
            }
        }
    }
}

/// The separation that paths are planned with.
fn planned_separation(raw: &Raw) -> Separation {
    let (separation, strays) = (separation(raw), strays(raw));
    Separation {
        horizontal_m: separation.horizontal_m + 2.0 * strays.horizontal_m,
        vertical_m: separation.vertical_m + 2.0 * strays.vertical_m,
    }
}

/// The field with the mission's path.
const MISSION_FILE: &str = "mission.file";

fn read_mission(
    (source, raw): (&Source, &Raw),
    read: &dyn Fn(&Path) -> Result<String, BadInput>,
) -> Result<Mission, BadInput> {
    let file = &raw.mission.file;
    let path = source.resolve(MISSION_FILE, file.get_ref());
    let text = read(&path).map_err(|error| {
        let base = match source.is_given_outside(MISSION_FILE) {
            true => "; given with `--set`, a path starts at the current folder",
            false => "",
        };
        let accepted = source.accepted_at(file.span());
        source.error_with(file.span(), &error.to_string(), format!("{accepted}{base}"))
    })?;
    mission_file::parse(&path, &text)
}

/// Checks altitude layers, separation and fence. Returns the description of the fence.
fn check_flight(
    source: &Source,
    raw: &Raw,
    course: &Course<'_>,
    fenced: Option<&Fenced<'_>>,
    speed_mps: f64,
) -> Result<Vec<String>, BadInput> {
    check_layers(source, raw, course)?;
    let flight = FlightPlan {
        layout: course.layout,
        changes: course.changes,
        waypoints: course.waypoints,
    };
    check_separation(source, raw, flight)?;
    match fenced {
        Some(fenced) => fenced.check(source, raw, flight, speed_mps),
        None => Ok(Vec::new()),
    }
}

/// What the swarm does not do of its mission, and a warning about paths near the ground.
fn notes(mission: &Mission, layout: &Layout) -> Vec<String> {
    let mut notes: Vec<_> = mission.notes().iter().map(ToString::to_string).collect();
    if layout.exposed_ends() > 0 {
        notes.push(format!(
            "{} paths from or to the ground pass below drones that climb or descend there: keep frame loss low during \
             take-off",
            layout.exposed_ends()
        ));
    }
    notes
}

fn vehicle(raw: &Raw, failsafe: Failsafe) -> navigation::Config {
    let vehicle = &raw.vehicle;
    navigation::Config {
        speed_mps: vehicle.speed_mps.0,
        climb_mps: vehicle.climb_mps.0,
        descent_mps: vehicle.descent_mps.0,
        acceleration_mps2: vehicle.acceleration_mps2.0,
        failsafe,
        avoid: None,
    }
}

/// As ArduCopter's defaults: LAND_SPEED 0.5 m/s below LAND_ALT_LOW 10 m.
fn landing(raw: &Raw, vehicle: &navigation::Config) -> Landing {
    Landing {
        descent_mps: vehicle.descent_mps,
        final_mps: raw.vehicle.landing_mps.0,
        final_altitude_m: raw.vehicle.landing_altitude_m.0,
        acceleration_mps2: vehicle.acceleration_mps2,
    }
}

fn protocol(source: &Source, raw: &Raw) -> Result<Protocol, BadInput> {
    let set = raw.protocol.parameters.set();
    let milliseconds = |value: Option<raw::Milliseconds>, default_ms: u64| {
        Duration::from_millis(value.map_or(default_ms, |value| value.0))
    };
    let time_to_live = raw.protocol.time_to_live_ms.as_ref();
    let protocol = Protocol {
        policy: (*raw.protocol.policy.get_ref()).into(),
        barrier: barrier(source, raw)?,
        liveness: raw.protocol.liveness.into(),
        succession: raw.protocol.succession.into(),
        period: milliseconds(raw.protocol.period_ms, set.period_ms),
        keep_alive: milliseconds(raw.protocol.keep_alive_ms, set.keep_alive_ms),
        hello_period: Duration::from_millis(raw.protocol.hello_period_ms.0),
        hello_gap: Duration::from_millis(raw.protocol.hello_gap_ms.0),
        discovery: Duration::from_millis(raw.protocol.discovery_ms.0),
        stable_after: u32::try_from(raw.protocol.stable_after.0).unwrap_or(u32::MAX),
        time_to_live: milliseconds(time_to_live.map(|it| *it.get_ref()), set.time_to_live_ms),
        heartbeat: milliseconds(raw.protocol.heartbeat_ms, set.heartbeat_ms),
        repair: milliseconds(raw.protocol.repair_ms, set.repair_ms),
    };
    let place = |field: Option<std::ops::Range<usize>>| field.unwrap_or(raw.protocol.policy.span());
    if protocol.hello_gap <= protocol.hello_period {
        let message = format!(
            "the hello gap, {} ms, must be longer than the hello period, {} ms; else no two hellos are consecutive",
            protocol.hello_gap.as_millis(),
            protocol.hello_period.as_millis()
        );
        return Err(source.error(place(raw.protocol.hello_gap_ms.span()), &message));
    }
    if protocol.time_to_live <= protocol.period.max(protocol.keep_alive) {
        let message = format!(
            "the time to live, {} ms, must be longer than the period and the keep-alive, {} ms; else every drone counts \
             as lost",
            protocol.time_to_live.as_millis(),
            protocol.period.max(protocol.keep_alive).as_millis()
        );
        return Err(source.error(place(time_to_live.map(|it| it.span())), &message));
    }
    Ok(protocol)
}

/// Which drones a master waits for. `neighbours` is refused with protocol "follow" and with changes of formation.
fn barrier(source: &Source, raw: &Raw) -> Result<Barrier, BadInput> {
    let Some(name) = &raw.protocol.barrier else {
        return Ok(Barrier::Strict);
    };
    let barrier = Barrier::from(*name.get_ref());
    if barrier == Barrier::Neighbours && *raw.protocol.kind.get_ref() != ProtocolKind::Muscop {
        let message =
            "`barrier = \"neighbours\"` needs the protocol \"muscop\": others have no barrier";
        return Err(source.error(name.span(), message));
    }
    if barrier == Barrier::Neighbours && !raw.changes.is_empty() {
        let message = "`barrier = \"neighbours\"` can't be used with `changes`: a formation changes after all drones \
                       have arrived";
        return Err(source.error(name.span(), message));
    }
    Ok(barrier)
}

/// Refuses a swarm of policy `flood` with more members than fit into a datagram.
fn check_datagrams(source: &Source, raw: &Raw, holds: &Holds) -> Result<(), BadInput> {
    if *raw.protocol.policy.get_ref() != PolicyName::Flood {
        return Ok(());
    }
    let drones = &raw.formation.drones;
    let largest = |id: u64| Member {
        id: NodeId(u32::try_from(id).unwrap_or(u32::MAX)),
        number: u32::MAX,
        acknowledged: u32::from(u16::MAX),
        out_of_range: true,
        landing: true,
    };
    let order = wire::encode_order(&muster_machines::mission::Order::Plan {
        index: u16::MAX,
        count: u16::MAX,
        waypoints: vec![Ned::new(-1e6, -1e6, -1e6); wire::PLAN_PART_MAX],
        holds: if holds.is_empty() {
            Vec::new()
        } else {
            vec![Holds::MAX; wire::PLAN_PART_MAX]
        },
    });
    let fits = |drones: u64| {
        let packet = Packet::Flood(Flood {
            hops: Some(u16::MAX),
            parent: Some(NodeId(u32::MAX)),
            heartbeat: u32::MAX,
            sequence: u32::from(u16::MAX),
            hears: (0..u32::try_from(drones).unwrap_or(u32::MAX))
                .map(NodeId)
                .collect(),
            members: (0..drones).map(largest).collect(),
            order: Some(order.clone().into()),
        });
        wire::encode_packet(&packet).len() <= wire::PAYLOAD_MAX
    };
    if fits(drones.get_ref().0) {
        return Ok(());
    }
    let most = (1..).take_while(|drones| fits(*drones)).last().unwrap_or(0);
    let message = format!(
        "policy `flood` lists all drones in a datagram of {} bytes, which holds at most {most}",
        wire::DATAGRAM_MAX
    );
    Err(source.error(drones.span(), &message))
}

/// Converts to `usize`, saturating.
#[must_use]
pub fn to_usize(value: u64) -> usize {
    usize::try_from(value).unwrap_or(usize::MAX)
}

/// The most pure relays of a swarm.
const RELAYS_MAX: usize = 1_000;

/// Positions of the pure relays.
fn relays(source: &Source, raw: &Raw) -> Result<Arc<[Ned]>, BadInput> {
    if let Some(relay) = raw.relays.first()
        && *raw.protocol.policy.get_ref() != PolicyName::Tree
    {
        let message = "policy `flood` has no pure relays; only policy `tree` has";
        return Err(source.error(relay.span(), message));
    }
    if let Some(relay) = raw.relays.get(RELAYS_MAX) {
        let message = format!(
            "the scenario has {} relays; at most {RELAYS_MAX} are accepted",
            raw.relays.len()
        );
        return Err(source.error(relay.span(), &message));
    }
    let place = |relay: &Located<raw::Relay>| {
        let relay = relay.get_ref();
        Ned::new(relay.north_m.0, relay.east_m.0, -relay.altitude_m.0)
    };
    Ok(raw.relays.iter().map(place).collect())
}
