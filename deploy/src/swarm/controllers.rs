//! The simulated flight controllers of a flight's drones. They run in the starter, each behind a port of the loopback
//! interface.

use std::collections::BTreeMap;
use std::io;
use std::net::{Ipv4Addr, TcpListener};
use std::thread;
use std::time::Duration;

use muster_controller::Truth;
use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;
use muster_port::raise_priority;
use muster_runtime::plan::Plan;
use muster_runtime::vehicle::VehicleKind;
use muster_scenarios::controllers::{LOOK_EVERY, config};
use muster_scenarios::scenario::{ControllerFault, Scenario};

use crate::controller::LiveController;

/// The open port of each drone's controller. Empty if vehicles are in closed form.
pub(super) type Ports = BTreeMap<NodeId, TcpListener>;

/// Opens a port for the controller of each drone.
pub(super) fn open_ports(plan: &Plan) -> io::Result<Ports> {
    let drones = match plan.vehicle_kind {
        VehicleKind::Msp => plan.layout.formation().drones(),
        VehicleKind::ClosedForm => 0,
    };
    let listen = |id| Ok((NodeId(id), TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?));
    (0..drones).map(listen).collect()
}

/// All controllers. Their threads end with them.
#[derive(Debug, Default)]
pub(super) struct Controllers(BTreeMap<NodeId, Flown>);

#[derive(Debug)]
struct Flown {
    controller: LiveController,
    looked_at: Option<Timestamp>,
    was_armed: bool,
}

impl Controllers {
    /// Starts the controllers behind these ports.
    ///
    /// # Errors
    /// If the system starts no threads.
    pub(super) fn start(scenario: &Scenario, ports: Ports) -> io::Result<Self> {
        let mut places = scenario.plan.start_positions();
        let start = |(id, listener): (NodeId, TcpListener)| {
            let place = places.next().expect("each drone has a start position");
            let seed = scenario.seed.wrapping_add(id.0.into());
            let controller = LiveController::start(config(&scenario.plan, place), seed);
            let server = controller.server();
            let thread = thread::Builder::new().name(format!("controller-{id}"));
            // A connection that breaks is closed, and the process connects again. Without connections at all its port stays
            // closed, which its drone reports.
            thread.spawn(move || {
                // Without it a busy machine looks like a lost receiver.
                let _ = raise_priority();
                server.listen(&listener, drop)
            })?;
            let flown = Flown {
                controller,
                looked_at: None,
                was_armed: false,
            };
            Ok((id, flown))
        };
        Ok(Self(
            ports.into_iter().map(start).collect::<io::Result<_>>()?,
        ))
    }

    /// The aircraft that have armed or disarmed since the last call, and those in flight that are due for a look.
    pub(super) fn look(&mut self, now: Timestamp) -> impl Iterator<Item = (NodeId, Truth)> {
        self.0.iter_mut().filter_map(move |(id, flown)| {
            let truth = flown.controller.truth();
            let is_news = std::mem::replace(&mut flown.was_armed, truth.is_armed) != truth.is_armed;
            let is_due = (flown.looked_at).is_none_or(|at| now.since(at) >= LOOK_EVERY);
            (is_news || truth.is_armed && is_due).then(|| {
                flown.looked_at = Some(now);
                (*id, truth)
            })
        })
    }

    /// Injects a fault.
    pub(super) fn affect(&self, drone: NodeId, fault: ControllerFault, lasts: Option<Duration>) {
        if let Some(flown) = self.0.get(&drone) {
            flown.controller.affect(fault, lasts);
        }
    }
}
