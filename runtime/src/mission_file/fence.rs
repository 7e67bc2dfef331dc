//! Reader of a plan's fence, and the check that the mission is inside.
//!
//! Source: *Plan File Format*, QGroundControl developer guide: `geoFence`, version 2.

use muster_machines::geodetic::{Geodetic, HOME_DISTANCE_MAX_M, local_ned};
use muster_machines::geometry::Ned;
use muster_machines::navigation::{Area, Polygon, PolygonError, Zone};

use super::document::{Document, Parsed};
use super::item::Position;
use super::json::{Node, Object};
use super::qgc_plan::{check_version, exactly};
use super::{FENCE_CORNERS_MAX, FENCE_ZONES_MAX, FenceZone, Note, NoteKind};
use crate::diagnostic::BadInput;

/// Since QGroundControl 3.4. Circles and polygons, each an inclusion or exclusion zone.
const FENCE_VERSION: u16 = 2;

/// A circle or polygon of a fence, as read from its file.
#[derive(Debug)]
pub(super) struct ParsedZone<'a> {
    name: String,
    at: &'a str,
    is_inclusion: bool,
    area: ParsedArea<'a>,
}

#[derive(Debug)]
enum ParsedArea<'a> {
    Circle {
        centre: Position<'a>,
        radius_m: Parsed<'a, Option<f64>>,
    },
    Polygon(Vec<Position<'a>>),
}

/// Reads a plan's fence; empty if it has none. Adds a note for an ignored return point.
pub(super) fn read<'a>(
    document: Document<'a>,
    plan: &Object<'a>,
    notes: &mut Vec<Note>,
) -> Result<Vec<ParsedZone<'a>>, BadInput> {
    let Some(fence) = plan.optional_field("geoFence") else {
        return Ok(Vec::new());
    };
    let item = fence.path().to_owned();
    let fence = fence.object()?;
    let list = |name: &str| match fence.optional_field(name) {
        Some(list) => list.elements(FENCE_CORNERS_MAX),
        None => Ok(Vec::new()),
    };
    let (circles, polygons) = (list("circles")?, list("polygons")?);
    // `polygon` is version 1's only polygon.
    let is_empty = circles.is_empty() && polygons.is_empty() && list("polygon")?.is_empty();
    if is_empty {
        return Ok(Vec::new());
    }
    check_version(document, &fence.field("version")?, FENCE_VERSION)?;
    if let Some(extra) = circles.iter().chain(&polygons).nth(FENCE_ZONES_MAX) {
        return Err(document.refuse(
            extra.pointer(),
            format_args!("the fence has more than {FENCE_ZONES_MAX} circles and polygons"),
            format!("at most {FENCE_ZONES_MAX} are accepted"),
        ));
    }
    let mut zones = Vec::new();
    for node in circles {
        zones.push(circle(document, node)?);
    }
    let mut corners = 0;
    for node in polygons {
        zones.push(polygon(document, node, &mut corners)?);
    }
    if fence.optional_field("breachReturn").is_some() {
        let kind = NoteKind::BreachReturnIgnored;
        notes.push(Note { item, kind });
    }
    Ok(zones)
}

fn circle<'a>(document: Document<'a>, node: Node<'a>) -> Result<ParsedZone<'a>, BadInput> {
    let (name, at) = (node.path().to_owned(), node.pointer());
    let zone = node.object()?;
    let circle = zone.field("circle")?.object()?;
    Ok(ParsedZone {
        name,
        at,
        is_inclusion: zone.field("inclusion")?.boolean()?.value,
        area: ParsedArea::Circle {
            centre: place(document, &circle.field("center")?)?,
            radius_m: circle.field("radius")?.number_or_null()?,
        },
    })
}

/// Parses a polygon, and adds its corners to the number of `corners` so far.
fn polygon<'a>(
    document: Document<'a>,
    node: Node<'a>,
    corners: &mut usize,
) -> Result<ParsedZone<'a>, BadInput> {
    let (name, at) = (node.path().to_owned(), node.pointer());
    let zone = node.object()?;
    let outline = zone.field("polygon")?.elements(FENCE_CORNERS_MAX)?;
    *corners += outline.len();
    if *corners > FENCE_CORNERS_MAX {
        return Err(document.refuse(
            at,
            format_args!("the fence's polygons have more than {FENCE_CORNERS_MAX} corners"),
            format!("at most {FENCE_CORNERS_MAX} are accepted for all polygons together"),
        ));
    }
    let outline = outline.iter().map(|corner| place(document, corner));
    Ok(ParsedZone {
        name,
        at,
        is_inclusion: zone.field("inclusion")?.boolean()?.value,
        area: ParsedArea::Polygon(outline.collect::<Result<_, _>>()?),
    })
}

