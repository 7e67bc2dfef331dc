//! The route that a swarm flies, of a mission's items.

use std::time::Duration;

use muster_machines::geometry::Ned;
use muster_machines::mission::Holds;

use super::command::{Handling, Manoeuvre, frame_name, handling, refused_name};
use super::document::Document;
use super::fence::WrittenZone;
use super::home::Origin;
use super::item::{Item, Listing, ZeroHeight};
use super::jumps::Jumps;
use super::{HEIGHT_MAX_M, Mission, NAV_WAYPOINTS_MIN, Note, NoteKind, WAYPOINTS_MAX};
use crate::diagnostic::BadInput;
use crate::geodetic::{Geodetic, about_home, whole_millimetres};

const ACCEPTED_COMMANDS: &str = "a swarm flies NAV_TAKEOFF (22), NAV_WAYPOINT (16), NAV_LAND (21) and \
                                 NAV_RETURN_TO_LAUNCH (20), and what is like them; replace the item by waypoints, or remove it";

/// `MAV_FRAME_GLOBAL_RELATIVE_ALT` and, the same, `MAV_FRAME_GLOBAL_RELATIVE_ALT_INT`.
const ABOVE_HOME_FRAMES: [u16; 2] = [3, 6];

/// Turns what a file says into what a swarm flies.
pub(super) fn follow(document: Document<'_>, listing: Listing<'_>) -> Result<Mission, BadInput> {
    let Origin {
        home,
        knows_sea_level,
        note,
    } = Origin::of(document, &listing)?;
    let mut notes = listing.notes;
    notes.extend(note);
    let mut route = Route {
        document,
        home,
        knows_sea_level,
        zero_height: listing.zero_height,
        points: Vec::new(),
        holds: Holds::default(),
        nav_waypoints: 0,
        has_taken_off: false,
        end: None,
        notes,
    };
    for item in (Jumps {
        document,
        items: &listing.items,
    })
    .flown()?
    {
        route.add(item)?;
    }
    route.finish(listing.items_at, &listing.fence)
}

/// A route as far as its items have been read.
struct Route<'a> {
    document: Document<'a>,
    home: Geodetic,
    /// Whether home's altitude above sea level is known.
    knows_sea_level: bool,
    zero_height: ZeroHeight,
    /// Empty, or the first is over home.
    points: Vec<Ned>,
    holds: Holds,
    /// Those over where the swarm takes off to count if there is a take-off before them.
    nav_waypoints: usize,
    has_taken_off: bool,
    /// The item after which nothing is flown.
    end: Option<End>,
    notes: Vec<Note>,
}

/// What ends a flight.
#[derive(PartialEq)]
enum End {
    Return,
    /// The item of this name lands.
    Landing(String),
}

