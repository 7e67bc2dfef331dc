//! What a swarm is to follow, read from the mission files that people already have.
//!
//! Three formats are read, told apart by how they begin, whatever the file's name: QGroundControl's `.plan` (JSON), the
//! `QGC WPL 110` text that QGroundControl, Mission Planner and MAVProxy write, and paths in KML. All become the same list
//! of MAVLink mission items, and one module makes the route of them.

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

use muster_machines::geometry::Ned;
use muster_machines::mission::Holds;
use muster_machines::navigation::Zone;

use crate::diagnostic::{BadInput, read_text};
use crate::geodetic::Geodetic;
use document::Document;

/// The most points that a mission's route has, the one over home included.
pub const WAYPOINTS_MAX: usize = 1_000;

/// The most items that a mission file has, those that the swarm ignores and home included.
pub const ITEMS_MAX: usize = 5_000;

/// The most circles and polygons that a plan's fence has.
pub const FENCE_ZONES_MAX: usize = 100;

/// The most corners that the polygons of a plan's fence have together.
pub const FENCE_CORNERS_MAX: usize = 1_000;

/// The fewest waypoints that a swarm follows. After a take-off, one may be where that leads to: the swarm hovers.
pub const NAV_WAYPOINTS_MIN: usize = 1;

/// The highest that a route goes above home, in metres. Most altitudes beyond it are above sea level, by mistake.
pub const HEIGHT_MAX_M: f64 = 1_000.0;

/// What a swarm follows: a home, and a route about it.
///
/// The route's first point is over home, at the height that the swarm takes off to; it may be the only one. No two consecutive points are the
/// same; each is within [`HOME_DISTANCE_MAX_M`](crate::geodetic::HOME_DISTANCE_MAX_M) of home, above it, and at most
/// [`HEIGHT_MAX_M`] above it. There are at most [`WAYPOINTS_MAX`].
#[derive(Debug, Clone, PartialEq)]
pub struct Mission {
    home: Geodetic,
    waypoints: Vec<Ned>,
    holds: Holds,
    fence: Vec<FenceZone>,
    notes: Vec<Note>,
}

/// A part of the fence that a plan has.
#[derive(Debug, Clone, PartialEq)]
pub struct FenceZone {
    /// As errors name it: `geoFence.polygons[0]`.
    pub name: String,
    /// Where it is, about home.
    pub zone: Zone,
}

impl Mission {
    /// Where the swarm's local frame has its origin.
    #[must_use]
    pub fn home(&self) -> Geodetic {
        self.home
    }

    /// The route, in flying order, to the whole millimetre. The first is where the swarm takes off to, over home.
    #[must_use]
    pub fn waypoints(&self) -> &[Ned] {
        &self.waypoints
    }

    /// How long the swarm waits at which of its waypoints, once all have arrived.
    #[must_use]
    pub fn holds(&self) -> &Holds {
        &self.holds
    }

    /// Where the swarm may fly, if its plan has a fence. Home, all waypoints and the straight ways between them lie within
    /// all areas to stay within, and outside of the others.
    #[must_use]
    pub fn fence(&self) -> &[FenceZone] {
        &self.fence
    }

    /// What the file asks for and the swarm doesn't do, in the file's order.
    #[must_use]
    pub fn notes(&self) -> &[Note] {
        &self.notes
    }
}

/// Something that a mission file asks for and the swarm doesn't do.
#[derive(Debug, Clone, PartialEq)]
pub struct Note {
    item: String,
    kind: NoteKind,
}

