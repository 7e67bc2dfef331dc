use std::num::NonZeroUsize;
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
use muster_runtime::diagnostic::{BadInput, read_text};
use muster_runtime::mission_file;
use muster_transport::sim::{self, Access, Bursts, Propagation};
use toml::Spanned;

use super::exposure::{check_apart, check_followers};
use super::failsafe::failsafe;
use super::faults::faults;
use super::fence::Fenced;
use super::file::{Override, Source};
use super::follow::{Heights, follow};
use super::limits::{Course, altitude_max_m, check_layers, controller, highest_layer_m, limits};
use super::raw::{MediumName, ModelName, ParametersName, PolicyName, ProtocolKind, Raw};
use super::room::{Room, arrange};
use super::{Chaos, Protocol, Scenario, Variation};
use muster_runtime::vehicle::Landing;

/// Reads a scenario and the mission that it names; `overrides` replace what the file says.
///
/// # Errors
/// When either file can't be used: the error names the file, shows the place and says what would be accepted.
pub fn load(path: &Path, overrides: &[Override]) -> Result<Scenario, BadInput> {
    load_from(path, overrides, &read_text)
}

/// Likewise, with each file's text from `read`.
///
/// # Errors
/// As [`load`], and what `read` refuses.
pub fn load_from(
    path: &Path,
    overrides: &[Override],
    read: &dyn Fn(&Path) -> Result<String, BadInput>,
) -> Result<Scenario, BadInput> {
    let source = Source::new(path, read(path)?, overrides)?;
    let raw = source.parse()?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut scenario = alone(path, (&source, &raw), overrides, read)?;
    for joins in &raw.swarms {
        let swarm = other((&source, &raw), joins, folder, read)?;
        let radio = scenario.radio;
        scenario
            .others
            .push((Scenario { radio, ..swarm }, joins.into()));
    }
    Ok(scenario)
}

/// The mission's file that a scenario names, as seen from its folder.
///
/// # Errors
/// As [`load`], of the scenario file.
pub fn mission_file(
    (path, text): (&Path, &str),
    overrides: &[Override],
) -> Result<PathBuf, BadInput> {
    let raw = Source::new(path, text.to_owned(), overrides)?.parse()?;
    Ok(raw.mission.file.into_inner())
}

/// The swarm of a file named by another one, whose seed and separation count for both.
fn other(
    (source, own): (&Source, &Raw),
    joins: &super::raw::Swarm,
    folder: &Path,
    read: &dyn Fn(&Path) -> Result<String, BadInput>,
) -> Result<Scenario, BadInput> {
    let file = &joins.scenario;
    let path = folder.join(file.get_ref());
    let Ok(text) = read(&path) else {
        let message = format!("{} can't be read", path.display());
        return Err(source.error(file.span(), &message));
    };
    if let (Some(after), Some(duration)) = (&joins.after_s, own.limits.duration_s)
        && after.get_ref().0 >= duration.0
    {
        let message = "the run is over by then, as `limits.duration_s` says";
        return Err(source.error(after.span(), message));
    }
    let others = Source::new(&path, text, &[])?;
    let mut raw = others.parse()?;
    *raw.seed.get_mut() = *own.seed.get_ref();
    raw.limits.separation_horizontal_m = own.limits.separation_horizontal_m;
    raw.limits.separation_vertical_m = own.limits.separation_vertical_m;
    for (field, is_there) in [
        ("swarms", !raw.swarms.is_empty()),
        ("faults", !raw.faults.is_empty()),
    ] {
        if is_there {
            let message = format!("{} has `{field}` of its own", path.display());
            return Err(source.error(file.span(), &message));
        }
    }
    alone(&path, (&others, &raw), &[], read)
}

/// A scenario without the other swarms that it names.
fn alone(
    path: &Path,
    (source, raw): (&Source, &Raw),
    overrides: &[Override],
    read: &dyn Fn(&Path) -> Result<String, BadInput>,
) -> Result<Scenario, BadInput> {
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
    let faults = faults(source, raw, waypoints.len())?;
    let radio = radio(source, raw)?;
    let mut notes: Vec<_> = mission.notes().iter().map(ToString::to_string).collect();
    if layout.exposed() > 0 {
        notes.push(format!(
            "{} times a drone's way from or to the ground leads below others that climb or descend through it: keep \
             the losses small while the swarm takes off",
            layout.exposed()
        ));
    }
    let scenario = Scenario {
        name: path.display().to_string(),
        overrides: overrides
            .iter()
            .filter(|change| !change.is_seed())
            .cloned()
            .collect(),
        seed: raw.seed.get_ref().0,
        layout,
        relays,
        changes,
        waypoints,
        holds: mission.holds().clone(),
        radio,
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
        faults,
        chaos: chaos(source, raw)?,
        unchecked: false,
        others: Vec::new(),
    };
    check_followers(source, raw, &scenario)?;
    Ok(scenario)
}

/// The most faults of a plan that is drawn: enough for three that only together break something, and one beside.
const FAULTS_MAX: u32 = 4;

