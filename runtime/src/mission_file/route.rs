//! Builds a swarm's route from a mission's items.

use std::time::Duration;

use muster_machines::geodetic::{Geodetic, local_ned, whole_millimetres};
use muster_machines::geometry::Ned;
use muster_machines::mission::Holds;

use super::command::{Handling, Manoeuvre, frame_name, handling, refused_name};
use super::document::Document;
use super::fence::ParsedZone;
use super::home::Origin;
use super::item::{Item, ParsedMission, ZeroHeight};
use super::jumps::Jumps;
use super::{HEIGHT_MAX_M, Mission, NAV_WAYPOINTS_MIN, Note, NoteKind, WAYPOINTS_MAX};
use crate::diagnostic::BadInput;

const ACCEPTED_COMMANDS: &str = "NAV_TAKEOFF (22), NAV_WAYPOINT (16), NAV_LAND (21), NAV_RETURN_TO_LAUNCH (20) and similar \
                                 commands are accepted: replace the item by waypoints, or remove it";

/// `MAV_FRAME_GLOBAL_RELATIVE_ALT` and, the same, `MAV_FRAME_GLOBAL_RELATIVE_ALT_INT`.
const ABOVE_HOME_FRAMES: [u16; 2] = [3, 6];

/// Builds the mission of a parsed file.
pub(super) fn build(
    document: Document<'_>,
    parsed: ParsedMission<'_>,
) -> Result<Mission, BadInput> {
    let Origin {
        home,
        knows_sea_level,
        note,
    } = Origin::of(document, &parsed)?;
    let mut notes = parsed.notes;
    notes.extend(note);
    let mut route = Route {
        document,
        home,
        knows_sea_level,
        zero_height: parsed.zero_height,
        points: Vec::new(),
        holds: Holds::default(),
        nav_waypoints: 0,
        has_taken_off: false,
        end: None,
        notes,
    };
    for item in (Jumps {
        document,
        items: &parsed.items,
    })
    .in_flight_order()?
    {
        route.add(item)?;
    }
    route.finish(parsed.items_at, &parsed.fence)
}

/// A route under construction.
struct Route<'a> {
    document: Document<'a>,
    home: Geodetic,
    /// Whether home's altitude above sea level is known.
    knows_sea_level: bool,
    zero_height: ZeroHeight,
    /// The first point is above home.
    points: Vec<Ned>,
    holds: Holds,
    /// Number of waypoints. One at the take-off point counts only after a take-off.
    nav_waypoints: usize,
    has_taken_off: bool,
    /// The end of the route, after which no item is flown.
    end: Option<End>,
    notes: Vec<Note>,
}

/// The end of a route.
#[derive(PartialEq)]
enum End {
    Return,
    /// The named item is a landing.
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
            Handling::FlightPlan(manoeuvre) => self.fly(item, manoeuvre),
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
                "end the mission with the landing, or make two missions: a swarm does not take off again",
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

    /// Adds a waypoint and its hold. One equal to the point before it only adds its hold.
    fn waypoint_with_hold(&mut self, item: &Item<'_>) -> Result<(), BadInput> {
        let is_elsewhere = self.waypoint(item)?;
        if !is_elsewhere && hold_s(item).is_none() {
            self.note(item, NoteKind::MergedWithPrevious);
        }
        self.hold(item)
    }

    /// Adds a waypoint. Returns whether it differs from the point before it.
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

    /// An item's place or, without coordinates, the last point's, as in flight controllers.
    fn point(&self, item: &Item<'_>, height_m: f64) -> Result<Ned, BadInput> {
        if item.position.has_no_coordinates() {
            let last = self.points.last().copied().unwrap_or(Ned::HOME);
            return Ok(last.at_altitude(height_m));
        }
        self.place(item, height_m)
    }

