//! A drone's status as OpenMetrics text.

use std::fmt;

use prometheus_client::collector::Collector;
use prometheus_client::encoding::{DescriptorEncoder, EncodeMetric, text};
use prometheus_client::metrics::MetricType;
use prometheus_client::metrics::counter::ConstCounter;
use prometheus_client::metrics::gauge::ConstGauge;
use prometheus_client::registry::Registry;

use super::state::STATES;
use crate::status::{ActorStatus, PortState, Role, Status};

/// Renders a status.
///
/// # Errors
/// None is expected: the text is written to memory.
pub(super) fn page(status: Status) -> Result<String, fmt::Error> {
    let mut registry = Registry::with_prefix("muster");
    registry.register_collector(Box::new(Snapshot(status)));
    let mut page = String::new();
    text::encode(&mut page, &registry)?;
    Ok(page)
}

/// A status as a source of metrics. It counts nothing itself.
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
        computer(status, page)?;
        swarm(status, page)?;
        vehicle(status, page)?;
        port(status, page)?;
        actors(status, page)?;
        agent(status, page)?;
        frames(status, page)?;
        datagrams(status, page)
    }
}

/// 1 for true, 0 for false.
fn flag(it: bool) -> f64 {
    f64::from(u8::from(it))
}

fn process(status: &Status, page: &mut Page<'_>) -> fmt::Result {
    let (drone, swarm) = (status.drone.to_string(), status.swarm.to_string());
    let labels = vec![
        ("drone", &*drone),
        ("swarm", &*swarm),
        ("version", &*status.version),
    ];
    let help = "The drone's number, its swarm, and the version of `musterd`";
    page.gauges(("drone_info", help), [(labels, 1.0)])?;
    let help = "Time since the start of the process";
    page.gauge(("uptime_seconds", help), status.up_s)?;
    let help = "Number of the process's start on this journal, from 1";
    page.gauge(("journal_incarnation", help), f64::from(status.incarnation))?;
    let help = "1 if all five actors run and answer and the journal is written";
    page.gauge(("healthy", help), flag(status.faults.is_empty()))?;
    let help = "Journal records that could not be written";
    page.counter(("journal_unwritten", help), status.journal_unwritten)?;
    let help = "Log lines dropped because the log's reader is too slow";
    page.counter(("log_lines_lost", help), status.log_lines_lost)
}

fn computer(status: &Status, page: &mut Page<'_>) -> fmt::Result {
    let computer = &status.computer;
    let help = "Processor temperature; it and the metrics below are absent if the computer does not report them";
    page.gauge(
        ("computer_temperature_celsius", help),
        computer.temperature_c,
    )?;
    let help = "1 if the supply's voltage is too low";
    page.gauge(
        ("computer_under_voltage", help),
        computer.under_voltage.map(flag),
    )?;
    let help = "1 if the processor is slowed down";
    page.gauge(("computer_throttled", help), computer.throttled.map(flag))?;
    let help = "1 if the supply's voltage was too low since the computer started";
    page.gauge(
        ("computer_had_under_voltage", help),
        computer.had_under_voltage.map(flag),
    )?;
    let help = "1 if the processor was slowed down since the computer started";
    page.gauge(
        ("computer_was_throttled", help),
        computer.was_throttled.map(flag),
    )?;
    let help = "Wear of the card, in tenths";
    page.gauge(("computer_card_wear_ratio", help), computer.card_wear)?;
    let help = "Free space for the journal";
    page.gauge(
        ("computer_free_bytes", help),
        computer.free_bytes.map(|it| it as f64),
    )
}

