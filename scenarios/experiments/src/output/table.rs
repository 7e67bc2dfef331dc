//! The table of a run for a terminal.

use comfy_table::{
    Attribute, Cell, CellAlignment, Color, ColumnConstraint, ContentArrangement, Row, Table, Width,
};
use muster_runtime::text::{NO_VALUE, drones, figure, figure_or_dash, plural, ranges};
use muster_scenarios::report::{
    Colour, DroneReport, Election, FirmwareStalls, FormationChange, FormationError, Report, Role,
    TABLE_STYLE, Violation,
};

use super::figures::{final_state, speedup_text};
use super::{agents, mission};
use crate::campaign::{median, p99};

/// Up to this many elections are listed one by one; more are summarized.
const LISTED_ELECTIONS_MAX: usize = 10;

/// Column headings of two lines, and whether the column holds numbers.
const COLUMNS: [(&str, bool); 9] = [
    ("\ndrone", true),
    ("\nrole", false),
    ("\nhops", true),
    ("\nrelay", false),
    ("flight\ntime s", true),
    ("messages\nsent", true),
    ("messages\nreceived", true),
    ("waypoint\ndelay s", true),
    ("\nstate", false),
];
/// Minimum width of the state column.
const STATE_MIN: u16 = 12;

/// The figures of a run as text for a terminal of `width` columns, with a final line feed; `None` is any width.
///
/// It needs less than 100 columns for hundreds of drones. States are wrapped if the terminal is narrower.
#[must_use]
pub fn table(report: &Report, width: Option<u16>, colour: Colour) -> String {
    let mut text = swarm(report, summary(report), width, colour);
    for other in &report.others {
        text.push_str(&format!("\n swarm of {}\n", other.scenario));
        text.push_str(&swarm(other, swarm_summary(other), width, colour));
    }
    rules(report, colour, &mut text);
    text
}

