//! How drones find each other, and again once they have lost each other.

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
use super::beacon::{BEACON_LEN, Beacon, Ear, Heard};
use super::budget::{Budget, Budgets};
use super::hub::Hub;

/// How long a connection must have lasted for the next attempt to be made as soon as for a first.
const LASTS: Duration = Duration::from_secs(3);

/// How often a drone says that it is there, but for the first few times.
const BEACON_EVERY: Duration = Duration::from_secs(1);
/// The first few times it does so more often, for all may have just begun.
const FIRST_BEACONS: u32 = 5;
const FIRST_EVERY: Duration = Duration::from_millis(200);

/// How many signatures of beacons from an address are looked at, and from all addresses together with which there is no
/// connection: a tenth of a processor's time at most.
const BEACONS_OF_ONE: Budget = Budget {
    burst: 128,
    refill: Duration::from_millis(10),
};
const BEACONS_OF_STRANGERS: Budget = Budget {
    burst: 512,
    refill: Duration::from_millis(1),
};

/// At how many places at once a drone is looked for with which there is no connection: for one more, the one that was first
/// heard of is given up. So whoever says old beacons again has to do so as often while one handshake takes place, each time
/// with others and from elsewhere, to keep a drone from being found.
const PLACES_MAX: usize = 8;

/// For how long the higher of two numbers lets the lower one connect first.
const COURTESY: Duration = Duration::from_millis(500);

/// How often it is looked after who is still trusted.
const REVIEW_EVERY: Duration = Duration::from_secs(1);

/// Lots that are no secret, and other ones for each drone and for whoever is to be found.
fn rng(hub: &Hub, with: u64) -> ChaCha8Rng {
    let own = u64::from(hub.id.0) << 32;
    ChaCha8Rng::seed_from_u64((hub.clock)().as_nanos() ^ own ^ with)
}

/// Keeps a connection with whoever is at an address, as long as this runs.
pub(super) async fn keep_up_with(hub: Arc<Hub>, address: SocketAddr) {
    let mut rng = rng(&hub, u64::from(address.port()));
    let mut back_off = BackOff::new();
    loop {
        let began = (hub.clock)();
        if let Some(drone) = hub.connect(address, None).await {
            until_alone(&hub, drone).await;
        }
        pause(&hub, &mut back_off, began, &mut rng).await;
    }
}

/// Returns once there is no connection with a drone, whichever side opened it.
async fn until_alone(hub: &Hub, drone: NodeId) {
    while let Some(connection) = hub.links.with(drone) {
        connection.closed().await;
    }
}

/// Waits after an attempt to connect, and whatever came of it.
async fn pause(hub: &Hub, back_off: &mut BackOff, began: Timestamp, rng: &mut impl Rng) {
    if (hub.clock)().since(began) >= LASTS {
        *back_off = BackOff::new();
    }
    sleep(back_off.wait(rng)).await;
}

/// Connects with a drone at a place whenever it is heard there and there is no connection with it.
async fn answer(hub: Arc<Hub>, drone: NodeId, address: SocketAddr, heard: Arc<Notify>) {
    let mut rng = rng(&hub, u64::from(drone.0) ^ u64::from(address.port()) << 16);
    let mut back_off = BackOff::new();
    loop {
        heard.notified().await;
        if drone < hub.id && hub.links.with(drone).is_none() {
            sleep(COURTESY).await;
        }
        if hub.links.with(drone).is_some() {
            continue;
        }
        let began = (hub.clock)();
        hub.connect(address, Some(drone)).await;
        pause(&hub, &mut back_off, began, &mut rng).await;
    }
}

/// Where drones are looked for; that ends with this value.
#[derive(Default)]
struct Search {
    /// The place of which was first heard is the first.
    places: BTreeMap<NodeId, VecDeque<Place>>,
    /// A task for each.
    answers: JoinSet<()>,
}

struct Place {
    address: SocketAddr,
    heard: Arc<Notify>,
    task: AbortHandle,
}

impl Search {
    /// A drone of the fleet was heard, or somebody who says again what it said.
    fn hears(&mut self, hub: &Arc<Hub>, drone: NodeId, address: SocketAddr) {
        while self.answers.try_join_next().is_some() {}
        let places = self.places.entry(drone).or_default();
        if let Some(place) = places.iter().find(|it| it.address == address) {
            return place.heard.notify_one();
        }
        // Who connects serves the connection, too.
        if hub.links.with(drone).is_some() {
            return;
        }
        if places.len() == PLACES_MAX
            && let Some(first) = places.pop_front()
        {
            first.task.abort();
        }
        let heard = Arc::new(Notify::new());
        heard.notify_one();
        let answer = answer(Arc::clone(hub), drone, address, Arc::clone(&heard));
        let task = self.answers.spawn(answer);
        places.push_back(Place {
            address,
            heard,
            task,
        });
    }
}

/// Where beacons go, and how they begin.
pub(super) struct Beacons {
    pub(super) swarm: SwarmId,
    /// Which of the drone's lives this is: a number that no other one has had.
    pub(super) incarnation: u32,
    pub(super) to: SocketAddr,
    /// The drone's own socket: where a beacon comes from, is where its drone is found.
    pub(super) from: UdpSocket,
}

/// Says again and again that this drone is there.
pub(super) async fn say(hub: Arc<Hub>, beacons: Beacons) {
    let mut rng = rng(&hub, 0);
    for count in 0.. {
        let beacon = Beacon {
            swarm: beacons.swarm,
            drone: hub.id,
            said: (beacons.incarnation, count),
        };
        // A network that does not take it now may do so the next time.
        let _ = (beacons.from).send_to(&beacon.signed(&*hub.identities), beacons.to);
        let every = if count < FIRST_BEACONS {
            FIRST_EVERY
        } else {
            BEACON_EVERY
        };
        sleep(every.mul_f64(rng.random_range(0.75..=1.25))).await;
    }
}

/// Hears who else is there, and connects with them, as long as this runs.
pub(super) async fn hear(
    hub: Arc<Hub>,
    swarm: SwarmId,
    socket: tokio::net::UdpSocket,
    own: SocketAddr,
) {
    let mut ear = Ear::new(swarm, hub.id);
    let mut budgets = Budgets::new(BEACONS_OF_ONE, BEACONS_OF_STRANGERS);
    let mut search = Search::default();
    // One byte more than a beacon has tells what is none.
    let mut buffer = [0; BEACON_LEN + 1];
    loop {
        let Ok((len, from)) = socket.recv_from(&mut buffer).await else {
            // What is wrong with a network may pass.
            sleep(FIRST_EVERY).await;
            continue;
        };
        if from == own {
            continue;
        }
        let has_time = || {
            let is_known = hub.links.lead_to(from.ip());
            budgets.take((hub.clock)(), from.ip(), is_known)
        };
        match ear.hear(&buffer[..len], &*hub.identities, has_time) {
            Heard::OfNoUse => {}
            Heard::Refused => {
                hub.beacons_refused.fetch_add(1, Ordering::Relaxed);
            }
            Heard::Drone(drone) => search.hears(&hub, drone, from),
        }
    }
}

/// Closes connections with those who are expelled, as long as this runs.
pub(super) async fn review(hub: Arc<Hub>) {
    loop {
        sleep(REVIEW_EVERY).await;
        hub.links.review(&*hub.identities);
    }
}
