//! Reader of QGroundControl's `.plan`.
//!
//! Source: *Plan File Format*, QGroundControl developer guide, version 4. Only the fields that the swarm needs are read. Rally
//! points are only counted, and a vehicle's settings are ignored.

use super::document::{Document, Parsed, quoted};
use super::fence;
use super::item::{Home, Item, ParsedMission, Position, ZeroHeight};
use super::json::{Node, Object};
use super::{ITEMS_MAX, Note, NoteKind};
use crate::diagnostic::BadInput;

const FILE_TYPE: &str = "Plan";
const FILE_VERSION: u16 = 1;

/// Since QGroundControl 3.2. Items have `params`.
const MISSION_VERSION: u16 = 2;

/// `firmwareType` of ArduPilot: `MAV_AUTOPILOT_ARDUPILOTMEGA`.
const ARDUPILOT: u16 = 3;

/// `MAV_FRAME_GLOBAL_TERRAIN_ALT`: altitudes above terrain.
const ABOVE_GROUND_FRAME: u16 = 10;

/// `AltitudeMode` of altitudes above terrain. QGroundControl converts them to altitudes above sea level once it has terrain
/// data; until then the item's altitude is `null`.
const CALCULATED_ABOVE_GROUND: u16 = 3;

/// The `complexItemType`s whose simple items are in the file.
const EXPANDED: [&str; 2] = ["survey", "CorridorScan"];

pub(super) fn read(document: Document<'_>) -> Result<ParsedMission<'_>, BadInput> {
    let plan = Node::root(document)?.object()?;
    check_type(document, &plan)?;
    check_version(document, &plan.field("version")?, FILE_VERSION)?;
    let mission = plan.field("mission")?.object()?;
    check_version(document, &mission.field("version")?, MISSION_VERSION)?;
    let home = home(document, &mission.field("plannedHomePosition")?)?;
    let zero_height = zero_height(&mission);
    let mut items = Vec::new();
    let array = mission.field("items")?;
    for node in array.elements(ITEMS_MAX)? {
        add_item(document, node, &mut items)?;
    }
    let mut notes = Vec::new();
    let fence = fence::read(document, &plan, &mut notes)?;
    notes.extend(rally_points(&plan)?);
    Ok(ParsedMission {
        home,
        items,
        zero_height,
        fence,
        notes,
        items_at: array.pointer(),
    })
}

/// A note if the plan has rally points.
fn rally_points(plan: &Object<'_>) -> Result<Option<Note>, BadInput> {
    let Some(part) = plan.optional_field("rallyPoints") else {
        return Ok(None);
    };
    let item = part.path().to_owned();
    let points = part.object()?.optional_field("points");
    let is_empty = match points {
        Some(points) => points.elements(ITEMS_MAX)?.is_empty(),
        None => true,
    };
    let kind = NoteKind::RallyPointsIgnored;
    Ok((!is_empty).then_some(Note { item, kind }))
}

fn check_type(document: Document<'_>, plan: &Object<'_>) -> Result<(), BadInput> {
    let file_type = plan.field("fileType")?.string()?;
    if file_type.value == FILE_TYPE {
        return Ok(());
    }
    Err(document.refuse(
        file_type.text,
        format_args!("`fileType` is {}", quoted(file_type.text)),
        "`fileType` must be \"Plan\": give a mission `.plan` saved by QGroundControl",
    ))
}

pub(super) fn check_version(
    document: Document<'_>,
    version: &Node<'_>,
    accepted: u16,
) -> Result<(), BadInput> {
    let Parsed { value, text } = version.code()?;
    if value == accepted {
        return Ok(());
    }
    Err(document.refuse(
        text,
        format_args!("`{}` is {value}", version.path()),
        format!(
            "`{}` must be {accepted}: save the plan again with QGroundControl 4",
            version.path()
        ),
    ))
}

fn home<'a>(document: Document<'a>, home: &Node<'a>) -> Result<Home<'a>, BadInput> {
    let [latitude, longitude, altitude] = exactly(
        document,
        home,
        "latitude, longitude and altitude above sea level",
    )?;
    let position = position(&latitude, &longitude, &altitude)?;
    Ok(if position.has_no_coordinates() {
        Home::Missing
    } else {
        Home::Planned(position)
    })
}

/// Only ArduCopter treats a height of zero as none.
fn zero_height(mission: &Object<'_>) -> ZeroHeight {
    let firmware = mission.optional_field("firmwareType");
    match firmware.and_then(|firmware| firmware.code().ok()) {
        Some(Parsed {
            value: ARDUPILOT, ..
        }) => ZeroHeight::Kept,
        _ => ZeroHeight::Ground,
    }
}

/// Adds a simple item, or the simple items of a complex one.
fn add_item<'a>(
    document: Document<'a>,
    node: Node<'a>,
    items: &mut Vec<Item<'a>>,
) -> Result<(), BadInput> {
    let object = node.object()?;
    let item_type = object.field("type")?.string()?;
    match item_type.value.as_str() {
        "SimpleItem" => add_simple_item(document, &object, items),
        "ComplexItem" => {
            check_expanded(document, &object)?;
            let transects = object.field("TransectStyleComplexItem")?.object()?;
            for node in transects.field("Items")?.elements(ITEMS_MAX)? {
                add_simple_item(document, &node.object()?, items)?;
            }
            Ok(())
        }
        _ => Err(document.refuse(
            item_type.text,
            format_args!(
                "`{}.type` is {}",
                object.node().path(),
                quoted(item_type.text)
            ),
            "`type` must be \"SimpleItem\" or \"ComplexItem\"",
        )),
    }
}

