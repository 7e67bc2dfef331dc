//! What drones do, as messages.

use muster_machines::geodetic::Geodetic;
use muster_machines::geometry::Ned;
use muster_machines::time::Timestamp;
use muster_scenarios::report::{
    Condition, Epoch, Flight, FlightOfDrone, NodeHistory, ObservedValue, Report, Route,
};
use serde_json::{Value, json};

use super::super::place::{Place, place, rounded};
use super::time;
use crate::output::closest::nearest;

/// A drone with what is known of it.
pub(super) struct Drone<'a> {
    pub(super) id: u32,
    pub(super) flown: &'a FlightOfDrone,
    history: Option<&'a NodeHistory>,
    epochs: &'a [Epoch],
    /// Number of the epochs of swarms before its own.
    first_epoch: usize,
}

impl<'a> Drone<'a> {
    /// The drones of all swarms.
    pub(super) fn all(report: &'a Report, flight: &'a Flight) -> Vec<Self> {
        let mut first_epoch = 0;
        let mut drones = Vec::new();
        for (report, flight) in report.swarms().zip(flight.swarms()) {
            let history = &flight.history;
            let pairs = report.drones.iter().zip(&flight.drones);
            drones.extend(pairs.map(|(report, flown)| Drone {
                id: report.id,
                flown,
                history: history.nodes.iter().find(|node| node.id == report.id),
                epochs: &history.epochs,
                first_epoch,
            }));
            first_epoch += history.epochs.len();
        }
        drones
    }

    pub(super) fn position(&self, at: Timestamp) -> Option<Ned> {
        self.flown.position_at(at)
    }

    pub(super) fn condition(&self, at: Timestamp) -> Condition {
        let history = self.history;
        history.map_or(Condition::Runs, |history| history.condition_at(at))
    }

    /// Whether its computer runs and it has not landed.
    pub(super) fn takes_part(&self, at: Timestamp) -> bool {
        let has_landed = self.history.and_then(|history| history.airborne);
        let has_landed = has_landed.is_some_and(|(_, to)| to.is_some_and(|to| to <= at));
        !has_landed && matches!(self.condition(at), Condition::Runs | Condition::Hangs)
    }

    fn is_airborne(&self, at: Timestamp) -> bool {
        self.history.is_some_and(|history| history.is_airborne(at))
    }

    pub(super) fn route(&self, at: Timestamp) -> Route {
        let history = self.history;
        let route = history.and_then(|history| NodeHistory::at(&history.routes, at));
        route.unwrap_or_default()
    }

    /// The leader epoch that it follows, and its index among those of all swarms.
    pub(super) fn epoch(&self, at: Timestamp) -> Option<(usize, Epoch)> {
        let index = self.history?.epoch_at(at)?;
        Some((self.first_epoch + index, self.epochs[index]))
    }

    /// Its `muster.Drone`.
    pub(super) fn state(&self, at: Timestamp) -> Value {
        let position = self.position(at).unwrap_or(Ned::HOME);
        let route = self.route(at);
        let epoch = self.epoch(at).map(|(_, epoch)| epoch);
        json!({
            "timestamp": time(at),
            "drone": self.id,
            "north_m": rounded(position.north_m(), 1e3),
            "east_m": rounded(position.east_m(), 1e3),
            "altitude_m": rounded(position.altitude_m(), 1e3),
            "state": self.flown.state_at(at).to_string(),
            "condition": self.condition(at).name(),
            "airborne": self.is_airborne(at),
            "leader": epoch.map(|epoch| epoch.master),
            "term": epoch.map(|epoch| epoch.term),
            "hops": route.hops,
            "parent": route.parent,
            "relay": route.relay,
        })
    }

    /// Its `foxglove.LocationFix`.
    pub(super) fn location(&self, at: Timestamp, home: Geodetic) -> Option<Value> {
        let Place {
            latitude_deg,
            longitude_deg,
            altitude_m,
        } = place(home, self.position(at)?);
        Some(json!({
            "timestamp": time(at),
            "frame_id": format!("drone-{}", self.id),
            "latitude": latitude_deg,
            "longitude": longitude_deg,
            "altitude": altitude_m,
            "position_covariance": [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            "position_covariance_type": 0,
        }))
    }
}

/// The `muster.Value` of an observed value.
pub(super) fn value(at: Timestamp, observed: &ObservedValue) -> Value {
    json!({
        "timestamp": time(at),
        "drone": observed.drone,
        "name": observed.name,
        "value": observed.value,
    })
}

/// The `muster.Swarm` of all drones.
pub(super) fn swarm(at: Timestamp, drones: &[Drone<'_>]) -> Value {
    let live = || drones.iter().filter(|drone| drone.takes_part(at));
    let followed: Vec<_> = live().filter_map(|drone| drone.epoch(at)).collect();
    let leaders = live().filter_map(|drone| {
        let (index, epoch) = drone.epoch(at)?;
        let members = followed.iter().filter(|(other, _)| *other == index).count();
        (epoch.master == drone.id)
            .then(|| json!({"drone": drone.id, "term": epoch.term, "members": members}))
    });
    let leaders: Vec<Value> = leaders.collect();
    let airborne = drones.iter().filter(|drone| drone.is_airborne(at));
    let places = airborne.filter_map(|drone| Some((drone.id, drone.position(at)?)));
    let mut places: Vec<(u32, Ned)> = places.collect();
    let closest_m = nearest(&mut places).map(|(distance_m, ..)| distance_m);
    json!({
        "timestamp": time(at),
        "airborne": places.len(),
        "leaders": leaders,
        "closest_m": closest_m.map(|distance_m| rounded(distance_m, 1e3)),
    })
}
