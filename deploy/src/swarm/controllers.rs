//! The flight controllers of a flight's drones, simulated by us or by their own firmware. They run beside the starter, each
//! behind a port of the loopback interface.

use std::collections::BTreeMap;
use std::io;
use std::net::{Ipv4Addr, SocketAddr, TcpListener, UdpSocket};
use std::path::Path;
use std::thread;
use std::time::Duration;

use muster_controller::{Sticks, Truth};
use muster_machines::geometry::Ned;
use muster_machines::identity::NodeId;
use muster_machines::msp::controller::Receiver;
use muster_machines::time::Timestamp;
use muster_port::raise_priority;
use muster_runtime::plan::Plan;
use muster_runtime::vehicle::VehicleKind;
use muster_scenarios::controllers::{LOOK_EVERY, config, flow_errors, pose_errors};
use muster_scenarios::report::FirmwareStalls;
use muster_scenarios::scenario::{ControllerFault, Scenario};

use crate::controller::LiveController;
use crate::firmware::{Firmware, Setup};
use crate::pilot::LivePilot;
use crate::{FlowSource, PoseSource};

/// The ports of each drone's controller. Empty if vehicles are in closed form.
pub(super) type Ports = BTreeMap<NodeId, Port>;

/// The open port of a drone's controller.
#[derive(Debug)]
pub(super) struct Port {
    listener: TcpListener,
    /// Where the drone listens for poses. `None` if GPS tells where it is.
    pose: Option<SocketAddr>,
    /// Where its optical flow module is. `None` without one.
    flow: Option<TcpListener>,
}

/// Where a drone finds its controller and its sensors.
#[derive(Debug, Clone, Copy)]
pub(super) struct Addresses {
    pub(super) controller: SocketAddr,
    /// Where the drone listens for poses.
    pub(super) pose: Option<SocketAddr>,
    pub(super) flow: Option<SocketAddr>,
}

impl Port {
    pub(super) fn addresses(&self) -> io::Result<Addresses> {
        let flow = self.flow.as_ref().map(TcpListener::local_addr);
        Ok(Addresses {
            controller: self.listener.local_addr()?,
            pose: self.pose,
            flow: flow.transpose()?,
        })
    }
}

/// Opens a port for the controller of each drone.
pub(super) fn open_ports(plan: &Plan) -> io::Result<Ports> {
    let drones = match plan.vehicle_kind {
        VehicleKind::Msp => plan.layout.formation().drones(),
        VehicleKind::ClosedForm => 0,
    };
    let any = (Ipv4Addr::LOCALHOST, 0);
    // All at once, so that they differ; then they are free for the drones.
    let sockets = (0..drones).filter(|_| plan.pose.is_some());
    let sockets = sockets.map(|_| UdpSocket::bind(any));
    let sockets: Vec<_> = sockets.collect::<io::Result<_>>()?;
    let listen = |id| {
        let pose = sockets.get(id as usize).map(UdpSocket::local_addr);
        let port = Port {
            listener: TcpListener::bind(any)?,
            pose: pose.transpose()?,
            flow: plan.flow.map(|_| TcpListener::bind(any)).transpose()?,
        };
        Ok((NodeId(id), port))
    };
    (0..drones).map(listen).collect()
}

/// What a controller is.
#[derive(Debug)]
enum Kind {
    /// With a pilot, if there is a pilot's receiver.
    Simulated(LiveController, Option<LivePilot>),
    Firmware(Firmware),
}

impl Kind {
    fn start(
        scenario: &Scenario,
        (id, port): (NodeId, Port),
        place: Ned,
        firmware: Option<&Path>,
    ) -> io::Result<Self> {
        let plan = &scenario.plan;
        let seed = scenario.seed.wrapping_add(id.0.into());
        let config = config(scenario, place);
        let sensor = plan.pose.zip(port.pose);
        let pose = sensor.map(|(sensor, to)| PoseSource {
            errors: pose_errors(sensor),
            seed,
            to,
        });
        let flow = plan
            .flow
            .zip(port.flow)
            .map(|(sensor, listener)| FlowSource {
                errors: flow_errors(sensor),
                seed,
                listener,
            });
        if let Some(program) = firmware {
            let firmware = Firmware::start(Setup {
                program: program.to_owned(),
                receiver: plan.receiver,
                config,
                seed,
                pose,
            })?;
            firmware.listen(port.listener)?;
            if let Some(source) = flow {
                firmware.measure_flow(source)?;
            }
            return Ok(Self::Firmware(firmware));
        }
        let controller = LiveController::start(config, seed);
        if let Some(source) = pose {
            controller.measure_pose(source)?;
        }
        if let Some(source) = flow {
            controller.measure_flow(source)?;
        }
        let server = controller.server();
        let thread = thread::Builder::new().name(format!("controller-{id}"));
        // A connection that breaks is closed, and the process connects again. Without connections at all its port stays
        // closed, which its drone reports.
        thread.spawn(move || {
            // Without it a busy machine looks like a lost receiver.
            let _ = raise_priority();
            server.listen(&port.listener, drop)
        })?;
        let has_pilot = plan.receiver == Receiver::Override;
        let pilot = has_pilot.then(|| controller.start_pilot()).transpose()?;
        Ok(Self::Simulated(controller, pilot))
    }