/// Table of a swarm, its summary `lines`, and remarks on single drones.
fn swarm(
    report: &Report,
    lines: Vec<(&'static str, String)>,
    width: Option<u16>,
    colour: Colour,
) -> String {
    let mut text = figures(report, width, colour);
    text.push('\n');
    for (name, value) in lines {
        text.push_str(&format!(" {name:<11}  {value}\n"));
    }
    for drone in &report.drones {
        if let Some(remark) = remark(drone) {
            text.push_str(&format!(
                " {:<11}  {remark}\n",
                format!("drone {}", drone.id)
            ));
        }
    }
    text
}

/// One row per drone, and a row of means below a line.
fn figures(report: &Report, width: Option<u16>, colour: Colour) -> String {
    let mut table = Table::new();
    table.force_no_tty().load_style(TABLE_STYLE);
    if colour == Colour::Always {
        table.enforce_styling();
    }
    if let Some(width) = width {
        table
            .set_content_arrangement(ContentArrangement::Dynamic)
            .set_width(width);
    }
    table.set_header(COLUMNS.map(|(name, _)| Cell::new(name).add_attribute(Attribute::Bold)));
    for (column, (name, numbers)) in table.column_iter_mut().zip(COLUMNS) {
        column.set_padding((1, 0)).set_constraint(match name {
            "\nstate" => ColumnConstraint::LowerBoundary(Width::Fixed(STATE_MIN)),
            _ => ColumnConstraint::ContentWidth,
        });
        if numbers {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    for drone in &report.drones {
        table.add_row(row(drone));
    }
    table.add_row(means(report));

    let mut lines: Vec<_> = table.lines().collect();
    let rule = lines.iter().find(|line| line.starts_with('─')).cloned();
    if let Some(rule) = rule {
        lines.insert(lines.len() - 1, rule);
    }
    lines
        .iter()
        .map(|line| format!("{}\n", line.trim_end()))
        .collect()
}

fn row(drone: &DroneReport) -> Row {
    let leads = drone.role == Role::Master;
    let [sent, received] = drone.messages();
    let cells = [
        if leads {
            format!("▸ {}", drone.id)
        } else {
            drone.id.to_string()
        },
        if leads { "master" } else { "member" }.to_owned(),
        drone
            .hops
            .map_or_else(|| NO_VALUE.to_owned(), |hops| hops.to_string()),
        if drone.relay { "relay" } else { "" }.to_owned(),
        figure_or_dash(drone.flight_time_s, 1),
        sent,
        received,
        figure_or_dash(drone.waypoint_delay_s, 2),
        final_state(drone).to_owned(),
    ];
    let unfinished = drone.flight_time_s.is_none();
    let mut row = Row::new();
    for (at, cell) in cells.into_iter().enumerate() {
        let mut cell = Cell::new(cell);
        if leads {
            cell = cell.fg(Color::Cyan).add_attribute(Attribute::Bold);
        }
        if unfinished && at + 1 == COLUMNS.len() {
            cell = cell.fg(Color::Yellow);
        }
        row.add_cell(cell);
    }
    row
}

fn means(report: &Report) -> Row {
    Row::from([
        "mean".to_owned(),
        String::new(),
        String::new(),
        String::new(),
        figure_or_dash(report.means.flight_time_s, 1),
        figure_or_dash(report.mean_messages_sent(), 0),
        figure(report.means.messages_received, 0),
        figure_or_dash(report.mean_waypoint_delay_s(), 2),
        String::new(),
    ])
}

fn summary(report: &Report) -> Vec<(&'static str, String)> {
    let speedup = speedup_text(report)
        .map(|text| format!(": {text}"))
        .unwrap_or_default();
    let duration = figure(report.simulated_s, 1);
    let mut lines = vec![match report.engine {
        Some(_) => (
            "simulated",
            format!("{duration} s in {} s{speedup}", figure(report.wall_s, 2)),
        ),
        None => (
            "flown",
            format!("{duration} s in real time, one process per drone"),
        ),
    }];
    if let Some(uncertainty_s) = report.clock_uncertainty_s {
        let uncertainty_ms = figure(uncertainty_s * 1e3, 2);
        lines.push(("clocks", format!("error at most {uncertainty_ms} ms")));
    }
    if let Some(stalls) = report.firmware_stalls.and_then(FirmwareStalls::text) {
        lines.push(("firmware", stalls));
    }
    if let Some(separation_m) = report.min_separation_m {
        lines.push((
            "separation",
            format!("{} m at closest approach", figure(separation_m, 1)),
        ));
    }
    lines.extend(swarm_summary(report));
    lines.extend(agents::lines(report));
    lines.extend(report.trace.clone().map(|trace| ("trace", trace)));
    lines
}

/// Summary lines of one swarm.
fn swarm_summary(report: &Report) -> Vec<(&'static str, String)> {
    let wait = report
        .mean_wait_s()
        .map(|wait_s| format!(", mean wait {} s", figure(wait_s, 2)));
    let mut lines = vec![(
        "barriers",
        format!("{}{}", report.barriers.len(), wait.unwrap_or_default()),
    )];
    if let Some(error) = &report.following {
        lines.push(("following", formation_error(error)));
    }
    if let Some(changes) = changes(report) {
        lines.push(("changes", changes));
    }
    match &report.elections[..] {
        few if few.len() <= LISTED_ELECTIONS_MAX => {
            lines.extend(few.iter().map(|it| ("election", describe_election(it))));
        }
        many => lines.extend(describe_elections(many)),
    }
    if let Some(bridges) = bridges(report) {
        lines.push(("relaying", bridges));
    }
    if !report.relays.is_empty() {
        lines.push(("relays", relays(report)));
    }
    if !report.dropped.is_empty() {
        let reasons: Vec<_> = report
            .dropped
            .iter()
            .map(|(reason, frames)| format!("{frames} {reason}"))
            .collect();
        lines.push(("dropped", format!("frames: {}", reasons.join(", "))));
    }
    if !report.never_met.is_empty() {
        lines.push(("network", mission::never_met(report)));
    }
    lines.extend(mission::never_injected(report).map(|never| ("faults", never)));
    lines.extend(mission::note(report).map(|note| ("mission", note)));
    lines
}

/// Route and traffic of each pure relay.
fn relays(report: &Report) -> String {
    let relays = report.relays.iter().map(|relay| {
        let route = match (relay.parent, relay.hops) {
            (Some(parent), Some(hops)) => {
                format!(
                    "{} to the master through {parent}",
                    plural(hops.into(), "hop")
                )
            }
            _ => "no route to the master".to_owned(),
        };
        let [sent, _] = relay.messages();
        {
            let frames = if sent == "1" { "frame" } else { "frames" };
            format!("{}: {route}, {sent} {frames} sent", relay.id)
        }
    });
    relays.collect::<Vec<_>>().join("; ")
}

fn formation_error(error: &FormationError) -> String {
    format!(
        "formation error: mean {} m, 95th percentile {} m, maximum {} m",
        figure(error.mean_m, 2),
        figure(error.p95_m, 2),
        figure(error.max_m, 2)
    )
}

/// Summary of the formation changes; `None` if none was completed by any drone.
fn changes(report: &Report) -> Option<String> {
    let longest_s = report
        .changes
        .iter()
        .filter_map(FormationChange::took_s)
        .reduce(f64::max)?;
    let all = plural(report.changes.len(), "change");
    let completed = match report.changes_made() {
        made if made == report.changes.len() => all,
        made => format!("{made} of {all}"),
    };
    let longest = figure(longest_s, 1);
    Some(format!(
        "{completed} completed by all drones, longest {longest} s"
    ))
}

/// Number and duration of many elections.
fn describe_elections(elections: &[Election]) -> [(&'static str, String); 3] {
    let distribution = |time: fn(&Election) -> Option<f64>| {
        let mut times_s: Vec<_> = elections.iter().filter_map(time).collect();
        times_s.sort_by(f64::total_cmp);
        let Some(longest_s) = times_s.last() else {
            return "never".to_owned();
        };
        let figures = [
            ("median", median(&times_s)),
            ("99th percentile", p99(&times_s)),
        ];
        let figures = figures
            .into_iter()
            .filter_map(|(name, time_s)| Some((name, time_s?)));
        let figures = figures.chain([("longest", *longest_s)]);
        let figures = figures.map(|(name, time_s)| format!("{name} {time_s:.3} s"));
        let figures: Vec<_> = figures.collect();
        let (ended, all) = (times_s.len(), elections.len());
        format!("{ended} of {all}: {}", figures.join(", "))
    };
    [
        (
            "elections",
            format!(
                "{} without an agreed master",
                plural(elections.len(), "period")
            ),
        ),
        ("new leader", distribution(|it| it.led_after_s)),
        ("all agreed", distribution(|it| it.settled_after_s)),
    ]
}

/// The shortest election of which the duration is shown, in seconds: the least that two decimals show.
const SHOWN_FROM_S: f64 = 0.01;

/// Time and result of one election.
fn describe_election(election: &Election) -> String {
    let start = format!("at {:.1} s: no agreed master", election.at_s);
    let Some(after_s) = election.settled_after_s else {
        return format!("{start} until the end");
    };
    let masters: Vec<_> = election.masters.iter().map(u32::to_string).collect();
    let then = match &masters[..] {
        [] => "no drone left that needs one".to_owned(),
        [master] => format!("master {master}"),
        masters => format!("masters {}, one per segment", masters.join(" and ")),
    };
    if after_s < SHOWN_FROM_S {
        return format!("{start} for less than {SHOWN_FROM_S} s; then {then}");
    }
    format!("{start}; {after_s:.2} s later: {then}")
}

/// The drones out of the master's range and their bridges; `None` if there are none.
fn bridges(report: &Report) -> Option<String> {
    let bridges: Vec<_> = report
        .bridges
        .iter()
        .map(|bridge| format!("{} for {}", bridge.bridge, ranges(&bridge.out_of_range)))
        .collect();
    let out_of_range: usize = report
        .bridges
        .iter()
        .map(|bridge| bridge.out_of_range.len())
        .sum();
    (out_of_range > 0).then(|| {
        let bridges = bridges.join("; ");
        let masters = report.drones.iter().filter(|it| it.role == Role::Master);
        let article = if masters.count() > 1 { "their" } else { "the" };
        format!(
            "{} out of {article} master's range; bridges: {bridges}",
            plural(out_of_range, "drone")
        )
    })
}

/// Early landing and restarts of a drone; `None` if there were none.
fn remark(drone: &DroneReport) -> Option<String> {
    let landed = drone
        .landed_because
        .as_ref()
        .map(|why| format!("landed early: {why}"));
    let restarts = match drone.restarts {
        0 => None,
        1 => Some("1 actor restart".to_owned()),
        restarts => Some(format!("{restarts} actor restarts")),
    };
    let remarks: Vec<_> = landed.into_iter().chain(restarts).collect();
    (!remarks.is_empty()).then(|| remarks.join("; "))
}

fn rules(report: &Report, colour: Colour, text: &mut String) {
    let (paint, verdict) = match report.violations.len() {
        0 if report.unchecked => (RED, UNCHECKED.to_owned()),
        0 => (GREEN, "none broken".to_owned()),
        1 => (RED, "broken once".to_owned()),
        times => (RED, format!("broken {times} times")),
    };
    text.push_str(&format!(
        " {:<11}  {}\n",
        "rules",
        painted(&verdict, paint, colour)
    ));
    for violation in &report.violations {
        text.push_str(&format!(
            "   {}\n",
            painted(&in_words(violation), paint, colour)
        ));
    }
    if !report.violations.is_empty() {
        text.push_str(&format!("     {}\n", report.command));
    }
}

fn in_words(violation: &Violation) -> String {
    let Violation {
        rule,
        at_s,
        drones: ids,
        what,
    } = violation;
    format!(
        "rule {rule} at {} s, {}: {what}",
        figure(*at_s, 1),
        drones(ids)
    )
}

/// Shown instead of the violations if rule checks were off.
pub(crate) const UNCHECKED: &str = "none checked: this run proves nothing";
pub(crate) const GREEN: &str = "\x1b[32m";
pub(crate) const RED: &str = "\x1b[31m";
const PLAIN: &str = "\x1b[0m";

pub(crate) fn painted(text: &str, paint: &str, colour: Colour) -> String {
    match colour {
        Colour::Never => text.to_owned(),
        Colour::Always => format!("{paint}{text}{PLAIN}"),
    }
}

#[cfg(test)]
mod tests;