/// What a search may choose: of each field that it varies, one of the values.
fn chaos(source: &Source, raw: &Raw) -> Result<Chaos, BadInput> {
    let vary = raw.chaos.vary.iter().map(|(key, values)| {
        let listed: Vec<_> = values.get_ref().iter().map(in_words).collect();
        Variation::new(key, &listed).map_err(|error| source.error(values.span(), &error))
    });
    Ok(Chaos {
        faults_max: raw
            .chaos
            .faults_max
            .and_then(|it| u32::try_from(it.0).ok())
            .unwrap_or(FAULTS_MAX),
        vary: vary.collect::<Result<_, _>>()?,
    })
}

/// A value as it is typed behind `--set`.
fn in_words(value: &toml::Value) -> String {
    value
        .as_str()
        .map_or_else(|| value.to_string(), str::to_owned)
}

/// The least distance between flying drones, over ground or in height.
const SEPARATION_M: f64 = 5.0;
/// An unloaded hop of a 64-byte datagram over 802.11a, as measured with ns-3.
const LATENCY_US: u64 = 231;
/// What a sender's own program adds, at most.
const JITTER_US: u64 = 1_000;
/// How many datagrams wait in a radio: 15 ms of airtime, more than a drone has to say at once.
const QUEUE_MAX: NonZeroUsize = NonZeroUsize::new(64).expect("64 is not 0");
/// A line of sight and some reflections; one of the two shapes that were compared with ns-3.
const NAKAGAMI_M: f64 = 3.0;

fn radio(source: &Source, raw: &Raw) -> Result<sim::Config, BadInput> {
    let radio = &raw.radio;
    let range_m = radio.range_m.0;
    let shape = radio.nakagami_m.as_ref();
    let propagation = match (radio.model, shape) {
        (ModelName::Nakagami, shape) => Propagation::Nakagami {
            range_m,
            shape: shape.map_or(NAKAGAMI_M, |shape| shape.get_ref().0),
        },
        (_, Some(shape)) => {
            let message = "only the model \"nakagami\" has a shape";
            return Err(source.error(shape.span(), message));
        }
        (ModelName::Range, None) => Propagation::Range { range_m },
        (ModelName::Ieee80211a, None) => Propagation::Ieee80211a { range_m },
    };
    let jitter = Duration::from_micros(radio.jitter_us.map_or(JITTER_US, |it| it.0));
    let (latency, queue_max) = (radio.latency_us.as_ref(), radio.queue_max.as_ref());
    let access = match (radio.medium, latency, queue_max) {
        (MediumName::Ideal, latency, None) => {
            let latency_us = latency.map_or(LATENCY_US, |it| it.get_ref().0);
            let latency = Duration::from_micros(latency_us);
            Access::Ideal { latency, jitter }
        }
        (MediumName::Ideal, _, Some(queue_max)) => {
            let message = "on an ideal medium nothing waits, so there is no queue";
            return Err(source.error(queue_max.span(), message));
        }
        (MediumName::Csma, Some(latency), _) => {
            let message = "on a shared medium a frame takes its airtime and its turn, no latency";
            return Err(source.error(latency.span(), message));
        }
        (MediumName::Csma, None, queue_max) => {
            let queue_max = queue_max.and_then(|it| NonZeroUsize::new(to_usize(it.get_ref().0)));
            let queue_max = queue_max.unwrap_or(QUEUE_MAX);
            Access::Csma { jitter, queue_max }
        }
    };
    Ok(sim::Config {
        propagation,
        loss: radio.loss.0,
        bursts: bursts(source, radio)?,
        access,
        datagram_max: wire::DATAGRAM_MAX,
    })
}

/// When links lose frames in bursts, if they do.
fn bursts(source: &Source, radio: &super::raw::Radio) -> Result<Option<Bursts>, BadInput> {
    let (every, length) = match (&radio.burst_every_ms, &radio.burst_ms, &radio.burst_loss) {
        (Some(every), Some(length), _) => (every.get_ref(), length.get_ref()),
        (Some(every), None, _) => {
            let message = "bursts without a length: the field `burst_ms` is missing";
            return Err(source.error(every.span(), message));
        }
        (None, Some(length), _) => {
            let message =
                "bursts without a time between them: the field `burst_every_ms` is missing";
            return Err(source.error(length.span(), message));
        }
        (None, None, Some(loss)) => {
            let message = "a loss in bursts, and there are no bursts";
            return Err(source.error(loss.span(), message));
        }
        (None, None, None) => return Ok(None),
    };
    let loss = radio.burst_loss.as_ref().map_or(1.0, |it| it.get_ref().0);
    // Where nothing is lost in bursts, nothing is drawn for them either.
    Ok((loss > 0.0).then(|| Bursts {
        every: Duration::from_millis(every.0),
        length: Duration::from_millis(length.0),
        loss,
    }))
}

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
    let milliseconds = |value: Option<super::raw::Milliseconds>, default: u64| {
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
        beacon: milliseconds(raw.protocol.beacon_ms, set.beacon),
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

pub(super) fn to_usize(value: u64) -> usize {
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
    let place = |relay: &Spanned<super::raw::Relay>| {
        let relay = relay.get_ref();
        Ned::new(relay.north_m.0, relay.east_m.0, -relay.altitude_m.0)
    };
    Ok(raw.relays.iter().map(place).collect())
}
