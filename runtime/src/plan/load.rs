//! A flight plan, put together from a scenario file's fields and its mission.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use muster_machines::formation::{Change, Flown, Separation};
use muster_machines::geometry::Ned;
use muster_machines::identity::NodeId;
use muster_machines::mission::{Barrier, Holds};
use muster_machines::navigation::{self, Failsafe};
use muster_machines::routing::{Flood, Member, Packet};
use muster_machines::traffic;
use muster_machines::wire;
use toml::Spanned;

use super::apart::check_apart;
use super::failsafe::failsafe;
use super::fence::Fenced;
use super::file::{Override, Source};
use super::follow::{Heights, follow};
use super::limits::{Course, altitude_max_m, check_layers, controller, highest_layer_m, limits};
use super::raw::{self, ParametersName, PolicyName, ProtocolKind, Raw};
use super::room::{Room, arrange};
use super::{Plan, Protocol};
use crate::diagnostic::BadInput;
use crate::mission_file;
use crate::vehicle::Landing;

/// Reads the plan of a scenario and the mission that it names, each file's text with `read`. What the scenario says of its
/// world must be of the right form, and means nothing here.
///
/// # Errors
/// When either file can't be used: the error names the file, shows the place and says what would be accepted.
pub fn load_from(
    path: &Path,
    read: &dyn Fn(&Path) -> Result<String, BadInput>,
) -> Result<Plan, BadInput> {
    let source = Source::new(path, read(path)?, &[])?;
    let raw = source.parse()?;
    put_together(path, (&source, &raw), read)
}

/// The mission's file that a scenario names, as seen from its folder.
///
/// # Errors
/// As [`load_from`], of the scenario file.
pub fn mission_file(
    (path, text): (&Path, &str),
    overrides: &[Override],
) -> Result<PathBuf, BadInput> {
    let raw = Source::new(path, text.to_owned(), overrides)?.parse()?;
    Ok(raw.mission.file.into_inner())
}

/// The plan of a scenario whose fields were read.
///
/// # Errors
/// As [`load_from`].
pub fn put_together(
    path: &Path,
    (source, raw): (&Source, &Raw),
    read: &dyn Fn(&Path) -> Result<String, BadInput>,
) -> Result<Plan, BadInput> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let mission_path = folder.join(raw.mission.file.get_ref());
    let mission = mission_file::parse(&mission_path, &read(&mission_path)?)?;
    let waypoints: Arc<[Ned]> = mission.waypoints().into();

    let separation = Separation {
        horizontal_m: raw
            .limits
            .separation_horizontal_m
            .map_or(SEPARATION_M, |it| it.0),
        vertical_m: raw
            .limits
            .separation_vertical_m
            .map_or(SEPARATION_M, |it| it.0),
    };
    let fenced = Fenced::of(raw, altitude_max_m(raw), mission.fence());
    let ceiling_m = fenced.as_ref().and_then(Fenced::ceiling_m);
    let ceiling_m = ceiling_m.unwrap_or(altitude_max_m(raw));
    let fence = fenced.as_ref().map(Fenced::fence);
    let protocol = protocol(source, raw)?;
    let mut vehicle = vehicle(raw, failsafe(source, raw, fence)?);
    let landing = landing(raw, &vehicle);
    vehicle.avoid = (raw.safety.avoid).then(|| avoid(raw, separation, landing, &protocol));
    let room = Room::new(raw, separation, &waypoints, ceiling_m);
    let (layout, changes) = arrange((source, raw), &waypoints, &room, &vehicle)?;
    let (layout, changes) = (Arc::new(layout), Arc::<[Change]>::from(changes));
    let heights = Heights {
        begin_m: waypoints[0].altitude_m(),
        highest_m: altitude_max_m(raw) - highest_layer_m(&layout, &changes, &waypoints),
    };
    let follow = follow(source, raw, &vehicle, heights)?;
    let settle = Duration::from_millis(raw.vehicle.settle_ms.map_or(0, |it| it.0));
    let course = Course {
        layout: &layout,
        changes: &changes,
        waypoints: &waypoints,
        holds: mission.holds(),
        vehicle: follow.as_ref().map_or(&vehicle, |follow| &follow.master),
        landing,
        settle,
        land_after: follow.as_ref().and_then(|follow| follow.land_after),
    };
    check_layers(source, raw, &course)?;
    let flown = Flown {
        layout: &layout,
        changes: &changes,
        waypoints: &waypoints,
    };
    check_apart(source, raw, flown)?;
    let fence = match &fenced {
        Some(fenced) => fenced.check(source, raw, flown, vehicle.speed_mps)?,
        None => Vec::new(),
    };
    let limits = limits(raw, separation, &course);
    let relays = relays(source, raw)?;
    check_datagrams(source, raw, mission.holds())?;
    let mut notes: Vec<_> = mission.notes().iter().map(ToString::to_string).collect();
    if layout.exposed() > 0 {
        notes.push(format!(
            "{} times a drone's way from or to the ground leads below others that climb or descend through it: keep \
             the losses small while the swarm takes off",
            layout.exposed()
        ));
    }
    Ok(Plan {
        layout,
        relays,
        changes,
        waypoints,
        holds: mission.holds().clone(),
        protocol,
        follow,
        vehicle,
        landing,
        settle,
        endurance: raw
            .vehicle
            .endurance_s
            .map(|it| Duration::from_secs_f64(it.0)),
        alone: raw.failsafe.alone.into(),
        limits,
        fence,
        notes,
    })
}