fn swarm(status: &Status, page: &mut Page<'_>) -> fmt::Result {
    let states = STATES.map(|name| (vec![("state", name)], flag(name == status.state.name)));
    page.gauges(
        (
            "state",
            "State of the mission: 1 for the current state, 0 for the others",
        ),
        states,
    )?;
    let help = "Waypoint that the drone is at or flies to";
    page.gauge(("waypoint", help), status.state.waypoint.map(f64::from))?;
    let roles = Role::ALL.map(|role| (vec![("role", role.name())], flag(role == status.role)));
    page.gauges(
        (
            "role",
            "Role in the swarm: 1 for the current role, 0 for the others",
        ),
        roles,
    )?;
    let ballot = status.ballot.as_ref();
    let help = "Term of the current leader's ballot";
    page.gauge(("ballot_term", help), ballot.map(|it| it.term.into()))?;
    let help = "Rank of the current leader's ballot";
    page.gauge(("ballot_rank", help), ballot.map(|it| it.rank.into()))?;
    let help = "Number of the current leader";
    page.gauge(("ballot_master", help), ballot.map(|it| it.master.into()))?;
    let help = "Hops to the master";
    page.gauge(("hops", help), status.hops.map(f64::from))?;
    let help = "Number of the parent, the next hop to the master";
    page.gauge(("parent", help), status.parent.map(f64::from))?;
    let neighbours = u32::try_from(status.neighbours().count()).unwrap_or(u32::MAX);
    let help = "Drones heard within the last 3 s";
    page.gauge(("neighbours", help), f64::from(neighbours))
}

fn vehicle(status: &Status, page: &mut Page<'_>) -> fmt::Result {
    let vehicle = &status.vehicle;
    let help = "Position north of the mission's home";
    page.gauge(("position_north_meters", help), vehicle.north_m)?;
    let help = "Position east of the mission's home";
    page.gauge(("position_east_meters", help), vehicle.east_m)?;
    let help = "Altitude above the mission's home";
    page.gauge(("altitude_meters", help), vehicle.altitude_m)?;
    let help = "Time since the drone lost its horizontal position; absent while it has one";
    page.gauge(("position_lost_seconds", help), vehicle.position_lost_s)?;
    let help = "Battery charge, from 0 (empty) to 1 (full)";
    page.gauge(("battery_ratio", help), vehicle.charge)?;
    page.gauge(("armed", "1 if the motors are armed"), flag(vehicle.armed))
}

fn port(status: &Status, page: &mut Page<'_>) -> fmt::Result {
    let port = status.port.as_ref();
    let states = port
        .map(|port| PortState::ALL.map(|it| (vec![("state", it.name())], flag(it == port.state))));
    let help = "State of the flight controller's port: 1 for the current state, 0 for the others";
    page.gauges(("port_state", help), states.into_iter().flatten())?;
    let help = "How often the flight controller's port was opened";
    page.counter(("port_opened", help), port.map(|it| it.opened))?;
    let help = "Mean delay of the flight controller's answers since its port was opened last";
    page.gauge(("port_latency_seconds", help), port.map(|it| it.latency_s))?;
    let help = "Longest delay of an answer since the port was opened last";
    let longest_s = port.map(|it| it.latency_max_s);
    page.gauge(("port_latency_max_seconds", help), longest_s)?;
    let help = "Share of questions without an answer since the port was opened last";
    page.gauge(("port_loss_ratio", help), port.map(|it| it.loss))?;
    let help = "Bad frames read since the port was opened last";
    page.gauge(
        ("port_bad_frames", help),
        port.map(|it| it.bad_frames as f64),
    )?;
    let help = "RC frames written";
    page.counter(("rc_frames_sent", help), port.map(|it| it.rc_sent))?;
    let help = "RC frames that the flight controller acknowledged";
    let acknowledged = port.map(|it| it.rc_acknowledged);
    page.counter(("rc_frames_acknowledged", help), acknowledged)?;
    let help = "RC frames written in the last whole second";
    page.gauge(("rc_rate_hertz", help), port.map(|it| it.rc_per_s as f64))?;
    let help = "Longest time between two RC frames while sticks were given";
    page.gauge(("rc_gap_max_seconds", help), port.map(|it| it.rc_gap_max_s))
}

