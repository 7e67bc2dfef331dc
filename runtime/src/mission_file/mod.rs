//! Reader of mission files.
//!
//! Three formats are accepted, recognised by their first characters and not by the file's name: QGroundControl's `.plan`
//! (JSON), `QGC WPL 110` text (written by QGroundControl, Mission Planner and MAVProxy), and paths in KML. Each is parsed into
//! a list of MAVLink mission items, of which the module `route` builds the route.

mod command;
mod document;
mod fence;
mod home;
mod item;
mod json;
mod jumps;
mod kml;
mod qgc_plan;
mod route;
mod waypoints;

use std::fmt;
use std::path::Path;

use muster_machines::geodetic::Geodetic;
use muster_machines::geometry::Ned;
use muster_machines::mission::Holds;
use muster_machines::navigation::Zone;

use crate::diagnostic::{BadInput, read_text};
use document::Document;

/// The most points of a route, including the one above home.
pub const WAYPOINTS_MAX: usize = 1_000;

/// The most items of a mission file, including home and ignored items.
pub const ITEMS_MAX: usize = 5_000;

/// The most circles and polygons of a plan's fence.
pub const FENCE_ZONES_MAX: usize = 100;

/// The most corners of all polygons of a plan's fence together.
pub const FENCE_CORNERS_MAX: usize = 1_000;

/// The fewest waypoints of a mission. After a take-off, a single waypoint at the take-off point is accepted: the swarm hovers.
pub const NAV_WAYPOINTS_MIN: usize = 1;

/// The highest point of a route above home, in metres. Higher altitudes are mostly above sea level by mistake.
pub const HEIGHT_MAX_M: f64 = 1_000.0;

/// A mission: home, and a route in the local frame about it.
///
/// The first point is above home, at the take-off height; it may be the only one. Consecutive points differ. Each point is
/// within [`HOME_DISTANCE_MAX_M`](muster_machines::geodetic::HOME_DISTANCE_MAX_M) of home, and above it by at most
/// [`HEIGHT_MAX_M`]. There are at most [`WAYPOINTS_MAX`] points.
#[derive(Debug, Clone, PartialEq)]
pub struct Mission {
    home: Geodetic,
    waypoints: Vec<Ned>,
    holds: Holds,
    fence: Vec<FenceZone>,
    notes: Vec<Note>,
}

/// A circle or polygon of a plan's fence.
#[derive(Debug, Clone, PartialEq)]
pub struct FenceZone {
    /// Name in errors: `geoFence.polygons[0]`.
    pub name: String,
    /// The zone in the local frame about home.
    pub zone: Zone,
}

impl Mission {
    /// Origin of the swarm's local frame.
    #[must_use]
    pub fn home(&self) -> Geodetic {
        self.home
    }

    /// The route in order of the flight, in whole millimetres. The first point is above home, at the take-off height.
    #[must_use]
    pub fn waypoints(&self) -> &[Ned] {
        &self.waypoints
    }

    /// How long the swarm holds at each waypoint after all drones have arrived.
    #[must_use]
    pub fn holds(&self) -> &Holds {
        &self.holds
    }

    /// The plan's fence; empty without one. Home, all waypoints and the legs between them are inside all inclusion zones and
    /// outside all exclusion zones.
    #[must_use]
    pub fn fence(&self) -> &[FenceZone] {
        &self.fence
    }

    /// What the swarm does not do of what the file asks for, in the file's order.
    #[must_use]
    pub fn notes(&self) -> &[Note] {
        &self.notes
    }
}

/// Something in a mission file that the swarm does not do, or does differently.
#[derive(Debug, Clone, PartialEq)]
pub struct Note {
    item: String,
    kind: NoteKind,
}