/// The least distance between flying drones, over ground or in height.
const SEPARATION_M: f64 = 5.0;
/// As ArduCopter's defaults: WPNAV_SPEED 10 m/s here as in the theses, WPNAV_ACCEL 1 m/s², WPNAV_SPEED_UP 2.5 m/s,
/// WPNAV_SPEED_DN 1.5 m/s.
fn vehicle(raw: &Raw, failsafe: Failsafe) -> navigation::Config {
    let vehicle = &raw.vehicle;
    navigation::Config {
        speed_mps: vehicle.speed_mps.map_or(10.0, |it| it.0),
        climb_mps: vehicle.climb_mps.map_or(2.5, |it| it.0),
        descent_mps: vehicle.descent_mps.map_or(1.5, |it| it.0),
        acceleration_mps2: vehicle.acceleration_mps2.map_or(1.0, |it| it.0),
        failsafe,
        avoid: None,
    }
}

/// How drones keep clear of each other.
fn avoid(
    raw: &Raw,
    separation: Separation,
    landing: Landing,
    protocol: &Protocol,
) -> traffic::Config {
    let touch_down_s = landing.final_altitude_m / landing.final_mps;
    traffic::Config {
        separation,
        time_to_live: protocol.time_to_live,
        controller: controller(raw),
        descent_mps: landing.descent_mps,
        touch_down: Duration::from_secs_f64(touch_down_s),
    }
}

/// As ArduCopter's defaults: LAND_SPEED 0.5 m/s below LAND_ALT_LOW 10 m.
fn landing(raw: &Raw, vehicle: &navigation::Config) -> Landing {
    Landing {
        descent_mps: vehicle.descent_mps,
        final_mps: raw.vehicle.landing_mps.map_or(0.5, |it| it.0),
        final_altitude_m: raw.vehicle.landing_altitude_m.map_or(10.0, |it| it.0),
        acceleration_mps2: vehicle.acceleration_mps2,
    }
}

/// The numbers of a parameter set, in milliseconds; the file may replace each.
struct Parameters {
    period: u64,
    keep_alive: u64,
    time_to_live: u64,
    beacon: u64,
    repair: u64,
}

/// The thesis's numbers (sections 4.2 and 4.4) and its ancestor's, the gap between hellos as `Neighbours` explains it,
/// and a keep-alive of a second for drones that are landing, for whom nobody waits: a frame a drone a second.
const QUIET: Parameters = Parameters {
    period: 200,
    keep_alive: 1_000,
    time_to_live: 5_000,
    beacon: 1_000,
    repair: 8,
};

/// For swarms that must notice within a second that their master is gone: two beacons of a link that loses nothing, and
/// twenty questions, are 0.5 s. Ten beacons a second leave two frames a second for all else.
const FAST: Parameters = Parameters {
    period: 100,
    keep_alive: 500,
    time_to_live: 2_000,
    beacon: 100,
    repair: 8,
};

/// For a network that delivers within a millisecond or two and seldom loses, as between processes of a machine or on a
/// switch: two beacons, and seven questions of 4.5 ms, are 0.11 s. A master, and whoever is a parent, sends 25 frames a second,
/// any other eight; whoever hears them checks as many signatures.
const LAN: Parameters = Parameters {
    period: 50,
    keep_alive: 250,
    time_to_live: 1_000,
    beacon: 35,
    repair: 3,
};

