use std::num::NonZeroUsize;
use std::path::Path;
use std::time::Duration;

use muster_machines::wire;
use muster_runtime::agents::Agents;
use muster_runtime::diagnostic::BadInput;
use muster_runtime::plan::file::{Override, Source};
use muster_runtime::plan::raw::{self, FormationKind, MediumName, ModelName, Raw};
use muster_runtime::plan::separation::{refuses_unreached, unreached_error};
use muster_runtime::plan::{build_plan, to_usize};
use muster_runtime::vehicle::VehicleKind;
use muster_transport::sim::{self, Access, Bursts, Propagation};

use super::faults::faults;
use super::shipped::{self, scenario_file, shown};
use super::{Chaos, Scenario, Variation};
use crate::controllers::Aircraft;

/// Reads a scenario and its mission; `overrides` replace fields of the file. A name without a folder and a dot is that of a
/// shipped scenario.
///
/// # Errors
/// If a file can't be used. The error names the file, shows the place and tells what is accepted.
pub fn load(path: &Path, overrides: &[Override]) -> Result<Scenario, BadInput> {
    load_for(path, overrides, &shipped::read, Some(Agents::installed()))
}

/// As [`load`], with each file's text from `read`.
///
/// # Errors
/// Those of [`load`] and of `read`.
pub fn load_from(
    path: &Path,
    overrides: &[Override],
    read: &dyn Fn(&Path) -> Result<String, BadInput>,
) -> Result<Scenario, BadInput> {
    with_others(path, overrides, (read, Some(Agents::installed())))
}

/// As [`load`], with each file's text from `read`, and with these agents instead of the program's. `None` accepts any name;
/// the agent is given later
/// ([`PlannedAgent::replace`](muster_runtime::agents::PlannedAgent::replace)).
///
/// # Errors
/// Those of [`load`] and of `read`.
pub fn load_for(
    path: &Path,
    overrides: &[Override],
    read: &dyn Fn(&Path) -> Result<String, BadInput>,
    agents: Option<&Agents>,
) -> Result<Scenario, BadInput> {
    with_others(&scenario_file(path)?, overrides, (read, agents))
}

/// A scenario with its other swarms.
fn with_others(
    path: &Path,
    overrides: &[Override],
    (read, agents): Inputs<'_>,
) -> Result<Scenario, BadInput> {
    let source = Source::overridden(path, read(path)?, overrides)?;
    let raw = source.parse()?;
    let mut scenario = alone(path, (&source, &raw), overrides, (read, agents))?;
    for joins in &raw.swarms {
        let swarm = other((&source, &raw), joins, (read, agents))?;
        let radio = scenario.radio;
        scenario.draws_places |= swarm.draws_places;
        scenario
            .others
            .push((Scenario { radio, ..swarm }, joins.into()));
    }
    Ok(scenario)
}

/// Where files are read from, and the agents that they may name.
type Inputs<'a> = (
    &'a dyn Fn(&Path) -> Result<String, BadInput>,
    Option<&'a Agents>,
);

/// The scenario of another swarm, with the seed and the separation of the file that names it.
fn other(
    (source, own): (&Source, &Raw),
    joins: &raw::Swarm,
    (read, agents): Inputs<'_>,
) -> Result<Scenario, BadInput> {
    let file = &joins.scenario;
    let path = source.resolve("swarms", file.get_ref());
    let text = scenario_file(&path).and_then(|path| Ok((read(&path)?, path)));
    let (text, path) = text.map_err(|error| source.error(file.span(), &error.to_string()))?;
    if let (Some(span), Some(duration)) = (joins.after_s.span(), own.limits.duration_s)
        && joins.after_s.0 >= duration.0
    {
        let message = format!(
            "the run ends before, at `limits.duration_s` = {}",
            duration.0
        );
        return Err(source.error(span, &message));
    }
    let others = Source::new(&path, text);
    let mut raw = others.parse()?;
    *raw.seed.get_mut() = *own.seed.get_ref();
    raw.limits.separation_horizontal_m = own.limits.separation_horizontal_m.clone();
    raw.limits.separation_vertical_m = own.limits.separation_vertical_m.clone();
    for (field, has_entries) in [
        ("swarms", !raw.swarms.is_empty()),
        ("faults", !raw.faults.is_empty()),
    ] {
        if has_entries {
            let message = format!("{} has `{field}` of its own", path.display());
            return Err(source.error(file.span(), &message));
        }
    }
    alone(&path, (&others, &raw), &[], (read, agents))
}

