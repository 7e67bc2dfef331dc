use muster_machines::geometry::Ned;
use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;

use muster_runtime::vehicle::{Piece, Vehicle};

/// Where vehicles in the air are: what is needed of their motions to tell that often, kept together, so that a look at all
/// of them costs little.
#[derive(Debug)]
pub(super) struct Whereabouts(Vec<Known>);

/// What is known of where a vehicle is.
#[derive(Debug, Clone, Copy)]
enum Known {
    /// Nothing: its motion may have changed.
    Nothing,
    /// It is in this piece of its motion, until the next one begins, if there is one.
    Moves(Piece, Option<Timestamp>),
    /// Where it was when last told, or on the ground.
    Stays,
}

impl Whereabouts {
    /// Of so many vehicles.
    pub(super) fn of(vehicles: usize) -> Self {
        Self(vec![Known::Nothing; vehicles])
    }

    /// To be told whenever a vehicle's motion changes, it arms or disarms.
    pub(super) fn forget(&mut self, id: NodeId) {
        self.0[id.0 as usize] = Known::Nothing;
    }

    /// Tells of each armed vehicle where it is, unless that is where it was the last time.
    pub(super) fn each_that_moved(
        &mut self,
        now: Timestamp,
        vehicles: &[Vehicle],
        mut tell: impl FnMut(NodeId, Ned),
    ) {
        for ((id, known), vehicle) in (0..).map(NodeId).zip(&mut self.0).zip(vehicles) {
            match *known {
                Known::Stays => continue,
                Known::Moves(_, until) if until.is_none_or(|until| now < until) => {}
                Known::Moves(..) | Known::Nothing => *known = Known::look_at(vehicle, now),
            }
            if let Known::Moves(piece, until) = *known {
                tell(id, Ned(piece.position(now)));
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