    /// The last point's height, if the item's altitude means none.
    fn kept_height_m(&self, item: &Item<'_>) -> Option<f64> {
        let is_zero = item.position.altitude_m.value == Some(0.0);
        let is_none = is_zero && ABOVE_HOME_FRAMES.contains(&item.frame.value);
        let last = self.points.last()?;
        (is_none && self.zero_height == ZeroHeight::Kept).then(|| last.altitude_m())
    }

    /// Adds a point at the item's place, then one above or below it.
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

    /// Counts a waypoint if it differs from the one before it, or follows a take-off.
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

    /// Adds a hold at the last point.
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
                "give 0 to {} s, added up at one place",
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

    /// An item's place at a height above home.
    fn place(&self, item: &Item<'_>, height_m: f64) -> Result<Ned, BadInput> {
        let altitude_m = self.home.altitude_m() + height_m;
        let place = item
            .position
            .geodetic(self.document, &item.name, altitude_m)?;
        local_ned(self.home, place).map_err(|error| {
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
                "home is {home_m} m above sea level: give an altitude up to {HEIGHT_MAX_M} m above home, or frame 3 for heights \
                 above home"
            )
        } else if height_m > 0.0 {
            format!(
                "give a height up to {HEIGHT_MAX_M} m, or frame 0 for altitudes above sea level"
            )
        } else {
            format!("give a height above 0 and up to {HEIGHT_MAX_M} m")
        };
        Err(self.document.refuse(
            item.position.altitude_m.text,
            format_args!("{}: the height above home is {height_m} m", item.name),
            help,
        ))
    }

    /// Whether an item's altitude is above sea level; else it is above home.
    fn above_sea_level(&self, item: &Item<'_>) -> Result<bool, BadInput> {
        match item.frame.value {
            0 if self.knows_sea_level => Ok(true),
            0 => Err(self.document.refuse(
                item.frame.text,
                format_args!(
                    "{}: the altitude is above sea level, but home's altitude is unknown",
                    item.name
                ),
                "give altitudes above home (frame 3), or home with its altitude above sea level",
            )),
            frame if ABOVE_HOME_FRAMES.contains(&frame) => Ok(false),
            10 | 11 => Err(self.document.refuse(
                item.frame.text,
                format_args!(
                    "{}: the altitude is above terrain, of which the swarm has no map",
                    item.name
                ),
                "give altitudes above home (frame 3) or above sea level (frame 0)",
            )),
            other => Err(self.document.refuse(
                item.frame.text,
                format_args!("{}: the frame is {}", item.name, frame_name(other)),
                "frames 0 (above sea level), 3 and 6 (above home) are accepted",
            )),
        }
    }

    /// Adds a point unless it equals the last one. Returns whether it was added.
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
                format!("at most {WAYPOINTS_MAX} are accepted, including the one above home"),
            ));
        }
        self.points.push(point);
        Ok(true)
    }

    fn note(&mut self, item: &Item<'_>, kind: NoteKind) {
        let item = item.name.clone();
        let note = Note { item, kind };
        // An item that a jump repeats is noted once.
        if !self.notes.contains(&note) {
            self.notes.push(note);
        }
    }

    fn finish(self, items_at: &str, written: &[ParsedZone<'_>]) -> Result<Mission, BadInput> {
        if self.nav_waypoints < NAV_WAYPOINTS_MIN {
            return Err(self.document.refuse(
                items_at,
                "the mission has no waypoint other than the take-off point",
                "add a NAV_WAYPOINT (16) elsewhere or, to hover, one after a NAV_TAKEOFF (22): landing and return don't count",
            ));
        }
        let fence = written.iter().map(|zone| {
            let local = zone.to_local(self.document, self.home)?;
            zone.check(self.document, &local.zone, &self.points)?;
            Ok(local)
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

/// An item's hold in seconds, its first parameter. `None` if it is 0 or not given.
fn hold_s(item: &Item<'_>) -> Option<f64> {
    item.first.value.filter(|hold_s| *hold_s != 0.0)
}
