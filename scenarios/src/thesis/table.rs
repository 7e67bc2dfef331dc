//! The thesis's tables on a terminal, with ours beside them.

use comfy_table::{Attribute, Cell, CellAlignment, Table};

use super::compare::{Comparison, Delays, Experiment, Quantity, Wait};
use crate::report::Colour;
use crate::report::table::{GREEN, RED, STYLE, painted};
use muster_runtime::text::{NOTHING, figure, figure_or_nothing};

/// The columns, named in two lines.
const COLUMNS: [&str; 6] = [
    "\nexperiment",
    "\n",
    "flight time s\nmaster",
    "\nmaximum",
    "\nmean",
    "messages\nreceived",
];
/// How many of them, from the left, hold words.
const WORDS: usize = 2;
/// Digits after the point, quantity by quantity.
pub(super) const DIGITS: [usize; 4] = [1, 1, 1, 0];

/// What a comparison came to, as text; it ends with a line feed.
#[must_use]
pub fn table(comparison: &Comparison, colour: Colour) -> String {
    let mut rows = Vec::new();
    for experiment in &comparison.experiments {
        rows.extend(rows_of(experiment));
    }
    let mut text = lines(&COLUMNS, WORDS, rows, colour);
    text.push('\n');
    let waits = &comparison.waits;
    let rows = [
        wait("thesis, figure 36", &waits.thesis),
        wait("ours, for all drones", &waits.strict),
        wait("ours, for the master's neighbours", &waits.neighbours),
        wait("likewise, settling like the ancestor", &waits.settling),
    ];
    let runs = comparison.waits_runs.number();
    let mean = format!("{runs}\nmean s");
    let heading = [
        "15 in line:\nwait at a waypoint",
        &mean,
        "lowest\nrun",
        "highest\nrun",
        "least\ndrone",
        "most\ndrone",
    ];
    text.push_str(&lines(&heading, 1, rows.into(), colour));
    text.push('\n');
    let rows = [
        delays("ancestor", &comparison.single_hop.ancestor),
        delays("ours, settling like it", &comparison.single_hop.ours),
    ];
    let heading = [
        "5 in line, one hop:\nwait at a waypoint",
        &mean,
        "lowest\nrun",
        "highest\nrun",
        "\nlongest",
    ];
    text.push_str(&lines(&heading, 1, rows.into(), colour));
    text.push_str(&format!(
        "\n seed   {}, engine {}\n waits  {}\n",
        comparison.seed,
        comparison.engine,
        comparison.waits_runs.about()
    ));
    text.push_str(&rules(comparison, colour));
    text
}

/// The thesis's row, ours, and the difference between them.
fn rows_of(experiment: &Experiment) -> [Vec<String>; 3] {
    let of = |figures: fn(&Quantity) -> Option<f64>| {
        let quantities = experiment.quantities.iter().zip(DIGITS);
        quantities.map(move |(quantity, digits)| figure_or_nothing(figures(quantity), digits))
    };
    let row = |first: &str, what: &str, cells: Vec<String>| {
        let words = [first.to_owned(), what.to_owned()];
        words.into_iter().chain(cells).collect()
    };
    let table = format!("thesis, table {}", experiment.table);
    let off = experiment.quantities.iter().map(off);
    [
        row(
            experiment.report.name(),
            &table,
            of(|quantity| Some(quantity.thesis)).collect(),
        ),
        row("", "ours", of(|quantity| quantity.ours).collect()),
        row("", "off by %", off.collect()),
    ]
}

/// How far ours is off, with a sign.
pub(super) fn off(quantity: &Quantity) -> String {
    match quantity.off_percent {
        Some(off) if off >= 0.0 => format!("+{}", figure(off, 1)),
        Some(off) => figure(off, 1),
        None => NOTHING.to_owned(),
    }
}

fn wait(whose: &str, wait: &Wait) -> Vec<String> {
    let runs = [wait.mean_s, wait.lowest_run_s, wait.highest_run_s];
    let drones = [wait.least_s, wait.most_s];
    row_of_seconds(whose, &[&runs[..], &drones[..]].concat())
}

fn delays(whose: &str, delays: &Delays) -> Vec<String> {
    let runs = [delays.mean_s, delays.lowest_run_s, delays.highest_run_s];
    row_of_seconds(whose, &[&runs[..], &[delays.longest_s]].concat())
}

fn row_of_seconds(whose: &str, seconds: &[Option<f64>]) -> Vec<String> {
    let figures = seconds.iter().map(|it| figure_or_nothing(*it, 2));
    [whose.to_owned()].into_iter().chain(figures).collect()
}

/// A table whose first `words` columns hold words and the others numbers.
fn lines(heading: &[&str], words: usize, rows: Vec<Vec<String>>, colour: Colour) -> String {
    let mut table = Table::new();
    table.force_no_tty().load_style(STYLE);
    if colour == Colour::Always {
        table.enforce_styling();
    }
    let heading = heading.iter();
    table.set_header(heading.map(|name| Cell::new(name).add_attribute(Attribute::Bold)));
    table.add_rows(rows);
    for (place, column) in table.column_iter_mut().enumerate() {
        column.set_padding((1, 0));
        if place >= words {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    table
        .lines()
        .map(|line| format!("{}\n", line.trim_end()))
        .collect()
}

fn rules(comparison: &Comparison, colour: Colour) -> String {
    let broken: Vec<_> = comparison
        .reports()
        .filter(|report| !report.violations.is_empty())
        .map(|report| format!("broken by: {}", report.command))
        .collect();
    let verdict = if broken.is_empty() {
        painted("none broken", GREEN, colour)
    } else {
        painted(&broken.join("\n        "), RED, colour)
    };
    format!(" rules  {verdict}\n")
}
