//! What a drone tells of itself, as a page of metrics in the format OpenMetrics.

use std::fmt;

use prometheus_client::collector::Collector;
use prometheus_client::encoding::{DescriptorEncoder, EncodeMetric, text};
use prometheus_client::metrics::MetricType;
use prometheus_client::metrics::counter::ConstCounter;
use prometheus_client::metrics::gauge::ConstGauge;
use prometheus_client::registry::Registry;

use super::state::STATES;
use crate::status::{ActorStatus, Role, Status};

/// The page for one status.
///
/// # Errors
/// Never, as far as anybody knows: text is written to memory.
pub(super) fn page(status: Status) -> Result<String, fmt::Error> {
    let mut registry = Registry::with_prefix("muster");
    registry.register_collector(Box::new(Snapshot(status)));
    let mut page = String::new();
    text::encode(&mut page, &registry)?;
    Ok(page)
}

/// A status as a source of metrics: nothing is counted but where the status has it from.
#[derive(Debug)]
struct Snapshot(Status);

/// A metric's labels and values.
type Labels<'a> = Vec<(&'static str, &'a str)>;

struct Page<'a>(DescriptorEncoder<'a>);

impl Page<'_> {
    fn metric<'a, M: EncodeMetric>(
        &mut self,
        (name, help): (&str, &str),
        kind: MetricType,
        samples: impl IntoIterator<Item = (Labels<'a>, M)>,
    ) -> fmt::Result {
        let mut metric = self.0.encode_descriptor(name, help, None, kind)?;
        for (labels, value) in samples {
            if labels.is_empty() {
                value.encode(metric)?;
                break;
            }
            value.encode(metric.encode_family(&labels)?)?;
        }
        Ok(())
    }

    fn gauges<'a>(
        &mut self,
        described: (&str, &str),
        samples: impl IntoIterator<Item = (Labels<'a>, f64)>,
    ) -> fmt::Result {
        let samples = samples.into_iter();
        let samples = samples.map(|(labels, value)| (labels, ConstGauge::new(value)));
        self.metric(described, MetricType::Gauge, samples)
    }

    fn gauge(&mut self, described: (&str, &str), value: impl Into<Option<f64>>) -> fmt::Result {
        self.gauges(described, value.into().map(|value| (Vec::new(), value)))
    }

    fn counters<'a>(
        &mut self,
        described: (&str, &str),
        samples: impl IntoIterator<Item = (Labels<'a>, u64)>,
    ) -> fmt::Result {
        let samples = samples.into_iter();
        let samples = samples.map(|(labels, value)| (labels, ConstCounter::new(value)));
        self.metric(described, MetricType::Counter, samples)
    }

    fn counter(&mut self, described: (&str, &str), value: impl Into<Option<u64>>) -> fmt::Result {
        self.counters(described, value.into().map(|value| (Vec::new(), value)))
    }
}

impl Collector for Snapshot {
    fn encode(&self, encoder: DescriptorEncoder<'_>) -> fmt::Result {
        let status = &self.0;
        let page = &mut Page(encoder);
        process(status, page)?;
        swarm(status, page)?;
        vehicle(status, page)?;
        actors(status, page)?;
        frames(status, page)?;
        datagrams(status, page)
    }
}

/// 1 for what holds, 0 for what does not.
fn holds(it: bool) -> f64 {
    f64::from(u8::from(it))
}

fn process(status: &Status, page: &mut Page<'_>) -> fmt::Result {
    let (drone, swarm) = (status.drone.to_string(), status.swarm.to_string());
    let labels = vec![
        ("drone", &*drone),
        ("swarm", &*swarm),
        ("version", &*status.version),
    ];
    let help = "Which drone of which swarm this is, and the version of its program";
    page.gauges(("drone_info", help), [(labels, 1.0)])?;
    let help = "For how long the process has run";
    page.gauge(("uptime_seconds", help), status.up_s)?;
    let help = "Which incarnation of the drone's journal this is, from 1";
    page.gauge(("journal_incarnation", help), f64::from(status.incarnation))?;
    let help = "Whether all five actors run and answer, and the journal is written";
    page.gauge(("healthy", help), holds(status.faults.is_empty()))?;
    let help = "Records that could not be written to the journal";
    page.counter(("journal_unwritten", help), status.journal_unwritten)?;
    let help = "Lines of the log that nobody read in time";
    page.counter(("log_lines_lost", help), status.log_lines_lost)
}

