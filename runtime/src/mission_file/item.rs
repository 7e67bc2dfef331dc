//! Mission items, common to all formats.

use muster_machines::geodetic::{Geodetic, GeodeticError};

use super::Note;
use super::command::{Handling, Manoeuvre, handling};
use super::document::{Document, Parsed};
use super::fence::ParsedZone;
use crate::diagnostic::BadInput;

/// A mission as read from its file, before the route is built.
#[derive(Debug)]
pub(super) struct ParsedMission<'a> {
    pub(super) home: Home<'a>,
    pub(super) items: Vec<Item<'a>>,
    pub(super) zero_height: ZeroHeight,
    pub(super) fence: Vec<ParsedZone<'a>>,
    /// Notes on other parts of the file than items.
    pub(super) notes: Vec<Note>,
    /// Place for the error that there are too few items.
    pub(super) items_at: &'a str,
}

/// Home as given in a file.
#[derive(Debug)]
pub(super) enum Home<'a> {
    /// Set by the operator, with its altitude above sea level.
    Planned(Position<'a>),
    /// Item 0 of a waypoints file, which autopilots overwrite with the place where they arm.
    Item0 {
        at: Position<'a>,
        is_above_sea_level: bool,
    },
    /// On the ground, with unknown altitude above sea level.
    OnTheGround(Position<'a>),
    /// Not given: the mission's first place is home.
    Missing,
}

/// Meaning of a waypoint's height of zero above home.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ZeroHeight {
    /// None: the current height is kept, as in ArduCopter's missions.
    Kept,
    /// The ground.
    Ground,
}

/// The fields of a mission item that the swarm needs.
#[derive(Debug)]
pub(super) struct Item<'a> {
    /// Name in errors and notes.
    pub(super) name: String,
    pub(super) command: Parsed<'a, u16>,
    pub(super) frame: Parsed<'a, u16>,
    /// Number by which jumps name the item.
    pub(super) number: Option<u16>,
    /// The first two parameters. For a waypoint: the hold in seconds. For a jump: the target's number, and the repetitions.
    pub(super) first: Parsed<'a, Option<f64>>,
    pub(super) second: Parsed<'a, Option<f64>>,
    pub(super) position: Position<'a>,
    pub(super) auto_continue: bool,
}

impl Item<'_> {
    /// Whether the swarm flies the item as this manoeuvre.
    pub(super) fn is_flown_as(&self, manoeuvre: Manoeuvre) -> bool {
        handling(self.command.value) == Handling::FlightPlan(manoeuvre)
    }
}

/// Coordinates and altitude of an item or of home. Numbers are finite; `None` for `NaN` or `null` in the file.
#[derive(Debug)]
pub(super) struct Position<'a> {
    pub(super) latitude_deg: Parsed<'a, Option<f64>>,
    pub(super) longitude_deg: Parsed<'a, Option<f64>>,
    pub(super) altitude_m: Parsed<'a, Option<f64>>,
}

impl Position<'_> {
    /// Latitude and longitude of zero mean that an item has no coordinates.
    pub(super) fn has_no_coordinates(&self) -> bool {
        self.latitude_deg.value == Some(0.0) && self.longitude_deg.value == Some(0.0)
    }

    /// The place at an altitude above sea level. Errors name it `name`.
    pub(super) fn geodetic(
        &self,
        document: Document<'_>,
        name: &str,
        altitude_m: f64,
    ) -> Result<Geodetic, BadInput> {
        let latitude_deg = given(document, name, "latitude", self.latitude_deg)?;
        let longitude_deg = given(document, name, "longitude", self.longitude_deg)?;
        Geodetic::new(latitude_deg, longitude_deg, altitude_m).map_err(|error| {
            let part = match error {
                GeodeticError::Latitude { .. } => self.latitude_deg,
                GeodeticError::Longitude { .. } => self.longitude_deg,
                GeodeticError::Altitude { .. } => self.altitude_m,
            };
            document.refuse(
                part.text,
                format_args!("{name}: {error}"),
                "give the latitude within 90 degrees, the longitude within 180, and the altitude in metres",
            )
        })
    }

    /// The altitude as given, relative to the item's frame.
    pub(super) fn altitude_m(&self, document: Document<'_>, name: &str) -> Result<f64, BadInput> {
        given(document, name, "altitude", self.altitude_m)
    }
}

fn given(
    document: Document<'_>,
    name: &str,
    quantity: &str,
    number: Parsed<'_, Option<f64>>,
) -> Result<f64, BadInput> {
    number.value.ok_or_else(|| {
        document.refuse(
            number.text,
            format_args!("{name}: the {quantity} is not given"),
            format!("the {quantity} must be a finite number"),
        )
    })
}
