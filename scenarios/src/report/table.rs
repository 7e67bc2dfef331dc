//! The table that a run ends with on a terminal.

use comfy_table::{
    Attribute, Cell, CellAlignment, Color, ColumnConstraint, ContentArrangement, LineStyle, Row,
    Table, TableStyle, Width,
};

use super::figures::{count, pace};
use super::{DroneReport, Election, FormationChange, FormationError, Report, Role, Violation};
use muster_runtime::text::{NOTHING, drones, figure, figure_or_nothing, plural, ranges};

/// Whether text is coloured.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Colour {
    /// Plain text.
    Never,
    /// ANSI escapes.
    Always,
}

/// So many elections are told one by one.
const LISTED_ELECTIONS_MAX: usize = 10;

/// How tables on a terminal are ruled.
pub const STYLE: TableStyle =
    TableStyle::new().header_separator(LineStyle::none().fill('─').junction('─'));

/// The columns, named in two lines, and whether each holds numbers.
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
/// States are not wrapped to less than this.
const STATE_MIN: u16 = 12;

/// The figures of a run as text for a terminal of `width` columns, or of any width; it ends with a line feed.
///
/// It takes less than 100 columns for hundreds of drones. In fewer than it needs, the states are wrapped.
#[must_use]
pub fn table(report: &Report, width: Option<u16>, colour: Colour) -> String {
    let mut text = swarm(report, summary(report), width, colour);
    for other in &report.others {
        text.push_str(&format!("\n the swarm of {}\n", other.scenario));
        text.push_str(&swarm(other, of_swarm(other), width, colour));
    }
    rules(report, colour, &mut text);
    text
}

/// The drones of a swarm, `lines` on it all, and a remark on each drone that asks for one.
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

/// A row a drone and a row of means under a line.
fn figures(report: &Report, width: Option<u16>, colour: Colour) -> String {
    let mut table = Table::new();
    table.force_no_tty().load_style(STYLE);
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
    let cells = [
        if leads {
            format!("▸ {}", drone.id)
        } else {
            drone.id.to_string()
        },
        if leads { "master" } else { "slave" }.to_owned(),
        drone
            .hops
            .map_or_else(|| NOTHING.to_owned(), |hops| hops.to_string()),
        if drone.relay { "relay" } else { "" }.to_owned(),
        figure_or_nothing(drone.flight_time_s, 1),
        figure(count(drone.messages_sent), 0),
        figure(count(drone.messages_received), 0),
        figure_or_nothing(drone.waypoint_delay_s, 2),
        drone.state.clone(),
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
        figure_or_nothing(report.means.flight_time_s, 1),
        figure_or_nothing(report.mean_messages_sent(), 0),
        figure(report.means.messages_received, 0),
        figure_or_nothing(report.mean_waypoint_delay_s(), 2),
        String::new(),
    ])
}

fn summary(report: &Report) -> Vec<(&'static str, String)> {
    let pace = pace(report)
        .map(|pace| format!(": {pace}"))
        .unwrap_or_default();
    let lasted = figure(report.simulated_s, 1);
    let mut lines = vec![match report.engine {
        Some(_) => (
            "simulated",
            format!("{lasted} s in {} s{pace}", figure(report.wall_s, 2)),
        ),
        None => (
            "flown",
            format!("{lasted} s in real time, each drone a process of its own"),
        ),
    }];
    if let Some(uncertainty_s) = report.clock_uncertainty_s {
        let uncertainty_ms = figure(uncertainty_s * 1e3, 2);
        lines.push(("clocks", format!("known to {uncertainty_ms} ms")));
    }
    if let Some(separation_m) = report.min_separation_m {
        lines.push((
            "separation",
            format!("{} m at the closest", figure(separation_m, 1)),
        ));
    }
    lines.extend(of_swarm(report));
    lines.extend(report.trace.clone().map(|trace| ("trace", trace)));
    lines
}

/// What a swarm did.
fn of_swarm(report: &Report) -> Vec<(&'static str, String)> {
    let wait = report
        .mean_wait_s()
        .map(|wait_s| format!(", mean wait {} s", figure(wait_s, 2)));
    let mut lines = vec![(
        "barriers",
        format!("{}{}", report.barriers.len(), wait.unwrap_or_default()),
    )];
    if let Some(error) = &report.following {
        lines.push(("following", kept_formation(error)));
    }
    if let Some(changes) = made_changes(report) {
        lines.push(("changes", changes));
    }
    match &report.elections[..] {
        few if few.len() <= LISTED_ELECTIONS_MAX => {
            lines.extend(few.iter().map(|it| ("election", describe_election(it))));
        }
        many => lines.extend(describe_elections(many)),
    }
    if let Some(beyond) = beyond_the_master(report) {
        lines.push(("relaying", beyond));
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
    if !report.mission_completed {
        lines.push(("mission", not_completed(report).to_owned()));
    }
    lines
}

/// How a swarm ended that has not left its last waypoint to land.
fn not_completed(report: &Report) -> &'static str {
    let has_begun = |drone: &DroneReport| drone.waypoints > 0 || drone.landed_because.is_some();
    if !report.violations.is_empty() {
        "not completed: the run ended where a rule was broken"
    } else if report.unchecked {
        "not completed"
    } else if report.drones.iter().any(has_begun) {
        "not completed: the swarm came down before the last waypoint"
    } else {
        "not flown: no drone got to the first waypoint"
    }
}

/// What each pure relay did.
fn relays(report: &Report) -> String {
    let relays = report.relays.iter().map(|relay| {
        let way = match (relay.parent, relay.hops) {
            (Some(parent), Some(hops)) => {
                format!(
                    "{} from the master over {parent}",
                    plural(hops.into(), "hop")
                )
            }
            _ => "no way to the master".to_owned(),
        };
        format!("{}: {way}, {} frames sent", relay.id, relay.messages_sent)
    });
    relays.collect::<Vec<_>>().join("; ")
}