impl Route<'_> {
    fn add(&mut self, item: &Item<'_>) -> Result<(), BadInput> {
        let handling = handling(item.command.value);
        if self.end == Some(End::Return) && !matches!(handling, Handling::Ignored(_)) {
            self.note(item, NoteKind::LeftOutAfterReturn);
            return Ok(());
        }
        match handling {
            Handling::Flown(manoeuvre) => self.fly(item, manoeuvre),
            Handling::Ignored(kind) => {
                self.note(item, kind);
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
        if let Some(End::Landing(name)) = &self.end {
            return Err(self.document.refuse(
                item.command.text,
                format_args!("{} comes after {name}, where the swarm lands", item.name),
                "a swarm that has landed does not take off again: end the mission there, or make two of it",
            ));
        }
        if !item.auto_continue {
            self.note(item, NoteKind::StopIgnored);
        }
        match manoeuvre {
            Manoeuvre::TakeOff => self.take_off(item),
            Manoeuvre::Waypoint | Manoeuvre::Loiter => self.waypoint_with_hold(item),
            Manoeuvre::Spline => {
                self.note(item, NoteKind::CurveIgnored);
                self.waypoint_with_hold(item)
            }
            Manoeuvre::Turns => {
                self.note(item, NoteKind::TurnsIgnored);
                if !self.waypoint(item)? {
                    self.note(item, NoteKind::MergedWithPrevious);
                }
                Ok(())
            }
            Manoeuvre::LoiterToHeight => self.loiter_to_height(item),
            Manoeuvre::PayloadPlace => self.payload_place(item),
            Manoeuvre::Delay if item.first.value.is_some_and(|it| it < 0.0) => {
                self.note(item, NoteKind::TimeOfDayIgnored);
                Ok(())
            }
            Manoeuvre::Delay => self.hold(item),
            Manoeuvre::ChangeHeight => self.change_height(item),
            Manoeuvre::Jump => {
                self.note(item, NoteKind::EndlessJumpIgnored);
                Ok(())
            }
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
        self.has_taken_off = true;
        self.push(item, Ned::HOME.at_altitude(height_m)).map(drop)
    }

    /// A waypoint where the one before it is only adds its hold to that.
    fn waypoint_with_hold(&mut self, item: &Item<'_>) -> Result<(), BadInput> {
        let is_elsewhere = self.waypoint(item)?;
        if !is_elsewhere && hold_s(item).is_none() {
            self.note(item, NoteKind::MergedWithPrevious);
        }
        self.hold(item)
    }

    /// Whether it is elsewhere than the point before it.
    fn waypoint(&mut self, item: &Item<'_>) -> Result<bool, BadInput> {
        let kept_m = self.kept_height_m(item);
        let height_m = match kept_m {
            Some(height_m) => height_m,
            None => self.height_m(item)?,
        };
        let point = self.point(item, height_m)?;
        if self.points.is_empty() {
            self.push(item, Ned::HOME.at_altitude(height_m))?;
        }
        let is_elsewhere = self.push(item, point)?;
        self.count(is_elsewhere);
        if is_elsewhere && let Some(height_m) = kept_m {
            self.note(item, NoteKind::HeightKept { height_m });
        }
        Ok(is_elsewhere)
    }

    /// Where an item's coordinates are or, as flight controllers have it where there are none, where the drone is by then.
    fn point(&self, item: &Item<'_>, height_m: f64) -> Result<Ned, BadInput> {
        if item.position.has_no_coordinates() {
            let last = self.points.last().copied().unwrap_or(Ned::HOME);
            return Ok(last.at_altitude(height_m));
        }
        self.place(item, height_m)
    }

    /// The height of the point before an item, where the item says none.
    fn kept_height_m(&self, item: &Item<'_>) -> Option<f64> {
        let is_zero = item.position.altitude_m.value == Some(0.0);
        let is_none = is_zero && ABOVE_HOME_FRAMES.contains(&item.frame.value);
        let last = self.points.last()?;
        (is_none && self.zero_height == ZeroHeight::Kept).then(|| last.altitude_m())
    }

    /// First to the place, then up or down over it.
    fn loiter_to_height(&mut self, item: &Item<'_>) -> Result<(), BadInput> {
        let height_m = self.height_m(item)?;
        let last_m = self.points.last().map_or(height_m, |it| it.altitude_m());
        let (before, after) = (self.point(item, last_m)?, self.point(item, height_m)?);
        if self.points.is_empty() {
            self.push(item, Ned::HOME.at_altitude(height_m))?;
        }
        let is_elsewhere = self.push(item, before)?;
        let is_above_or_below = self.push(item, after)?;
        self.count(is_elsewhere || is_above_or_below);
        if !is_elsewhere && !is_above_or_below {
            self.note(item, NoteKind::MergedWithPrevious);
        }
        Ok(())
    }

    /// Counts a waypoint, if it is elsewhere than the one before it or where the take-off leads to.
    fn count(&mut self, is_elsewhere: bool) {
        if is_elsewhere || self.has_taken_off {
            self.nav_waypoints += 1;
        }
    }

    fn payload_place(&mut self, item: &Item<'_>) -> Result<(), BadInput> {
        let Some(last) = self.points.last() else {
            return Err(self.document.refuse(
                item.command.text,
                format_args!("{}: the swarm is not flying yet", item.name),
                "put a NAV_TAKEOFF (22) or a NAV_WAYPOINT (16) before it",
            ));
        };
        let height_m = last.altitude_m();
        self.above_sea_level(item)?;
        let point = self.point(item, height_m)?;
        if self.push(item, point)? {
            self.nav_waypoints += 1;
        }
        self.note(item, NoteKind::PayloadKept);
        Ok(())
    }

    fn change_height(&mut self, item: &Item<'_>) -> Result<(), BadInput> {
        let height_m = self.height_m(item)?;
        let last = self.points.last().copied().unwrap_or(Ned::HOME);
        self.push(item, last.at_altitude(height_m)).map(drop)
    }

    /// A wait where the swarm is by then.
    fn hold(&mut self, item: &Item<'_>) -> Result<(), BadInput> {
        let Some(hold_s) = hold_s(item) else {
            return Ok(());
        };
        let Some(point) = self.points.len().checked_sub(1) else {
            self.note(item, NoteKind::HoldOnGroundIgnored { hold_s });
            return Ok(());
        };
        let point = u16::try_from(point).expect("there are at most `WAYPOINTS_MAX`");
        let hold = Duration::try_from_secs_f64(hold_s);
        let added = hold.map(|hold| self.holds.add(point, hold));
        if matches!(added, Ok(Ok(()))) {
            return Ok(());
        }
        let before_s = self.holds.at(point).as_secs_f64();
        let message = if before_s > 0.0 {
            format!(
                "{}: the hold is {hold_s} s, after one of {before_s} s at the same place",
                item.name
            )
        } else {
            format!("{}: the hold is {hold_s} s", item.name)
        };
        Err(self.document.refuse(
            item.first.text,
            message,
            format!(
                "give seconds from 0 up to {} at one place",
                Holds::MAX.as_secs()
            ),
        ))
    }

    fn land(&mut self, item: &Item<'_>) -> Result<(), BadInput> {
        if !item.position.has_no_coordinates() {
            self.above_sea_level(item)?;
            if let Some(last) = self.points.last() {
                let point = self.place(item, last.altitude_m())?;
                self.push(item, point)?;
            }
        }
        self.end = Some(End::Landing(item.name.clone()));
        Ok(())
    }

    fn return_to_launch(&mut self, item: &Item<'_>) -> Result<(), BadInput> {
        if let Some(last) = self.points.last() {
            let over_home = Ned::HOME.at_altitude(last.altitude_m());
            self.push(item, over_home)?;
        }
        self.end = Some(End::Return);
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
        let is_above_sea_level = self.above_sea_level(item)?;
        let altitude_m = item.position.altitude_m(self.document, &item.name)?;
        let home_m = self.home.altitude_m();
        let height_m = whole_millimetres(if is_above_sea_level {
            altitude_m - home_m
        } else {
            altitude_m
        });
        if height_m > 0.0 && height_m <= HEIGHT_MAX_M {
            return Ok(height_m);
        }
        let help = if is_above_sea_level {
            format!(
                "home is {home_m} m above sea level: give an altitude up to {HEIGHT_MAX_M} m above that, or the frame 3 if it \
                 is meant above home"
            )
        } else if height_m > 0.0 {
            format!(
                "give one up to {HEIGHT_MAX_M} m, or the frame 0 if it is meant above sea level"
            )
        } else {
            format!("give one above 0 and up to {HEIGHT_MAX_M} m")
        };
        Err(self.document.refuse(
            item.position.altitude_m.text,
            format_args!("{}: the height above home is {height_m} m", item.name),
            help,
        ))
    }

    /// Whether an item's altitude is above sea level, and not above home.
    fn above_sea_level(&self, item: &Item<'_>) -> Result<bool, BadInput> {
        match item.frame.value {
            0 if self.knows_sea_level => Ok(true),
            0 => Err(self.document.refuse(
                item.frame.text,
                format_args!(
                    "{}: its altitude is above sea level, and that of home is not known",
                    item.name
                ),
                "give altitudes above home (frame 3), or home with its altitude above sea level",
            )),
            frame if ABOVE_HOME_FRAMES.contains(&frame) => Ok(false),
            10 | 11 => Err(self.document.refuse(
                item.frame.text,
                format_args!(
                    "{}: its altitude is above the ground there, of which the swarm has no map",
                    item.name
                ),
                "give altitudes above home (frame 3) or above sea level (frame 0)",
            )),
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
        let note = Note { item, kind };
        // What is come to again is told once.
        if !self.notes.contains(&note) {
            self.notes.push(note);
        }
    }

    fn finish(self, items_at: &str, written: &[WrittenZone<'_>]) -> Result<Mission, BadInput> {
        if self.nav_waypoints < NAV_WAYPOINTS_MIN {
            return Err(self.document.refuse(
                items_at,
                "the mission has no waypoint but where the swarm takes off to",
                "add a NAV_WAYPOINT (16) item elsewhere or, to hover, one after a NAV_TAKEOFF (22): landing and return don't count",
            ));
        }
        let fence = written.iter().map(|zone| {
            let about_home = zone.about(self.document, self.home)?;
            zone.check(self.document, &about_home.zone, &self.points)?;
            Ok(about_home)
        });
        let fence = fence.collect::<Result<_, BadInput>>()?;
        Ok(Mission {
            home: self.home,
            waypoints: self.points,
            holds: self.holds,
            fence,
            notes: self.notes,
        })
    }
}

/// How many seconds an item asks the swarm to wait, in its first parameter.
fn hold_s(item: &Item<'_>) -> Option<f64> {
    item.first.value.filter(|hold_s| *hold_s != 0.0)
}
