//! What can be observed of the drone: counters, its route, its log, its computer, its agent's calls.

use std::sync::Arc;

use muster_machines::node::Observation;
use muster_machines::routing::{self, Routes};
use muster_machines::time::Timestamp;
use muster_machines::{mission, radio};

use super::agent_calls::AgentCalls;
use super::computer::Computer;
use super::counts::Counts;
use super::reporter::Reporter;
use crate::log::Lost;
use crate::status::AgentStatus;

pub(super) struct Monitor {
    pub(super) counts: Counts,
    /// The route to the master.
    pub(super) routes: Routes,
    pub(super) reporter: Reporter,
    /// Counts lost log lines.
    lines_lost: Lost,
    pub(super) computer: Computer,
    /// Counts slow calls of the agent. `None` without an agent.
    agent_calls: Option<Arc<AgentCalls>>,
}

impl Monitor {
    pub(super) fn new(
        reporter: Reporter,
        lines_lost: Lost,
        computer: Computer,
        agent_calls: Option<Arc<AgentCalls>>,
    ) -> Self {
        Self {
            counts: Counts::default(),
            routes: Routes::default(),
            reporter,
            lines_lost,
            computer,
            agent_calls,
        }
    }

    /// Counts and logs an observation.
    pub(super) fn observe(&mut self, now: Timestamp, seen: &Observation) {
        match seen {
            Observation::Radio(radio::Event::Dropped(reason)) => self.counts.dropped(*reason),
            Observation::Routing(routing::Event::Routes(routes)) => self.routes.clone_from(routes),
            Observation::Routing(routing::Event::Ignored(_)) => self.counts.ignored += 1,
            Observation::Mission(mission::Event::Refused) => self.counts.orders_refused += 1,
            Observation::Mission(mission::Event::State(_)) => self.report_traffic(now),
            _ => {}
        }
        self.reporter.observed(now, seen);
    }

    /// Logs for programs how many frames were sent and admitted since the last time.
    pub(super) fn report_traffic(&mut self, now: Timestamp) {
        self.reporter.traffic(now, self.counts.traffic());
    }

    /// Log lines dropped because the log's reader is too slow.
    pub(super) fn lines_lost(&self) -> u64 {
        self.lines_lost.lines()
    }

    /// Counters of the agent's calls. `None` without an agent.
    pub(super) fn agent_calls(&self) -> Option<Arc<AgentCalls>> {
        self.agent_calls.clone()
    }

    /// State of the agent's calls. `None` without an agent.
    pub(super) fn agent_status(&self) -> Option<AgentStatus> {
        self.agent_calls.as_ref().map(|calls| calls.status())
    }
}
