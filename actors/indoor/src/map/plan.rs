//! Cells from images and from plans drawn as text.

use super::header::{Header, Mode, Source};
use super::image::Image;
use super::place::Place;
use super::{CELLS_MAX, State};
use crate::frames::MapPose;
use crate::refusal::Refusal;

/// Cells, row by row from the bottom.
pub(super) struct Grid {
    pub(super) columns: usize,
    pub(super) rows: usize,
    pub(super) states: Vec<State>,
    pub(super) kept_out: Vec<bool>,
}

impl Header {
    /// The fields of a plan drawn as text, with map_server's defaults.
    pub(super) fn of_plan(resolution_m: f64) -> Self {
        Self {
            source: Source::Plan {
                text: String::new(),
                cells: 1,
                place: Place::default(),
            },
            mode: Mode::Trinary,
            resolution_m,
            origin: MapPose::new(0.0, 0.0, 0.0),
            negate: false,
            occupied_thresh: 0.65,
            free_thresh: 0.196,
            keep_out: Vec::new(),
        }
    }

    fn state(&self, grey: u8, alpha: Option<u8>) -> State {
        let occupancy = match (self.mode, alpha) {
            (Mode::Scale, Some(0..=254)) => return State::Unknown,
            (Mode::Raw, _) if grey > 100 => return State::Unknown,
            (Mode::Raw, _) => f64::from(grey) / 100.0,
            _ if self.negate => f64::from(grey) / 255.0,
            _ => f64::from(255 - grey) / 255.0,
        };
        if occupancy > self.occupied_thresh {
            State::Occupied
        } else if occupancy < self.free_thresh {
            State::Free
        } else {
            State::Unknown
        }
    }
}

pub(super) fn of_image(header: &Header, image: &Image) -> Grid {
    let mut states = Vec::with_capacity(image.grey.len());
    for row in (0..image.rows).rev() {
        for at in row * image.columns..(row + 1) * image.columns {
            states.push(header.state(image.grey[at], image.alpha.get(at).copied()));
        }
    }
    Grid {
        columns: image.columns,
        rows: image.rows,
        kept_out: vec![false; states.len()],
        states,
    }
}

/// The cells of a plan, `cells` × `cells` for a character. Errors lie at the plan's place.
pub(super) fn of_text(plan: &str, cells: usize, place: &Place) -> Result<Grid, Refusal> {
    let lines: Vec<&str> = plan.lines().map(str::trim_end).collect();
    let is_drawn = |line: &&str| !line.is_empty();
    let first = lines.iter().position(&is_drawn).unwrap_or(0);
    let last = lines
        .iter()
        .rposition(is_drawn)
        .map_or(first, |last| last + 1);
    let lines = &lines[first..last];
    let width = lines
        .iter()
        .map(|line| line.chars().count())
        .max()
        .unwrap_or(0);
    let (columns, rows) = (width * cells, lines.len() * cells);
    let count = columns
        .checked_mul(rows)
        .filter(|it| (1..=CELLS_MAX).contains(it));
    if count.is_none() {
        let message = format!("the plan has {columns} × {rows} cells");
        return Err(Refusal::new(
            place.whole(),
            message,
            format!("1 to {CELLS_MAX} cells"),
        ));
    }
    let mut grid = Grid {
        columns,
        rows,
        states: Vec::with_capacity(columns * rows),
        kept_out: Vec::with_capacity(columns * rows),
    };
    for (number, line) in lines.iter().enumerate().rev() {
        let mut row = Vec::with_capacity(columns);
        for (column, (byte, drawn)) in line.char_indices().enumerate() {
            let Some(cell) = of_character(drawn) else {
                let span = place.of(first + number, byte..byte + drawn.len_utf8());
                let (line, column) = (first + number + 1, column + 1);
                let message =
                    format!("line {line}, column {column} of the plan: {drawn:?} is no cell");
                let accepted =
                    "`#` occupied, `.` free, `x` not to be entered, a space or `?` unknown";
                return Err(Refusal::new(span, message, accepted));
            };
            row.extend(std::iter::repeat_n(cell, cells));
        }
        row.resize(columns, (State::Unknown, false));
        for _ in 0..cells {
            grid.states.extend(row.iter().map(|(state, _)| *state));
            grid.kept_out
                .extend(row.iter().map(|(_, kept_out)| *kept_out));
        }
    }
    Ok(grid)
}

pub(super) fn of_character(drawn: char) -> Option<(State, bool)> {
    match drawn {
        '#' => Some((State::Occupied, false)),
        '.' => Some((State::Free, false)),
        'x' => Some((State::Free, true)),
        ' ' | '?' => Some((State::Unknown, false)),
        _ => None,
    }
}
