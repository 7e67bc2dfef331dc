//! A track for a terminal.

use comfy_table::{Attribute, Cell, CellAlignment, Table};
use muster_runtime::text::{figure, figure_or_dash, plural};
use muster_scenarios::report::{Colour, TABLE_STYLE};

use super::{Located, Track};
use crate::output::table::{GREEN, RED, painted};

/// Column headings of two lines.
const COLUMNS: [&str; 9] = [
    "\nscan",
    "\nx m",
    "\ny m",
    "heading\n°",
    "deviation\nm",
    "\nfit %",
    "\nparticles",
    "\n",
    "error\nm",
];
/// Most rows; of longer tracks, every n-th scan is shown.
const ROWS_MAX: usize = 40;

/// A track as text, with a final line feed.
#[must_use]
pub fn table(track: &Track, colour: Colour) -> String {
    let mut table = Table::new();
    table.force_no_tty().load_style(TABLE_STYLE);
    let heading = COLUMNS.iter().map(|name| {
        let cell = Cell::new(name).set_alignment(CellAlignment::Right);
        match colour {
            Colour::Always => cell.add_attribute(Attribute::Bold),
            Colour::Never => cell,
        }
    });
    table.set_header(heading);
    let every = track.scans.len().div_ceil(ROWS_MAX).max(1);
    let last = track.scans.len().saturating_sub(1);
    let shown = |scan: &&Located| scan.scan.is_multiple_of(every) || scan.scan == last;
    for scan in track.scans.iter().filter(shown) {
        table.add_row(row(scan).map(|text| Cell::new(text).set_alignment(CellAlignment::Right)));
    }
    format!("{table}\n\n{}", verdict(track, colour))
}

fn row(scan: &Located) -> [String; 9] {
    [
        scan.scan.to_string(),
        figure(scan.x_m, 2),
        figure(scan.y_m, 2),
        figure(scan.heading_deg, 1),
        figure(scan.deviation_m, 2),
        figure(scan.fit * 100.0, 0),
        figure(scan.particles as f64, 0),
        if scan.is_lost { "lost" } else { "" }.to_owned(),
        figure_or_dash(scan.error_m, 2),
    ]
}

fn verdict(track: &Track, colour: Colour) -> String {
    let scans = plural(track.scans.len(), "scan");
    let mut text = match track.found_at() {
        Some(at) => painted(&format!(" found at scan {at} of {scans}"), GREEN, colour),
        None => painted(&format!(" lost at the end of {scans}"), RED, colour),
    };
    if let Some(particles) = track.particles_mean() {
        text.push_str(&format!(
            ", {} particles on average since",
            figure(particles, 0)
        ));
    }
    if let Some(took_ms) = track.took_ms_median() {
        text.push_str(&format!(", {} ms a scan", figure(took_ms, 2)));
    }
    if let Some(last) = track.scans.last()
        && let (Some(error_m), Some(error_deg)) = (last.error_m, last.error_deg)
    {
        let (metres, degrees) = (figure(error_m, 2), figure(error_deg, 1));
        text.push_str(&format!(
            "\n error at the last scan: {metres} m and {degrees}°"
        ));
    }
    text.push('\n');
    text
}
