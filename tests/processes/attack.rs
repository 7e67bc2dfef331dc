//! Hostile traffic to the leader of a flying swarm, at the full rate of this machine. Every datagram must be counted by the
//! layer that dropped it, and genuine frames must get through.

use std::collections::BTreeMap;
use std::fs;
use std::net::{SocketAddr, UdpSocket};
use std::ops::RangeInclusive;
use std::path::Path;
use std::time::{Duration, Instant};

use muster_machines::identity::{NodeId, SwarmId};
use muster_machines::wire::{self, DATAGRAM_MAX, Header};
use serde_json::{Value, json};

use super::fleet::{Fleet, MASTER, Process, SCENARIO, replace};

/// The drones other than the leader.
const OTHERS: [u32; 4] = [0, 1, 3, 4];
/// Duration of the measurement before the attack. Each drone sends ten frames a second.
const CALM: Duration = Duration::from_secs(2);
/// Number of different datagrams of each kind, which are sent repeatedly.
const VARIANTS: usize = 1_024;

/// Kinds of hostile datagrams.
const KINDS: [&str; 7] = [
    "random bytes",
    "truncated frames",
    "replayed frames",
    "oversized",
    "forged in members' names",
    "of another swarm",
    "of strangers",
];

/// Result of an attack.
#[derive(Debug)]
pub(crate) struct Outcome {
    /// Hostile datagrams sent, by kind.
    pub(crate) sent: [(&'static str, u64); 7],
    /// Duration of the attack.
    pub(crate) duration: Duration,
    /// Datagrams that the leader dropped during the attack, by reason: frames refused, too long, dropped by the kernel.
    pub(crate) counted: BTreeMap<String, u64>,
    /// Frames that it admitted during the attack.
    pub(crate) let_in: u64,
    /// Bounds of the genuine frames sent during the attack; a range, since the drones are not queried at the same time.
    pub(crate) genuine: RangeInclusive<u64>,
    /// Smallest possible share of genuine frames that were admitted: before and during the attack.
    pub(crate) delivery: [f64; 2],
    /// Memory of the leader's process in KiB: before the attack, and its peak.
    pub(crate) memory_kib: [u64; 2],
    /// Exit code of each process.
    pub(crate) exit_codes: Vec<Option<i32>>,
    /// The ballots that each drone accepted, in order.
    pub(crate) ballots: Vec<Vec<Value>>,
    /// Orders that a mission refused.
    pub(crate) orders_refused: u64,
}

impl Outcome {
    /// Number of hostile datagrams sent.
    pub(crate) fn hostile(&self) -> u64 {
        self.sent.iter().map(|(_, n)| n).sum()
    }

    /// Number of datagrams that the leader counted.
    pub(crate) fn accounted(&self) -> u64 {
        self.let_in + self.counted.values().sum::<u64>()
    }

    /// Whether the leader counted all hostile and genuine datagrams.
    pub(crate) fn is_balanced(&self) -> bool {
        let genuine = self.accounted().checked_sub(self.hostile());
        genuine.is_some_and(|n| self.genuine.contains(&n))
    }
}

/// Counters of a drone's incoming datagrams.
struct Tally {
    counted: BTreeMap<String, u64>,
    let_in: u64,
    received: u64,
}

impl Tally {
    fn of(status: &Value) -> Self {
        let number = |value: &Value| value.as_u64().unwrap();
        let sum = |table: &Value| table.as_object().unwrap().values().map(number).sum();
        let dropped = status["frames"]["dropped"].as_object().unwrap();
        let mut counted: BTreeMap<_, _> = (dropped.iter())
            .map(|(reason, n)| (reason.clone(), number(n)))
            .collect();
        let datagrams = &status["datagrams"];
        counted.insert("too_long".to_owned(), number(&datagrams["too_long"]));
        let overflowed = datagrams["overflowed"].as_u64();
        let overflowed = overflowed.expect("Linux reports its drops");
        counted.insert("dropped by the kernel".to_owned(), overflowed);
        Self {
            counted,
            let_in: sum(&status["frames"]["let_in"]),
            received: number(&datagrams["received"]),
        }
    }

    fn since(mut self, before: &Self) -> Self {
        for (reason, n) in &mut self.counted {
            *n -= before.counted.get(reason).unwrap_or(&0);
        }
        self.let_in -= before.let_in;
        self.received -= before.received;
        self
    }

    /// Whether all received datagrams are handled.
    fn is_settled(&self) -> bool {
        let unread = ["too_long", "dropped by the kernel"];
        let read = self
            .counted
            .iter()
            .filter(|(it, _)| !unread.contains(&&***it));
        self.received == self.let_in + read.map(|(_, n)| n).sum::<u64>()
    }

    fn total(&self) -> u64 {
        self.let_in + self.counted.values().sum::<u64>()
    }
}

/// Parameters of an attack: volleys at full rate, with a pause after each.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Attack {
    /// Number of volleys.
    pub(crate) volleys: u64,
    /// Datagrams of a volley.
    pub(crate) datagrams: u64,
    /// Pause after a volley.
    pub(crate) pause: Duration,
}

/// Flies a mission with policy `flood`, in which all frames are broadcasts, and attacks the master in flight.
pub(crate) fn fly(attack: Attack) -> Outcome {
    let fleet = Fleet::new();
    let tap = UdpSocket::bind("127.0.0.1:0").unwrap();
    prepare(&fleet, &tap);
    let mut drones = fleet.fly();
    let in_flight = json!({ "State": { "MovingToWaypoint": { "waypoint": 1 } } });
    drones[MASTER as usize].wait_for_mission(&in_flight);
    let recorded = record(&tap);

    let sent_least = sent_by_others(&fleet).0;
    let at_first = Tally::of(&fleet.status(MASTER));
    std::thread::sleep(CALM);
    let hostile_datagrams = hostile_datagrams(&recorded);
    let (least_before, sent_most) = sent_by_others(&fleet);
    let memory_before = drones[MASTER as usize].memory_kib("VmRSS");
    let before = Tally::of(&fleet.status(MASTER));
    let calm = delivery(before.let_in - at_first.let_in, sent_most - sent_least);
    let most_before = sent_by_others(&fleet).1;

    let (sent, duration) = send_all(&fleet.address(MASTER), &hostile_datagrams, attack);
    let hostile: u64 = sent.iter().map(|(_, n)| n).sum();

    let least_after = sent_by_others(&fleet).0;
    let genuine_least = least_after - most_before;
    let status = fleet.wait_for_status(MASTER, "all datagrams handled", |status| {
        let tally = Tally::of(status).since(&before);
        tally.is_settled() && tally.total() >= hostile + genuine_least
    });
    let genuine_most = sent_by_others(&fleet).1 - least_before;
    let memory_after = drones[MASTER as usize].memory_kib("VmHWM");
    let tally = Tally::of(&status).since(&before);
    let orders_refused = (0..5).map(|id| {
        let refused = &fleet.status(id)["frames"]["orders_refused"];
        refused.as_u64().unwrap()
    });
    let orders_refused = orders_refused.sum();
    Outcome {
        sent,
        duration,
        let_in: tally.let_in,
        delivery: [calm, delivery(tally.let_in, genuine_most)],
        counted: tally.counted,
        genuine: genuine_least..=genuine_most,
        memory_kib: [memory_before, memory_after],
        exit_codes: drones.iter_mut().map(Process::end).collect(),
        ballots: drones.iter().map(Process::ballots).collect(),
        orders_refused,
    }
}

#[expect(clippy::cast_precision_loss, reason = "a few hundred frames")]
fn delivery(let_in: u64, sent: u64) -> f64 {
    let_in as f64 / sent as f64
}

/// Changes the scenario, and adds the attacker to the peers in the drones' files, so that it receives their frames.
fn prepare(fleet: &Fleet, tap: &UdpSocket) {
    let scenario = fs::read_to_string(SCENARIO).unwrap();
    let mission = fleet.path("mission.waypoints").display().to_string();
    let scenario = scenario
        .replace("../missions/hop.waypoints", &mission)
        .replace("policy = \"tree\"", "policy = \"flood\"\nperiod_ms = 100")
        .replace("parameters = \"fast\"\n", "");
    fs::write(fleet.path("scenario.toml"), scenario).unwrap();
    // Its first leg becomes a hundred metres long, so that it lasts as long as the attack.
    let hop = SCENARIO.replace("hardware/swarm-short.toml", "missions/hop.waypoints");
    fs::copy(hop, &mission).unwrap();
    replace(
        Path::new(&mission),
        "41.76518000\t-0.81500000",
        "41.76590000\t-0.81500000",
    );
    let tap = tap.local_addr().unwrap();
    for id in 0..5 {
        let file = fleet.file(id);
        replace(&file, SCENARIO, "scenario.toml");
        replace(&file, "peers = [", &format!("peers = [\"{tap}\", "));
    }
}

/// Records frames of the other drones.
fn record(tap: &UdpSocket) -> Vec<Vec<u8>> {
    tap.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
    let mut recorded = Vec::new();
    while recorded.len() < 100 {
        let mut buffer = [0; DATAGRAM_MAX];
        let len = tap.recv(&mut buffer).unwrap();
        let frame = wire::decode_frame(&buffer[..len]).unwrap();
        // The master ignores its own frames.
        if frame.header.sender != NodeId(MASTER) {
            recorded.push(buffer[..len].to_vec());
        }
    }
    recorded
}

/// Frames that the other drones have sent, counted twice in a row, as bounds for the time in between.
fn sent_by_others(fleet: &Fleet) -> (u64, u64) {
    let sent = |id| {
        let status = fleet.status(id);
        let kinds = status["frames"]["sent"].as_object().unwrap().clone();
        let of_kind =
            |kind: &Value| kind["news"].as_u64().unwrap() + kind["keep_alives"].as_u64().unwrap();
        kinds.values().map(of_kind).sum::<u64>()
    };
    let all = || OTHERS.map(sent).iter().sum();
    (all(), all())
}

/// A reproducible random generator.
struct Rng(u64);

impl Rng {
    fn next(&mut self) -> u64 {
        // SplitMix64: Steele, Lea and Flood, "Fast splittable pseudorandom number generators", 2014.
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, bound: usize) -> usize {
        usize::try_from(self.next() % bound as u64).unwrap()
    }

