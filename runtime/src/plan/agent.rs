//! The agent of a plan.

use std::sync::Arc;
use std::time::Duration;

use muster_machines::geometry::Ned;

use super::file::Source;
use super::raw::{ProtocolKind, Raw};
use crate::agents::{Agents, PlannedAgent};
use crate::diagnostic::BadInput;

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
    let table = match (&raw.agent, raw.protocol.kind) {
        (Some(table), ProtocolKind::Agent) => table.get_ref(),
        (Some(table), _) => {
            let message = "the table `[agent]` needs the protocol \"agent\"";
            return Err(source.error(table.span(), message));
        }
        (None, ProtocolKind::Agent) => {
            let message = "the protocol \"agent\" needs a table `[agent]`";
            return Err(source.error(raw.protocol.policy.span(), message));
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
        (table.parameters.as_ref()).map_or_else(Default::default, |it| it.get_ref().clone()),
        agents.unwrap_or(Agents::installed()),
    );
    if let Some(agents) = agents.filter(|_| !agent.is_available()) {
        return Err(source.error(table.name.span(), &unavailable(&agent.name, agents)));
    }
    let drones = u32::try_from(raw.formation.drones.get_ref().0).unwrap_or(u32::MAX);
    if let Err(error) = agent.check(drones) {
        let span = table.parameters.as_ref().map(|it| it.span());
        let message = format!(
            "the agent `{}` refuses its parameters: {}",
            agent.name,
            error.to_string().trim()
        );
        return Err(source.error(span.unwrap_or(table.name.span()), &message));
    }
    Ok(Some(agent))
}

fn unavailable(name: &str, agents: &Agents) -> String {
    let names: Vec<_> = agents.names().collect();
    if names.is_empty() {
        format!("this program has no agents; use the program that has `{name}`")
    } else {
        format!(
            "this program has no agent `{name}`; it has {}",
            names.join(", ")
        )
    }
}
