//! Flats: a plan drawn as text, the drone's start and camera, people. The shipped ones are part of the program.

use std::path::Path;
use std::sync::Arc;

use muster_indoor::coverage::View;
use muster_indoor::frames::{MapPose, MapXy};
use muster_indoor::map::Map;
use muster_runtime::diagnostic::{BadInput, FileFormat, TomlFile, did_you_mean, read_text};
use muster_runtime::schema::{FieldList, Located};
use serde::Deserialize;

/// Edge of a cell of a flat's map, in metres.
pub const CELL_M: f64 = 0.05;
/// Most people of a flat.
pub const PEOPLE_MAX: usize = 50;
/// Edge of the area that a character of a plan stands for, in metres: cells of the map at least, a room at most.
const CHARACTER_M: (f64, f64) = (CELL_M, 2.0);
/// Length by which that edge may be off by rounding, in metres.
const ROUNDING_M: f64 = 1e-9;

/// Name and text of each shipped flat.
const SHIPPED: [(&str, &str); 4] = [
    ("flat", include_str!("../flats/flat.toml")),
    ("corridor", include_str!("../flats/corridor.toml")),
    ("ell", include_str!("../flats/ell.toml")),
    ("office", include_str!("../flats/office.toml")),
];

const FORMAT: FileFormat = FileFormat {
    fields: FieldList::EMPTY,
    description: "a flat has `about`, `cell_m`, `plan`, `start`, `camera` and any number of `[[people]]`",
};

/// A flat with people.
#[derive(Debug, Clone)]
pub struct Flat {
    /// Its name: that of its file.
    pub name: String,
    /// One line on it.
    pub about: String,
    /// Its map, in cells of [`CELL_M`].
    pub map: Arc<Map>,
    /// Where the drone starts.
    pub start: MapPose,
    /// The drone's camera.
    pub camera: View,
    /// Who walks about.
    pub people: Vec<Walk>,
}