fn check_expanded(document: Document<'_>, complex: &Object<'_>) -> Result<(), BadInput> {
    let kind = complex.field("complexItemType")?.string()?;
    if EXPANDED.contains(&kind.value.as_str()) {
        return Ok(());
    }
    Err(document.refuse(
        kind.text,
        format_args!(
            "`{}` is a complex item of the type {}, which a swarm can't fly",
            complex.node().path(),
            quoted(kind.text)
        ),
        "\"survey\" and \"CorridorScan\" are accepted: replace other complex items by waypoints",
    ))
}

fn add_simple_item<'a>(
    document: Document<'a>,
    item: &Object<'a>,
    items: &mut Vec<Item<'a>>,
) -> Result<(), BadInput> {
    if items.len() == ITEMS_MAX {
        return Err(document.refuse(
            item.node().pointer(),
            format_args!("the mission has more than {ITEMS_MAX} items"),
            format!("at most {ITEMS_MAX} are accepted, including those of surveys"),
        ));
    }
    let parameters = item.field("params")?;
    let [first, second, third, fourth, latitude, longitude, altitude] =
        exactly(document, &parameters, "the parameters of a MAVLink command")?;
    for unused in [third, fourth] {
        unused.number_or_null()?;
    }
    let position = position(&latitude, &longitude, &altitude)?;
    items.push(Item {
        name: item.node().path().to_owned(),
        command: item.field("command")?.code()?,
        frame: frame(item, &position)?,
        number: item
            .optional_field("doJumpId")
            .and_then(|id| Some(id.code().ok()?.value)),
        first: first.number_or_null()?,
        second: second.number_or_null()?,
        position,
        auto_continue: item.field("autoContinue")?.boolean()?.value,
    });
    Ok(())
}

/// The reference of an item's altitude.
fn frame<'a>(item: &Object<'a>, position: &Position<'a>) -> Result<Parsed<'a, u16>, BadInput> {
    let frame = item.field("frame")?.code()?;
    let mode = item.optional_field("AltitudeMode");
    match (
        position.altitude_m.value,
        mode.and_then(|mode| mode.code().ok()),
    ) {
        (
            None,
            Some(Parsed {
                value: CALCULATED_ABOVE_GROUND,
                text,
            }),
        ) => Ok(Parsed {
            value: ABOVE_GROUND_FRAME,
            text,
        }),
        _ => Ok(frame),
    }
}

/// The elements of an array that must have `N`.
pub(super) fn exactly<'a, const N: usize>(
    document: Document<'a>,
    array: &Node<'a>,
    meaning: &str,
) -> Result<[Node<'a>; N], BadInput> {
    let values = array.elements(ITEMS_MAX)?;
    let count = values.len();
    values.try_into().map_err(|_| {
        document.refuse(
            array.pointer(),
            format_args!("`{}` has {count} values", array.path()),
            format!("it must have {N}: {meaning}"),
        )
    })
}

fn position<'a>(
    latitude: &Node<'a>,
    longitude: &Node<'a>,
    altitude: &Node<'a>,
) -> Result<Position<'a>, BadInput> {
    Ok(Position {
        latitude_deg: latitude.number_or_null()?,
        longitude_deg: longitude.number_or_null()?,
        altitude_m: altitude.number_or_null()?,
    })
}
