//! Hostile traffic at the rate that this machine can send, to the drone that leads a swarm in flight, and what becomes of
//! it: every datagram is to be counted by whoever dropped it, and what the others say is to get through.

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

/// Five drones; the others talk to the one that leads.
const OTHERS: [u32; 4] = [0, 1, 3, 4];
/// For how long delivery is measured before the attack: each drone speaks ten times a second.
const CALM: Duration = Duration::from_secs(2);
/// How many datagrams of a kind are made; they are sent again and again.
const VARIANTS: usize = 1_024;

/// What is sent, by kind.
const KINDS: [&str; 7] = [
    "random bytes",
    "truncated frames",
    "replayed frames",
    "oversized",
    "forged in members' names",
    "of another swarm",
    "of strangers",
];

/// What became of an attack.
#[derive(Debug)]
pub(crate) struct Outcome {
    /// Datagrams that were sent, by kind.
    pub(crate) sent: [(&'static str, u64); 7],
    /// How long that took.
    pub(crate) lasted: Duration,
    /// What the drone counted meanwhile: frames not let in by reason, too long, lost by the system.
    pub(crate) counted: BTreeMap<String, u64>,
    /// Frames that it let in meanwhile.
    pub(crate) let_in: u64,
    /// Frames that the other drones sent meanwhile: they are not asked at the very same time.
    pub(crate) genuine: RangeInclusive<u64>,
    /// The share of those that were let in, at least: before the attack, and while it lasted.
    pub(crate) delivery: [f64; 2],
    /// The memory of the drone's process: before the attack, and the most until after it, in KiB.
    pub(crate) memory_kib: [u64; 2],
    /// How each process ended.
    pub(crate) exit_codes: Vec<Option<i32>>,
    /// Whom each drone obeyed, in order.
    pub(crate) leader: Vec<Vec<Value>>,
    /// Orders that a mission could not read or not obey.
    pub(crate) orders_refused: u64,
}

impl Outcome {
    /// All that was sent to the drone in hostile intent.
    pub(crate) fn hostile(&self) -> u64 {
        self.sent.iter().map(|(_, n)| n).sum()
    }

    /// All that the drone accounts for.
    pub(crate) fn accounted(&self) -> u64 {
        self.let_in + self.counted.values().sum::<u64>()
    }

    /// Whether that is what was sent, by friend and foe.
    pub(crate) fn is_balanced(&self) -> bool {
        let friends = self.accounted().checked_sub(self.hostile());
        friends.is_some_and(|n| self.genuine.contains(&n))
    }
}

/// What a drone has counted of what came in.
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
        let overflowed = overflowed.expect("Linux tells what it dropped");
        counted.insert("lost by the system".to_owned(), overflowed);
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

    /// Whether all that was taken in was looked at.
    fn is_settled(&self) -> bool {
        let unread = ["too_long", "lost by the system"];
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

/// How an attack is made: in volleys, each as fast as this machine can send, with a pause behind each.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Attack {
    /// How many volleys.
    pub(crate) volleys: u64,
    /// How many datagrams each has.
    pub(crate) datagrams: u64,
    /// How long the pauses are.
    pub(crate) pause: Duration,
}

/// Flies a mission by policy `flood`, in which all that a drone says is for all, and attacks the master in mid-flight.
pub(crate) fn fly(attack: Attack) -> Outcome {
    let fleet = Fleet::new();
    let ear = UdpSocket::bind("127.0.0.1:0").unwrap();
    prepare(&fleet, &ear);
    let mut drones = fleet.fly();
    let under_way = json!({ "State": { "MovingToWaypoint": { "waypoint": 1 } } });
    drones[MASTER as usize].wait_for_mission(&under_way);
    let heard = eavesdrop(&ear);

    let sent_least = sent_by_others(&fleet).0;
    let at_first = Tally::of(&fleet.status(MASTER));
    std::thread::sleep(CALM);
    let ammunition = ammunition(&heard);
    let (least_before, sent_most) = sent_by_others(&fleet);
    let memory_before = drones[MASTER as usize].memory_kib("VmRSS");
    let before = Tally::of(&fleet.status(MASTER));
    let calm = delivery(before.let_in - at_first.let_in, sent_most - sent_least);
    let most_before = sent_by_others(&fleet).1;

    let (sent, lasted) = shoot(&fleet.address(MASTER), &ammunition, attack);
    let hostile: u64 = sent.iter().map(|(_, n)| n).sum();

    let least_after = sent_by_others(&fleet).0;
    let genuine_least = least_after - most_before;
    let status = fleet.wait_for_status(MASTER, "done with all of it", |status| {
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
        lasted,
        let_in: tally.let_in,
        delivery: [calm, delivery(tally.let_in, genuine_most)],
        counted: tally.counted,
        genuine: genuine_least..=genuine_most,
        memory_kib: [memory_before, memory_after],
        exit_codes: drones.iter_mut().map(Process::end).collect(),
        leader: drones.iter().map(Process::leader).collect(),
        orders_refused,
    }
}

#[expect(clippy::cast_precision_loss, reason = "a few hundred frames")]
fn delivery(let_in: u64, sent: u64) -> f64 {
    let_in as f64 / sent as f64
}

/// The drones' files name the attacker among the peers, which is how it hears them.
fn prepare(fleet: &Fleet, ear: &UdpSocket) {
    let scenario = fs::read_to_string(SCENARIO).unwrap();
    let mission = fleet.path("mission.waypoints").display().to_string();
    let scenario = scenario
        .replace("../missions/hop.waypoints", &mission)
        .replace("policy = \"tree\"", "policy = \"flood\"\nperiod_ms = 100")
        .replace("parameters = \"fast\"\n", "");
    fs::write(fleet.path("scenario.toml"), scenario).unwrap();
    // Its first leg is a hundred metres long, which takes as long as the attack does.
    let hop = SCENARIO.replace("hardware/swarm-short.toml", "missions/hop.waypoints");
    fs::copy(hop, &mission).unwrap();
    replace(
        Path::new(&mission),
        "41.76518000\t-0.81500000",
        "41.76590000\t-0.81500000",
    );
    let ear = ear.local_addr().unwrap();
    for id in 0..5 {
        let file = fleet.file(id);
        replace(&file, SCENARIO, "scenario.toml");
        replace(&file, "peers = [", &format!("peers = [\"{ear}\", "));
    }
}

/// Frames of all drones, as they come in for somebody who is none of them.
fn eavesdrop(ear: &UdpSocket) -> Vec<Vec<u8>> {
    ear.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
    let mut heard = Vec::new();
    while heard.len() < 100 {
        let mut buffer = [0; DATAGRAM_MAX];
        let len = ear.recv(&mut buffer).unwrap();
        let frame = wire::decode_frame(&buffer[..len]).unwrap();
        // A frame of its own tells the master nothing that it did not know.
        if frame.header.sender != NodeId(MASTER) {
            heard.push(buffer[..len].to_vec());
        }
    }
    heard
}

/// How many frames the other drones have sent: before they were asked, and after.
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

/// Numbers that look like chance, the same each time.
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

/// The datagrams of each kind, made of what was heard.
fn ammunition(heard: &[Vec<u8>]) -> [Vec<Vec<u8>>; 7] {
    let mut rng = Rng(1);
    std::array::from_fn(|kind| {
        let variants = 0..VARIANTS;
        let datagrams = variants.map(|nth| {
            let genuine = &heard[nth % heard.len()];
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

/// A frame with another header, and the signature that it had.
fn altered(genuine: &[u8], alter: impl FnOnce(&mut Header)) -> Vec<u8> {
    let frame = wire::decode_frame(genuine).unwrap();
    let mut header = frame.header;
    alter(&mut header);
    let mut altered = wire::encode_covered(&header, frame.payload, Vec::new());
    altered.extend_from_slice(frame.authenticator);
    altered
}

/// Sends the kinds in turn; what the system did not take is not counted.
fn shoot(
    at: &str,
    ammunition: &[Vec<Vec<u8>>; 7],
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
            if socket.send_to(&ammunition[kind][variant], target).is_ok() {
                sent[kind].1 += 1;
            }
            nth += 1;
        }
        std::thread::sleep(attack.pause);
    }
    (sent, began.elapsed())
}