/// Parses coordinates without an altitude.
fn place<'a>(document: Document<'a>, node: &Node<'a>) -> Result<Position<'a>, BadInput> {
    let [latitude, longitude] = exactly(document, node, "latitude and longitude")?;
    let latitude_deg = latitude.number_or_null()?;
    Ok(Position {
        latitude_deg,
        longitude_deg: longitude.number_or_null()?,
        altitude_m: Parsed {
            value: None,
            text: latitude_deg.text,
        },
    })
}

impl ParsedZone<'_> {
    /// The zone in the local frame about home.
    pub(super) fn to_local(
        &self,
        document: Document<'_>,
        home: Geodetic,
    ) -> Result<FenceZone, BadInput> {
        let name = &self.name;
        let area = match &self.area {
            ParsedArea::Circle { centre, radius_m } => {
                let is_accepted = |it: &f64| *it > 0.0 && *it <= HOME_DISTANCE_MAX_M;
                let Some(radius) = radius_m.value.filter(is_accepted) else {
                    let found = match radius_m.value {
                        Some(radius) => format!("is {radius} m"),
                        None => "is not given".to_owned(),
                    };
                    return Err(document.refuse(
                        radius_m.text,
                        format_args!("{name}: the radius {found}"),
                        format!("give a radius above 0 and up to {HOME_DISTANCE_MAX_M} m"),
                    ));
                };
                Area::Circle {
                    centre: local(document, name, home, centre)?,
                    radius_m: radius,
                }
            }
            ParsedArea::Polygon(outline) => {
                let corners = outline
                    .iter()
                    .map(|corner| local(document, name, home, corner))
                    .collect::<Result<Vec<_>, _>>()?;
                let polygon = Polygon::new(corners);
                Area::Polygon(polygon.map_err(|error| self.refuse(document, outline, error))?)
            }
        };
        Ok(FenceZone {
            zone: Zone {
                area,
                is_inclusion: self.is_inclusion,
            },
            name: self.name.clone(),
        })
    }

    fn refuse(
        &self,
        document: Document<'_>,
        outline: &[Position<'_>],
        error: PolygonError,
    ) -> BadInput {
        let (at, help) = match error {
            PolygonError::TooFewCorners { .. } => (self.at, "give at least three corners"),
            PolygonError::SidesMeet { second, .. } => (
                outline[second].latitude_deg.text,
                "give the corners in order, so that no two sides meet",
            ),
        };
        document.refuse(at, format_args!("{}: {error}", self.name), help)
    }

    /// Refuses a fence if home, a waypoint or a leg is on its wrong side.
    pub(super) fn check(
        &self,
        document: Document<'_>,
        zone: &Zone,
        waypoints: &[Ned],
    ) -> Result<(), BadInput> {
        let (side, through) = if self.is_inclusion {
            ("outside of it", "leaves it")
        } else {
            ("inside of it", "crosses it")
        };
        let refuse = |what: String| {
            let message = format!("{}: {what}", self.name);
            let help = "move the fence or the waypoints: the whole mission, including home, must be inside of all inclusion zones \
                        and outside of all exclusion zones";
            Err(document.refuse(self.at, message, help))
        };
        let places = waypoints.iter().copied().enumerate();
        let places = places.map(|(number, at)| (format!("waypoint {number}"), at));
        for (name, place) in [("home".to_owned(), Ned::HOME)].into_iter().chain(places) {
            let clearance_m = zone.clearance_m(place);
            if clearance_m <= 0.0 {
                return refuse(format!("{name} is {:.1} m {side}", -clearance_m));
            }
        }
        for (number, leg) in waypoints.windows(2).enumerate() {
            if zone.clearance_along_m(leg[0], leg[1]) <= 0.0 {
                let next = number + 1;
                return refuse(format!(
                    "the leg from waypoint {number} to waypoint {next} {through}"
                ));
            }
        }
        Ok(())
    }
}

fn local(
    document: Document<'_>,
    name: &str,
    home: Geodetic,
    position: &Position<'_>,
) -> Result<Ned, BadInput> {
    let place = position.geodetic(document, name, home.altitude_m())?;
    local_ned(home, place).map_err(|error| {
        document.refuse(
            position.latitude_deg.text,
            format_args!("{name}: {error}"),
            "check home and the fence, and that latitude comes before longitude",
        )
    })
}
