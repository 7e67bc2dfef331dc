//! The route that a swarm flies, of a mission's items.

use muster_machines::geometry::Ned;

use super::command::{Handling, Manoeuvre, frame_name, handling, refused_name};
use super::document::Document;
use super::item::{Item, Listing};
use super::{HEIGHT_MAX_M, Mission, NAV_WAYPOINTS_MIN, Note, NoteKind, WAYPOINTS_MAX};
use crate::diagnostic::BadInput;
use crate::geodetic::{Geodetic, about_home, whole_millimetres};

const ACCEPTED_COMMANDS: &str = "a swarm flies NAV_TAKEOFF (22), NAV_WAYPOINT (16), NAV_LAND (21) and \
                                 NAV_RETURN_TO_LAUNCH (20); replace the item by waypoints, or remove it";

/// Turns what a file says into what a swarm flies.
pub(super) fn follow(document: Document<'_>, listing: &Listing<'_>) -> Result<Mission, BadInput> {
    let mut route = Route {
        document,
        home: listing.home.home(document)?,
        points: Vec::new(),
        nav_waypoints: 0,
        ended_by: None,
        notes: Vec::new(),
    };
    for item in &listing.items {
        route.add(item)?;
    }
    route.finish(listing.items_at)
}

/// A route as far as its items have been read.
struct Route<'a> {
    document: Document<'a>,
    home: Geodetic,
    /// Empty, or the first is over home.
    points: Vec<Ned>,
    nav_waypoints: usize,
    /// The item after which nothing is flown.
    ended_by: Option<String>,
    notes: Vec<Note>,
}

