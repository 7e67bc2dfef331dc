//! The text of a map: the fields of ROS's map_server, and two of our own.
//!
//! Source: *map_server*, "Map format", ROS wiki, and the same of Nav2. Our own are `plan`, a floor plan drawn as text in the
//! place of an image, and `keep_out`, zones that are not to be entered. Deviation: an unknown field is refused, since it is
//! most likely a misspelt one.

use std::ops::Range;

use super::place::Place;
use super::plan::of_character;
use super::yaml::{self, Content, Entry, Value};
use crate::frames::{MapPose, MapXy};
use crate::refusal::Refusal;

/// Longest text of a map, in bytes.
pub const TEXT_SIZE_MAX: usize = 1 << 20;
/// Most zones that are not to be entered.
pub const ZONES_MAX: usize = 200;
/// Most corners of a zone.
pub const CORNERS_MAX: usize = 200;
/// Cells from 1 mm to 10 m.
const RESOLUTION_M: (f64, f64) = (0.001, 10.0);
/// Farthest origin, in metres: f32 tables hold a place at this distance to a centimetre.
const ORIGIN_MAX_M: f64 = 50_000.0;
/// Farthest corner of a zone, in metres: beyond the largest map at the farthest origin.
const CORNER_MAX_M: f64 = 2.0 * ORIGIN_MAX_M;
/// Most cells that a character of a plan is split into, in a row.
const CELLS_PER_CHARACTER_MAX: f64 = 100.0;

const FIELDS: [&str; 10] = [
    "image",
    "mode",
    "resolution",
    "origin",
    "negate",
    "occupied_thresh",
    "free_thresh",
    "plan",
    "cells_per_character",
    "keep_out",
];

/// How a pixel becomes a cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Mode {
    /// Occupied above the upper threshold, free below the lower one, unknown between.
    #[default]
    Trinary,
    /// As trinary; transparent pixels are unknown.
    Scale,
    /// The pixel is the occupancy in percent; above 100 it is unknown. `negate` has no effect.
    Raw,
}

/// Where the cells come from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Source {
    /// A file, relative to the map's own.
    Image(String),
    /// A plan drawn as text, one character for `cells` × `cells` cells.
    Plan {
        text: String,
        cells: usize,
        place: Place,
    },
}

/// A map's text, checked.
#[derive(Debug, Clone, PartialEq)]
pub struct Header {
    pub(super) source: Source,
    /// How a pixel becomes a cell.
    pub mode: Mode,
    /// Metres along a cell's edge.
    pub resolution_m: f64,
    /// The lower left corner of the image, and the direction of its rows.
    pub origin: MapPose,
    /// Whether white is occupied.
    pub negate: bool,
    /// A cell is occupied above this occupancy, 0 to 1.
    pub occupied_thresh: f64,
    /// A cell is free below this occupancy, 0 to 1.
    pub free_thresh: f64,
    /// Zones that are not to be entered.
    pub keep_out: Vec<Zone>,
}

/// A polygon. Its sides may cross: what an odd number of them separates from outside is inside.
#[derive(Debug, Clone, PartialEq)]
pub struct Zone {
    /// Its corners, at least three.
    pub corners: Vec<MapXy>,
    /// Where it stands in the text, in bytes.
    pub span: Range<usize>,
}

impl Header {
    /// The image's file, relative to the map's own; `None` if the map is drawn as text.
    #[must_use]
    pub fn image(&self) -> Option<&str> {
        match &self.source {
            Source::Image(path) => Some(path),
            Source::Plan { .. } => None,
        }
    }

    /// Parses a map's text.
    ///
    /// # Errors
    /// If it can't be used, with the place.
    pub fn parse(text: &str) -> Result<Self, Refusal> {
        if text.len() > TEXT_SIZE_MAX {
            let message = format!("the text is longer than {TEXT_SIZE_MAX} bytes");
            return Err(Refusal::new(0..0, message, "an image holds large maps"));
        }
        let fields = Fields::new(text, yaml::parse(text)?)?;
        let is_plan = fields.find("plan").is_some();
        let or_required = |default: f64| is_plan.then_some(default);
        let (occupied, free) = ("occupied_thresh", "free_thresh");
        let occupied_thresh = fields.number(occupied, (0.0, 1.0), or_required(0.65))?;
        let free_thresh = fields.number(free, (0.0, 1.0), or_required(0.196))?;
        if free_thresh > occupied_thresh {
            let message = format!("`free_thresh` is above `occupied_thresh`, {occupied_thresh}");
            let accepted =
                "a cell is free below `free_thresh` and occupied above `occupied_thresh`";
            return Err(Refusal::new(fields.span(free), message, accepted));
        }
        Ok(Self {
            source: fields.source()?,
            mode: fields.mode()?,
            resolution_m: fields.number("resolution", RESOLUTION_M, None)?,
            origin: fields.origin(is_plan)?,
            negate: fields.negate()?,
            occupied_thresh,
            free_thresh,
            keep_out: fields.keep_out()?,
        })
    }
}