/// How well the others kept formation on the master.
fn kept_formation(error: &FormationError) -> String {
    format!(
        "formation kept to {} m in the mean, {} m for 95 of 100, {} m at most",
        figure(error.mean_m, 2),
        figure(error.p95_m, 2),
        figure(error.max_m, 2)
    )
}

/// How the changes of formation went, if there were any.
fn made_changes(report: &Report) -> Option<String> {
    let longest_s = report
        .changes
        .iter()
        .filter_map(FormationChange::took_s)
        .reduce(f64::max)?;
    let made = report.changes_made();
    let of = report.changes.len();
    let made = if made == of {
        format!("{}, all drones there", plural(of, "change"))
    } else {
        format!("all drones there after {made} of {}", plural(of, "change"))
    };
    Some(format!("{made}, {} s at most", figure(longest_s, 1)))
}

/// How often the swarm had lost its master, and for how long.
fn describe_elections(elections: &[Election]) -> [(&'static str, String); 3] {
    let spread = |what: fn(&Election) -> Option<f64>| {
        let mut times_s: Vec<_> = elections.iter().filter_map(what).collect();
        times_s.sort_by(f64::total_cmp);
        let Some(longest_s) = times_s.last() else {
            return "never".to_owned();
        };
        let percentile_s = |percent: usize| times_s[(times_s.len() - 1) * percent / 100];
        format!(
            "{} of {} times: after {:.3} s in the median, {:.3} s in 99 of 100, {longest_s:.3} s at most",
            times_s.len(),
            elections.len(),
            percentile_s(50),
            percentile_s(99),
        )
    };
    [
        (
            "elections",
            format!(
                "{} times a part of the swarm had no master",
                elections.len()
            ),
        ),
        ("led again", spread(|it| it.led_after_s)),
        ("all agreed", spread(|it| it.settled_after_s)),
    ]
}

/// When the swarm had lost its master, and who led how much later.
fn describe_election(election: &Election) -> String {
    let begun = format!(
        "at {:.1} s a part of the swarm had no master",
        election.at_s
    );
    let Some(after_s) = election.settled_after_s else {
        return format!("{begun}, and that remained so");
    };
    let masters: Vec<_> = election.masters.iter().map(u32::to_string).collect();
    match &masters[..] {
        [] => format!("{begun}; {after_s:.2} s later nobody was left that needed one"),
        masters => format!(
            "{begun}; {after_s:.2} s later {} led",
            masters.join(" and ")
        ),
    }
}

/// Whom the master does not hear, and through whom it hears of them.
fn beyond_the_master(report: &Report) -> Option<String> {
    let bridges: Vec<_> = report
        .bridges
        .iter()
        .map(|bridge| format!("{} for {}", bridge.bridge, ranges(&bridge.out_of_range)))
        .collect();
    let beyond: usize = report
        .bridges
        .iter()
        .map(|bridge| bridge.out_of_range.len())
        .sum();
    (beyond > 0).then(|| {
        let bridges = bridges.join("; ");
        format!("{beyond} drones are out of the master's range; bridges: {bridges}")
    })
}

/// What a person would ask about this drone.
fn remark(drone: &DroneReport) -> Option<String> {
    let landed = drone
        .landed_because
        .as_ref()
        .map(|why| format!("came down early: {why}"));
    let restarted = match drone.restarts {
        0 => None,
        1 => Some("an actor was restarted once".to_owned()),
        times => Some(format!("actors were restarted {times} times")),
    };
    let remarks: Vec<_> = landed.into_iter().chain(restarted).collect();
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

/// What stands where a run without checkers would have passed.
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
mod tests {
    use super::*;
    use crate::report::sample;

    #[test]
    fn fifteen_drones_fit_a_hundred_columns() {
        let (report, _) = sample::swarm(15);
        let text = table(&report, Some(100), Colour::Never);
        assert!(
            text.lines().all(|line| line.chars().count() <= 100),
            "{text}"
        );
        insta::assert_snapshot!(text);
    }

    #[test]
    fn what_went_wrong_is_said_in_words() {
        let (report, _) = sample::troubled();
        insta::assert_snapshot!(table(&report, None, Colour::Never));
    }

    #[test]
    fn nobody_is_said_to_have_come_down_who_may_still_fly() {
        let (mut report, _) = sample::troubled();
        report.violations.clear();
        assert!(not_completed(&report).contains("came down"));
        let (broken, _) = sample::troubled();
        assert!(!broken.violations.is_empty() && !not_completed(&broken).contains("came down"));
        for drone in &mut report.drones {
            (drone.waypoints, drone.landed_because) = (0, None);
        }
        assert!(not_completed(&report).starts_with("not flown"));
    }

    #[test]
    fn a_drone_alone_has_no_separation_and_no_barrier() {
        let (mut report, _) = sample::swarm(1);
        report.barriers.clear();
        insta::assert_snapshot!(table(&report, Some(80), Colour::Never));
    }

    #[test]
    fn a_narrow_terminal_wraps_states_and_no_numbers() {
        let (report, _) = sample::troubled();
        let narrow = table(&report, Some(70), Colour::Never);
        for drone in &report.drones {
            assert!(
                narrow.contains(&figure(count(drone.messages_received), 0)),
                "{narrow}"
            );
        }
    }

    #[test]
    fn escapes_are_written_only_when_asked_for() {
        let (report, _) = sample::troubled();
        assert!(!table(&report, None, Colour::Never).contains('\x1b'));
        assert!(table(&report, None, Colour::Always).contains('\x1b'));
    }
}
