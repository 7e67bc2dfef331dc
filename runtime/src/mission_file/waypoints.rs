//! The `QGC WPL 110` text: a header, then an item a line.
//!
//! Source: *File Formats*, "Mission Plain-Text File Format", of the MAVLink developer guide. Deviations, as the readers
//! in common use have them: any white space separates columns, and empty lines and those that begin with `#` are
//! passed over.

use super::ITEMS_MAX;
use super::command::{Handling, Manoeuvre, handling};
use super::document::{Document, Written, quoted};
use super::item::{Home, Item, Listing, Position};
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

pub(super) fn read(document: Document<'_>) -> Result<Listing<'_>, BadInput> {
    let mut lines = document
        .text
        .lines()
        .filter(|line| !line.trim().is_empty() && !line.starts_with('#'));
    check_header(document, lines.next().unwrap_or(document.end()))?;
    let mut items = Vec::new();
    for line in lines {
        if items.len() == ITEMS_MAX {
            return Err(document.refuse(
                line,
                format_args!("the file has more than {ITEMS_MAX} items"),
                format!("at most {ITEMS_MAX} are read, home included"),
            ));
        }
        items.push(item(document, line, items.len())?);
    }
    if items.is_empty() {
        return Err(document.refuse(
            document.end(),
            "the file has no item",
            "save the mission again: an item a line follows the header",
        ));
    }
    Ok(Listing {
        home: take_home(&mut items),
        items,
        notes: Vec::new(),
        items_at: document.end(),
    })
}

fn check_header(document: Document<'_>, line: &str) -> Result<(), BadInput> {
    if line.split_whitespace().eq(["QGC", "WPL", "110"]) {
        return Ok(());
    }
    Err(document.refuse(
        line,
        format_args!("the header is {}", quoted(line)),
        "only version 110 is read, whose first line is `QGC WPL 110`: save the mission again from a ground station",
    ))
}

fn item<'a>(document: Document<'a>, line: &'a str, expected: usize) -> Result<Item<'a>, BadInput> {
    let columns: Vec<&'a str> = line.split_whitespace().take(COLUMNS.len() + 1).collect();
    let Ok(columns) = <[&'a str; COLUMNS.len()]>::try_from(columns) else {
        let count = line.split_whitespace().count();
        return Err(document.refuse(
            line,
            format_args!("item {expected} has {count} columns"),
            format!("a line has {}: {}", COLUMNS.len(), COLUMNS.join(" ")),
        ));
    };
    let row = Row {
        document,
        columns,
        index: expected,
    };
    row.check_index()?;
    row.flag(1)?;
    for parameter in 6..8 {
        row.number(parameter)?;
    }
    Ok(Item {
        name: format!("item {expected}"),
        frame: row.code(2)?,
        command: row.code(3)?,
        number: u16::try_from(expected).ok(),
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

/// Takes out item 0 where it says where home is. Ground stations write it as a waypoint above sea level; some above home, at
/// height 0, or before the take-off. Those for PX4 leave it out.
fn take_home<'a>(items: &mut Vec<Item<'a>>) -> Home<'a> {
    let is =
        |item: &Item<'_>, manoeuvre| handling(item.command.value) == Handling::Flown(manoeuvre);
    let Some(first) = items.first().filter(|item| is(item, Manoeuvre::Waypoint)) else {
        return Home::Missing;
    };
    let is_above_sea_level = first.frame.value == HOME_FRAME;
    let is_on_the_ground = first.position.altitude_m.value == Some(0.0);
    let is_before_take_off = items
        .get(1)
        .is_some_and(|item| is(item, Manoeuvre::TakeOff));
    if !is_above_sea_level && !is_on_the_ground && !is_before_take_off {
        return Home::Missing;
    }
    let home = items.remove(0).position;
    match (home.has_no_coordinates(), is_above_sea_level) {
        (true, _) => Home::Missing,
        (false, true) => Home::Given(home),
        (false, false) => Home::OnTheGround(home),
    }
}

/// A line that has all its columns.
struct Row<'a> {
    document: Document<'a>,
    columns: [&'a str; COLUMNS.len()],
    index: usize,
}

impl<'a> Row<'a> {
    fn check_index(&self) -> Result<(), BadInput> {
        if self.columns[0].parse() == Ok(self.index) {
            return Ok(());
        }
        Err(self.refuse(
            0,
            &format!("{}: items are numbered from 0 in order", self.index),
        ))
    }

    fn code(&self, column: usize) -> Result<Written<'a, u16>, BadInput> {
        let text = self.columns[column];
        match text.parse() {
            Ok(value) => Ok(Written { value, text }),
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

    fn number(&self, column: usize) -> Result<Written<'a, Option<f64>>, BadInput> {
        let text = self.columns[column];
        match text.parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(Written {
                value: Some(number),
                text,
            }),
            Ok(number) if number.is_nan() => Ok(Written { value: None, text }),
            _ => Err(self.refuse(column, "a finite number")),
        }
    }

    fn refuse(&self, column: usize, accepted: &str) -> BadInput {
        let (name, text) = (COLUMNS[column], self.columns[column]);
        self.document.refuse(
            text,
            format_args!(
                "the column `{name}` of item {} is {}",
                self.index,
                quoted(text)
            ),
            format!("`{name}` must be {accepted}"),
        )
    }
}
