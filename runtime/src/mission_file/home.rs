//! Determines a mission's home.

use muster_machines::geodetic::{Geodetic, local_ned};
use muster_machines::geometry::Ned;

use super::command::{Handling, Manoeuvre, handling};
use super::document::Document;
use super::item::{Home, Item, ParsedMission, Position};
use super::{Note, NoteKind};
use crate::diagnostic::BadInput;

const NO_HOME: &str = "the file has no home and no place that could be home";
const SET_HOME: &str =
    "set the planned home position in the ground station, and save the mission again";

/// The largest horizontal distance between a mission's first place and the others if home is replaced, in metres. About the
/// range of a multicopter.
const TOGETHER_M: f64 = 20_000.0;

/// A mission's home.
pub(super) struct Origin {
    pub(super) home: Geodetic,
    /// Whether home's altitude above sea level is known.
    pub(super) knows_sea_level: bool,
    /// A note if home is not taken from the file.
    pub(super) note: Option<Note>,
}

impl Origin {
    pub(super) fn of(document: Document<'_>, parsed: &ParsedMission<'_>) -> Result<Self, BadInput> {
        match &parsed.home {
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
                let replaced = Self::replaced(document, &parsed.items, written.home);
                Ok(replaced.unwrap_or(written))
            }
            Home::Missing => Self::first_place(document, parsed),
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

    /// Replaces home by the first place, if all places are too far from home and close to each other. Autopilots overwrite
    /// item 0 with the place where they arm, and simulators arm at places of their own.
    fn replaced(document: Document<'_>, items: &[Item<'_>], written: Geodetic) -> Option<Self> {
        let places: Vec<(&Item<'_>, Geodetic)> = items
            .iter()
            .filter(|item| item.flies_to_coordinates() || item.lands_at_coordinates())
            .map(|item| {
                let place = item.position.geodetic(document, &item.name, 0.0).ok()?;
                Some((item, place))
            })
            .collect::<Option<_>>()?;
        let [(first, home), _, ..] = places[..] else {
            return None;
        };
        let is_together = |place: Geodetic| {
            local_ned(home, place)
                .is_ok_and(|place| place.horizontal_distance_m(Ned::HOME) <= TOGETHER_M)
        };
        let are_far = places
            .iter()
            .all(|(_, place)| local_ned(written, *place).is_err() && is_together(*place));
        let distance_m = local_ned(written, home).err()?.distance_m;
        are_far.then(|| Self {
            home,
            knows_sea_level: false,
            note: Some(Note {
                item: first.name.clone(),
                kind: NoteKind::HomeReplaced { distance_m },
            }),
        })
    }

    fn first_place(document: Document<'_>, parsed: &ParsedMission<'_>) -> Result<Self, BadInput> {
        let first = parsed.items.iter().find(|item| item.flies_to_coordinates());
        let Some(first) = first else {
            return Err(document.refuse(parsed.items_at, NO_HOME, SET_HOME));
        };
        Ok(Self {
            home: first.position.geodetic(document, &first.name, 0.0)?,
            knows_sea_level: false,
            note: Some(Note {
                item: first.name.clone(),
                kind: NoteKind::HomeFromFirstPlace,
            }),
        })
    }
}

impl Item<'_> {
    /// Whether the swarm flies to the item's coordinates, other than to land.
    fn flies_to_coordinates(&self) -> bool {
        let is_flown = matches!(
            handling(self.command.value),
            Handling::FlightPlan(
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

    fn lands_at_coordinates(&self) -> bool {
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
