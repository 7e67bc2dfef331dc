use crate::geometry::Ned;

/// What a master tells its swarm to do, one order after the other.
#[derive(Debug, Clone, PartialEq)]
pub enum Order {
    /// A part of the mission; carried out once the part is stored.
    Plan {
        /// Which part.
        index: u16,
        /// How many parts there are.
        count: u16,
        /// Its waypoints, for the centre of the formation.
        waypoints: Vec<Ned>,
    },
    /// Take off; carried out once in the slot at waypoint 0.
    TakeOff,
    /// Go to a waypoint; carried out once there.
    Move {
        /// The waypoint that is opened, 0 being where the take-off ends.
        waypoint: u16,
    },
    /// Gather beside the master and land; carried out once on the ground.
    Land {
        /// Where the centre of the formation lands, at the height of the last waypoint.
        at: Ned,
    },
}
