//! The table of a search for a terminal.

use comfy_table::{Attribute, Cell, CellAlignment, Table};

use super::coverage::Row;
use super::run::{Finding, SearchResult};
use super::state::BrokenPlan;
use crate::report::Colour;
use crate::report::figures::count;
use crate::report::table::{GREEN, RED, STYLE, painted};
use muster_runtime::text::{drones, figure, plural};

/// The verdict of a search as text, with a final line feed: whether a plan broke a rule, and which.
#[must_use]
pub fn table(searched: &SearchResult, colour: Colour) -> String {
    let SearchResult {
        plans, completed, ..
    } = *searched;
    match &searched.finding {
        Some(finding) => found(finding, colour),
        None if searched.broken.is_empty() => {
            let ok = format!("OK: {plans} plans, no rule broken");
            format!(
                "{}; mission completed in {completed}\n",
                painted(&ok, GREEN, colour)
            )
        }
        None => listed(searched, colour),
    }
}

/// What a search has covered, as text with a final line feed: faults by the state in which they were injected, values, and
/// time.
#[must_use]
pub fn explanation(searched: &SearchResult, colour: Colour) -> String {
    let SearchResult {
        plans,
        completed,
        redrawn,
        combinations,
        simulated_s,
        drone_s,
        core_s,
        ..
    } = *searched;
    let hours = figure(simulated_s / 3_600.0, 1);
    let per_second = |number: f64| figure(number / core_s.max(f64::EPSILON), 0);
    format!(
        "{}{}\n plans  {} without a violation; mission completed in {completed}\n values {} combinations; {redrawn} redraws \
         of incompatible values\n time   {hours} simulated hours in {} core-seconds: {} plans and {} drone-seconds per \
         core-second\n",
        coverage(searched, colour),
        gaps(searched),
        plans - searched.broken.len() as u64,
        figure(count(combinations), 0),
        figure(core_s, 0),
        figure(count(plans) / core_s.max(f64::EPSILON), 1),
        per_second(drone_s),
    )
}

/// Maximum number of listed plans; the folder has all.
const LISTED_MAX: usize = 20;

fn listed(searched: &SearchResult, colour: Colour) -> String {
    let broken = &searched.broken;
    let verdict = format!("BROKEN: a rule, by {} of {}", broken.len(), searched.plans);
    let mut text = format!("{}\n", painted(&format!("{verdict} plans"), RED, colour));
    for BrokenPlan { seed, rule, what } in broken.iter().take(LISTED_MAX) {
        text.push_str(&format!("  seed {seed}: rule {rule}, {what}\n"));
    }
    if let Some(more @ 1..) = broken.len().checked_sub(LISTED_MAX) {
        text.push_str(&format!("  and {more} more\n"));
    }
    text
}

fn coverage(searched: &SearchResult, colour: Colour) -> String {
    let mut table = Table::new();
    table.force_no_tty().load_style(STYLE);
    if colour == Colour::Always {
        table.enforce_styling();
    }
    let head = |name: &str| Cell::new(name).add_attribute(Attribute::Bold);
    let columns = Row::COLUMNS.iter().map(|name| head(name));
    table.set_header(std::iter::once(head("injected fault")).chain(columns));
    for (name, row) in searched.coverage.rows() {
        let cells = row
            .cells()
            .map(|number| Cell::new(number).set_alignment(CellAlignment::Right));
        table.add_row(std::iter::once(Cell::new(name)).chain(cells));
    }
    format!("{table}\n")
}

/// States in which some kind of fault was never injected.
fn gaps(searched: &SearchResult) -> String {
    let rows: Vec<_> = searched.coverage.rows().collect();
    let mut lines = String::new();
    for (place, column) in Row::COLUMNS.iter().enumerate() {
        let missed: Vec<_> = rows
            .iter()
            .filter(|(_, row)| row.cells()[place] == 0)
            .map(|(name, _)| *name)
            .collect();
        let line = match missed.len() {
            0 => continue,
            all if all == rows.len() => format!("no fault injected: {column}"),
            _ => format!("not injected, {column}: {}", missed.join(", ")),
        };
        lines.push_str(&format!(" {line}\n"));
    }
    lines
}

fn found(finding: &Finding, colour: Colour) -> String {
    let violation = &finding.violation;
    let (before, after) = finding.faults;
    let broken = format!(
        "BROKEN: rule {} at {} s by {}: {}",
        violation.rule,
        figure(violation.at_s, 3),
        drones(&violation.drones),
        violation.what
    );
    format!(
        "{}\n  seed {}: {} of {before} left after {} smaller plans\n    {}\n    muster sim {}\n",
        painted(&broken, RED, colour),
        finding.seed,
        plural(after, "fault"),
        finding.tried,
        finding.command,
        finding.scenario.display(),
    )
}