fn actors(status: &Status, page: &mut Page<'_>) -> fmt::Result {
    let all = |value: fn(&ActorStatus) -> f64| {
        let actors = status.actors.iter();
        actors.map(move |(name, actor)| (vec![("actor", &**name)], value(actor)))
    };
    page.gauges(("actor_up", "1 if the actor runs"), all(|it| flag(it.up)))?;
    let help = "Messages in the actor's queue";
    page.gauges(("actor_queue_depth", help), all(|it| it.waiting.into()))?;
    let help = "Size of the actor's queue";
    page.gauges(("actor_queue_limit", help), all(|it| it.waiting_max.into()))?;
    let counts = |value: fn(&ActorStatus) -> u64| {
        let actors = status.actors.iter();
        actors.map(move |(name, actor)| (vec![("actor", &**name)], value(actor)))
    };
    let help = "Failures of the actor";
    page.counters(("actor_failures", help), counts(|it| it.failures))?;
    let help = "Restarts of the actor";
    page.counters(("actor_restarts", help), counts(|it| it.restarts))?;
    let help =
        "Timeouts after which the actor's deadline was still in the past; a defect if above 0";
    page.counters(("actor_overdue", help), counts(|it| it.overdue))?;
    let help = "Messages, without frames, dropped because the actor's queue was full or the actor was down";
    page.counter(("messages_refused", help), status.messages_refused)
}

fn agent(status: &Status, page: &mut Page<'_>) -> fmt::Result {
    let agent = status.agent.as_ref();
    let help = "Calls of the drone's agent that took longer than 50 ms and held up the drone";
    page.counter(("agent_slow_calls", help), agent.map(|it| it.slow_calls))?;
    let help = "Duration of the longest call of the drone's agent";
    let longest_s = agent.map(|it| it.longest_call_s);
    page.gauge(("agent_longest_call_seconds", help), longest_s)
}

fn frames(status: &Status, page: &mut Page<'_>) -> fmt::Result {
    let frames = &status.frames;
    let sent = frames.sent.iter().flat_map(|(kind, sent)| {
        let causes = [("news", sent.news), ("keep_alive", sent.keep_alives)];
        causes.map(|(cause, n)| (vec![("kind", &**kind), ("cause", cause)], n))
    });
    let help = "Frames sent, by kind and cause";
    page.counters(("frames_sent", help), sent)?;
    let accepted = frames.let_in.iter();
    let accepted = accepted.map(|(kind, n)| (vec![("kind", &**kind)], *n));
    page.counters(("frames_let_in", "Frames accepted, by kind"), accepted)?;
    let dropped = frames.dropped.iter();
    let dropped = dropped.map(|(why, n)| (vec![("reason", &**why)], *n));
    page.counters(("frames_dropped", "Frames dropped, by reason"), dropped)?;
    let help = "Frames accepted by the radio and ignored by the routing";
    page.counter(("frames_ignored", help), frames.ignored)?;
    let help = "Orders that the mission could not read or execute";
    page.counter(("orders_refused", help), frames.orders_refused)
}

fn datagrams(status: &Status, page: &mut Page<'_>) -> fmt::Result {
    let datagrams = &status.datagrams;
    let help = "Datagrams given to the system, one for each peer";
    page.counter(("datagrams_sent", help), datagrams.sent)?;
    let help = "Datagrams that the system refused to send";
    page.counter(("datagrams_unsent", help), datagrams.unsent)?;
    let help = "Datagrams received";
    page.counter(("datagrams_received", help), datagrams.received)?;
    let help = "Datagrams dropped because they were too long";
    page.counter(("datagrams_too_long", help), datagrams.too_long)?;
    let help = "Datagrams that the system dropped because its buffers were full";
    page.counter(("datagrams_overflowed", help), datagrams.overflowed)
}