/// Where a person walks, to and fro.
#[derive(Debug, Clone, PartialEq)]
pub struct Walk {
    /// Corners, at least two.
    pub path: Vec<MapXy>,
    /// In m/s.
    pub speed_mps: f64,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Raw {
    about: String,
    cell_m: Located<f64>,
    plan: Located<String>,
    start: Located<RawPose>,
    camera: Located<RawCamera>,
    #[serde(default)]
    people: Vec<Located<RawWalk>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawPose {
    x_m: f64,
    y_m: f64,
    heading_deg: f64,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawCamera {
    range_m: f64,
    cone_deg: f64,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawWalk {
    speed_mps: f64,
    path: Vec<[f64; 2]>,
}

/// Name and one line of each shipped flat.
#[must_use]
pub fn shipped() -> Vec<(&'static str, String)> {
    let about = |(name, text): &(&'static str, &str)| {
        let flat = Flat::parse(Path::new(name), text).expect("shipped flats are tested");
        (*name, flat.about)
    };
    SHIPPED.iter().map(about).collect()
}

impl Flat {
    /// Reads a flat: a shipped one by its name, a single word without a dot; else a file.
    ///
    /// # Errors
    /// If there is none of this name, or the file can't be used; with the place.
    pub fn read(named: &Path) -> Result<Self, BadInput> {
        let name = named.to_str().filter(|it| !it.contains(['.', '/']));
        let Some(name) = name else {
            return Self::parse(named, &read_text(named)?);
        };
        match SHIPPED.iter().find(|(it, _)| *it == name) {
            Some((_, text)) => Self::parse(named, text),
            None => {
                let names = SHIPPED.iter().map(|(it, _)| *it);
                let near = did_you_mean(name, names.clone());
                let help = format!("shipped flats: {}", names.collect::<Vec<_>>().join(", "));
                let message = format!("there is no shipped flat of this name{near}");
                Err(BadInput::without_excerpt(named, message, help))
            }
        }
    }

    /// Parses a flat's text. Errors name `path`.
    ///
    /// # Errors
    /// If it can't be used, with the place.
    pub fn parse(path: &Path, text: &str) -> Result<Self, BadInput> {
        let file: TomlFile<Raw> =
            TomlFile::parse(path, text.to_owned(), FORMAT).map_err(|error| {
                if draws_nothing(text) {
                    no_flat(path)
                } else {
                    error
                }
            })?;
        let map = drawn_map(&file)?;
        let start = start(&file, &map)?;
        let camera = camera(&file)?;
        let people = people(&file, &map)?;
        Ok(Self {
            name: path
                .file_stem()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned(),
            about: file.raw.about.clone(),
            map: Arc::new(map),
            start,
            camera,
            people,
        })
    }
}

/// The map of the drawn plan.
fn drawn_map(file: &TomlFile<Raw>) -> Result<Map, BadInput> {
    let raw = &file.raw;
    let cell_m = *raw.cell_m.get_ref();
    let cells = (cell_m / CELL_M).round();
    let is_whole = (cell_m - cells * CELL_M).abs() <= ROUNDING_M;
    if !(CHARACTER_M.0..=CHARACTER_M.1).contains(&cell_m) || !is_whole {
        let (from, to) = CHARACTER_M;
        let help = format!("{from} to {to} metres, in multiples of {CELL_M}");
        return Err(file.error_with(
            raw.cell_m.span(),
            &format!("`cell_m` can't be {cell_m}"),
            &help,
        ));
    }
    let cells = cells as usize;
    // The drawn plan first, for the places in its errors.
    Map::from_text(raw.plan.get_ref(), cell_m)
        .and_then(|_| Map::from_text(&widened(raw.plan.get_ref(), cells), CELL_M))
        .map_err(|error| {
            let span = file.place_of(&raw.plan, error.span);
            file.error_with(span, &error.message, &error.accepted)
        })
}

/// Whether a point is inside and clear of walls.
fn is_free(map: &Map, point: MapXy) -> bool {
    map.distance_m(point) > 0.0 && map.distance_m(point).is_finite()
}

fn start(file: &TomlFile<Raw>, map: &Map) -> Result<MapPose, BadInput> {
    let raw = &file.raw;
    let RawPose {
        x_m,
        y_m,
        heading_deg,
    } = raw.start.get_ref();
    if !heading_deg.is_finite() {
        let message = format!("`heading_deg` can't be {heading_deg}");
        let help = "degrees from the x axis, counter-clockwise: a finite number";
        return Err(file.error_with(raw.start.span(), &message, help));
    }
    let start = MapPose::new(*x_m, *y_m, heading_deg.to_radians());
    if !is_free(map, start.at) {
        let help = "a place inside, clear of walls";
        return Err(file.error_with(raw.start.span(), "the drone can't start in a wall", help));
    }
    Ok(start)
}

fn camera(file: &TomlFile<Raw>) -> Result<View, BadInput> {
    let raw = &file.raw;
    let RawCamera { range_m, cone_deg } = raw.camera.get_ref();
    if !(0.5..=20.0).contains(range_m) || !(20.0..=360.0).contains(cone_deg) {
        let help = "`range_m` from 0.5 to 20, `cone_deg` from 20 to 360";
        return Err(file.error_with(raw.camera.span(), "no such camera", help));
    }
    Ok(View {
        range_m: *range_m,
        cone_rad: cone_deg.to_radians(),
    })
}

fn people(file: &TomlFile<Raw>, map: &Map) -> Result<Vec<Walk>, BadInput> {
    let raw = &file.raw;
    if let Some(one_more) = raw.people.get(PEOPLE_MAX) {
        let help = format!("at most {PEOPLE_MAX} people");
        return Err(file.error_with(one_more.span(), "too many people", &help));
    }
    let mut people = Vec::new();
    for person in &raw.people {
        let RawWalk { speed_mps, path } = person.get_ref();
        let path: Vec<MapXy> = path.iter().map(|[x, y]| MapXy::new(*x, *y)).collect();
        let is_leg = |leg: &[MapXy]| {
            let (bearing_rad, length_m) = (leg[0].bearing_rad(leg[1]), leg[0].distance_m(leg[1]));
            map.cast(leg[0], bearing_rad, length_m).is_none()
        };
        let is_walk = path.len() >= 2
            && path.iter().all(|it| is_free(map, *it))
            && path.windows(2).all(is_leg);
        if !is_walk || !(0.1..=3.0).contains(speed_mps) {
            let help = "`path` has two places inside at least, straight legs without walls between; `speed_mps` is from 0.1 to 3";
            return Err(file.error_with(person.span(), "no person can walk so", help));
        }
        people.push(Walk {
            path,
            speed_mps: *speed_mps,
        });
    }
    Ok(people)
}

/// Whether a text is TOML of another kind: it has neither a plan nor the size of a plan's characters.
fn draws_nothing(text: &str) -> bool {
    let table = text.parse::<toml::Table>();
    table.is_ok_and(|it| !it.contains_key("plan") && !it.contains_key("cell_m"))
}

/// The error for a scenario, a drone's configuration or other TOML in the place of a flat.
fn no_flat(path: &Path) -> BadInput {
    let help = format!(
        "{}; a map is YAML with `image` or `plan`",
        FORMAT.description
    );
    BadInput::without_excerpt(path, "this TOML file is no flat: it has no `plan`", help)
}

/// A plan with each character repeated, in both directions.
pub(crate) fn widened(plan: &str, times: usize) -> String {
    let mut wide = String::new();
    for line in plan.lines() {
        let line: String = line
            .chars()
            .flat_map(|it| std::iter::repeat_n(it, times))
            .collect();
        for _ in 0..times {
            wide.push_str(&line);
            wide.push('\n');
        }
    }
    wide
}