fn swarm(status: &Status, page: &mut Page<'_>) -> fmt::Result {
    let states = STATES.map(|name| (vec![("state", name)], holds(name == status.state.name)));
    page.gauges(
        ("state", "What the drone is doing: 1 for one of them"),
        states,
    )?;
    let help = "The waypoint that the drone is at or makes for";
    page.gauge(("waypoint", help), status.state.waypoint.map(f64::from))?;
    let roles = Role::ALL.map(|role| (vec![("role", role.name())], holds(role == status.role)));
    page.gauges(
        ("role", "What the drone is in its swarm: 1 for one of them"),
        roles,
    )?;
    let ballot = status.ballot.as_ref();
    let help = "The term of the ballot that the drone obeys";
    page.gauge(("ballot_term", help), ballot.map(|it| it.term.into()))?;
    let help = "The rank of the ballot that the drone obeys";
    page.gauge(("ballot_rank", help), ballot.map(|it| it.rank.into()))?;
    let help = "The number of the master that the drone obeys";
    page.gauge(("ballot_master", help), ballot.map(|it| it.master.into()))?;
    let help = "How many hops the drone is from its master";
    page.gauge(("hops", help), status.hops.map(f64::from))?;
    let help = "The number of the neighbour through which acknowledgements go";
    page.gauge(("parent", help), status.parent.map(f64::from))?;
    let neighbours = u32::try_from(status.neighbours().count()).unwrap_or(u32::MAX);
    let help = "Drones that were heard within the last seconds";
    page.gauge(("neighbours", help), f64::from(neighbours))
}

fn vehicle(status: &Status, page: &mut Page<'_>) -> fmt::Result {
    let vehicle = &status.vehicle;
    let help = "Where the drone is, north of the mission's home";
    page.gauge(("position_north_meters", help), vehicle.north_m)?;
    let help = "Where the drone is, east of the mission's home";
    page.gauge(("position_east_meters", help), vehicle.east_m)?;
    let help = "Where the drone is, above the mission's home";
    page.gauge(("altitude_meters", help), vehicle.altitude_m)?;
    let help = "Since when the drone has not known where it is over ground; nothing while it knows";
    page.gauge(("position_lost_seconds", help), vehicle.position_lost_s)?;
    let help = "What is left in the battery, as a share of a full one";
    page.gauge(("battery_ratio", help), vehicle.charge)?;
    page.gauge(
        ("armed", "Whether the motors are armed"),
        holds(vehicle.armed),
    )
}

fn actors(status: &Status, page: &mut Page<'_>) -> fmt::Result {
    let all = |value: fn(&ActorStatus) -> f64| {
        let actors = status.actors.iter();
        actors.map(move |(name, actor)| (vec![("actor", &**name)], value(actor)))
    };
    page.gauges(
        ("actor_up", "Whether an actor runs"),
        all(|it| holds(it.up)),
    )?;
    let help = "Messages that wait for an actor";
    page.gauges(("actor_queue_depth", help), all(|it| it.waiting.into()))?;
    let help = "How many messages may wait for an actor";
    page.gauges(("actor_queue_limit", help), all(|it| it.waiting_max.into()))?;
    let counts = |value: fn(&ActorStatus) -> u64| {
        let actors = status.actors.iter();
        actors.map(move |(name, actor)| (vec![("actor", &**name)], value(actor)))
    };
    let help = "How often an actor has failed";
    page.counters(("actor_failures", help), counts(|it| it.failures))?;
    let help = "How often an actor was started again";
    page.counters(("actor_restarts", help), counts(|it| it.restarts))?;
    let help = "How often an actor handled a timeout and had a deadline that was not after it";
    page.counters(("actor_overdue", help), counts(|it| it.overdue))?;
    let help = "Messages, no frames among them, for which an actor had no room or was not there";
    page.counter(("messages_refused", help), status.messages_refused)
}

fn frames(status: &Status, page: &mut Page<'_>) -> fmt::Result {
    let frames = &status.frames;
    let sent = frames.sent.iter().flat_map(|(kind, sent)| {
        let causes = [("news", sent.news), ("keep_alive", sent.keep_alives)];
        causes.map(|(cause, n)| (vec![("kind", &**kind), ("cause", cause)], n))
    });
    let help = "Frames that were sent, by what they carry and why they were";
    page.counters(("frames_sent", help), sent)?;
    let let_in = frames.let_in.iter();
    let let_in = let_in.map(|(kind, n)| (vec![("kind", &**kind)], *n));
    page.counters(
        (
            "frames_let_in",
            "Frames that were let in, by what they carry",
        ),
        let_in,
    )?;
    let dropped = frames.dropped.iter();
    let dropped = dropped.map(|(why, n)| (vec![("reason", &**why)], *n));
    page.counters(
        ("frames_dropped", "Frames that were not let in, by reason"),
        dropped,
    )?;
    let help = "Frames that were let in and of no use to the routing";
    page.counter(("frames_ignored", help), frames.ignored)?;
    let help = "Orders that the mission could not read, or not obey in its state";
    page.counter(("orders_refused", help), frames.orders_refused)
}

fn datagrams(status: &Status, page: &mut Page<'_>) -> fmt::Result {
    let datagrams = &status.datagrams;
    let help = "Datagrams that were handed to the system, one for each peer";
    page.counter(("datagrams_sent", help), datagrams.sent)?;
    let help = "Datagrams that the system did not take";
    page.counter(("datagrams_unsent", help), datagrams.unsent)?;
    let help = "Datagrams that were taken in";
    page.counter(("datagrams_received", help), datagrams.received)?;
    let help = "Datagrams that were dropped unread because they were too long";
    page.counter(("datagrams_too_long", help), datagrams.too_long)?;
    let help = "Datagrams that the system dropped because its buffers were full";
    page.counter(("datagrams_overflowed", help), datagrams.overflowed)
}
