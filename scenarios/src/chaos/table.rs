//! The table of a search for a terminal.

use comfy_table::{Attribute, Cell, CellAlignment, Table};

use super::coverage::Row;
use super::run::{Finding, SearchResult};
use super::state::BrokenPlan;
use crate::report::Colour;
use crate::report::figures::count;
use crate::report::table::{GREEN, RED, STYLE, painted};
use muster_runtime::text::{drones, figure, plural};

/// The result of a search as text, with a final line feed.
#[must_use]
pub fn table(searched: &SearchResult, colour: Colour) -> String {
    let mut text = coverage(searched, colour);
    text.push_str(&gaps(searched));
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
    text.push_str(&format!(
        "\n plans  {} without a violation; mission completed in {completed}\n values {} combinations; {} redraws of \
         incompatible values\n time   {hours} simulated hours in {} core-seconds: {} plans and {} drone-seconds \
         per core-second\n",
        plans - searched.broken.len() as u64,
        figure(count(combinations), 0),
        redrawn,
        figure(core_s, 0),
        figure(count(plans) / core_s.max(f64::EPSILON), 1),
        per_second(drone_s),
    ));
    text.push_str(&match &searched.finding {
        Some(finding) => found(finding, colour),
        None if searched.broken.is_empty() => {
            format!(" rules  {}\n", painted("none broken", GREEN, colour))
        }
        None => listed(&searched.broken, colour),
    });
    text
}

/// Maximum number of listed plans; the folder has all.
const LISTED_MAX: usize = 20;

fn listed(broken: &[BrokenPlan], colour: Colour) -> String {
    let plans = format!("broken by {}", plural(broken.len(), "plan"));
    let mut text = format!(" rules  {}\n", painted(&plans, RED, colour));
    for BrokenPlan { seed, rule, what } in broken.iter().take(LISTED_MAX) {
        text.push_str(&format!("   seed {seed}: rule {rule}, {what}\n"));
    }
    if let Some(more) = broken
        .len()
        .checked_sub(LISTED_MAX)
        .filter(|more| *more > 0)
    {
        text.push_str(&format!("   and {more} more\n"));
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
        "rule {} broken at {} s by {}: {}",
        violation.rule,
        figure(violation.at_s, 3),
        drones(&violation.drones),
        violation.what
    );
    format!(
        " rules  {}\n   seed {}: {} of {before} left after {} smaller plans\n     {}\n     muster sim {}\n",
        painted(&broken, RED, colour),
        finding.seed,
        plural(after, "fault"),
        finding.tried,
        finding.command,
        finding.scenario.display(),
    )
}
