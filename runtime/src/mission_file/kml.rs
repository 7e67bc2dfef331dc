//! A path drawn on a map: the first `LineString` of a KML file.
//!
//! Source: OGC 12-007r2, *OGC KML 2.3*, "kml:LineString". What is above the ground there is flown above home, with a note.
//! Altitudes above sea level are read where QGroundControl exports a plan, whose path begins at the planned home.

use std::ops::Range;

use roxmltree::{Document as Xml, Error, Node};

use super::document::{Document, Written, quoted};
use super::item::{Home, Item, Listing, Position, ZeroHeight};
use super::{ITEMS_MAX, Note, NoteKind};
use crate::diagnostic::BadInput;

const NAV_WAYPOINT: u16 = 16;
const NAV_LAND: u16 = 21;
const ABOVE_SEA_LEVEL: u16 = 0;
const ABOVE_HOME: u16 = 3;

/// What QGroundControl names a document that it exports.
const QGROUNDCONTROL: &str = "QGroundControl Plan KML";

/// How far from the ground the ends of a path may be, in metres, for the swarm to take off and land there.
const ON_THE_GROUND_M: f64 = 0.5;

const DRAW: &str = "draw a path with altitudes relative to the ground, and save it as KML";

pub(super) fn read(document: Document<'_>) -> Result<Listing<'_>, BadInput> {
    let xml = Xml::parse(document.text).map_err(|error| not_xml(document, &error))?;
    let Some(path) = named(xml.root(), "LineString") else {
        return Err(document.refuse(document.end(), "the file has no `LineString`", DRAW));
    };
    let Some(coordinates) = named(path, "coordinates") else {
        let place = opening(document, path);
        return Err(document.refuse(place, "the `LineString` has no `coordinates`", DRAW));
    };
    let (frame, mut notes) = frame(document, &xml, path)?;
    let text = content(document, coordinates);
    let mut items = Vec::new();
    for point in text.split_whitespace() {
        if items.len() == ITEMS_MAX {
            return Err(document.refuse(
                point,
                format_args!("the path has more than {ITEMS_MAX} points"),
                format!("at most {ITEMS_MAX} are read"),
            ));
        }
        items.push(item(document, point, frame, items.len() + 1)?);
    }
    let home = take_ends(&mut items, frame.value, &mut notes);
    Ok(Listing {
        home,
        items,
        zero_height: ZeroHeight::Ground,
        fence: Vec::new(),
        notes,
        items_at: text,
    })
}

/// Takes out the point where the path begins, if it is on the ground: home is there. If it ends on the ground, the swarm lands.
fn take_ends<'a>(items: &mut Vec<Item<'a>>, frame: u16, notes: &mut Vec<Note>) -> Home<'a> {
    let is_above_sea_level = frame == ABOVE_SEA_LEVEL;
    let ground_m = match items.first() {
        Some(home) if is_above_sea_level => home.position.altitude_m.value,
        _ => Some(0.0),
    };
    let is_on_the_ground = |item: &Item<'_>| match (item.position.altitude_m.value, ground_m) {
        (Some(altitude_m), Some(ground_m)) => (altitude_m - ground_m).abs() <= ON_THE_GROUND_M,
        _ => false,
    };
    if let [_, .., end] = &mut items[..]
        && is_on_the_ground(end)
    {
        end.command.value = NAV_LAND;
    }
    if items.len() < 2 || !is_on_the_ground(&items[0]) {
        return Home::Missing;
    }
    let begin = items.remove(0);
    notes.push(Note {
        item: begin.name,
        kind: NoteKind::HomeWherePathBegins,
    });
    if is_above_sea_level {
        Home::Planned(begin.position)
    } else {
        Home::OnTheGround(begin.position)
    }
}

