//! Discovery: opens connections to listed peers and to drones whose beacons arrive, and reopens lost ones.

use std::collections::{BTreeMap, VecDeque};
use std::net::{SocketAddr, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use muster_machines::identity::{NodeId, SwarmId};
use muster_machines::time::Timestamp;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use tokio::sync::Notify;
use tokio::task::{AbortHandle, JoinSet};
use tokio::time::sleep;

use super::back_off::BackOff;
use super::beacon::{BEACON_LEN, Beacon, BeaconFilter, Received};
use super::hub::Hub;
use super::rate_limit::{RateLimit, RateLimiter};

/// A connection that lasted this long resets the back-off.
const STABLE_AFTER: Duration = Duration::from_secs(3);

/// Mean period of beacons after the first few.
const BEACON_PERIOD: Duration = Duration::from_secs(1);
/// The first beacons are more frequent, since the whole swarm may just have started.
const FIRST_BEACONS: u32 = 5;
const FIRST_PERIOD: Duration = Duration::from_millis(200);

/// Limits of verified beacon signatures, per address and for all unconnected addresses together. They cost at most a tenth
/// of a processor.
const BEACONS_PER_ADDRESS: RateLimit = RateLimit {
    burst: 128,
    refill: Duration::from_millis(10),
};
const BEACONS_OF_STRANGERS: RateLimit = RateLimit {
    burst: 512,
    refill: Duration::from_millis(1),
};

/// Number of candidate addresses of an unconnected drone; a further one replaces the oldest. To block a drone, an attacker
/// must replay this many different beacons from different addresses within each handshake.
const CANDIDATES_MAX: usize = 8;

/// Head start of the drone with the lower number, to avoid two simultaneous connections.
const HEAD_START: Duration = Duration::from_millis(500);

/// Period of the check for revoked drones.
const REVIEW_PERIOD: Duration = Duration::from_secs(1);

/// A random generator for jitter; not for secrets. `salt` tells the tasks of a drone apart.
fn rng(hub: &Hub, salt: u64) -> ChaCha8Rng {
    let own = u64::from(hub.id.0) << 32;
    ChaCha8Rng::seed_from_u64((hub.clock)().as_nanos() ^ own ^ salt)
}

/// Keeps a connection with an address open, whichever end opened it. Never returns.
pub(super) async fn maintain_connection(hub: Arc<Hub>, address: SocketAddr) {
    let mut rng = rng(&hub, u64::from(address.port()));
    let mut back_off = BackOff::new();
    loop {
        let started = (hub.clock)();
        // The other end may have connected since an attempt of this one failed.
        let drone = match hub.links.drone_at(address) {
            None => hub.connect(address, None).await,
            connected => connected,
        };
        if let Some(drone) = drone {
            until_disconnected(&hub, drone).await;
        }
        back_off_after(&hub, &mut back_off, started, &mut rng).await;
    }
}

/// Waits until there is no connection with a drone, in either direction.
async fn until_disconnected(hub: &Hub, drone: NodeId) {
    while let Some(connection) = hub.links.get(drone) {
        connection.closed().await;
    }
}

/// Waits before the next attempt to connect.
async fn back_off_after(hub: &Hub, back_off: &mut BackOff, started: Timestamp, rng: &mut impl Rng) {
    if (hub.clock)().since(started) >= STABLE_AFTER {
        *back_off = BackOff::new();
    }
    sleep(back_off.wait(rng)).await;
}

/// Connects to a drone at an address on each notification of a beacon, unless they are connected. Never returns.
async fn connect_on_beacon(hub: Arc<Hub>, drone: NodeId, address: SocketAddr, beacon: Arc<Notify>) {
    let mut rng = rng(&hub, u64::from(drone.0) ^ u64::from(address.port()) << 16);
    let mut back_off = BackOff::new();
    loop {
        beacon.notified().await;
        if drone < hub.id && hub.links.get(drone).is_none() {
            sleep(HEAD_START).await;
        }
        if hub.links.get(drone).is_some() {
            continue;
        }
        let started = (hub.clock)();
        hub.connect(address, Some(drone)).await;
        back_off_after(&hub, &mut back_off, started, &mut rng).await;
    }
}

/// Candidate addresses of drones. Dropping it ends its tasks.
#[derive(Default)]
struct Candidates {
    /// Oldest first.
    by_drone: BTreeMap<NodeId, VecDeque<Candidate>>,
    /// One task per candidate.
    tasks: JoinSet<()>,
}

struct Candidate {
    address: SocketAddr,
    beacon: Arc<Notify>,
    task: AbortHandle,
}

impl Candidates {
    /// Handles an accepted beacon, which may be a replay from another address.
    fn beacon_received(&mut self, hub: &Arc<Hub>, drone: NodeId, address: SocketAddr) {
        while self.tasks.try_join_next().is_some() {}
        let candidates = self.by_drone.entry(drone).or_default();
        if let Some(candidate) = candidates.iter().find(|it| it.address == address) {
            return candidate.beacon.notify_one();
        }
        // The task of another candidate serves the connection.
        if hub.links.get(drone).is_some() {
            return;
        }
        if candidates.len() == CANDIDATES_MAX
            && let Some(oldest) = candidates.pop_front()
        {
            oldest.task.abort();
        }
        let beacon = Arc::new(Notify::new());
        beacon.notify_one();
        let connect = connect_on_beacon(Arc::clone(hub), drone, address, Arc::clone(&beacon));
        let task = self.tasks.spawn(connect);
        candidates.push_back(Candidate {
            address,
            beacon,
            task,
        });
    }
}

/// The beacons of this drone.
pub(super) struct OwnBeacons {
    pub(super) swarm: SwarmId,
    /// Incarnation of the drone; unique.
    pub(super) incarnation: u32,
    pub(super) to: SocketAddr,
    /// The drone's own socket: peers connect to the source address of its beacons.
    pub(super) from: UdpSocket,
}

/// Sends this drone's beacons. Never returns.
pub(super) async fn send_beacons(hub: Arc<Hub>, beacons: OwnBeacons) {
    let mut rng = rng(&hub, 0);
    for count in 0.. {
        let beacon = Beacon {
            swarm: beacons.swarm,
            drone: hub.id,
            sequence: (beacons.incarnation, count),
        };
        // A failure may be temporary.
        let _ = (beacons.from).send_to(&beacon.signed(&*hub.identities), beacons.to);
        let period = if count < FIRST_BEACONS {
            FIRST_PERIOD
        } else {
            BEACON_PERIOD
        };
        sleep(period.mul_f64(rng.random_range(0.75..=1.25))).await;
    }
}

/// Receives beacons and connects to their drones. Never returns.
pub(super) async fn receive_beacons(
    hub: Arc<Hub>,
    swarm: SwarmId,
    socket: tokio::net::UdpSocket,
    own: SocketAddr,
) {
    let mut filter = BeaconFilter::new(swarm, hub.id);
    let mut limiter = RateLimiter::new(BEACONS_PER_ADDRESS, BEACONS_OF_STRANGERS);
    let mut candidates = Candidates::default();
    // The extra byte reveals datagrams that are too long.
    let mut buffer = [0; BEACON_LEN + 1];
    loop {
        let Ok((len, from)) = socket.recv_from(&mut buffer).await else {
            // A network failure may be temporary.
            sleep(FIRST_PERIOD).await;
            continue;
        };
        if from == own {
            continue;
        }
        let may_verify = || {
            let is_known = hub.links.has_address(from.ip());
            limiter.take((hub.clock)(), from.ip(), is_known)
        };
        match filter.receive(&buffer[..len], &*hub.identities, may_verify) {
            Received::Ignored => {}
            Received::Refused => {
                hub.beacons_refused.fetch_add(1, Ordering::Relaxed);
            }
            Received::Drone(drone) => candidates.beacon_received(&hub, drone, from),
        }
    }
}

/// Closes connections with revoked drones. Never returns.
pub(super) async fn close_revoked(hub: Arc<Hub>) {
    loop {
        sleep(REVIEW_PERIOD).await;
        hub.links.close_untrusted(&*hub.identities);
    }
}