impl Route<'_> {
    fn add(&mut self, item: &Item<'_>) -> Result<(), BadInput> {
        match handling(item.command.value) {
            Handling::Flown(manoeuvre) => self.fly(item, manoeuvre),
            Handling::Ignored(command) => {
                self.note(item, NoteKind::CommandIgnored { command });
                Ok(())
            }
            Handling::Refused => Err(self.document.refuse(
                item.command.text,
                format_args!(
                    "{}: a swarm can't fly {}",
                    item.name,
                    refused_name(item.command.value)
                ),
                ACCEPTED_COMMANDS,
            )),
        }
    }

    fn fly(&mut self, item: &Item<'_>, manoeuvre: Manoeuvre) -> Result<(), BadInput> {
        if let Some(end) = &self.ended_by {
            return Err(self.document.refuse(
                item.command.text,
                format_args!("{} comes after {end}, where the mission ends", item.name),
                "remove it, or what ends the mission before it",
            ));
        }
        if !item.auto_continue {
            self.note(item, NoteKind::StopIgnored);
        }
        match manoeuvre {
            Manoeuvre::TakeOff => self.take_off(item),
            Manoeuvre::Waypoint => self.waypoint(item),
            Manoeuvre::Land => self.land(item),
            Manoeuvre::ReturnToLaunch => self.return_to_launch(item),
        }
    }

    fn take_off(&mut self, item: &Item<'_>) -> Result<(), BadInput> {
        if !self.points.is_empty() {
            return Err(self.document.refuse(
                item.command.text,
                format_args!("{}: the swarm is already flying", item.name),
                "NAV_TAKEOFF is accepted once, before the first waypoint",
            ));
        }
        let height_m = self.height_m(item)?;
        self.push(item, Ned::HOME.at_altitude(height_m)).map(drop)
    }

    fn waypoint(&mut self, item: &Item<'_>) -> Result<(), BadInput> {
        let height_m = self.height_m(item)?;
        let point = self.place(item, height_m)?;
        if self.points.is_empty() {
            self.push(item, Ned::HOME.at_altitude(point.altitude_m()))?;
        }
        if let Some(hold_s) = item.hold_s.value.filter(|hold_s| *hold_s != 0.0) {
            self.note(item, NoteKind::HoldIgnored { hold_s });
        }
        if self.push(item, point)? {
            self.nav_waypoints += 1;
        } else {
            self.note(item, NoteKind::MergedWithPrevious);
        }
        Ok(())
    }

    fn land(&mut self, item: &Item<'_>) -> Result<(), BadInput> {
        if !item.position.has_no_coordinates() {
            self.above_sea_level(item)?;
            if let Some(last) = self.points.last() {
                let point = self.place(item, last.altitude_m())?;
                self.push(item, point)?;
            }
        }
        self.ended_by = Some(item.name.clone());
        Ok(())
    }

    fn return_to_launch(&mut self, item: &Item<'_>) -> Result<(), BadInput> {
        if let Some(last) = self.points.last() {
            let over_home = Ned::HOME.at_altitude(last.altitude_m());
            self.push(item, over_home)?;
        }
        self.ended_by = Some(item.name.clone());
        Ok(())
    }

    /// Where an item's coordinates are, at a height above home.
    fn place(&self, item: &Item<'_>, height_m: f64) -> Result<Ned, BadInput> {
        let altitude_m = self.home.altitude_m() + height_m;
        let place = item
            .position
            .geodetic(self.document, &item.name, altitude_m)?;
        about_home(self.home, place).map_err(|error| {
            self.document.refuse(
                item.position.latitude_deg.text,
                format_args!("{}: {error}", item.name),
                "check home and the item, and that latitude comes before longitude",
            )
        })
    }

    /// An item's height above home, in metres, to the whole millimetre.
    fn height_m(&self, item: &Item<'_>) -> Result<f64, BadInput> {
        let altitude_m = item.position.altitude_m(self.document, &item.name)?;
        let height_m = whole_millimetres(if self.above_sea_level(item)? {
            altitude_m - self.home.altitude_m()
        } else {
            altitude_m
        });
        if height_m > 0.0 && height_m <= HEIGHT_MAX_M {
            return Ok(height_m);
        }
        Err(self.document.refuse(
            item.position.altitude_m.text,
            format_args!("{}: the height above home is {height_m} m", item.name),
            format!(
                "give one above 0 and up to {HEIGHT_MAX_M} m, and check that the frame is meant"
            ),
        ))
    }

    /// Whether an item's altitude is above sea level, and not above home.
    fn above_sea_level(&self, item: &Item<'_>) -> Result<bool, BadInput> {
        match item.frame.value {
            0 => Ok(true),
            3 | 6 => Ok(false),
            other => Err(self.document.refuse(
                item.frame.text,
                format_args!("{}: the frame is {}", item.name, frame_name(other)),
                "the frames 0 (above sea level), 3 and 6 (above home) are accepted",
            )),
        }
    }

    /// Adds a point, unless the last one is the same; says which.
    fn push(&mut self, item: &Item<'_>, point: Ned) -> Result<bool, BadInput> {
        if self.points.last() == Some(&point) {
            return Ok(false);
        }
        if self.points.len() == WAYPOINTS_MAX {
            return Err(self.document.refuse(
                item.command.text,
                format_args!(
                    "{}: the route has more than {WAYPOINTS_MAX} points",
                    item.name
                ),
                format!("at most {WAYPOINTS_MAX} are flown, the one over home included"),
            ));
        }
        self.points.push(point);
        Ok(true)
    }

    fn note(&mut self, item: &Item<'_>, kind: NoteKind) {
        let item = item.name.clone();
        self.notes.push(Note { item, kind });
    }

    fn finish(self, items_at: &str) -> Result<Mission, BadInput> {
        if self.nav_waypoints < NAV_WAYPOINTS_MIN {
            return Err(self.document.refuse(
                items_at,
                format_args!(
                    "a swarm needs at least {NAV_WAYPOINTS_MIN} distinct waypoints, and the mission has {}",
                    self.nav_waypoints
                ),
                "add NAV_WAYPOINT (16) items: those where take-off leads to, of landing and of return don't count",
            ));
        }
        Ok(Mission {
            home: self.home,
            waypoints: self.points,
            notes: self.notes,
        })
    }
}