    fn bytes(&mut self, len: usize) -> Vec<u8> {
        (0..len).map(|_| self.next().to_le_bytes()[0]).collect()
    }
}

/// The hostile datagrams of each kind, made from recorded frames.
fn hostile_datagrams(recorded: &[Vec<u8>]) -> [Vec<Vec<u8>>; 7] {
    let mut rng = Rng(1);
    std::array::from_fn(|kind| {
        let variants = 0..VARIANTS;
        let datagrams = variants.map(|nth| {
            let genuine = &recorded[nth % recorded.len()];
            let header = wire::decode_frame(genuine).unwrap().header;
            let later = u64::try_from(nth).unwrap() * 100;
            match kind {
                0 => {
                    let len = rng.below(DATAGRAM_MAX);
                    rng.bytes(len)
                }
                1 => genuine[..rng.below(genuine.len())].to_vec(),
                2 => genuine.clone(),
                3 => {
                    let len = DATAGRAM_MAX + 1 + rng.below(7_000);
                    rng.bytes(len)
                }
                4 => altered(genuine, |it| it.counter += 1 + later),
                5 => altered(genuine, |it| it.swarm = SwarmId(it.swarm.0 + 1)),
                _ => altered(genuine, |it| {
                    it.sender = NodeId(5 + u32::try_from(nth).unwrap());
                    it.counter = header.counter + later;
                }),
            }
        });
        datagrams.collect()
    })
}

/// A frame with a changed header and its original signature.
fn altered(genuine: &[u8], alter: impl FnOnce(&mut Header)) -> Vec<u8> {
    let frame = wire::decode_frame(genuine).unwrap();
    let mut header = frame.header;
    alter(&mut header);
    let mut altered = wire::encode_covered(&header, frame.payload);
    altered.extend_from_slice(frame.authenticator);
    altered
}

/// Sends all kinds in turn. Datagrams that the kernel refuses are not counted. Returns the counts and the duration.
fn send_all(
    at: &str,
    datagrams: &[Vec<Vec<u8>>; 7],
    attack: Attack,
) -> ([(&'static str, u64); 7], Duration) {
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    let target: SocketAddr = at.parse().unwrap();
    let mut sent = KINDS.map(|kind| (kind, 0));
    let began = Instant::now();
    let mut nth = 0;
    for volley in 1..=attack.volleys {
        while sent.iter().map(|(_, n)| n).sum::<u64>() < volley * attack.datagrams {
            let variant = nth / KINDS.len() % VARIANTS;
            let kind = nth % KINDS.len();
            if socket.send_to(&datagrams[kind][variant], target).is_ok() {
                sent[kind].1 += 1;
            }
            nth += 1;
        }
        std::thread::sleep(attack.pause);
    }
    (sent, began.elapsed())
}