/// What a swarm leaves out of a mission, and why.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NoteKind {
    /// A command that moves no drone: a camera's, a gimbal's.
    CommandIgnored {
        /// Its name in MAVLink, without the `MAV_CMD_`.
        command: &'static str,
    },
    /// A change of speed: the swarm flies at its scenario's.
    SpeedIgnored,
    /// `CONDITION_CHANGE_ALT`, which ArduCopter passes over, too.
    HeightConditionIgnored,
    /// Turns about a place: the swarm flies to it and on.
    TurnsIgnored,
    /// A payload to set down: the swarm flies over the place, at the height that it has.
    PayloadKept,
    /// A height of zero above home, by which ArduCopter's missions say none: the swarm keeps the height that it has.
    HeightKept {
        /// That height, in metres above home.
        height_m: f64,
    },
    /// A wait before the take-off.
    HoldOnGroundIgnored {
        /// How long the file asks for, in seconds.
        hold_s: f64,
    },
    /// A wait for a time of day: the swarm flies on.
    TimeOfDayIgnored,
    /// An item after which the drone is to wait for its operator: the swarm flies on.
    StopIgnored,
    /// A waypoint where the one before it is, to the millimetre: it is left out.
    MergedWithPrevious,
    /// A curve: the swarm flies straight to its end.
    CurveIgnored,
    /// A jump back without end: the swarm goes on behind it.
    EndlessJumpIgnored,
    /// The indices of a waypoints file are not 0, 1, 2, …: its items are taken in the order of their lines.
    IndicesIgnored,
    /// The file has no home: it is taken to be where this item is.
    HomeTaken,
    /// All of the mission's places are far from the home that item 0 of a waypoints file says, and near each other: home
    /// is taken to be where this item is.
    HomeReplaced {
        /// How far from there item 0 is, in metres.
        distance_m: f64,
    },
    /// An item after the return to launch, which ends the mission.
    LeftOutAfterReturn,
    /// A path drawn on a map begins on the ground: home is taken to be there.
    HomeWherePathBegins,
    /// A place to return to from the fence: who is stopped there lands there.
    BreachReturnIgnored,
    /// Altitudes above the ground there, of which the swarm has no map: they are taken to be above home.
    GroundTakenForLevel,
    /// Rally points: who must come down lands over home, or where it is.
    RallyPointsIgnored,
}

impl Note {
    /// Which item, as errors name it: `mission.items[3]` in a `.plan`, `item 3` in a `QGC WPL 110` file.
    #[must_use]
    pub fn item(&self) -> &str {
        &self.item
    }

    /// What is left out.
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
                write!(f, "{command} is ignored, it moves no drone of the swarm")
            }
            NoteKind::SpeedIgnored => f.write_str(
                "DO_CHANGE_SPEED is not leader, the swarm flies at `vehicle.speed_mps`",
            ),
            NoteKind::HeightConditionIgnored => {
                f.write_str("CONDITION_CHANGE_ALT is ignored, as ArduCopter ignores it")
            }
            NoteKind::TurnsIgnored => f.write_str("the turns are not flown, the swarm flies on"),
            NoteKind::PayloadKept => f.write_str(
                "the payload is not set down, the swarm flies over the place and does not descend",
            ),
            NoteKind::HeightKept { height_m } => write!(
                f,
                "a height of 0 says none, the swarm keeps its {height_m} m above home"
            ),
            NoteKind::HoldOnGroundIgnored { hold_s } => write!(
                f,
                "the hold of {hold_s} s is ignored, the swarm has not taken off by then"
            ),
            NoteKind::TimeOfDayIgnored => {
                f.write_str("the wait for a time of day is ignored, the swarm flies on")
            }
            NoteKind::StopIgnored => {
                f.write_str("the wait for the operator is ignored, the swarm flies on")
            }
            NoteKind::MergedWithPrevious => {
                f.write_str("the waypoint is left out, it is where the one before it is")
            }
            NoteKind::CurveIgnored => f.write_str("the curve is flown as a straight leg"),
            NoteKind::EndlessJumpIgnored => f.write_str(
                "the jump has no end and is ignored, the swarm goes on with the next item",
            ),
            NoteKind::IndicesIgnored => f.write_str(
                "the numbers are not 0, 1, 2, …, the items are taken in the order of their lines",
            ),
            NoteKind::HomeTaken => {
                f.write_str("home is taken to be there, the file does not say where it is")
            }
            NoteKind::HomeReplaced { distance_m } => write!(
                f,
                "home is taken to be there, not in item 0, {:.0} km away, which autopilots overwrite",
                distance_m / 1_000.0
            ),
            NoteKind::HomeWherePathBegins => {
                f.write_str("home is taken to be there, the path begins on the ground")
            }
            NoteKind::LeftOutAfterReturn => {
                f.write_str("the item is left out, the mission ends with the return to launch")
            }
            NoteKind::BreachReturnIgnored => f.write_str(
                "the place to return to is ignored, a drone that is stopped at the fence lands there",
            ),
            NoteKind::GroundTakenForLevel => f.write_str(
                "the altitudes, above the ground there, are taken as heights above home, the swarm has no map of the ground",
            ),
            NoteKind::RallyPointsIgnored => f.write_str("rally points are ignored"),
        }
    }
}

