//! The table of a search for a terminal.

use comfy_table::{Attribute, Cell, CellAlignment, Table};
use muster_runtime::text::{drones, figure, plural};
use muster_scenarios::report::{Colour, TABLE_STYLE, count, program};

use super::coverage::Row;
use super::run::{Finding, SearchResult};
use super::state::{AcceptedPlan, BrokenPlan};
use crate::output::table::{GREEN, RED, painted};

/// The verdict of a search as text, with a final line feed: whether a plan broke a rule, and which; then in which plans drones
/// came too close in an accepted exposure.
#[must_use]
pub fn table(searched: &SearchResult, colour: Colour) -> String {
    format!(
        "{}{}",
        verdict(searched, colour),
        accepted(&searched.accepted)
    )
}

fn verdict(searched: &SearchResult, colour: Colour) -> String {
    let SearchResult {
        plans, completed, ..
    } = *searched;
    match &searched.finding {
        Some(finding) => found(finding, colour),
        None if searched.broken.is_empty() => {
            let outside = match searched.accepted.is_empty() {
                true => "",
                false => " outside of accepted exposures",
            };
            let ok = format!("OK: {}, no rule broken{outside}", number(plans, "plan"));
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
        "{}\n plans  {} without a violation; mission completed in {completed}\n values {}; {} of incompatible values\n time   {hours} simulated hours in {} core-seconds: {} plans and {} drone-seconds per \
         core-second\n",
        coverage(searched, colour),
        plans - (searched.broken.len() + searched.accepted.len()) as u64,
        number(combinations, "combination"),
        number(redrawn, "redraw"),
        figure(core_s, 0),
        figure(count(plans) / core_s.max(f64::EPSILON), 1),
        per_second(drone_s),
    )
}

fn number(number: u64, thing: &str) -> String {
    plural(usize::try_from(number).unwrap_or(usize::MAX), thing)
}

/// Maximum number of listed plans; the folder has all.
const LISTED_MAX: usize = 20;

fn listed(searched: &SearchResult, colour: Colour) -> String {
    let broken = &searched.broken;
    let plans = number(searched.plans, "plan");
    let verdict = format!("BROKEN: a rule, by {} of {plans}", broken.len());
    let mut text = format!("{}\n", painted(&verdict, RED, colour));
    let lines = (broken.iter())
        .map(|BrokenPlan { seed, rule, what }| format!("  seed {seed}: rule {rule}, {what}\n"));
    text.push_str(&first_lines(lines));
    text
}

fn accepted(plans: &[AcceptedPlan]) -> String {
    if plans.is_empty() {
        return String::new();
    }
    let lines = plans.iter().map(|plan| {
        let AcceptedPlan {
            seed,
            exposures,
            what,
        } = plan;
        format!("  seed {seed}: {what} ({})\n", exposures.join(", "))
    });
    format!(
        "too close in an exposure that `limits.accept` lists, in {}:\n{}",
        plural(plans.len(), "plan"),
        first_lines(lines)
    )
}

/// The first lines, and how many are left out.
fn first_lines(lines: impl ExactSizeIterator<Item = String>) -> String {
    let left_out = lines.len().saturating_sub(LISTED_MAX);
    let mut text: String = lines.take(LISTED_MAX).collect();
    if left_out > 0 {
        text.push_str(&format!("  and {left_out} more\n"));
    }
    text
}

/// How often each fault was injected in each state, without rows and columns of faults and states that never were.
fn coverage(searched: &SearchResult, colour: Colour) -> String {
    let (injected, never): (Vec<_>, Vec<_>) = (searched.coverage.rows())
        .map(|(name, row)| (name, row.cells()))
        .partition(|(_, cells)| cells.iter().any(|it| *it > 0));
    let (met, unmet): (Vec<_>, Vec<_>) = (Row::COLUMNS.iter().enumerate())
        .partition(|(place, _)| injected.iter().any(|(_, cells)| cells[*place] > 0));
    let mut table = Table::new();
    table.force_no_tty().load_style(TABLE_STYLE);
    if colour == Colour::Always {
        table.enforce_styling();
    }
    let head = |name: &str| Cell::new(name).add_attribute(Attribute::Bold);
    let columns = met.iter().map(|(_, name)| head(name));
    table.set_header(std::iter::once(head("injected fault")).chain(columns));
    for (name, row) in &injected {
        let cells = met.iter().map(|(place, _)| match row[*place] {
            0 => Cell::new("–"),
            number => Cell::new(number),
        });
        let cells = cells.map(|it| it.set_alignment(CellAlignment::Right));
        table.add_row(std::iter::once(Cell::new(name)).chain(cells));
    }
    let never = never.iter().map(|(name, _)| *name);
    let unmet = unmet.iter().map(|(_, name)| **name);
    let lines = [
        ("never injected", never.collect()),
        ("no fault injected", unmet.collect()),
    ];
    let lines = lines.map(|(what, names): (_, Vec<&str>)| match names.is_empty() {
        true => String::new(),
        false => format!(" {what}: {}\n", names.join(", ")),
    });
    format!("{table}\n{}", lines.concat())
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
        "{}\n  seed {}: {} of {before} left after {} smaller plans\n    {}\n    {} sim {}\n",
        painted(&broken, RED, colour),
        finding.seed,
        plural(after, "fault"),
        finding.tried,
        finding.command,
        program(),
        finding.scenario.display(),
    )
}
