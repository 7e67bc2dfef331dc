use std::num::NonZeroUsize;
use std::path::Path;
use std::time::Duration;

use muster_machines::wire;
use muster_runtime::diagnostic::{BadInput, read_text};
use muster_runtime::plan::file::{Override, Source};
use muster_runtime::plan::raw::{self, MediumName, ModelName, Raw};
use muster_runtime::plan::{put_together, to_usize};
use muster_transport::sim::{self, Access, Bursts, Propagation};

use super::exposure::check_followers;
use super::faults::faults;
use super::{Chaos, Scenario, Variation};

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

/// The swarm of a file named by another one, whose seed and separation count for both.
fn other(
    (source, own): (&Source, &Raw),
    joins: &raw::Swarm,
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
    let plan = put_together(path, (source, raw), read)?;
    let faults = faults(source, raw, plan.waypoints.len())?;
    let scenario = Scenario {
        name: path.display().to_string(),
        overrides: overrides
            .iter()
            .filter(|change| !change.is_seed())
            .cloned()
            .collect(),
        seed: raw.seed.get_ref().0,
        plan,
        radio: radio(source, raw)?,
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
fn bursts(source: &Source, radio: &raw::Radio) -> Result<Option<Bursts>, BadInput> {
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