/// What the swarm does not do or does differently.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NoteKind {
    /// A command that does not move a drone: a camera's, a gimbal's.
    CommandIgnored {
        /// Its name in MAVLink, without `MAV_CMD_`.
        command: &'static str,
    },
    /// A change of speed: the swarm flies at its scenario's speed.
    SpeedIgnored,
    /// `CONDITION_CHANGE_ALT`, which ArduCopter ignores, too.
    HeightConditionIgnored,
    /// Turns about a place: the swarm flies to it and on.
    TurnsIgnored,
    /// A payload to place: the swarm flies over the place at its current height.
    PayloadKept,
    /// A height of zero above home, which means "none" in ArduCopter's missions: the swarm keeps its height.
    HeightKept {
        /// The height that is kept, in metres above home.
        height_m: f64,
    },
    /// A hold before the take-off.
    HoldOnGroundIgnored {
        /// The requested hold, in seconds.
        hold_s: f64,
    },
    /// A wait for a time of day: the swarm flies on.
    TimeOfDayIgnored,
    /// An item after which the drone would wait for its operator: the swarm flies on.
    StopIgnored,
    /// A waypoint equal to the one before it, to the millimetre: it is left out.
    MergedWithPrevious,
    /// A curve: the swarm flies straight to its end.
    CurveIgnored,
    /// An endless jump back: the swarm continues with the next item.
    EndlessJumpIgnored,
    /// The indices of a waypoints file are not 0, 1, 2, …; its items are flown in the order of their lines.
    IndicesIgnored,
    /// The file has no home: this item's place is home.
    HomeFromFirstPlace,
    /// All places of the mission are far from item 0 of a waypoints file and close to each other: this item's place is home.
    HomeReplaced {
        /// Distance of item 0, in metres.
        distance_m: f64,
    },
    /// An item after the return to launch, which ends the mission.
    LeftOutAfterReturn,
    /// A KML path begins on the ground: home is there.
    HomeFromPathStart,
    /// A place to return to from the fence: a drone that is stopped at the fence lands there.
    BreachReturnIgnored,
    /// Altitudes above terrain, of which the swarm has no map: they are used as heights above home.
    TerrainAltitudesAboveHome,
    /// Rally points: a drone that must land does so above home or where it is.
    RallyPointsIgnored,
}

impl Note {
    /// Name of the item in errors: `mission.items[3]` in a `.plan`, `item 3` in a `QGC WPL 110` file.
    #[must_use]
    pub fn item(&self) -> &str {
        &self.item
    }

    /// What the swarm does not do or does differently.
    #[must_use]
    pub fn kind(&self) -> NoteKind {
        self.kind
    }
}

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: ", self.item)?;
        match self.kind {
            NoteKind::CommandIgnored { command } => {
                write!(f, "{command} is ignored; it does not move the swarm")
            }
            NoteKind::HeightKept { height_m } => write!(
                f,
                "an altitude of 0 means none; the swarm keeps its height, {height_m} m above home"
            ),
            NoteKind::HoldOnGroundIgnored { hold_s } => {
                write!(
                    f,
                    "the hold of {hold_s} s is ignored; it is before the take-off"
                )
            }
            NoteKind::HomeReplaced { distance_m } => write!(
                f,
                "home is this place, for item 0 is {:.0} km away, overwritten by an autopilot",
                distance_m / 1_000.0
            ),
            kind => f.write_str(kind.description()),
        }
    }
}

impl NoteKind {
    /// The text of a note without values; empty for the others.
    const fn description(self) -> &'static str {
        match self {
            Self::CommandIgnored { .. }
            | Self::HeightKept { .. }
            | Self::HoldOnGroundIgnored { .. }
            | Self::HomeReplaced { .. } => "",
            Self::SpeedIgnored => {
                "DO_CHANGE_SPEED is ignored; the swarm flies at `vehicle.speed_mps`"
            }
            Self::HeightConditionIgnored => {
                "CONDITION_CHANGE_ALT is ignored, as ArduCopter ignores it"
            }
            Self::TurnsIgnored => "the turns are not flown; the swarm flies on",
            Self::PayloadKept => {
                "the payload is not placed; the swarm flies over the place and does not descend"
            }
            Self::TimeOfDayIgnored => "the wait for a time of day is ignored; the swarm flies on",
            Self::StopIgnored => "the wait for the operator is ignored; the swarm flies on",
            Self::MergedWithPrevious => "the waypoint is left out; it equals the one before it",
            Self::CurveIgnored => "the curve is flown as a straight leg",
            Self::EndlessJumpIgnored => {
                "the endless jump is ignored; the swarm continues with the next item"
            }
            Self::IndicesIgnored => {
                "the indices are not 0, 1, 2, …; the items are flown in the order of their lines"
            }
            Self::HomeFromFirstPlace => "home is this place, for the file has none",
            Self::HomeFromPathStart => "home is this place, for the path begins on the ground",
            Self::LeftOutAfterReturn => {
                "the item is left out; the mission ends with the return to launch"
            }
            Self::BreachReturnIgnored => {
                "the return point is ignored; a drone that is stopped at the fence lands there"
            }
            Self::TerrainAltitudesAboveHome => {
                "altitudes above ground are used as heights above home; the swarm has no terrain map"
            }
            Self::RallyPointsIgnored => "rally points are ignored",
        }
    }
}

