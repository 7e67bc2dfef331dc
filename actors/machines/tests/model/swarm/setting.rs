//! Initial state of the model, and its links.

use std::num::NonZeroU32;
use std::sync::Arc;
use std::time::Duration;

use muster_machines::formation::{Formation, Kind, Layout, Separation};
use muster_machines::geometry::Ned;
use muster_machines::identity::NodeId;
use muster_machines::leader::LinkSymmetry;
use muster_machines::mission::{
    Alone, Barrier, Conduct, Config, Holds, Input, Liveness, Succession,
};
use muster_machines::navigation;
use muster_machines::routing::Notice;

use super::{Action, Drone, Flaw};

/// Links: one bit for each blocked pair and direction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct Links(u64);

impl Links {
    pub(crate) const fn whole() -> Self {
        Self(0)
    }

    pub(crate) const fn is_whole(self) -> bool {
        self.0 == 0
    }

    /// Whether frames of `from` reach `to`.
    pub(crate) fn carries(self, from: NodeId, to: NodeId) -> bool {
        from != to && self.0 & bit(from, to) == 0
    }

    pub(crate) fn after(self, action: &Action, drones: usize) -> Self {
        match *action {
            Action::Split(set) => {
                let is_in = |id: NodeId| set >> id.0 & 1 == 1;
                let ids = || (0..).map(NodeId).take(drones);
                let pairs = ids().flat_map(|from| ids().map(move |to| (from, to)));
                let cut = pairs.filter(|(from, to)| is_in(*from) != is_in(*to));
                cut.fold(self, |links, (from, to)| Self(links.0 | bit(from, to)))
            }
            Action::OneWay { from, to } => Self(self.0 | bit(to, from)),
            _ => Self::whole(),
        }
    }

    /// Running drones connected with `id` by mutual links, `id` first.
    pub(crate) fn segment_of(
        self,
        id: NodeId,
        drones: usize,
        is_up: impl Fn(NodeId) -> bool,
    ) -> Vec<NodeId> {
        let mut segment = vec![id];
        let mut next = 0;
        while let Some(at) = segment.get(next).copied() {
            let all = (0..).map(NodeId).take(drones);
            let near = all.filter(|it| {
                is_up(*it)
                    && self.carries(at, *it)
                    && self.carries(*it, at)
                    && !segment.contains(it)
            });
            segment.extend(near.collect::<Vec<_>>());
            next += 1;
        }
        segment
    }
}

const fn bit(from: NodeId, to: NodeId) -> u64 {
    1 << (from.0 * 8 + to.0)
}

/// Configurations of a line of drones with two waypoints.
pub(crate) fn configs(drones: u32) -> Vec<Config> {
    let count = NonZeroU32::new(drones).expect("a swarm has drones");
    let separation = Separation {
        horizontal_m: 5.0,
        vertical_m: 5.0,
    };
    let formation = Formation::new(Kind::Linear, count, 100.0, 0.0);
    let layout = Arc::new(Layout::new(formation, 10.0, separation));
    let mission: Arc<[Ned]> = [0.0, 100.0]
        .map(|north_m| Ned::new(north_m, 0.0, -25.0))
        .into();
    let second = Duration::from_secs(1);
    (0..drones)
        .map(|id| Config {
            id: NodeId(id),
            layout: Arc::clone(&layout),
            mission: Arc::clone(&mission),
            holds: Holds::default(),
            changes: Arc::default(),
            conduct: Conduct::Waypoints,
            barrier: Barrier::Strict,
            liveness: Liveness::Heartbeat,
            succession: Succession::Elect,
            alone: Alone::CarryOn,
            spreading_grace: Duration::ZERO,
            candidacy_back_off: Duration::ZERO,
            set_up_limit: 30 * second,
            take_off_limit: 60 * second,
            landing_limit: 60 * second,
            climb_limit: 10 * second,
            leg_limit: 100 * second,
            flight_time: 2_000 * second,
            waypoints_max: 10,
        })
        .collect()
}

/// The swarm after a take-off by its own protocol without losses: at the first waypoint, before the master receives the
/// arrivals.
pub(crate) fn in_flight(configs: &[Config]) -> Vec<Arc<Drone>> {
    let mut drones: Vec<Drone> = configs.iter().map(Drone::new).collect();
    let master = configs[0].layout.formation().centre().0 as usize;
    drones[master].handle(Input::Fly);
    exchange(&mut drones);
    for (drone, config) in drones.iter_mut().zip(configs) {
        let arrived = navigation::Notice::Arrived(take_off(config));
        drone.handle(Input::Navigation(arrived));
    }
    exchange(&mut drones);
    for drone in &mut drones {
        drone.handle(Input::Routing(Notice::RoutesReady));
    }
    drones[master].handle_all(Flaw::None);
    let order = drones[master].frame().expect("the master leads");
    for drone in &mut drones {
        drone.receive(&order, LinkSymmetry::Symmetric, true, Flaw::None);
        drone.handle_all(Flaw::None);
        drone.journal.sync();
        drone.sent = Arc::new(drone.frame().into_iter().collect());
    }
    drones.into_iter().map(Arc::new).collect()
}

/// The goal of a drone that takes off.
fn take_off(config: &Config) -> navigation::Goal {
    let to = config.layout.slot(config.id, config.mission[0]);
    let layer_m = config.layout.take_off_layers_m()[config.id.0 as usize];
    navigation::Goal::TakeOff {
        to,
        transit_altitude_m: to.altitude_m() + layer_m,
        arm: true,
    }
}

/// All drones exchange frames until nothing changes.
fn exchange(drones: &mut [Drone]) {
    loop {
        let before = drones.to_vec();
        for sender in 0..drones.len() {
            drones[sender].handle_all(Flaw::None);
            if let Some(frame) = drones[sender].frame() {
                for receiver in (0..drones.len()).filter(|it| *it != sender) {
                    drones[receiver].receive(&frame, LinkSymmetry::Symmetric, true, Flaw::None);
                    drones[receiver].handle_all(Flaw::None);
                }
            }
        }
        if drones == before {
            return;
        }
    }
}