/// A scenario without its other swarms.
fn alone(
    path: &Path,
    (source, raw): (&Source, &Raw),
    overrides: &[Override],
    (read, agents): Inputs<'_>,
) -> Result<Scenario, BadInput> {
    let plan = build_plan((source, raw), read, agents)?;
    let faults = faults(source, raw, plan.waypoints.len())?;
    let scenario = Scenario {
        name: shown(path).display().to_string(),
        overrides: overrides
            .iter()
            .filter(|change| !change.is_seed())
            .cloned()
            .collect(),
        seed: raw.seed.get_ref().0,
        draws_places: draws_places(raw),
        plan,
        radio: radio(source, raw)?,
        aircraft: aircraft(source, raw)?,
        faults,
        chaos: chaos(source, raw)?,
        unchecked: false,
        others: Vec::new(),
    };
    if refuses_unreached(raw, scenario.plan.layout.layering())
        && let Some(apart) = scenario.unreached()
    {
        return Err(unreached_error((source, raw), &apart, ""));
    }
    Ok(scenario)
}

/// Whether the seed of the run decides the places of a formation.
fn draws_places(raw: &Raw) -> bool {
    let own = (raw.formation.kind, raw.formation.seed.is_some());
    let changes = raw.changes.iter().map(|it| (it.kind, it.seed.is_some()));
    std::iter::once(own)
        .chain(changes)
        .any(|(kind, has_seed)| kind == FormationKind::Random && !has_seed)
}

fn aircraft(source: &Source, raw: &Raw) -> Result<Aircraft, BadInput> {
    let Some(aircraft) = &raw.aircraft else {
        return Ok(Aircraft::default());
    };
    if VehicleKind::from(raw.vehicle.kind) != VehicleKind::Msp {
        let message = "only a `vehicle.kind = \"msp\"` has such an aircraft";
        return Err(source.error(aircraft.span(), message));
    }
    Ok(aircraft.get_ref().into())
}

/// What a search may choose.
fn chaos(source: &Source, raw: &Raw) -> Result<Chaos, BadInput> {
    let vary = raw.chaos.vary.iter().map(|(key, values)| {
        let listed: Vec<_> = values.get_ref().iter().map(override_value).collect();
        let variation = Variation::new(key, &listed).map(Variation::in_file);
        variation.map_err(|error| source.error(values.span(), &error))
    });
    Ok(Chaos {
        faults_max: u32::try_from(raw.chaos.faults_max.0).unwrap_or(u32::MAX),
        vary: vary.collect::<Result<_, _>>()?,
    })
}

/// A value as it is given to `--set`.
fn override_value(value: &toml::Value) -> String {
    value
        .as_str()
        .map_or_else(|| value.to_string(), str::to_owned)
}

fn radio(source: &Source, raw: &Raw) -> Result<sim::Config, BadInput> {
    let radio = &raw.radio;
    let range_m = radio.range_m.0;
    let propagation = match (radio.model, radio.nakagami_m.span()) {
        (ModelName::Nakagami, _) => Propagation::Nakagami {
            range_m,
            shape: radio.nakagami_m.0,
        },
        (_, Some(span)) => {
            let message = "only the model \"nakagami\" has a shape";
            return Err(source.error(span, message));
        }
        (ModelName::Range, None) => Propagation::Range { range_m },
        (ModelName::Ieee80211a, None) => Propagation::Ieee80211a { range_m },
    };
    let jitter = Duration::from_micros(radio.jitter_us.0);
    let access = match radio.medium {
        MediumName::Ideal => {
            if let Some(span) = radio.queue_max.span() {
                let message = "only the medium \"csma\" has a queue";
                return Err(source.error(span, message));
            }
            let latency = Duration::from_micros(radio.latency_us.0);
            Access::Ideal { latency, jitter }
        }
        MediumName::Csma => {
            if let Some(span) = radio.latency_us.span() {
                let message = "only the medium \"ideal\" has a latency; with \"csma\" it follows from airtime and access";
                return Err(source.error(span, message));
            }
            let queue_max = NonZeroUsize::new(to_usize(radio.queue_max.0));
            let queue_max = queue_max.expect("read as a number from 1");
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

/// The bursts of losses on links; `None` if there are none.
fn bursts(source: &Source, radio: &raw::Radio) -> Result<Option<Bursts>, BadInput> {
    let loss = &radio.burst_loss;
    let (every, length) = match (&radio.burst_every_ms, &radio.burst_ms, loss.span()) {
        (Some(every), Some(length), _) => (every.get_ref(), length.get_ref()),
        (Some(every), None, _) => {
            let message = "`burst_every_ms` needs `burst_ms`";
            return Err(source.error(every.span(), message));
        }
        (None, Some(length), _) => {
            let message = "`burst_ms` needs `burst_every_ms`";
            return Err(source.error(length.span(), message));
        }
        (None, None, Some(span)) => {
            let message = "`burst_loss` needs `burst_every_ms` and `burst_ms`";
            return Err(source.error(span, message));
        }
        (None, None, None) => return Ok(None),
    };
    let loss = loss.0;
    // Without losses no random number is drawn for bursts.
    Ok((loss > 0.0).then(|| Bursts {
        every: Duration::from_millis(every.0),
        length: Duration::from_millis(length.0),
        loss,
    }))
}
