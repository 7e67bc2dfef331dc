//! The agent of a plan.

use std::error::Error;
use std::ops::Range;
use std::sync::Arc;
use std::time::Duration;

use muster_machines::geometry::Ned;

use super::file::Source;
use super::raw::{ProtocolKind, Raw};
use crate::agents::{Agents, Parameters, ParametersError, PlannedAgent};
use crate::diagnostic::{BadInput, did_you_mean, names};
use crate::schema::Located;

/// How long agents are expected to fly: a default for the limits.
pub(super) const EXPECTED: Duration = Duration::from_secs(300);

/// The plan's agent, from `agents` if they are given. `None` with another protocol.
pub(super) fn agent(
    source: &Source,
    raw: &Raw,
    waypoints: &Arc<[Ned]>,
    altitude_max_m: f64,
    agents: Option<&Agents>,
) -> Result<Option<PlannedAgent>, BadInput> {
    let table = match (&raw.agent, raw.protocol.kind.get_ref()) {
        (Some(table), ProtocolKind::Agent) => table.get_ref(),
        (Some(table), _) => {
            let message = "the table `[agent]` needs the protocol \"agent\"";
            return Err(source.error(table.span(), message));
        }
        (None, ProtocolKind::Agent) => {
            let message = "the protocol \"agent\" needs a table `[agent]`";
            let help = "add `[agent]` with `name`, the agent that flies";
            return Err(source.error_with(raw.protocol.kind.span(), message, help.to_owned()));
        }
        (None, _) => return Ok(None),
    };
    if let Some(change) = raw.changes.first() {
        let message = "agents have no changes of formation: they fly where they decide";
        return Err(source.error(change.waypoint.span(), message));
    }
    let agent = PlannedAgent::new(
        table.name.get_ref(),
        Arc::clone(waypoints),
        (
            Duration::from_millis(table.telemetry_ms.get_ref().0),
            altitude_max_m,
        ),
        (table.parameters.as_ref()).map_or_else(Parameters::default, |it| Parameters {
            table: it.get_ref().clone(),
            file: Some(source.text.clone()),
        }),
        agents.unwrap_or(Agents::installed()),
    );
    if let Some(agents) = agents.filter(|_| !agent.is_available()) {
        return Err(source.error(table.name.span(), &unavailable(&agent.name, agents)));
    }
    let drones = u32::try_from(raw.formation.drones.get_ref().0).unwrap_or(u32::MAX);
    if let Err(error) = agent.check(drones) {
        let table = table
            .parameters
            .as_ref()
            .map_or(table.name.span(), Located::span);
        return Err(refused(source, table, &agent.name, error.as_ref()));
    }
    Ok(Some(agent))
}

/// The agent refuses its parameters, which are at `table`.
fn refused(
    source: &Source,
    table: Range<usize>,
    agent: &str,
    error: &(dyn Error + 'static),
) -> BadInput {
    let message = format!(
        "the agent `{agent}` refuses its parameters: {}",
        error.to_string().trim()
    );
    let Some(ParametersError(error)) = error.downcast_ref() else {
        return source.error(table, &message);
    };
    let span = error.span().unwrap_or(table);
    let names = names(error.message()).skip(1).collect::<Vec<_>>();
    match error.message().starts_with("unknown field") && !names.is_empty() {
        true => source.error_with(
            span,
            &message,
            format!("the agent takes {}", names.join(", ")),
        ),
        false => source.error(span, &message),
    }
}

fn unavailable(name: &str, agents: &Agents) -> String {
    let names: Vec<_> = agents.names().collect();
    if names.is_empty() {
        format!("this program has no agents; use the program that has `{name}`")
    } else {
        format!(
            "this program has no agent `{name}`; it has {}{}",
            names.join(", "),
            did_you_mean(name, names.iter())
        )
    }
}
