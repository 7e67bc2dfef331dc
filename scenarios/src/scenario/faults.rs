use std::ops::Range;
use std::sync::Arc;
use std::time::Duration;

use muster_machines::geometry::Ned;
use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;
use muster_runtime::diagnostic::BadInput;
use muster_runtime::plan::file::{Source, field_help};
use muster_runtime::plan::raw::{
    self, DroneName, FaultKindName, Pair, ProtocolKind, Raw, ReceiverName, Role, Sender, Whole,
};
use muster_runtime::schema::Located;
use muster_runtime::vehicle::VehicleKind;

use super::{
    ControllerFault, Distortion, DroneFault, Fault, FaultKind, LinkFault, Links, Tampered, Target,
    Trigger, When,
};

/// The fault plan of a scenario file.
pub(super) fn faults(source: &Source, raw: &Raw, waypoints: usize) -> Result<Vec<Fault>, BadInput> {
    let reader = Reader {
        source,
        vehicle: raw.vehicle.kind.into(),
        has_pilots: raw.vehicle.receiver.as_ref().map(|it| *it.get_ref())
            == Some(ReceiverName::Override),
        drones: raw.formation.drones.get_ref().0 + raw.relays.len() as u64,
        last_waypoint: match raw.protocol.kind.get_ref() {
            // A swarm that follows its master, or is on task, reaches waypoint 0 when it has taken off, and no other.
            ProtocolKind::Follow | ProtocolKind::Agent => 0,
            ProtocolKind::Muscop => waypoints - 1,
        },
    };
    raw.faults.iter().map(|fault| reader.fault(fault)).collect()
}

/// A key that was checked to be there.
const CHECKED: &str = "the kind requires it";

struct Reader<'a> {
    source: &'a Source,
    vehicle: VehicleKind,
    /// Whether the flight controllers have a pilot's receiver.
    has_pilots: bool,
    /// Number of drones and relays.
    drones: u64,
    /// The last waypoint that drones reach.
    last_waypoint: usize,
}

