use std::ops::Range;

use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;
use muster_runtime::diagnostic::BadInput;

use super::file::Source;
use super::raw::{self, Office, Raw, Victim, Whole};
use super::{Fault, FaultKind, Target};

/// What goes wrong, and when.
pub(super) fn faults(source: &Source, raw: &Raw) -> Result<Vec<Fault>, BadInput> {
    let drones = raw.formation.drones.get_ref().0 + raw.relays.len() as u64;
    let drone = |drone: &Whole<0, 99_999>, span: Range<usize>| {
        let id = u32::try_from(drone.0).ok().filter(|_| drone.0 < drones);
        id.map(NodeId).ok_or_else(|| {
            let message = format!("there is no drone {} in a swarm of {drones}", drone.0);
            source.error(span, &message)
        })
    };
    let kind = |fault: &raw::Fault| match (&fault.crash, &fault.drone, &fault.kill) {
        (Some(actor), Some(of), None) => {
            let drone = drone(of.get_ref(), of.span())?;
            Ok(FaultKind::CrashActor(drone, actor.get_ref().address()))
        }
        (None, None, Some(victim)) => Ok(FaultKind::Kill(match victim.get_ref() {
            Victim::Office(Office::Master) => Target::Master,
            Victim::Drone(id) => Target::Drone(drone(id, victim.span())?),
        })),
        _ => {
            let message = "a fault is either `kill`, or `crash` with its `drone`";
            Err(source.error(fault.at_s.span(), message))
        }
    };
    raw.faults
        .iter()
        .map(|fault| {
            Ok(Fault {
                at: Timestamp::from_secs_f64(fault.at_s.get_ref().0),
                kind: kind(fault)?,
            })
        })
        .collect()
}