/// Reads a mission file of any of the formats.
///
/// # Route
///
/// | command | route |
/// | --- | --- |
/// | `NAV_TAKEOFF` | sets the height of the first point, which is above home whatever the item's coordinates |
/// | `NAV_WAYPOINT` | a point; without a take-off the first one sets the height above home |
/// | `NAV_LOITER_TIME`, `NAV_LOITER_TURNS`, `NAV_SPLINE_WAYPOINT` | a point |
/// | `NAV_CONTINUE_AND_CHANGE_ALT`, a waypoint without coordinates | a point above or below the one before it |
/// | `NAV_LOITER_TO_ALT` | a point at the height of the one before it, and one above or below |
/// | `NAV_PAYLOAD_PLACE` | a point at the height of the one before it |
/// | `DO_JUMP` | continues at the named item, as often as given, but not past the return |
/// | `NAV_RETURN_TO_LAUNCH` | a point above home at the last height; later items are left out, with a [`Note`] |
/// | `NAV_LAND` | a point above its coordinates, if it has any, at the last height; the route ends |
/// | other commands that don't move a drone | ignored, with a [`Note`] |
///
/// A point equal to the one before it, as in surveys, is left out, with a [`Note`]. `NaN` in a parameter (`null` in JSON)
/// means that it is not given; it is refused if the route needs the parameter.
///
/// # Altitudes
///
/// Altitudes are above home or above sea level. Altitudes above terrain are refused, for the swarm has no map. In a waypoints
/// file, and in a plan for ArduPilot, a waypoint's altitude of 0 above home means none; the swarm keeps its height, with a
/// [`Note`].
///
/// # Holds
///
/// The first parameter of `NAV_WAYPOINT`, `NAV_LOITER_TIME`, `NAV_SPLINE_WAYPOINT` and `NAV_DELAY` is a hold in seconds, up
/// to [`Holds::MAX`]. Holds at the same point add up. A `NAV_DELAY` for a time of day is ignored, with a [`Note`].
///
/// # Fence
///
/// The circles and polygons of a plan's `geoFence` are used: the swarm stays inside every inclusion zone, as ArduPilot does by
/// default, and outside every exclusion zone. Fence files beside a waypoints file are not read.
///
/// # Home
///
/// Home is taken from the file. If it has none, home is the first place with coordinates, with a [`Note`], and altitudes above
/// sea level are refused. The same applies to a waypoints file whose places are all further than
/// [`HOME_DISTANCE_MAX_M`](muster_machines::geodetic::HOME_DISTANCE_MAX_M) from item 0 and close to each other.
///
/// # KML
///
/// The first path is flown. Home is its first point, on the ground or below it. If the path ends on the ground, the swarm
/// lands. Altitudes are above ground; above sea level only in a plan exported by QGroundControl.
///
/// # Errors
///
/// If the file is not text, has none of the formats, breaks its format's rules, has an item that a swarm can't fly, has fewer
/// than [`NAV_WAYPOINTS_MIN`] waypoints, or exceeds a limit of this module. The error shows the file, the place and what is
/// accepted.
pub fn load(path: &Path) -> Result<Mission, BadInput> {
    parse(path, &read_text(path)?)
}

/// Parses a mission file's text as [`load`] does. Errors name `path`.
///
/// # Errors
///
/// As [`load`], except for unreadable files.
pub fn parse(path: &Path, text: &str) -> Result<Mission, BadInput> {
    let document = Document { path, text };
    let trimmed = text.trim_start();
    if trimmed.starts_with('{') {
        return route::build(document, qgc_plan::read(document)?);
    }
    if waypoints::has_header(text) {
        return route::build(document, waypoints::read(document)?);
    }
    if trimmed.starts_with('<') {
        return route::build(document, kml::read(document)?);
    }
    Err(document.refuse(
        trimmed.lines().next().unwrap_or_default(),
        "this is not a mission file in an accepted format",
        "give a QGroundControl `.plan` (begins with `{`), a waypoints file (first line `QGC WPL 110`) or KML (begins with `<`)",
    ))
}

#[cfg(test)]
mod tests;