struct Fields<'a> {
    text: &'a str,
    entries: Vec<Entry>,
    /// Where a missing field is reported.
    end: usize,
}

impl<'a> Fields<'a> {
    fn new(text: &'a str, entries: Vec<Entry>) -> Result<Self, Refusal> {
        for (index, entry) in entries.iter().enumerate() {
            let key = entry.key.as_str();
            if !FIELDS.contains(&key) {
                let near =
                    |field: &&&str| strsim::osa_distance(key, field) <= (key.len() / 3).max(1);
                let near = FIELDS.iter().filter(near);
                let near = near.min_by_key(|field| strsim::osa_distance(key, field));
                let near = near.map_or_else(String::new, |it| format!("; did you mean `{it}`?"));
                let message = format!("maps have no field `{key}`{near}");
                let accepted = format!("the fields are {}", FIELDS.join(", "));
                return Err(Refusal::new(entry.key_span.clone(), message, accepted));
            }
            if entries[..index].iter().any(|earlier| earlier.key == key) {
                let message = format!("`{key}` is given twice");
                return Err(Refusal::new(
                    entry.key_span.clone(),
                    message,
                    "give it once",
                ));
            }
            if key == "plan" {
                let next = entries.get(index + 1);
                let end = next.map_or(text.len(), |it| it.key_span.start);
                refuse_lost_lines(text, entry.value.span.end..end)?;
            }
        }
        Ok(Self {
            text,
            entries,
            end: text.trim_end().len(),
        })
    }

    fn find(&self, key: &str) -> Option<&Value> {
        let mut entries = self.entries.iter();
        entries.find(|it| it.key == key).map(|it| &it.value)
    }

    /// Where a field's name begins.
    fn key(&self, key: &str) -> usize {
        let entry = self.entries.iter().find(|it| it.key == key);
        entry.map_or(self.end, |entry| entry.key_span.start)
    }

    fn span(&self, key: &str) -> Range<usize> {
        self.find(key)
            .map_or(self.end..self.end, |value| value.span.clone())
    }

    fn refuse(
        &self,
        key: &str,
        message: impl Into<String>,
        accepted: impl Into<String>,
    ) -> Refusal {
        Refusal::new(self.span(key), message, accepted)
    }

    /// A scalar's text; `None` if the field is missing.
    fn scalar(&self, key: &str, accepted: &str) -> Result<Option<&str>, Refusal> {
        match self.find(key).map(|value| &value.content) {
            None => Ok(None),
            Some(Content::Scalar(text)) => Ok(Some(text)),
            Some(Content::List(_)) => Err(self.refuse(
                key,
                format!("`{key}` is a list"),
                format!("`{key}` takes {accepted}"),
            )),
        }
    }

    fn number(&self, key: &str, range: (f64, f64), default: Option<f64>) -> Result<f64, Refusal> {
        let accepted = format!("a number from {} to {}", range.0, range.1);
        match (self.scalar(key, &accepted)?, default) {
            (None, Some(default)) => Ok(default),
            (None, None) => {
                let message = format!("the field `{key}` is missing");
                Err(self.refuse(key, message, format!("`{key}` takes {accepted}")))
            }
            (Some(text), _) => match text.trim().parse::<f64>() {
                Ok(number) if number >= range.0 && number <= range.1 => Ok(number),
                _ => {
                    let message = format!("`{key}` can't be {text:?}");
                    Err(self.refuse(key, message, format!("`{key}` takes {accepted}")))
                }
            },
        }
    }

    fn source(&self) -> Result<Source, Refusal> {
        let accepted = "the name of a PGM or PNG file beside the map";
        match (
            self.scalar("image", accepted)?,
            self.scalar("plan", "lines of text")?,
        ) {
            (Some(_), Some(_)) => {
                let message = "the map has both an image and a plan";
                Err(self.refuse("plan", message, "give one of them"))
            }
            (Some(path), None) if path.trim().is_empty() => Err(self.refuse(
                "image",
                "`image` is empty",
                format!("`image` takes {accepted}"),
            )),
            (Some(path), None) => match self.find("cells_per_character") {
                Some(value) => Err(Refusal::new(
                    value.span.clone(),
                    "`cells_per_character` is for plans",
                    "leave it out: each pixel of an image is one cell",
                )),
                None => Ok(Source::Image(path.to_owned())),
            },
            (None, Some(plan)) => {
                let range = (1.0, CELLS_PER_CHARACTER_MAX);
                let cells = self.number("cells_per_character", range, Some(1.0))?;
                if libm::trunc(cells) < cells {
                    let message = "`cells_per_character` is no whole number";
                    return Err(self.refuse("cells_per_character", message, "a whole number"));
                }
                Ok(Source::Plan {
                    text: plan.to_owned(),
                    cells: cells as usize,
                    place: Place::after(self.text, self.key("plan"), (plan, self.span("plan"))),
                })
            }
            (None, None) => {
                let message = "the map has no image and no plan";
                Err(self.refuse("image", message, format!("`image` takes {accepted}")))
            }
        }
    }