/// What the altitudes of a path are above.
fn frame<'a>(
    document: Document<'a>,
    xml: &Xml<'_>,
    path: Node<'_, '_>,
) -> Result<(Written<'a, u16>, Vec<Note>), BadInput> {
    let mode = named(path, "altitudeMode");
    let text = mode.map_or_else(|| opening(document, path), |mode| content(document, mode));
    match (mode, text.trim()) {
        (Some(_), "absolute") if is_exported_plan(xml) => {
            let value = ABOVE_SEA_LEVEL;
            Ok((Written { value, text }, Vec::new()))
        }
        (Some(_), "absolute") => Err(document.refuse(
            text,
            "the path's altitudes are above sea level, and that of home is not known",
            "give altitudes relative to the ground; those above sea level are read where QGroundControl has exported a plan, whose \
             path begins at home",
        )),
        (Some(_), "relativeToGround") => {
            let value = ABOVE_HOME;
            let note = Note {
                item: "altitudeMode".to_owned(),
                kind: NoteKind::GroundTakenForLevel,
            };
            Ok((Written { value, text }, vec![note]))
        }
        _ => Err(document.refuse(text, "the path lies on the ground", DRAW)),
    }
}

fn is_exported_plan(xml: &Xml<'_>) -> bool {
    let document = named(xml.root(), "Document");
    let name = document.and_then(|document| named(document, "name"));
    name.and_then(|name| name.text()).map(str::trim) == Some(QGROUNDCONTROL)
}

/// A point: longitude, latitude and altitude.
fn item<'a>(
    document: Document<'a>,
    point: &'a str,
    frame: Written<'a, u16>,
    number: usize,
) -> Result<Item<'a>, BadInput> {
    let mut numbers = point.split(',').map(|text| number_in(document, text));
    let mut next = || numbers.next().transpose();
    let (longitude, latitude, altitude) = (next()?, next()?, next()?);
    let (Some(longitude_deg), Some(latitude_deg), None) = (longitude, latitude, numbers.next())
    else {
        return Err(document.refuse(
            point,
            format_args!("point {number} is {}", quoted(point)),
            "a point is its longitude, latitude and altitude, with commas between them and no space",
        ));
    };
    let none = Written {
        value: None,
        text: point,
    };
    Ok(Item {
        name: format!("point {number}"),
        command: Written {
            value: NAV_WAYPOINT,
            text: point,
        },
        frame,
        number: None,
        first: none,
        second: none,
        position: Position {
            latitude_deg,
            longitude_deg,
            altitude_m: altitude.unwrap_or(none),
        },
        auto_continue: true,
    })
}

fn number_in<'a>(
    document: Document<'a>,
    text: &'a str,
) -> Result<Written<'a, Option<f64>>, BadInput> {
    match text.parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(Written {
            value: Some(number),
            text,
        }),
        _ => Err(document.refuse(
            text,
            format_args!("{} is not a finite number", quoted(text)),
            "a point is its longitude, latitude and altitude, with commas between them and no space",
        )),
    }
}

/// The first element of this name within another.
fn named<'x, 'input>(within: Node<'x, 'input>, name: &str) -> Option<Node<'x, 'input>> {
    let is_it = |node: &Node<'_, '_>| node.is_element() && node.tag_name().name() == name;
    within.descendants().find(is_it)
}

/// What stands between an element's tags, as it is written.
fn content<'a>(document: Document<'a>, element: Node<'_, '_>) -> &'a str {
    let text = element.children().find(Node::is_text);
    slice(
        document,
        text.map_or_else(|| element.range(), |text| text.range()),
    )
}

/// An element's opening tag.
fn opening<'a>(document: Document<'a>, element: Node<'_, '_>) -> &'a str {
    let tag = slice(document, element.range());
    &tag[..tag.find('>').map_or(tag.len(), |end| end + 1)]
}

fn slice(document: Document<'_>, range: Range<usize>) -> &str {
    document.text.get(range).unwrap_or_default()
}

fn not_xml(document: Document<'_>, error: &Error) -> BadInput {
    let place = error.pos();
    let (line, column) = (place.row as usize, place.col as usize);
    let start = document.line_start(line);
    let rest = &document.text[start..];
    let within = rest.char_indices().nth(column.saturating_sub(1));
    let at = start + within.map_or(rest.len(), |(at, _)| at);
    let described = error.to_string();
    let problem = described.strip_suffix(&format!(" at {place}"));
    document.refuse_at(
        at..at + 1,
        format_args!("this is not XML: {}", problem.unwrap_or(&described)),
        "give a KML file as Google Earth saves it",
    )
}
