//! Plans, statuses and results of rollouts as tables for a terminal.

use comfy_table::{Attribute, Cell, Table};
use muster_daemon::audit::Finding;
use muster_daemon::slots::{DroneFacts, DroneHealth};
use muster_scenarios::report::{Colour, TABLE_STYLE};

use super::apply::{Applied, HostOutcome};
use super::look::{Looked, Planned};
use super::plan::Work;
use super::session::SessionError;

/// A cell without a value.
const EMPTY: &str = "–";

fn rendered<const N: usize>(
    header: [&str; N],
    rows: impl IntoIterator<Item = [String; N]>,
    colour: Colour,
) -> String {
    let mut table = Table::new();
    table.force_no_tty().load_style(TABLE_STYLE);
    if colour == Colour::Always {
        table.enforce_styling();
    }
    table.set_header(header.map(|name| Cell::new(name).add_attribute(Attribute::Bold)));
    for row in rows {
        table.add_row(row);
    }
    let lines = table.lines().map(|line| format!("{}\n", line.trim_end()));
    lines.collect()
}

/// What a rollout would change, a row a host.
#[must_use]
pub fn plan_table(planned: &[Planned], version: &str, colour: Colour) -> String {
    let rows = planned.iter().map(|it| {
        let (what, mut why) = match &it.plan.work {
            Work::None => ("nothing".to_owned(), Vec::new()),
            Work::Install => (
                format!("install {version}"),
                vec!["no release yet".to_owned()],
            ),
            Work::Upgrade { from } if from == version => {
                (format!("replace {version}"), vec!["other files".to_owned()])
            }
            Work::Upgrade { from } => (format!("{from} to {version}"), Vec::new()),
            Work::Configure => (
                "configure".to_owned(),
                vec!["the configuration has changed".to_owned()],
            ),
            Work::Blocked { why } => ("can't be changed".to_owned(), vec![why.clone()]),
        };
        if it.plan.changes() && !it.plan.in_flight.is_empty() {
            let drones: Vec<_> = it.plan.in_flight.iter().map(u32::to_string).collect();
            why.push(format!("waits for drones in flight: {}", drones.join(", ")));
        }
        why.extend(it.plan.notes.iter().cloned());
        [it.wave.to_string(), it.name.clone(), what, why.join("; ")]
    });
    rendered(["wave", "host", "change", "why"], rows, colour)
}

/// How a rollout came out, a row a host.
#[must_use]
pub fn applied_table(applied: &[Applied], colour: Colour) -> String {
    let rows = applied.iter().map(|it| {
        let outcome = match it.outcome {
            HostOutcome::Unchanged => "unchanged",
            HostOutcome::Changed => "changed",
            HostOutcome::Deferred => "deferred",
            HostOutcome::WentBack => "went back",
            HostOutcome::TakenBack => "taken back",
            HostOutcome::Failed => "failed",
            HostOutcome::NotReached => "not reached",
        };
        [
            it.wave.to_string(),
            it.name.clone(),
            outcome.to_owned(),
            it.version.clone().unwrap_or_else(|| EMPTY.to_owned()),
            it.took_s
                .map_or_else(|| EMPTY.to_owned(), |it| format!("{it:.1} s")),
            it.remark.clone().unwrap_or_default(),
        ]
    });
    rendered(
        ["wave", "host", "outcome", "version", "took", "remark"],
        rows,
        colour,
    )
}

/// How hosts and their drones do, a row a host.
#[must_use]
pub fn status_table(looked: &[Looked], colour: Colour) -> String {
    let rows = looked.iter().map(|it| {
        let facts = match &it.facts {
            Ok(facts) => facts,
            Err(error) => {
                let empty = || EMPTY.to_owned();
                return [
                    it.name.clone(),
                    empty(),
                    empty(),
                    empty(),
                    error.to_string(),
                ];
            }
        };
        let mut remarks = Vec::new();
        if facts.is_on_trial {
            remarks.push("on trial".to_owned());
        }
        if let Some(failure) = &facts.failure {
            remarks.push(format!("{} was taken back: {}", failure.slot, failure.why));
        }
        let drones = facts
            .drones
            .iter()
            .map(|(id, drone)| format!("{id} {}", health_text(drone)));
        let version = facts.current.as_ref().map(|it| it.version.clone());
        let or_empty = |it: Option<String>| it.unwrap_or_else(|| EMPTY.to_owned());
        [
            it.name.clone(),
            or_empty(version),
            or_empty(facts.rollback_slot.clone()),
            drones.collect::<Vec<_>>().join("\n"),
            remarks.join("\n"),
        ]
    });
    rendered(
        ["host", "version", "rollback", "drones", "remarks"],
        rows,
        colour,
    )
}

/// What is not safe about hosts, a row a finding.
#[must_use]
pub fn audit_table(
    audited: &[(String, Result<Vec<Finding>, SessionError>)],
    colour: Colour,
) -> String {
    let rows = audited.iter().flat_map(|(name, found)| match found {
        Err(error) => vec![[
            name.clone(),
            EMPTY.to_owned(),
            error.to_string(),
            String::new(),
            String::new(),
        ]],
        Ok(findings) if findings.is_empty() => {
            vec![[
                name.clone(),
                "none".to_owned(),
                String::new(),
                String::new(),
                String::new(),
            ]]
        }
        Ok(findings) => {
            let row = |it: &Finding| {
                [
                    name.clone(),
                    it.rule.clone(),
                    it.what.clone(),
                    it.why.clone(),
                    it.undo.clone(),
                ]
            };
            findings.iter().map(row).collect()
        }
    });
    rendered(["host", "finding", "what", "why", "undo"], rows, colour)
}

fn health_text(drone: &DroneFacts) -> String {
    let health = match &drone.health {
        DroneHealth::Healthy { proven } if proven.is_empty() => {
            "healthy, hears no drone".to_owned()
        }
        DroneHealth::Healthy { proven } => format!("healthy, hears {}", proven.len()),
        DroneHealth::FlightOver => "flight over".to_owned(),
        DroneHealth::Starting(words) | DroneHealth::Unhealthy(words) | DroneHealth::Dead(words) => {
            words.clone()
        }
    };
    let flies = if drone.in_flight { ", in flight" } else { "" };
    format!("{health}{flies}")
}
