//! The thesis's tables and ours for a terminal.

use comfy_table::{Attribute, Cell, CellAlignment, Table};
use muster_runtime::text::{NO_VALUE, figure, figure_or_dash};
use muster_scenarios::report::{Colour, TABLE_STYLE};

use super::compare::{Comparison, Delays, Experiment, Quantity, Wait};
use crate::output::table::{GREEN, RED, painted};

/// Column headings of two lines.
const COLUMNS: [&str; 6] = [
    "\nexperiment",
    "\n",
    "flight time s\nmaster",
    "\nmaximum",
    "\nmean",
    "messages\nreceived",
];
/// Number of columns, from the left, that hold text.
const TEXT_COLUMNS: usize = 2;
/// Number of decimals, by quantity.
pub(super) const DIGITS: [usize; 4] = [1, 1, 1, 0];

/// A comparison as text, with a final line feed.
#[must_use]
pub fn table(comparison: &Comparison, colour: Colour) -> String {
    let mut rows = Vec::new();
    for experiment in &comparison.experiments {
        rows.extend(rows_of(experiment));
    }
    let mut text = lines(&COLUMNS, TEXT_COLUMNS, rows, colour);
    text.push('\n');
    let waits = &comparison.waits;
    let rows = [
        wait("thesis, figure 36", &waits.thesis),
        wait("ours, waiting for all drones", &waits.strict),
        wait("ours, waiting for neighbours", &waits.neighbours),
        wait("ours, neighbours + settling time", &waits.settling),
    ];
    let runs = comparison.waits_runs.number();
    let mean = format!("{runs}\nmean s");
    let heading = [
        "15 in line:\nwait at a waypoint",
        &mean,
        "lowest\nrun",
        "highest\nrun",
        "shortest\ndrone",
        "longest\ndrone",
    ];
    text.push_str(&lines(&heading, 1, rows.into(), colour));
    text.push('\n');
    let rows = [
        delays("ancestor", &comparison.single_hop.ancestor),
        delays("ours, with settling time", &comparison.single_hop.ours),
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

/// Rows of the thesis, of our run and of the difference.
fn rows_of(experiment: &Experiment) -> [Vec<String>; 3] {
    let values = |value: fn(&Quantity) -> Option<f64>| {
        let quantities = experiment.quantities.iter().zip(DIGITS);
        quantities.map(move |(quantity, digits)| figure_or_dash(value(quantity), digits))
    };
    let row = |first: &str, what: &str, cells: Vec<String>| {
        let words = [first.to_owned(), what.to_owned()];
        words.into_iter().chain(cells).collect()
    };
    let table = format!("thesis, table {}", experiment.table);
    let differences = experiment.quantities.iter().map(difference);
    [
        row(
            experiment.report.name(),
            &table,
            values(|quantity| Some(quantity.thesis)).collect(),
        ),
        row("", "ours", values(|quantity| quantity.ours).collect()),
        row("", "difference %", differences.collect()),
    ]
}

/// Difference in per cent, with a sign.
pub(super) fn difference(quantity: &Quantity) -> String {
    match quantity.off_percent {
        Some(off) if off >= 0.0 => format!("+{}", figure(off, 1)),
        Some(off) => figure(off, 1),
        None => NO_VALUE.to_owned(),
    }
}

fn wait(name: &str, wait: &Wait) -> Vec<String> {
    let runs = [wait.mean_s, wait.lowest_run_s, wait.highest_run_s];
    let drones = [wait.least_s, wait.most_s];
    row_of_seconds(name, &[&runs[..], &drones[..]].concat())
}

fn delays(name: &str, delays: &Delays) -> Vec<String> {
    let runs = [delays.mean_s, delays.lowest_run_s, delays.highest_run_s];
    row_of_seconds(name, &[&runs[..], &[delays.longest_s]].concat())
}

fn row_of_seconds(name: &str, seconds: &[Option<f64>]) -> Vec<String> {
    let figures = seconds.iter().map(|it| figure_or_dash(*it, 2));
    [name.to_owned()].into_iter().chain(figures).collect()
}

/// A table with `text_columns` columns of text, then columns of numbers.
fn lines(heading: &[&str], text_columns: usize, rows: Vec<Vec<String>>, colour: Colour) -> String {
    let mut table = Table::new();
    table.force_no_tty().load_style(TABLE_STYLE);
    if colour == Colour::Always {
        table.enforce_styling();
    }
    let heading = heading.iter();
    table.set_header(heading.map(|name| Cell::new(name).add_attribute(Attribute::Bold)));
    table.add_rows(rows);
    for (place, column) in table.column_iter_mut().enumerate() {
        column.set_padding((1, 0));
        if place >= text_columns {
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
