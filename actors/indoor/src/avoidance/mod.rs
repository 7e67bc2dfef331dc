//! Local obstacle avoidance: from what is near and where the goal is to a direction and a speed.
//!
//! Directions are in the frame of the certainty grid: radians from its x axis, counter-clockwise.

mod grid;
mod potential;
mod sectors;
mod vfh;
mod vfh_plus;

pub use self::grid::{CELL_M, CERTAINTY_MAX, CertaintyGrid, SIDE};
pub use self::potential::PotentialFields;
pub use self::sectors::{SECTOR_RAD, SECTORS, SectorSet, sector_of};
pub use self::vfh::Vfh;
pub use self::vfh_plus::VfhPlus;

/// How to avoid obstacles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Method {
    /// Potential fields (Khatib 1986): the baseline. It gets trapped.
    PotentialFields,
    /// Vector Field Histogram (Borenstein and Koren 1991), as the indoor thesis has it.
    Vfh,
    /// VFH+ (Ulrich and Borenstein 1998).
    #[default]
    VfhPlus,
}

impl Method {
    /// All methods.
    pub const ALL: [Self; 3] = [Self::PotentialFields, Self::Vfh, Self::VfhPlus];

    /// Its name for people.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::PotentialFields => "potential fields",
            Self::Vfh => "VFH",
            Self::VfhPlus => "VFH+",
        }
    }

    /// An avoider for a drone of this radius that flies at most so fast.
    #[must_use]
    pub fn avoider(self, limits: Limits) -> Box<dyn Avoider> {
        match self {
            Self::PotentialFields => Box::new(PotentialFields::new(limits)),
            Self::Vfh => Box::new(Vfh::new(limits)),
            Self::VfhPlus => Box::new(VfhPlus::new(limits)),
        }
    }
}

/// What a drone needs and can do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Distance that obstacles are to have from the drone's centre, in metres.
    pub radius_m: f64,
    /// Highest speed, in m/s.
    pub speed_max_mps: f64,
    /// Highest turn rate, in rad/s.
    pub turn_rate_max_rps: f64,
}

/// What an avoider is given.
#[derive(Debug, Clone, Copy)]
pub struct Situation<'a> {
    /// What is near.
    pub grid: &'a CertaintyGrid,
    /// Distance to the goal, in metres.
    pub goal_m: f64,
    /// Direction of the goal.
    pub goal_rad: f64,
    /// Direction of the present motion.
    pub course_rad: f64,
    /// Present speed, in m/s; 0 at rest.
    pub speed_mps: f64,
    /// Present turn rate, in rad/s.
    pub turn_rate_rps: f64,
    /// Directions that no sensor can look into.
    pub blind: SectorSet,
}

/// A direction and a speed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Steering {
    /// Direction to fly to.
    pub course_rad: f64,
    /// Speed, in m/s, from 0 to the highest.
    pub speed_mps: f64,
}

/// A method of avoiding obstacles, with its memory.
pub trait Avoider: std::fmt::Debug + Send {
    /// The direction and speed to fly; `None` if there is no way.
    fn steer(&mut self, situation: &Situation<'_>) -> Option<Steering>;
}

#[cfg(test)]
mod tests;