    fn truth(&self) -> Truth {
        match self {
            Self::Simulated(controller, _) => controller.truth(),
            Self::Firmware(firmware) => firmware.truth(),
        }
    }

    /// How often it stood still while it was armed. `None` of our simulation: it moves with its aircraft.
    fn stalls(&self) -> Option<FirmwareStalls> {
        match self {
            Self::Simulated(..) => None,
            Self::Firmware(firmware) => Some(firmware.stalls()),
        }
    }

    /// The sticks since the last call. `None` before the first RC frame to firmware.
    fn take_sticks(&self) -> Option<Sticks> {
        match self {
            Self::Simulated(controller, _) => Some(controller.take_sticks()),
            Self::Firmware(firmware) => firmware.take_sticks(),
        }
    }

    const fn pilot(&self) -> Option<&LivePilot> {
        match self {
            Self::Simulated(_, pilot) => pilot.as_ref(),
            Self::Firmware(firmware) => firmware.pilot(),
        }
    }
}

/// All controllers. Their threads end with them.
#[derive(Debug, Default)]
pub(super) struct Controllers(BTreeMap<NodeId, Flown>);

#[derive(Debug)]
struct Flown {
    controller: Kind,
    looked_at: Option<Timestamp>,
    was_armed: bool,
}

impl Controllers {
    /// Starts the controllers behind these ports. `firmware`: the program that they run, instead of our simulation.
    ///
    /// # Errors
    /// If the system starts no threads, or the firmware doesn't start.
    pub(super) fn start(
        scenario: &Scenario,
        ports: Ports,
        firmware: Option<&Path>,
    ) -> io::Result<Self> {
        let places = scenario.plan.start_positions();
        let flown = ports.into_iter().zip(places).map(|((id, port), place)| {
            let controller = Kind::start(scenario, (id, port), place, firmware)?;
            let flown = Flown {
                controller,
                looked_at: None,
                was_armed: false,
            };
            Ok((id, flown))
        });
        Ok(Self(flown.collect::<io::Result<_>>()?))
    }

    /// The aircraft that have armed or disarmed since the last call, and those in flight that are due for a look.
    /// With their sticks since the last look, as far as known.
    pub(super) fn look(
        &mut self,
        now: Timestamp,
    ) -> impl Iterator<Item = (NodeId, Truth, Option<Sticks>)> {
        self.0.iter_mut().filter_map(move |(id, flown)| {
            let truth = flown.controller.truth();
            let is_news = std::mem::replace(&mut flown.was_armed, truth.is_armed) != truth.is_armed;
            let is_due = (flown.looked_at).is_none_or(|at| now.since(at) >= LOOK_EVERY);
            (is_news || truth.is_armed && is_due).then(|| {
                flown.looked_at = Some(now);
                (*id, truth, flown.controller.take_sticks())
            })
        })
    }

    /// How often firmware stood still while it was armed, all drones together. `None` without one.
    pub(super) fn stalls(&self) -> Option<FirmwareStalls> {
        let all = self.0.values().filter_map(|it| it.controller.stalls());
        all.reduce(FirmwareStalls::joined)
    }

    /// The drones' pilots, if there are any, see which drones are to take off.
    pub(super) fn show_pilots(&self, is_to_take_off: impl Fn(NodeId) -> bool) {
        for (id, flown) in &self.0 {
            if let Some(pilot) = flown.controller.pilot() {
                pilot.show(is_to_take_off(*id));
            }
        }
    }

    /// Injects a fault.
    pub(super) fn affect(&self, drone: NodeId, fault: ControllerFault, lasts: Option<Duration>) {
        let Some(controller) = self.0.get(&drone).map(|it| &it.controller) else {
            return;
        };
        match (fault, controller) {
            (ControllerFault::TakeOver, _) => {
                if let Some(pilot) = controller.pilot() {
                    pilot.take_over();
                }
            }
            (_, Kind::Simulated(controller, _)) => controller.affect(fault, lasts),
            (_, Kind::Firmware(_)) => {}
        }
    }
}
