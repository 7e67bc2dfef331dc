//! How drones find each other, and again once they have lost each other.

use std::collections::BTreeMap;
use std::net::{SocketAddr, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use muster_machines::identity::{NodeId, SwarmId};
use muster_machines::time::Timestamp;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use tokio::sync::watch;
use tokio::task::JoinSet;
use tokio::time::sleep;

use super::back_off::BackOff;
use super::beacon::{BEACON_LEN, Beacon, Ear, Heard};
use super::budget::Budgets;
use super::hub::Hub;

/// How long a connection must have lasted for the next attempt to be made as soon as for a first.
const LASTS: Duration = Duration::from_secs(3);

/// How often a drone says that it is there, but for the first few times.
const BEACON_EVERY: Duration = Duration::from_secs(1);
/// The first few times it does so more often, for all may have just begun.
const FIRST_BEACONS: u32 = 5;
const FIRST_EVERY: Duration = Duration::from_millis(200);

/// How many beacons of an address are looked into at once, and how long it takes until one more is.
const BEACON_BURST: u32 = 128;
const BEACON_REFILL: Duration = Duration::from_millis(10);

/// For how long the higher of two numbers lets the lower one connect first.
const COURTESY: Duration = Duration::from_millis(500);

/// How often it is looked after who is still trusted.
const REVIEW_EVERY: Duration = Duration::from_secs(1);

/// Lots that are no secret, and other ones for each drone and for whoever is to be found.
fn lots(hub: &Hub, with: u64) -> ChaCha8Rng {
    let own = u64::from(hub.id.0) << 32;
    ChaCha8Rng::seed_from_u64((hub.clock)().as_nanos() ^ own ^ with)
}

/// Keeps a connection with whoever is at an address, as long as this runs.
pub(super) async fn keep_up_with(hub: Arc<Hub>, address: SocketAddr) {
    let mut lots = lots(&hub, u64::from(address.port()));
    let mut back_off = BackOff::new();
    loop {
        let began = (hub.clock)();
        if let Some(drone) = hub.connect(address, None).await {
            until_alone(&hub, drone).await;
        }
        pause(&hub, &mut back_off, began, &mut lots).await;
    }
}

/// Returns once there is no connection with a drone, whichever side opened it.
async fn until_alone(hub: &Hub, drone: NodeId) {
    while let Some(connection) = hub.links.with(drone) {
        connection.closed().await;
    }
}

/// Waits after an attempt to connect, and whatever came of it.
async fn pause(hub: &Hub, back_off: &mut BackOff, began: Timestamp, lots: &mut impl Rng) {
    if (hub.clock)().since(began) >= LASTS {
        *back_off = BackOff::new();
    }
    sleep(back_off.wait(lots)).await;
}

/// Connects with a drone whenever it is heard and there is no connection with it.
async fn answer(hub: Arc<Hub>, drone: NodeId, mut place: watch::Receiver<SocketAddr>) {
    let mut lots = lots(&hub, u64::from(drone.0));
    let mut back_off = BackOff::new();
    while place.changed().await.is_ok() {
        if drone < hub.id && hub.links.with(drone).is_none() {
            sleep(COURTESY).await;
        }
        if hub.links.with(drone).is_some() {
            continue;
        }
        let began = (hub.clock)();
        let address = *place.borrow_and_update();
        hub.connect(address, Some(drone)).await;
        pause(&hub, &mut back_off, began, &mut lots).await;
    }
}

/// Where beacons go, and how they begin.
pub(super) struct Beacons {
    pub(super) swarm: SwarmId,
    /// Which of the drone's lives this is.
    pub(super) life: u32,
    pub(super) to: SocketAddr,
    /// The drone's own socket: where a beacon comes from, is where its drone is found.
    pub(super) from: UdpSocket,
}

/// Says again and again that this drone is there.
pub(super) async fn say(hub: Arc<Hub>, beacons: Beacons) {
    let mut lots = lots(&hub, 0);
    for count in 0.. {
        let beacon = Beacon {
            swarm: beacons.swarm,
            drone: hub.id,
            said: (beacons.life, count),
        };
        // A network that does not take it now may do so the next time.
        let _ = (beacons.from).send_to(&beacon.signed(&*hub.identities), beacons.to);
        let every = if count < FIRST_BEACONS {
            FIRST_EVERY
        } else {
            BEACON_EVERY
        };
        sleep(every.mul_f64(lots.random_range(0.75..=1.25))).await;
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
    let mut budgets = Budgets::new(BEACON_BURST, BEACON_REFILL);
    let mut places: BTreeMap<NodeId, watch::Sender<SocketAddr>> = BTreeMap::new();
    // One for each drone of the fleet that was ever heard; they end with this task.
    let mut answers = JoinSet::new();
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
        let heard = if budgets.take((hub.clock)(), from.ip()) {
            ear.hear(&buffer[..len], &*hub.identities)
        } else {
            Heard::Refused
        };
        match heard {
            Heard::OfNoUse => {}
            Heard::Refused => {
                hub.beacons_refused.fetch_add(1, Ordering::Relaxed);
            }
            Heard::Drone(drone) => {
                let place = places.entry(drone).or_insert_with(|| {
                    let (sender, place) = watch::channel(from);
                    answers.spawn(answer(Arc::clone(&hub), drone, place));
                    sender
                });
                place.send_replace(from);
            }
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
