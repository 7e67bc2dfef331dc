//! Reader of KML: the first `LineString` of the file.
//!
//! Source: OGC 12-007r2, *OGC KML 2.3*, "kml:LineString". Altitudes above ground are used as heights above home, with a note.
//! Altitudes above sea level are accepted only in a plan exported by QGroundControl, whose path begins at home.

use std::ops::Range;

use roxmltree::{Document as Xml, Error, Node};

use super::document::{Document, Parsed, quoted};
use super::item::{Home, Item, ParsedMission, Position, ZeroHeight};
use super::{ITEMS_MAX, Note, NoteKind};
use crate::diagnostic::BadInput;

const NAV_WAYPOINT: u16 = 16;
const NAV_LAND: u16 = 21;
const ABOVE_SEA_LEVEL: u16 = 0;
const ABOVE_HOME: u16 = 3;

/// Document name in QGroundControl's exports.
const QGROUNDCONTROL: &str = "QGroundControl Plan KML";

/// The largest height of a path's ends that counts as on the ground, in metres.
const ON_THE_GROUND_M: f64 = 0.5;

const DRAW: &str = "draw a path with altitudes relative to the ground and save it as KML";

pub(super) fn read(document: Document<'_>) -> Result<ParsedMission<'_>, BadInput> {
    let xml = Xml::parse(document.text).map_err(|error| not_xml(document, &error))?;
    let Some(path) = find_element(xml.root(), "LineString") else {
        return Err(document.refuse(document.end(), "the file has no `LineString`", DRAW));
    };
    let Some(coordinates) = find_element(path, "coordinates") else {
        let place = opening_tag(document, path);
        return Err(document.refuse(place, "the `LineString` has no `coordinates`", DRAW));
    };
    let (frame, mut notes) = frame(document, &xml, path)?;
    let text = content(document, coordinates);
    // A comment parts the text.
    let parts = coordinates.children().filter(Node::is_text);
    let points = parts.flat_map(|part| slice(document, part.range()).split_whitespace());
    let mut items = Vec::new();
    for point in points {
        if items.len() == ITEMS_MAX {
            return Err(document.refuse(
                point,
                format_args!("the path has more than {ITEMS_MAX} points"),
                format!("at most {ITEMS_MAX} are accepted"),
            ));
        }
        items.push(item(document, point, frame, items.len() + 1)?);
    }
    let home = take_ends(&mut items, frame.value, &mut notes);
    Ok(ParsedMission {
        home,
        items,
        zero_height: ZeroHeight::Ground,
        fence: Vec::new(),
        notes,
        items_at: text,
    })
}

/// Removes the first point if it is on the ground, and returns it as home. If the last point is on the ground, makes it a
/// landing.
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
    let start = items.remove(0);
    notes.push(Note {
        item: start.name,
        kind: NoteKind::HomeFromPathStart,
    });
    if is_above_sea_level {
        Home::Planned(start.position)
    } else {
        Home::OnTheGround(start.position)
    }
}

/// The reference of a path's altitudes.
fn frame<'a>(
    document: Document<'a>,
    xml: &Xml<'_>,
    path: Node<'_, '_>,
) -> Result<(Parsed<'a, u16>, Vec<Note>), BadInput> {
    let mode = find_element(path, "altitudeMode");
    let text = mode.map_or_else(
        || opening_tag(document, path),
        |mode| content(document, mode),
    );
    match (mode, text.trim()) {
        (Some(_), "absolute") if is_exported_plan(xml) => {
            let value = ABOVE_SEA_LEVEL;
            Ok((Parsed { value, text }, Vec::new()))
        }
        (Some(_), "absolute") => Err(document.refuse(
            text,
            "the path's altitudes are above sea level, but home's altitude is unknown",
            "give altitudes relative to the ground; above sea level is accepted only in plans exported by QGroundControl, which \
             begin at home",
        )),
        (Some(_), "relativeToGround") => {
            let value = ABOVE_HOME;
            let note = Note {
                item: "altitudeMode".to_owned(),
                kind: NoteKind::TerrainAltitudesAboveHome,
            };
            Ok((Parsed { value, text }, vec![note]))
        }
        _ => Err(document.refuse(text, "the path is on the ground", DRAW)),
    }
}

fn is_exported_plan(xml: &Xml<'_>) -> bool {
    let document = find_element(xml.root(), "Document");
    let name = document.and_then(|document| find_element(document, "name"));
    name.and_then(|name| name.text()).map(str::trim) == Some(QGROUNDCONTROL)
}

/// Parses a point as a waypoint.
fn item<'a>(
    document: Document<'a>,
    point: &'a str,
    frame: Parsed<'a, u16>,
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
            "give a point as longitude,latitude,altitude without spaces",
        ));
    };
    let none = Parsed {
        value: None,
        text: point,
    };
    Ok(Item {
        name: format!("point {number}"),
        command: Parsed {
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
) -> Result<Parsed<'a, Option<f64>>, BadInput> {
    match text.parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(Parsed {
            value: Some(number),
            text,
        }),
        _ => Err(document.refuse(
            text,
            format_args!("{} is not a finite number", quoted(text)),
            "give a point as longitude,latitude,altitude without spaces",
        )),
    }
}

/// The first descendant element of this name.
fn find_element<'x, 'input>(within: Node<'x, 'input>, name: &str) -> Option<Node<'x, 'input>> {
    let is_it = |node: &Node<'_, '_>| node.is_element() && node.tag_name().name() == name;
    within.descendants().find(is_it)
}

/// The text between an element's tags.
fn content<'a>(document: Document<'a>, element: Node<'_, '_>) -> &'a str {
    let text = element.children().find(Node::is_text);
    slice(
        document,
        text.map_or_else(|| element.range(), |text| text.range()),
    )
}

/// An element's opening tag.
fn opening_tag<'a>(document: Document<'a>, element: Node<'_, '_>) -> &'a str {
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
        "give a KML file as saved by Google Earth",
    )
}