impl Reader<'_> {
    fn fault(&self, fault: &Located<raw::Fault>) -> Result<Fault, BadInput> {
        let (span, fault) = (fault.span(), fault.get_ref());
        self.check_keys(fault)?;
        self.check_vehicle(fault)?;
        let kind = self.kind(fault)?;
        let (times, every) = self.repetition(fault)?;
        let duration = fault.for_s.as_ref();
        Ok(Fault {
            when: self.when(span, fault)?,
            kind,
            duration: duration.map(|it| Duration::from_secs_f64(it.get_ref().0)),
            times,
            every,
        })
    }

    /// Refuses a fault without a key that its kind requires, or with one that its kind does not take.
    fn check_keys(&self, fault: &raw::Fault) -> Result<(), BadInput> {
        let kind = *fault.kind.get_ref();
        let (name, taken) = (kind.name(), kind.keys());
        let all: Vec<String> = taken.iter().map(|key| format!("`{key}`")).collect();
        let all = all.join(", ");
        for (key, span) in fault.keys() {
            match span {
                Some(span) if !taken.iter().any(|it| it == key) => {
                    let message =
                        format!("a fault of kind `{name}` has no `{key}`; it takes {all}");
                    return Err(self.source.error(span, &message));
                }
                None if taken.required.contains(&key) => {
                    let message = format!("a fault of kind `{name}` needs `{key}`; it takes {all}");
                    let help = field_help(&format!("faults.{key}"));
                    return Err(self.source.error_with(fault.kind.span(), &message, help));
                }
                Some(_) | None => {}
            }
        }
        Ok(())
    }

    /// Refuses a fault of what the scenario's vehicles do not have.
    fn check_vehicle(&self, fault: &raw::Fault) -> Result<(), BadInput> {
        let (kind, name) = (*fault.kind.get_ref(), fault.kind.get_ref().name());
        let message = match self.vehicle {
            VehicleKind::Msp if kind == FaultKindName::Drain => format!(
                "a fault of kind `{name}` needs a vehicle without flight controller; with `vehicle.kind` = \"msp\", use \
                 `sag-battery`"
            ),
            VehicleKind::Msp if kind == FaultKindName::TakeOver && !self.has_pilots => {
                format!("a fault of kind `{name}` needs `vehicle.receiver` = \"override\"")
            }
            VehicleKind::Msp => return Ok(()),
            _ if kind.is_of_controller() => {
                format!("a fault of kind `{name}` needs `vehicle.kind` = \"msp\"")
            }
            _ => return Ok(()),
        };
        Err(self.source.error(fault.kind.span(), &message))
    }

    fn when(&self, span: Range<usize>, fault: &raw::Fault) -> Result<When, BadInput> {
        let after = Duration::from_secs_f64(fault.after_s.0);
        match (&fault.at_s, &fault.at_waypoint, &fault.when) {
            (Some(at), None, None) => match fault.after_s.span() {
                None => Ok(When::At(Timestamp::from_secs_f64(at.0))),
                Some(span) => {
                    let message = "`after_s` needs `at_waypoint` or `when`, found `at_s`";
                    Err(self.source.error(span, message))
                }
            },
            (None, Some(waypoint), None) => {
                let (at, last) = (waypoint.get_ref().0, self.last_waypoint);
                if at > last as u64 {
                    let message = format!("waypoint {at} is not reached, the last one is {last}");
                    return Err(self.source.error(waypoint.span(), &message));
                }
                let waypoint = u16::try_from(at).unwrap_or(u16::MAX);
                Ok(When::After(Trigger::Waypoint(waypoint), after))
            }
            (None, None, Some(trigger)) => Ok(When::After((*trigger).into(), after)),
            (None, None, None) => {
                let message = "a fault needs one of `at_s`, `at_waypoint` and `when`";
                Err(self.source.error(span, message))
            }
            _ => {
                let message = "a fault takes only one of `at_s`, `at_waypoint` and `when`";
                Err(self.source.error(span, message))
            }
        }
    }

    fn repetition(&self, fault: &raw::Fault) -> Result<(u32, Duration), BadInput> {
        match (fault.times.span(), &fault.every_s) {
            (None, None) => Ok((1, Duration::ZERO)),
            (Some(_), Some(every)) => Ok((
                u32::try_from(fault.times.0).unwrap_or(u32::MAX),
                Duration::from_secs_f64(every.get_ref().0),
            )),
            (Some(times), None) => Err(self.source.error(times, "`times` needs `every_s`")),
            (None, Some(every)) => Err(self.source.error(every.span(), "`every_s` needs `times`")),
        }
    }

    /// What happens, of a fault whose keys were checked.
    fn kind(&self, fault: &raw::Fault) -> Result<FaultKind, BadInput> {
        let actor = fault.actor.as_ref().map(|actor| actor.get_ref().address());
        let number =
            |share: &Option<Located<raw::Share>>| share.as_ref().expect(CHECKED).get_ref().0;
        let by = || Duration::from_millis(fault.by_ms.as_ref().expect(CHECKED).get_ref().0);
        match fault.kind.get_ref() {
            FaultKindName::CrashActor => {
                self.of_drone(fault, DroneFault::CrashActor(actor.expect(CHECKED)))
            }
            FaultKindName::Hang => self.of_drone(fault, DroneFault::Hang(actor)),
            FaultKindName::Restart => self.of_drone(fault, DroneFault::Restart),
            FaultKindName::Kill => self.of_drone(fault, DroneFault::Kill),
            FaultKindName::CrashAircraft => self.of_drone(fault, DroneFault::CrashAircraft),
            FaultKindName::LoseGps => self.of_drone(fault, DroneFault::LoseGps),
            FaultKindName::Drain => self.of_drone(fault, DroneFault::Drain(number(&fault.charge))),
            FaultKindName::Replay => self.of_drone(fault, DroneFault::Replay),
            FaultKindName::Forge => self.of_drone(fault, DroneFault::Forge),
            FaultKindName::Skew => {
                let ppm = fault.ppm.as_ref().expect(CHECKED).get_ref().0;
                self.of_drone(fault, DroneFault::Skew(ppm))
            }
            FaultKindName::FreezeController => self.of_controller(fault, ControllerFault::Freeze),
            FaultKindName::ClosePort => self.of_controller(fault, ControllerFault::ClosePort),
            FaultKindName::LoseBytes => {
                self.of_controller(fault, ControllerFault::LoseBytes(fault.share.0))
            }
            FaultKindName::CorruptBytes => {
                self.of_controller(fault, ControllerFault::CorruptBytes(fault.share.0))
            }
            FaultKindName::DelayBytes => {
                self.of_controller(fault, ControllerFault::DelayBytes(by()))
            }
            FaultKindName::SagBattery => {
                let volts = fault.volts.as_ref().expect(CHECKED).get_ref().0;
                self.of_controller(fault, ControllerFault::SagBattery(volts))
            }
            FaultKindName::WeakenMotor => {
                let motor = fault
                    .motor
                    .as_ref()
                    .map(|it| u8::try_from(it.get_ref().0).expect("at most 4"));
                self.of_controller(fault, ControllerFault::WeakenMotor(motor, fault.share.0))
            }
            FaultKindName::Shake => {
                let dps = fault.rate_dps.as_ref().expect(CHECKED).get_ref().0;
                self.of_controller(fault, ControllerFault::Shake(dps))
            }
            FaultKindName::TakeOver => self.of_controller(fault, ControllerFault::TakeOver),
            FaultKindName::Cut => self.of_links(fault, LinkFault::Cut),
            FaultKindName::OneWay => self.of_links(fault, LinkFault::OneWay),
            FaultKindName::Heal => self.of_links(fault, LinkFault::Healed),
            FaultKindName::Degrade => {
                self.of_links(fault, LinkFault::Degraded(number(&fault.loss)))
            }
            FaultKindName::Jam => {
                let offset =
                    |it: &Option<Located<raw::Offset>>| it.as_ref().expect(CHECKED).get_ref().0;
                Ok(FaultKind::Jam {
                    centre: Ned::new(offset(&fault.north_m), offset(&fault.east_m), 0.0),
                    radius_m: fault.radius_m.as_ref().expect(CHECKED).get_ref().0,
                })
            }
            FaultKindName::Corrupt => self.of_frames(fault, Distortion::Corrupt),
            FaultKindName::Duplicate => self.of_frames(fault, Distortion::Duplicate),
            FaultKindName::Delay => self.of_frames(fault, Distortion::Delay(by())),
            FaultKindName::Reorder => self.of_frames(fault, Distortion::Reorder(by())),
        }
    }

    fn of_drone(&self, fault: &raw::Fault, what: DroneFault) -> Result<FaultKind, BadInput> {
        let drone = fault.drone.as_ref().expect(CHECKED);
        let target = match drone.get_ref() {
            DroneName::Role(Role::Master) => Target::Master,
            DroneName::Number(id) => Target::Drone(self.drone(id, drone.span())?),
        };
        Ok(FaultKind::Drone(target, what))
    }

    fn of_controller(
        &self,
        fault: &raw::Fault,
        what: ControllerFault,
    ) -> Result<FaultKind, BadInput> {
        self.of_drone(fault, DroneFault::Controller(what))
    }

    fn of_links(&self, fault: &raw::Fault, what: LinkFault) -> Result<FaultKind, BadInput> {
        let pair = fault.links.as_ref().expect(CHECKED);
        let group = |ids: &[Whole<0, 99_999>]| {
            let ids = ids.iter().map(|id| self.drone(id, pair.span()));
            ids.collect::<Result<Arc<[NodeId]>, BadInput>>()
        };
        let [from, to] = match pair.get_ref() {
            Pair::Drones(drones) => [group(&drones[..1])?, group(&drones[1..])?],
            Pair::Groups(groups) => [group(&groups[0])?, group(&groups[1])?],
        };
        if let Some(both) = from.iter().find(|id| to.contains(id)) {
            let message = format!("drone {both} is in both groups");
            return Err(self.source.error(pair.span(), &message));
        }
        Ok(FaultKind::Links(Links { from, to }, what))
    }

    fn of_frames(&self, fault: &raw::Fault, how: Distortion) -> Result<FaultKind, BadInput> {
        let sender = fault.from.as_ref().expect(CHECKED);
        let from = match sender.get_ref() {
            Sender::All(_) => None,
            Sender::Drone(id) => Some(self.drone(id, sender.span())?),
        };
        let share = fault.share.0;
        Ok(FaultKind::Tamper(Tampered { from, share, how }))
    }

    fn drone(&self, id: &Whole<0, 99_999>, span: Range<usize>) -> Result<NodeId, BadInput> {
        let known = u32::try_from(id.0).ok().filter(|_| id.0 < self.drones);
        known.map(NodeId).ok_or_else(|| {
            let message = format!("there is no drone {} in a swarm of {}", id.0, self.drones);
            self.source.error(span, &message)
        })
    }
}
