//! The status of drones as a table for a terminal.

use comfy_table::{Attribute, Cell, CellAlignment, Table};
use muster_daemon::status::{AgentStatus, LeaderEpoch, PortState, PortStatus, Role, Status};
use muster_scenarios::report::{Colour, TABLE_STYLE};

use super::{AskError, Target};

/// The result of a query.
#[derive(Debug)]
pub struct Answer {
    /// The drone that was queried.
    pub target: Target,
    /// Its status, or why there is none.
    pub status: Result<Status, AskError>,
}

/// The columns: a header of two lines, and whether the cells are numbers.
const COLUMNS: [(&str, bool); 13] = [
    ("\ndrone", true),
    ("\nstate", false),
    ("\nrole", false),
    ("\nleader", true),
    ("\nterm", true),
    ("\nhops", true),
    ("neigh-\nbours", true),
    ("altitude\nm", true),
    ("north, east\nm", true),
    ("battery\n%", true),
    ("\nrestarts", true),
    ("frames\ndropped", true),
    ("\nuptime", true),
];

/// A cell without a value.
const EMPTY: &str = "–";

/// One row per drone, ordered by number, then faults, flight controllers' ports and failed queries. Ends with a line feed.
#[must_use]
pub fn table(answers: &[Answer], colour: Colour) -> String {
    let mut answers: Vec<_> = answers.iter().collect();
    answers.sort_by_key(|answer| number(answer).unwrap_or(u32::MAX));
    let mut table = Table::new();
    table.force_no_tty().load_style(TABLE_STYLE);
    if colour == Colour::Always {
        table.enforce_styling();
    }
    table.set_header(COLUMNS.map(|(name, _)| Cell::new(name).add_attribute(Attribute::Bold)));
    for (column, (_, numbers)) in table.column_iter_mut().zip(COLUMNS) {
        column.set_padding((1, 0));
        if numbers {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    for answer in &answers {
        table.add_row(match &answer.status {
            Ok(status) => row(status),
            Err(_) => without_answer(answer),
        });
    }
    let lines = table.lines().map(|line| format!("{}\n", line.trim_end()));
    let mut text: String = lines.collect();
    let remarks: Vec<_> = answers.into_iter().flat_map(remarks).collect();
    if !remarks.is_empty() {
        text.push('\n');
    }
    for (name, remark) in remarks {
        text.push_str(&format!(" {name:<11}  {remark}\n"));
    }
    text
}

fn number(answer: &Answer) -> Option<u32> {
    answer
        .status
        .as_ref()
        .map_or(answer.target.drone, |it| Some(it.drone))
}

fn row(status: &Status) -> Vec<String> {
    let leads = if status.role == Role::Master {
        "▸ "
    } else {
        ""
    };
    let vehicle = &status.vehicle;
    let of_ballot = |it: fn(&LeaderEpoch) -> u32| or_empty(status.ballot.as_ref().map(it));
    vec![
        format!("{leads}{}", status.drone),
        status.state.words.clone(),
        status.role.name().to_owned(),
        of_ballot(|it| it.master),
        of_ballot(|it| it.term),
        or_empty(status.hops),
        status.neighbours().count().to_string(),
        format!("{:.1}", without_negative_zero(vehicle.altitude_m)),
        format!(
            "{:.1}, {:.1}",
            without_negative_zero(vehicle.north_m),
            without_negative_zero(vehicle.east_m)
        ),
        format!("{:.0}", vehicle.charge * 100.0),
        status.restarts().to_string(),
        status.dropped().to_string(),
        duration(status.up_s),
    ]
}

/// Zero instead of a value that would print as "-0.0".
fn without_negative_zero(metres: f64) -> f64 {
    if metres.abs() < 0.05 { 0.0 } else { metres }
}

fn without_answer(answer: &Answer) -> Vec<String> {
    let mut cells = vec![EMPTY.to_owned(); COLUMNS.len()];
    cells[0] = or_empty(answer.target.drone);
    cells[1] = "no answer".to_owned();
    cells
}

/// The faults and the port of a drone, or the failure of its query, each with the drone's name.
fn remarks(answer: &Answer) -> Vec<(String, String)> {
    let name =
        number(answer).map_or_else(|| answer.target.address.clone(), |id| format!("drone {id}"));
    let remarks = match &answer.status {
        Ok(status) => {
            let slow = status.agent.filter(|agent| agent.slow_calls > 0).map(slow);
            let port = status.port.as_ref().map(port);
            let computer = computer(status);
            status
                .faults
                .iter()
                .cloned()
                .chain(slow)
                .chain(port)
                .chain(computer)
                .collect()
        }
        Err(error) if number(answer).is_some() => {
            vec![format!("{}: {error}", answer.target.address)]
        }
        Err(error) => vec![error.to_string()],
    };
    remarks.into_iter().map(|it| (name.clone(), it)).collect()
}

/// What is said of a slow agent.
fn slow(agent: AgentStatus) -> String {
    let (times, longest_ms) = (agent.slow_calls, agent.longest_call_s * 1e3);
    format!("its agent is slow: {times} calls over 50 ms, the longest {longest_ms:.0} ms")
}

/// From this temperature on a Raspberry Pi slows down, in degrees Celsius.
const HOT_C: f64 = 80.0;
/// From this share of its life on a card is to be replaced.
const WORN: f64 = 0.9;
/// Below this a journal may soon not be written, in bytes.
const SPACE_MIN: u64 = 100_000_000;

/// What is said of a drone's computer. `None` if all is well, as far as it tells.
fn computer(status: &Status) -> Option<String> {
    let computer = &status.computer;
    let mut words = Vec::new();
    if let Some(hot) = computer.temperature_c.filter(|it| *it >= HOT_C) {
        words.push(format!("{hot:.0} °C"));
    }
    let mut flag = |now, before, name: &str| match (now, before) {
        (Some(true), _) => words.push(name.replace("was ", "")),
        (_, Some(true)) => words.push(name.to_owned()),
        _ => {}
    };
    flag(
        computer.under_voltage,
        computer.had_under_voltage,
        "voltage was too low",
    );
    flag(
        computer.throttled,
        computer.was_throttled,
        "was slowed down",
    );
    if let Some(wear) = computer.card_wear.filter(|it| *it >= WORN) {
        words.push(format!("wear of the card {:.0} %", 100.0 * wear));
    }
    if let Some(free) = computer.free_bytes.filter(|it| *it < SPACE_MIN) {
        words.push(format!("{} MB free", free / 1_000_000));
    }
    (!words.is_empty()).then(|| format!("its computer: {}", words.join(", ")))
}

/// What is said of a flight controller's port.
fn port(port: &PortStatus) -> String {
    let state = port.state.name();
    if let (PortState::Closed, Some(error)) = (port.state, &port.closed_by) {
        return format!("port {state}: {error}");
    }
    let fitness = if port.unfit.is_empty() {
        ""
    } else {
        ", not fit to fly"
    };
    format!(
        "port {state}{fitness}, {:.1} ms, {:.0} % lost, RC {}/s, longest gap {:.0} ms",
        1e3 * port.latency_s,
        100.0 * port.loss,
        port.rc_per_s,
        1e3 * port.rc_gap_max_s
    )
}

fn or_empty(value: Option<impl ToString>) -> String {
    value.map_or_else(|| EMPTY.to_owned(), |it| it.to_string())
}

/// For example "42 s", "12 min", "3 h 20 min".
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "the cast saturates"
)]
fn duration(seconds: f64) -> String {
    match seconds.max(0.0) as u64 {
        seconds @ 0..120 => format!("{seconds} s"),
        seconds @ 120..7_200 => format!("{} min", seconds / 60),
        seconds => format!("{} h {} min", seconds / 3_600, seconds / 60 % 60),
    }
}

#[cfg(test)]
mod tests;
