//! The figures of messages: latency and delivery on a line, a large message, and a sender beyond its budget.

use std::time::Duration;

use bytes::Bytes;
use muster_machines::identity::NodeId;
use muster_machines::routing::{Destination, Outcome, Reliability};
use muster_transport::sim::Config;

use crate::swarm::Swarm;

/// Time in which all that is under way arrives or expires.
const SETTLING: Duration = Duration::from_secs(31);

/// What became of small messages.
#[derive(Debug)]
pub(crate) struct Latency {
    /// Share that arrived, 0 to 1, and share that was acknowledged.
    pub(crate) arrived: f64,
    pub(crate) acknowledged: f64,
    pub(crate) median: Duration,
    pub(crate) p99: Duration,
    pub(crate) longest: Duration,
    /// Number of messages that arrived more than once.
    pub(crate) twice: usize,
    pub(crate) frames: usize,
    pub(crate) over_budget: usize,
}

/// Sends messages of 64 bytes from drone 0 of 15 in line to the leader, one each 100 ms.
pub(crate) fn latency(
    config: Config,
    leader: u32,
    reliability: Reliability,
    count: u32,
    seed: u64,
) -> Latency {
    let mut swarm = Swarm::line(15, leader, config, seed);
    let frames = swarm.frames;
    let mut sent = Vec::new();
    for nth in 0..count {
        let mut payload = nth.to_le_bytes().to_vec();
        payload.resize(64, 0);
        sent.push(swarm.now);
        swarm.send(0, Destination::Leader, reliability, payload.into());
        swarm.run(Duration::from_millis(100));
    }
    let frames = swarm.frames - frames;
    swarm.run(SETTLING);
    let mut times = vec![None; sent.len()];
    let mut twice = 0;
    for got in swarm.got.iter().filter(|got| got.by == NodeId(leader)) {
        let nth = got
            .payload
            .first_chunk()
            .map_or(0, |nth| u32::from_le_bytes(*nth)) as usize;
        twice += usize::from(times[nth].is_some());
        times[nth].get_or_insert(got.at.since(sent[nth]));
    }
    let mut times: Vec<Duration> = times.into_iter().flatten().collect();
    times.sort_unstable();
    let share = |number: usize| number as f64 / f64::from(count);
    let is_delivered = |it: &&(NodeId, u32, Outcome)| it.2 == Outcome::Delivered;
    let quantile = |share: usize| {
        times
            .get(times.len() * share / 100)
            .copied()
            .unwrap_or_default()
    };
    Latency {
        arrived: share(times.len()),
        acknowledged: share(swarm.outcomes.iter().filter(is_delivered).count()),
        median: quantile(50),
        p99: quantile(99),
        longest: times.last().copied().unwrap_or_default(),
        twice,
        frames,
        over_budget: swarm.over_budget,
    }
}

/// What became of a large message.
#[derive(Debug)]
pub(crate) struct Large {
    /// When it arrived whole, after it was sent.
    pub(crate) took: Option<Duration>,
    /// Whether the origin was told so.
    pub(crate) is_acknowledged: bool,
    /// Bytes on the air, for each byte of the message.
    pub(crate) bytes_a_byte: f64,
    pub(crate) over_budget: usize,
}

/// Sends `length` bytes over `hops` hops to the leader.
pub(crate) fn large(config: Config, hops: u32, length: usize, seed: u64) -> Large {
    // The second next drone is beyond the range.
    let mut swarm = Swarm::line(hops + 1, 0, config, seed);
    let payload: Vec<u8> = (0..length).map(|at| (at % 251) as u8).collect();
    let (sent_at, bytes) = (swarm.now, swarm.bytes);
    let to = Destination::Leader;
    swarm.send(hops, to, Reliability::Acknowledged, payload.clone().into());
    for _ in 0..1_200 {
        swarm.run(Duration::from_millis(100));
        if !swarm.outcomes.is_empty() {
            break;
        }
    }
    let whole = swarm.got.iter().find(|got| got.payload == payload);
    Large {
        took: whole.map(|got| got.at.since(sent_at)),
        is_acknowledged: swarm.outcomes.iter().any(|it| it.2 == Outcome::Delivered),
        bytes_a_byte: (swarm.bytes - bytes) as f64 / length as f64,
        over_budget: swarm.over_budget,
    }
}

/// What others lose beside a sender at ten times its budget.
#[derive(Debug)]
pub(crate) struct Beside {
    pub(crate) sent: usize,
    pub(crate) arrived: usize,
    pub(crate) median: Duration,
    /// Messages of the greedy sender that arrived, for each second.
    pub(crate) greedy_hz: f64,
    pub(crate) over_budget: usize,
}

/// Thirteen of 15 drones in line each send one acknowledged message a second to the leader in the middle. If `is_greedy`,
/// drone 4 sends 400 a second, all best effort: ten times its budget.
pub(crate) fn beside(config: Config, is_greedy: bool, seed: u64) -> Beside {
    const SECONDS: u32 = 30;
    const GREEDY: u32 = 4;
    let mut swarm = Swarm::line(15, 7, config, seed);
    let mut sent = Vec::new();
    for tick in 0..SECONDS * 400 {
        if is_greedy {
            let payload = Bytes::from_static(&[1; 64]);
            swarm.send(
                GREEDY,
                Destination::Leader,
                Reliability::BestEffort,
                payload,
            );
        }
        let from = tick * 15 / 400 % 15;
        if tick * 15 % 400 < 15 && from != 7 && from != GREEDY {
            let payload = (sent.len() as u32).to_le_bytes().to_vec();
            sent.push(swarm.now);
            swarm.send(
                from,
                Destination::Leader,
                Reliability::Acknowledged,
                payload.into(),
            );
        }
        swarm.run(Duration::from_micros(2_500));
    }
    swarm.run(SETTLING);
    let greedy = swarm
        .got
        .iter()
        .filter(|got| got.from == NodeId(GREEDY))
        .count();
    let others = swarm.got.iter().filter(|got| got.from != NodeId(GREEDY));
    let mut times: Vec<Duration> = others
        .map(|got| {
            let nth = got
                .payload
                .first_chunk()
                .map_or(0, |nth| u32::from_le_bytes(*nth));
            got.at.since(sent[nth as usize])
        })
        .collect();
    times.sort_unstable();
    Beside {
        sent: sent.len(),
        arrived: times.len(),
        median: times.get(times.len() / 2).copied().unwrap_or_default(),
        greedy_hz: greedy as f64 / f64::from(SECONDS),
        over_budget: swarm.over_budget,
    }
}
