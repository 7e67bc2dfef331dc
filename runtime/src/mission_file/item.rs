//! A MAVLink mission item, from whichever format.

use super::Note;
use super::command::{Handling, Manoeuvre, handling};
use super::document::{Document, Written};
use super::fence::WrittenZone;
use crate::diagnostic::BadInput;
use crate::geodetic::{Geodetic, GeodeticError};

/// A mission as its file says it: where home is, and the items after it.
#[derive(Debug)]
pub(super) struct Listing<'a> {
    pub(super) home: Home<'a>,
    pub(super) items: Vec<Item<'a>>,
    pub(super) zero_height: ZeroHeight,
    pub(super) fence: Vec<WrittenZone<'a>>,
    /// What stands beside the items and is not obeyed.
    pub(super) notes: Vec<Note>,
    /// Where to point when there are too few.
    pub(super) items_at: &'a str,
}

/// Where a file says that home is.
#[derive(Debug)]
pub(super) enum Home<'a> {
    /// Where the operator has planned it, with its height above sea level.
    Planned(Position<'a>),
    /// In item 0 of a waypoints file, which an autopilot overwrites with where it arms.
    Item0 {
        at: Position<'a>,
        is_above_sea_level: bool,
    },
    /// On the ground, at no known height above sea level.
    OnTheGround(Position<'a>),
    /// Nowhere: the first place that the mission comes to is taken.
    Missing,
}

/// What a waypoint's height of zero above home says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ZeroHeight {
    /// The height that the drone has by then, as in ArduCopter's missions.
    Kept,
    /// The ground.
    Ground,
}

/// What the swarm needs to know of a mission item.
#[derive(Debug)]
pub(super) struct Item<'a> {
    /// How errors and notes name it.
    pub(super) name: String,
    pub(super) command: Written<'a, u16>,
    pub(super) frame: Written<'a, u16>,
    /// What a jump names it by.
    pub(super) number: Option<u16>,
    /// The first two parameters: of a waypoint, the seconds to wait there; of a jump, where to and how often.
    pub(super) first: Written<'a, Option<f64>>,
    pub(super) second: Written<'a, Option<f64>>,
    pub(super) position: Position<'a>,
    pub(super) auto_continue: bool,
}

impl Item<'_> {
    /// Whether the swarm makes this manoeuvre of it.
    pub(super) fn is_flown_as(&self, manoeuvre: Manoeuvre) -> bool {
        handling(self.command.value) == Handling::Flown(manoeuvre)
    }
}

/// The last three parameters of an item, or home. Numbers are finite, `None` where the file says `NaN` or `null`.
#[derive(Debug)]
pub(super) struct Position<'a> {
    pub(super) latitude_deg: Written<'a, Option<f64>>,
    pub(super) longitude_deg: Written<'a, Option<f64>>,
    pub(super) altitude_m: Written<'a, Option<f64>>,
}

impl Position<'_> {
    /// Zero latitude and longitude are how mission files say that there is none.
    pub(super) fn has_no_coordinates(&self) -> bool {
        self.latitude_deg.value == Some(0.0) && self.longitude_deg.value == Some(0.0)
    }

    /// The coordinates of what errors call `name`, at an altitude above sea level.
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
                "give the latitude and the longitude in degrees, in this order, and the altitude in metres",
            )
        })
    }

    /// The altitude as written, above whatever the frame says.
    pub(super) fn altitude_m(&self, document: Document<'_>, name: &str) -> Result<f64, BadInput> {
        given(document, name, "altitude", self.altitude_m)
    }
}

fn given(
    document: Document<'_>,
    name: &str,
    quantity: &str,
    number: Written<'_, Option<f64>>,
) -> Result<f64, BadInput> {
    number.value.ok_or_else(|| {
        document.refuse(
            number.text,
            format_args!("{name}: the {quantity} is not given"),
            format!("the {quantity} must be a finite number"),
        )
    })
}