/// Reads a mission file of any of the formats.
///
/// # Route
///
/// `NAV_TAKEOFF` gives the height of the first point, which is over home whatever the item's coordinates; without one
/// the first `NAV_WAYPOINT` gives it. Each `NAV_WAYPOINT` adds a point. The route ends with the items, or with
/// `NAV_RETURN_TO_LAUNCH`, which adds a point over home, or `NAV_LAND`, which adds one over its coordinates if it has
/// any; both at the height of the last point. Items after the return are left out, with a [`Note`]. Altitudes may be above
/// home or above sea level; not above the ground, of which the swarm has no map. In a waypoints file, and in a plan for
/// ArduPilot, a waypoint's altitude of 0 above home is none: it has the height of the point before it, with a [`Note`].
///
/// `NAV_LOITER_TIME`, `NAV_LOITER_TURNS` and `NAV_SPLINE_WAYPOINT` are points, too; so is `NAV_CONTINUE_AND_CHANGE_ALT`, or a
/// waypoint without coordinates, where the point before it is. `NAV_LOITER_TO_ALT` is a point at the height of the one
/// before it and one above or below it; `NAV_PAYLOAD_PLACE` only the first of these. `DO_JUMP` goes on at the item that it
/// names, as often as it says, but not past the return.
///
/// The first parameter of a `NAV_WAYPOINT`, a `NAV_LOITER_TIME`, a `NAV_SPLINE_WAYPOINT` or a `NAV_DELAY` is how long the
/// swarm waits there, in seconds, up to [`Holds::MAX`]. What is asked for at the same point adds up. A `NAV_DELAY` for a time
/// of day is ignored, with a [`Note`].
///
/// Of a plan's fence (`geoFence`) the circles and polygons are obeyed: the swarm stays within each area to stay within, as
/// ArduPilot's vehicles do unless they are told otherwise, and out of all others. Fences of a waypoints file are files of
/// their own, which are not read.
///
/// Home is where the file says. Where it does not, home is where the first point with coordinates is, with a [`Note`], and no
/// altitude may be above sea level. So it is, too, where a waypoints file's item 0 says a home that all other places are
/// further from than [`HOME_DISTANCE_MAX_M`](crate::geodetic::HOME_DISTANCE_MAX_M), and these are near each other.
///
/// Of KML the first path is flown. Home is where it begins, on the ground or below its first point. Where it ends on the
/// ground, the swarm lands. Its altitudes are above the ground; above sea level only where QGroundControl has exported a plan.
///
/// Other commands that move no drone are ignored, with a [`Note`]. A waypoint that is exactly where the one before it
/// is, as surveys have them, is left out with a note. `NaN` (in JSON, `null`) in a parameter says, as in MAVLink, that
/// it isn't given: it is refused where the route needs it.
///
/// # Errors
///
/// When the file can't be read as text, is of none of the formats or breaks its rules, has an item that the swarm can't
/// fly, has fewer than [`NAV_WAYPOINTS_MIN`] waypoints, or exceeds a limit of this module. The error names the file,
/// the line where there is one, and what would be accepted.
pub fn load(path: &Path) -> Result<Mission, BadInput> {
    parse(path, &read_text(path)?)
}

/// Reads the text of a mission file, likewise; `path` is what errors call it.
///
/// # Errors
///
/// Those of [`load`], save that there is a text.
pub fn parse(path: &Path, text: &str) -> Result<Mission, BadInput> {
    let document = Document { path, text };
    let begins = text.trim_start();
    if begins.starts_with('{') {
        return route::follow(document, qgc_plan::read(document)?);
    }
    if waypoints::is_begun(text) {
        return route::follow(document, waypoints::read(document)?);
    }
    if begins.starts_with('<') {
        return route::follow(document, kml::read(document)?);
    }
    Err(document.refuse(
        begins.lines().next().unwrap_or_default(),
        "this is no mission that can be read",
        "give a `.plan` saved by QGroundControl, a JSON object that begins with `{`; a waypoints file, whose first line is \
         `QGC WPL 110`; or KML, which begins with `<`",
    ))
}

#[cfg(test)]
mod tests;
