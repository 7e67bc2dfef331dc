//! Where a mission begins, from what its file says.

use muster_machines::geometry::Ned;

use super::command::{Handling, Manoeuvre, handling};
use super::document::Document;
use super::item::{Home, Item, Listing, Position};
use super::{Note, NoteKind};
use crate::diagnostic::BadInput;
use crate::geodetic::{Geodetic, about_home};

const NO_HOME: &str = "the file says neither where home is nor any other place";
const SET_HOME: &str =
    "set the planned home position in the ground station, and save the mission again";

/// How far the places of a mission that leaves home behind may be from the first of them over ground, in metres: no
/// further than multicopters fly.
const TOGETHER_M: f64 = 20_000.0;

/// Home, and what is known of it.
pub(super) struct Origin {
    pub(super) home: Geodetic,
    /// Whether home's altitude above sea level is known.
    pub(super) knows_sea_level: bool,
    /// That home is not where the file says.
    pub(super) note: Option<Note>,
}

impl Origin {
    pub(super) fn of(document: Document<'_>, listing: &Listing<'_>) -> Result<Self, BadInput> {
        match &listing.home {
            Home::Planned(at) => Self::above_sea_level(document, at),
            Home::OnTheGround(at) => Self::on_the_ground(document, at),
            Home::Item0 {
                at,
                is_above_sea_level,
            } => {
                let written = if *is_above_sea_level {
                    Self::above_sea_level(document, at)?
                } else {
                    Self::on_the_ground(document, at)?
                };
                let elsewhere = Self::elsewhere(document, &listing.items, written.home);
                Ok(elsewhere.unwrap_or(written))
            }
            Home::Missing => Self::first_place(document, listing),
        }
    }

    fn above_sea_level(document: Document<'_>, at: &Position<'_>) -> Result<Self, BadInput> {
        let altitude_m = at.altitude_m(document, "home")?;
        Ok(Self {
            home: at.geodetic(document, "home", altitude_m)?,
            knows_sea_level: true,
            note: None,
        })
    }

    fn on_the_ground(document: Document<'_>, at: &Position<'_>) -> Result<Self, BadInput> {
        Ok(Self {
            home: at.geodetic(document, "home", 0.0)?,
            knows_sea_level: false,
            note: None,
        })
    }

    /// Where the mission's places are, if all are too far from home and near each other. An autopilot overwrites item 0
    /// with where it arms, and simulators arm it at places of their own.
    fn elsewhere(document: Document<'_>, items: &[Item<'_>], written: Geodetic) -> Option<Self> {
        let places: Vec<(&Item<'_>, Geodetic)> = items
            .iter()
            .filter(|item| item.is_at_a_place() || item.lands_at_a_place())
            .map(|item| {
                let place = item.position.geodetic(document, &item.name, 0.0).ok()?;
                Some((item, place))
            })
            .collect::<Option<_>>()?;
        let [(first, home), _, ..] = places[..] else {
            return None;
        };
        let is_together = |place: Geodetic| {
            about_home(home, place)
                .is_ok_and(|place| place.horizontal_distance_m(Ned::HOME) <= TOGETHER_M)
        };
        let are_elsewhere = places
            .iter()
            .all(|(_, place)| about_home(written, *place).is_err() && is_together(*place));
        let distance_m = about_home(written, home).err()?.distance_m;
        are_elsewhere.then(|| Self {
            home,
            knows_sea_level: false,
            note: Some(Note {
                item: first.name.clone(),
                kind: NoteKind::HomeReplaced { distance_m },
            }),
        })
    }

    fn first_place(document: Document<'_>, listing: &Listing<'_>) -> Result<Self, BadInput> {
        let first = listing.items.iter().find(|item| item.is_at_a_place());
        let Some(first) = first else {
            return Err(document.refuse(listing.items_at, NO_HOME, SET_HOME));
        };
        Ok(Self {
            home: first.position.geodetic(document, &first.name, 0.0)?,
            knows_sea_level: false,
            note: Some(Note {
                item: first.name.clone(),
                kind: NoteKind::HomeTaken,
            }),
        })
    }
}

impl Item<'_> {
    /// Whether a drone flies to its coordinates, and not only to land there.
    fn is_at_a_place(&self) -> bool {
        let is_flown = matches!(
            handling(self.command.value),
            Handling::Flown(
                Manoeuvre::TakeOff
                    | Manoeuvre::Waypoint
                    | Manoeuvre::Spline
                    | Manoeuvre::Loiter
                    | Manoeuvre::Turns
                    | Manoeuvre::LoiterToHeight
                    | Manoeuvre::PayloadPlace
            )
        );
        is_flown && self.has_coordinates()
    }

    fn lands_at_a_place(&self) -> bool {
        self.is_flown_as(Manoeuvre::Land) && self.has_coordinates()
    }

    fn has_coordinates(&self) -> bool {
        let Position {
            latitude_deg,
            longitude_deg,
            ..
        } = &self.position;
        let is_given = latitude_deg.value.is_some() && longitude_deg.value.is_some();
        is_given && !self.position.has_no_coordinates()
    }
}