fn protocol(source: &Source, raw: &Raw) -> Result<Protocol, BadInput> {
    let set = match raw.protocol.parameters {
        ParametersName::Quiet => QUIET,
        ParametersName::Fast => FAST,
        ParametersName::Lan => LAN,
    };
    let milliseconds = |value: Option<raw::Milliseconds>, default: u64| {
        Duration::from_millis(value.map_or(default, |value| value.0))
    };
    let gap = raw.protocol.hello_gap_ms.as_ref();
    let time_to_live = raw.protocol.time_to_live_ms.as_ref();
    let protocol = Protocol {
        policy: (*raw.protocol.policy.get_ref()).into(),
        barrier: barrier(source, raw)?,
        liveness: raw.protocol.liveness.into(),
        succession: raw.protocol.succession.into(),
        period: milliseconds(raw.protocol.period_ms, set.period),
        keep_alive: milliseconds(raw.protocol.keep_alive_ms, set.keep_alive),
        hello_period: milliseconds(raw.protocol.hello_period_ms, 500),
        hello_gap: milliseconds(gap.map(|it| *it.get_ref()), 750),
        discovery: milliseconds(raw.protocol.discovery_ms, 8_000),
        stable_after: raw
            .protocol
            .stable_after
            .and_then(|it| u32::try_from(it.0).ok())
            .unwrap_or(3),
        time_to_live: milliseconds(time_to_live.map(|it| *it.get_ref()), set.time_to_live),
        beacon: milliseconds(raw.protocol.heartbeat_ms, set.beacon),
        repair: milliseconds(raw.protocol.repair_ms, set.repair),
    };
    let place = |field: Option<std::ops::Range<usize>>| field.unwrap_or(raw.protocol.policy.span());
    if protocol.hello_gap <= protocol.hello_period {
        let message = "no two hellos would ever be in a row: the gap is not above the period";
        return Err(source.error(place(gap.map(Spanned::span)), message));
    }
    if protocol.time_to_live <= protocol.period.max(protocol.keep_alive) {
        let message =
            "every drone would be taken for lost: the time to live is not above the periods";
        return Err(source.error(place(time_to_live.map(Spanned::span)), message));
    }
    Ok(protocol)
}

/// For whom a master waits; for all, where whoever is behind the others would be in their way or none is waited for.
fn barrier(source: &Source, raw: &Raw) -> Result<Barrier, BadInput> {
    let Some(name) = &raw.protocol.barrier else {
        return Ok(Barrier::Strict);
    };
    let barrier = Barrier::from(*name.get_ref());
    if barrier == Barrier::Neighbours && raw.protocol.kind == ProtocolKind::Follow {
        let message = "a master that is followed waits for nobody at a waypoint";
        return Err(source.error(name.span(), message));
    }
    if barrier == Barrier::Neighbours && !raw.changes.is_empty() {
        let message = "a swarm changes formation only once all have arrived";
        return Err(source.error(name.span(), message));
    }
    Ok(barrier)
}

/// Refuses a swarm whose lists of members would outgrow a datagram.
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
        "policy `flood` lists every member in a datagram of {} bytes, which {most} drones fill",
        wire::DATAGRAM_MAX
    );
    Err(source.error(drones.span(), &message))
}

/// A number as one of what is in memory; the most where it is larger.
#[must_use]
pub fn to_usize(value: u64) -> usize {
    usize::try_from(value).unwrap_or(usize::MAX)
}

/// The most pure relays.
const RELAYS_MAX: usize = 1_000;

/// Where the pure relays are.
fn relays(source: &Source, raw: &Raw) -> Result<Arc<[Ned]>, BadInput> {
    if let Some(relay) = raw.relays.first()
        && *raw.protocol.policy.get_ref() != PolicyName::Tree
    {
        let message = "policy `flood` has no pure relays: every drone that it lists is awaited";
        return Err(source.error(relay.span(), message));
    }
    if let Some(relay) = raw.relays.get(RELAYS_MAX) {
        let message = format!("more than {RELAYS_MAX} relays");
        return Err(source.error(relay.span(), &message));
    }
    let place = |relay: &Spanned<raw::Relay>| {
        let relay = relay.get_ref();
        Ned::new(relay.north_m.0, relay.east_m.0, -relay.altitude_m.0)
    };
    Ok(raw.relays.iter().map(place).collect())
}
