//! Reader of `QGC WPL 110` text: a header, then one item per line.
//!
//! Source: *File Formats*, "Mission Plain-Text File Format", MAVLink developer guide. Deviations, as in other readers: any white
//! space separates columns; empty lines and lines that begin with `#` are skipped; items are in the order of their lines,
//! whatever their indices.

use super::command::Manoeuvre;
use super::document::{Document, Parsed, quoted};
use super::item::{Home, Item, ParsedMission, Position, ZeroHeight};
use super::{ITEMS_MAX, Note, NoteKind};
use crate::diagnostic::BadInput;

const COLUMNS: [&str; 12] = [
    "index",
    "current",
    "frame",
    "command",
    "p1",
    "p2",
    "p3",
    "p4",
    "x",
    "y",
    "z",
    "autocontinue",
];

/// `MAV_FRAME_GLOBAL`: altitudes above sea level.
const HOME_FRAME: u16 = 0;

/// Mission Planner's command of item 0 if home is not set.
const NO_COMMAND: u16 = 0;

/// Whether a text has the format's header, of any version.
pub(super) fn has_header(text: &str) -> bool {
    let header = lines(text).next().unwrap_or_default();
    header.split_whitespace().take(2).eq(["QGC", "WPL"])
}

pub(super) fn read(document: Document<'_>) -> Result<ParsedMission<'_>, BadInput> {
    let mut lines = lines(document.text);
    check_header(document, lines.next().unwrap_or(document.end()))?;
    let rows: Vec<&str> = lines.collect();
    if let Some(row) = rows.get(ITEMS_MAX) {
        return Err(document.refuse(
            row,
            format_args!("the file has more than {ITEMS_MAX} items"),
            format!("at most {ITEMS_MAX} are accepted, including home"),
        ));
    }
    let indices = Indices::of(&rows);
    let mut items = Vec::new();
    for (place, row) in rows.iter().enumerate() {
        items.push(item(document, row, indices.number(place))?);
    }
    if items.is_empty() {
        return Err(document.refuse(
            document.end(),
            "the file has no item",
            "give one item per line after the header",
        ));
    }
    indices.check_jumps(document, &items)?;
    Ok(ParsedMission {
        home: if indices.begin_with_home() {
            take_home(&mut items)
        } else {
            Home::Missing
        },
        items,
        zero_height: ZeroHeight::Kept,
        fence: Vec::new(),
        notes: indices.note().into_iter().collect(),
        items_at: document.end(),
    })
}

/// The lines that are neither empty nor comments.
fn lines(text: &str) -> impl Iterator<Item = &str> {
    text.lines()
        .filter(|line| !line.trim().is_empty() && !line.starts_with('#'))
}

/// The column `index`, which programs fill in different ways.
enum Indices {
    /// Ascending: the numbers by which jumps name the items.
    Ascending(Vec<u16>),
    /// Any other: they are ignored.
    Unordered { first: Option<u16> },
}

impl Indices {
    fn of(rows: &[&str]) -> Self {
        let index = |row: &&str| row.split_whitespace().next()?.parse().ok();
        let indices: Option<Vec<u16>> = rows.iter().map(index).collect();
        match indices {
            Some(indices) if indices.is_sorted_by(|index, next| index < next) => {
                Self::Ascending(indices)
            }
            _ => Self::Unordered {
                first: rows.first().and_then(index),
            },
        }
    }

    /// The number of an item: its index or, if these don't ascend, its place.
    fn number(&self, place: usize) -> usize {
        match self {
            Self::Ascending(indices) => indices.get(place).copied().map_or(place, usize::from),
            Self::Unordered { .. } => place,
        }
    }

    /// Whether the first item is home, which has index 0. Missions read back from an autopilot with DroneKit have none.
    fn begin_with_home(&self) -> bool {
        match self {
            Self::Ascending(indices) => indices.first() == Some(&0),
            Self::Unordered { first } => *first == Some(0),
        }
    }

    fn note(&self) -> Option<Note> {
        let is_usual = match self {
            Self::Ascending(indices) => (0..).zip(indices).all(|(place, index)| place == *index),
            Self::Unordered { .. } => false,
        };
        if is_usual {
            return None;
        }
        Some(Note {
            item: COLUMNS[0].to_owned(),
            kind: NoteKind::IndicesIgnored,
        })
    }

    /// Refuses jumps in a file whose indices don't ascend, for a jump names an item by its index.
    fn check_jumps(&self, document: Document<'_>, items: &[Item<'_>]) -> Result<(), BadInput> {
        let Self::Unordered { .. } = self else {
            return Ok(());
        };
        match items.iter().find(|item| item.is_flown_as(Manoeuvre::Jump)) {
            Some(jump) => Err(document.refuse(
                jump.first.text,
                format_args!(
                    "{}: the jump needs ascending indices, which the file does not have",
                    jump.name
                ),
                "number the items from 0 in the order of their lines, or save the mission again from a ground station",
            )),
            None => Ok(()),
        }
    }
}

