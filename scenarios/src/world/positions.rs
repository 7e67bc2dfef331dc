//! Positions of vehicles in flight.

use muster_machines::geometry::Ned;
use muster_machines::identity::NodeId;
use muster_machines::motion::Piece;
use muster_machines::time::Timestamp;
use muster_runtime::vehicle::Vehicle;

/// The positions of vehicles in flight: the current piece of each motion, kept together so that a pass over all vehicles
/// reads little memory.
///
/// Invariant: an entry is that of the vehicle's present motion, or unknown. [`Positions::invalidate`] is called whenever a
/// vehicle's motion changes, it arms or disarms.
#[derive(Debug)]
pub(super) struct Positions(Vec<Known>);

#[derive(Debug, Clone, Copy)]
enum Known {
    /// The motion may have changed.
    Unknown,
    /// It is in this piece of its motion, until the next one begins, if there is one.
    Moves(Piece, Option<Timestamp>),
    /// It is at its last visited position, or on the ground.
    Stays,
}

impl Positions {
    /// For this many vehicles.
    pub(super) fn new(vehicles: usize) -> Self {
        Self(vec![Known::Unknown; vehicles])
    }

    pub(super) fn invalidate(&mut self, id: NodeId) {
        self.0[id.0 as usize] = Known::Unknown;
    }

    /// Visits the position of each armed vehicle that has moved since the last visit.
    pub(super) fn visit_moved(
        &mut self,
        now: Timestamp,
        vehicles: &[Vehicle],
        mut visit: impl FnMut(NodeId, Ned),
    ) {
        for ((id, known), vehicle) in (0..).map(NodeId).zip(&mut self.0).zip(vehicles) {
            match *known {
                Known::Stays => continue,
                Known::Moves(_, until) if until.is_none_or(|until| now < until) => {}
                Known::Moves(..) | Known::Unknown => *known = Known::look_at(vehicle, now),
            }
            if let Known::Moves(piece, until) = *known {
                visit(id, Ned(piece.position(now)));
                if until.is_none() && now >= piece.end {
                    *known = Known::Stays;
                }
            }
        }
    }
}

impl Known {
    fn look_at(vehicle: &Vehicle, now: Timestamp) -> Self {
        match vehicle.motion().piece(now) {
            Some((piece, until)) if vehicle.is_armed() => Self::Moves(*piece, until),
            _ => Self::Stays,
        }
    }
}
