//! Rule 5: every aircraft ends on the ground in time, and whole.

use muster_controller::{Contact, Truth};
use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;
use nalgebra::Vector3;

use super::Violation;

/// All drones end on the ground, disarmed, within the time limit. `armed` are those that do not.
pub(crate) fn check(now: Timestamp, armed: Vec<NodeId>) -> Option<Violation> {
    (!armed.is_empty()).then(|| Violation {
        rule: 5,
        at: now,
        what: match armed.len() {
            1 => "1 drone is still armed at the end of the run".to_owned(),
            armed => format!("{armed} drones are still armed at the end of the run"),
        },
        drones: armed,
    })
}

/// Height from which an aircraft falls rather than settles, in metres.
const FALLS_FROM_M: f64 = 0.5;
/// Cosine of the tilt beyond which an aircraft has tipped over: 60°. Its motors may stop.
const TIPPED_COS: f64 = 0.5;

/// Whether the aircraft of a flight controller has broken by itself: it touched the ground too fast or too much tilted. And
/// whether its motors were stopped in the air.
#[derive(Debug, Default)]
pub(crate) struct Wrecks {
    is_excused: bool,
    is_broken: bool,
    /// Whether it was armed when last looked at, and not flown by its failsafe.
    was_flown: bool,
    /// Height at which its motors were stopped, in metres.
    dropped_m: Option<f64>,
}

impl Wrecks {
    /// A fault of the plan breaks the aircraft, or leaves it without control. No fault excuses that its motors are stopped.
    pub(crate) const fn excuse(&mut self) {
        self.is_excused = true;
    }

    /// Looks at the aircraft.
    pub(crate) fn look(&mut self, truth: &Truth) {
        self.is_broken |= truth.contact == Contact::Wreck && !self.is_excused;
        let height_m = truth.position.altitude_m();
        let is_upright = (truth.attitude * Vector3::z()).z > TIPPED_COS;
        let flies = truth.contact == Contact::Airborne && height_m > FALLS_FROM_M && is_upright;
        if self.was_flown && !truth.is_armed && flies {
            self.dropped_m.get_or_insert(height_m);
        }
        self.was_flown = truth.is_armed && !truth.is_failsafe;
    }

    /// Whether a drone's aircraft has broken by itself, or its motors were stopped in the air.
    pub(crate) fn check(&self, now: Timestamp, drone: NodeId) -> Option<Violation> {
        let what = match self.dropped_m {
            Some(height_m) => {
                format!("the motors of drone {drone} were stopped {height_m:.1} m above the ground")
            }
            None if self.is_broken => {
                format!("the aircraft of drone {drone} broke when it touched the ground")
            }
            None => return None,
        };
        Some(Violation {
            rule: 5,
            at: now,
            drones: vec![drone],
            what,
        })
    }
}

#[cfg(test)]
mod tests {
    use muster_machines::geometry::{Ned, Velocity};
    use nalgebra::{Quaternion, UnitQuaternion};

    use super::*;

    const STANDS: Truth = Truth {
        position: Ned::HOME,
        velocity: Velocity::ZERO,
        attitude: UnitQuaternion::new_unchecked(Quaternion::new(1.0, 0.0, 0.0, 0.0)),
        rates_rad_s: Vector3::new(0.0, 0.0, 0.0),
        rotors_rad_s: [0.0; 4],
        is_armed: false,
        is_failsafe: false,
        contact: Contact::Ground,
        charge: 1.0,
        volts: 16.0,
        amps: 0.0,
    };

    fn is_broken(excused: bool, seen: &[Truth]) -> bool {
        let mut wrecks = Wrecks::default();
        if excused {
            wrecks.excuse();
        }
        seen.iter().for_each(|truth| wrecks.look(truth));
        wrecks.check(Timestamp::ZERO, NodeId(0)).is_some()
    }

    #[test]
    fn an_aircraft_that_breaks_by_itself_breaks_the_rule() {
        let wreck = Truth {
            contact: Contact::Wreck,
            ..STANDS
        };
        assert!(!is_broken(false, &[STANDS]));
        assert!(is_broken(false, &[STANDS, wreck]));
        assert!(!is_broken(true, &[STANDS, wreck]));
    }

    #[test]
    fn motors_that_are_stopped_in_the_air_break_the_rule_whatever_the_faults() {
        let at = |altitude_m: f64| Truth {
            position: Ned::new(0.0, 0.0, -altitude_m),
            contact: Contact::Airborne,
            ..STANDS
        };
        let flies = |altitude_m: f64| Truth {
            is_armed: true,
            ..at(altitude_m)
        };
        assert!(is_broken(true, &[flies(2.0), at(2.0)]));
        assert!(!is_broken(true, &[flies(0.1), at(0.1)]));
        let lands_by_its_failsafe = Truth {
            is_failsafe: true,
            ..flies(2.0)
        };
        assert!(!is_broken(true, &[lands_by_its_failsafe, at(2.0)]));
        let tipped = Truth {
            attitude: UnitQuaternion::from_euler_angles(2.0, 0.0, 0.0),
            ..at(2.0)
        };
        assert!(!is_broken(true, &[flies(2.0), tipped]));
    }
}