fn check_header(document: Document<'_>, line: &str) -> Result<(), BadInput> {
    if line.split_whitespace().eq(["QGC", "WPL", "110"]) {
        return Ok(());
    }
    Err(document.refuse(
        line,
        format_args!("the header is {}", quoted(line)),
        "the first line must be `QGC WPL 110`: save the mission again from a ground station",
    ))
}

fn item<'a>(document: Document<'a>, line: &'a str, number: usize) -> Result<Item<'a>, BadInput> {
    let columns: Vec<&'a str> = line.split_whitespace().take(COLUMNS.len() + 1).collect();
    let Ok(columns) = <[&'a str; COLUMNS.len()]>::try_from(columns) else {
        let count = line.split_whitespace().count();
        return Err(document.refuse(
            line,
            format_args!("item {number} has {count} columns"),
            format!("a line has {}: {}", COLUMNS.len(), COLUMNS.join(" ")),
        ));
    };
    let row = Row {
        document,
        columns,
        number,
    };
    row.code(0)?;
    row.flag(1)?;
    for parameter in 6..8 {
        row.number(parameter)?;
    }
    Ok(Item {
        name: format!("item {number}"),
        frame: row.code(2)?,
        command: row.code(3)?,
        number: u16::try_from(number).ok(),
        first: row.number(4)?,
        second: row.number(5)?,
        position: Position {
            latitude_deg: row.number(8)?,
            longitude_deg: row.number(9)?,
            altitude_m: row.number(10)?,
        },
        auto_continue: row.flag(11)?,
    })
}

/// Removes item 0 and returns it as home, if it is home.
///
/// Ground stations write home as a waypoint above sea level; some above home at height 0, or before a take-off. Mission Planner
/// writes no command if home is not set. Ground stations for PX4 write no home.
fn take_home<'a>(items: &mut Vec<Item<'a>>) -> Home<'a> {
    let Some(first) = items.first() else {
        return Home::Missing;
    };
    if first.command.value == NO_COMMAND && first.position.has_no_coordinates() {
        items.remove(0);
        return Home::Missing;
    }
    let is_above_sea_level = first.frame.value == HOME_FRAME;
    let is_on_the_ground = first.position.altitude_m.value == Some(0.0);
    let is_before_take_off = items
        .get(1)
        .is_some_and(|item| item.is_flown_as(Manoeuvre::TakeOff));
    let is_home = is_above_sea_level || is_on_the_ground || is_before_take_off;
    if !first.is_flown_as(Manoeuvre::Waypoint) || !is_home {
        return Home::Missing;
    }
    let at = items.remove(0).position;
    if at.has_no_coordinates() {
        return Home::Missing;
    }
    Home::Item0 {
        at,
        is_above_sea_level,
    }
}

/// A line with all columns.
struct Row<'a> {
    document: Document<'a>,
    columns: [&'a str; COLUMNS.len()],
    number: usize,
}

impl<'a> Row<'a> {
    fn code(&self, column: usize) -> Result<Parsed<'a, u16>, BadInput> {
        let text = self.columns[column];
        match text.parse() {
            Ok(value) => Ok(Parsed { value, text }),
            Err(_) => Err(self.refuse(column, "a whole number from 0 to 65535")),
        }
    }

    fn flag(&self, column: usize) -> Result<bool, BadInput> {
        match self.columns[column] {
            "0" => Ok(false),
            "1" => Ok(true),
            _ => Err(self.refuse(column, "0 or 1")),
        }
    }

    fn number(&self, column: usize) -> Result<Parsed<'a, Option<f64>>, BadInput> {
        let text = self.columns[column];
        match text.parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(Parsed {
                value: Some(number),
                text,
            }),
            Ok(number) if number.is_nan() => Ok(Parsed { value: None, text }),
            _ => Err(self.refuse(column, "a finite number")),
        }
    }

    fn refuse(&self, column: usize, accepted: &str) -> BadInput {
        let (name, text) = (COLUMNS[column], self.columns[column]);
        self.document.refuse(
            text,
            format_args!(
                "the column `{name}` of item {} is {}",
                self.number,
                quoted(text)
            ),
            format!("`{name}` must be {accepted}"),
        )
    }
}