    fn mode(&self) -> Result<Mode, Refusal> {
        let accepted = "`trinary`, `scale` or `raw`";
        match self.scalar("mode", accepted)? {
            None | Some("trinary") => Ok(Mode::Trinary),
            Some("scale") => Ok(Mode::Scale),
            Some("raw") => Ok(Mode::Raw),
            Some(other) => {
                let message = format!("`mode` can't be {other:?}");
                Err(self.refuse("mode", message, format!("`mode` takes {accepted}")))
            }
        }
    }

    fn negate(&self) -> Result<bool, Refusal> {
        let accepted = "0, 1, `false` or `true`";
        match self.scalar("negate", accepted)? {
            None | Some("0" | "false" | "False" | "FALSE") => Ok(false),
            Some("1" | "true" | "True" | "TRUE") => Ok(true),
            Some(other) => {
                let message = format!("`negate` can't be {other:?}");
                Err(self.refuse("negate", message, format!("`negate` takes {accepted}")))
            }
        }
    }

    fn origin(&self, is_plan: bool) -> Result<MapPose, Refusal> {
        let accepted = format!(
            "`origin` takes [x, y, yaw] of the lower left corner: metres up to {ORIGIN_MAX_M}, radians"
        );
        let Some(value) = self.find("origin") else {
            return match is_plan {
                true => Ok(MapPose::new(0.0, 0.0, 0.0)),
                false => Err(self.refuse("origin", "the field `origin` is missing", accepted)),
            };
        };
        match numbers(value).as_deref() {
            Some(&[x_m, y_m, yaw_rad])
                if x_m.abs().max(y_m.abs()) <= ORIGIN_MAX_M && yaw_rad.abs() <= 10.0 =>
            {
                Ok(MapPose::new(x_m, y_m, yaw_rad))
            }
            _ => Err(self.refuse("origin", "`origin` is no pose", accepted)),
        }
    }

    fn keep_out(&self) -> Result<Vec<Zone>, Refusal> {
        let accepted = format!(
            "`keep_out` takes up to {ZONES_MAX} zones, each a list of 3 to {CORNERS_MAX} corners [x, y] in metres, up to {CORNER_MAX_M}"
        );
        let Some(value) = self.find("keep_out") else {
            return Ok(Vec::new());
        };
        let zones = match &value.content {
            Content::List(zones) if zones.len() <= ZONES_MAX => zones,
            _ => return Err(self.refuse("keep_out", "this is no list of zones", accepted)),
        };
        let zone = |zone: &Value| {
            let corners = match &zone.content {
                Content::List(corners) if (3..=CORNERS_MAX).contains(&corners.len()) => corners,
                _ => {
                    return Err(Refusal::new(
                        zone.span.clone(),
                        "this is no zone",
                        accepted.clone(),
                    ));
                }
            };
            let corner = |value: &Value| match numbers(value).as_deref() {
                Some(&[x_m, y_m]) if x_m.abs().max(y_m.abs()) <= CORNER_MAX_M => {
                    Ok(MapXy::new(x_m, y_m))
                }
                _ => Err(Refusal::new(
                    value.span.clone(),
                    "this is no corner",
                    accepted.clone(),
                )),
            };
            let corners: Result<Vec<MapXy>, Refusal> = corners.iter().map(corner).collect();
            corners.map(|corners| Zone {
                corners,
                span: zone.span.clone(),
            })
        };
        zones.iter().map(zone).collect()
    }
}

/// Refuses lines that look like a plan's, but stand behind its end: YAML ends a block at the first line that begins further left
/// than its first one, and takes what begins with `#` as a comment. At the beginning of a line a comment is accepted unless it is
/// drawn with a plan's characters alone.
fn refuse_lost_lines(text: &str, behind: Range<usize>) -> Result<(), Refusal> {
    let mut start = text[..behind.start].rfind('\n').map_or(0, |it| it + 1);
    for line in text[start..behind.end].split_inclusive('\n') {
        let span = start..start + line.trim_end().len();
        start += line.len();
        let is_drawn =
            line.trim().len() > 1 && line.trim().chars().all(|it| of_character(it).is_some());
        let is_indented = line.starts_with([' ', '\t']);
        let is_lost = line.trim_start().starts_with('#') && (is_indented || is_drawn);
        if is_lost && span.start >= behind.start {
            let message = "the plan has ended before this line, for it begins further left than the plan's first line";
            let accepted = "`plan: |2` for lines that begin after two spaces, or `?` in the place of a space for what is unknown";
            return Err(Refusal::new(span, message, accepted));
        }
    }
    Ok(())
}

/// A list's finite numbers.
fn numbers(value: &Value) -> Option<Vec<f64>> {
    let Content::List(values) = &value.content else {
        return None;
    };
    let number = |value: &Value| match &value.content {
        Content::Scalar(text) => text.trim().parse().ok().filter(|it: &f64| it.is_finite()),
        Content::List(_) => None,
    };
    values.iter().map(number).collect()
}
