//! Measures how long each call of the drone's agent takes. A slow call holds up all actors, which share its thread.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use muster_machines::agent::{self, Agent, Context, Factory, SwarmEvent, Telemetry, TimerId};
use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;

use crate::clock::Clock;
use crate::status::AgentStatus;

/// A call that takes longer is slow: a quarter of the default period of telemetry, and longer than a hop takes.
const SLOW_AFTER: Duration = Duration::from_millis(50);

/// Slow calls of the drone's agent, over all its restarts in this process.
#[derive(Debug, Default)]
pub(super) struct AgentCalls {
    slow: AtomicU64,
    /// Duration of the longest call, slow or not, in nanoseconds.
    longest_ns: AtomicU64,
}

impl AgentCalls {
    /// Measures the calls of the agents that `config` builds.
    pub(super) fn measure(self: &Arc<Self>, clock: Clock, config: agent::Config) -> agent::Config {
        let (calls, factory) = (Arc::clone(self), config.factory);
        let factory = Factory::new(move || {
            let call = calls.begin(clock, "new");
            let agent = factory.build();
            drop(call);
            let calls = Arc::clone(&calls);
            Box::new(Measured {
                agent,
                calls,
                clock,
            })
        });
        agent::Config { factory, ..config }
    }

    pub(super) fn status(&self) -> AgentStatus {
        let longest = Duration::from_nanos(self.longest_ns.load(Ordering::Relaxed));
        AgentStatus {
            slow_calls: self.slow.load(Ordering::Relaxed),
            longest_call_s: longest.as_secs_f64(),
        }
    }

    fn begin(&self, clock: Clock, method: &'static str) -> Call<'_> {
        Call {
            calls: self,
            clock,
            method,
            began: clock.now(),
        }
    }

    /// Counts a call; logs it if it was slow. The duration of each limits the number of these lines to 20 a second.
    fn end(&self, method: &str, took: Duration) {
        let nanos = u64::try_from(took.as_nanos()).unwrap_or(u64::MAX);
        self.longest_ns.fetch_max(nanos, Ordering::Relaxed);
        if took > SLOW_AFTER {
            self.slow.fetch_add(1, Ordering::Relaxed);
            let took_ms = nanos / 1_000_000;
            tracing::warn!(method, took_ms, "the agent is slow: it holds up the drone");
        }
    }
}

/// A call that runs. It ends when this is dropped, also by a panic of the agent.
struct Call<'a> {
    calls: &'a AgentCalls,
    clock: Clock,
    method: &'static str,
    began: Timestamp,
}

impl Drop for Call<'_> {
    fn drop(&mut self) {
        let took = self.clock.now().since(self.began);
        self.calls.end(self.method, took);
    }
}

/// An agent whose calls are measured.
struct Measured {
    agent: Box<dyn Agent>,
    calls: Arc<AgentCalls>,
    clock: Clock,
}

impl Agent for Measured {
    fn start(&mut self, context: &mut Context<'_>) {
        let _call = self.calls.begin(self.clock, "start");
        self.agent.start(context);
    }

    fn telemetry(&mut self, telemetry: &Telemetry, context: &mut Context<'_>) {
        let _call = self.calls.begin(self.clock, "telemetry");
        self.agent.telemetry(telemetry, context);
    }

    fn message(&mut self, from: NodeId, payload: &[u8], context: &mut Context<'_>) {
        let _call = self.calls.begin(self.clock, "message");
        self.agent.message(from, payload, context);
    }

    fn timer(&mut self, timer: TimerId, context: &mut Context<'_>) {
        let _call = self.calls.begin(self.clock, "timer");
        self.agent.timer(timer, context);
    }

    fn swarm(&mut self, event: SwarmEvent, context: &mut Context<'_>) {
        let _call = self.calls.begin(self.clock, "swarm");
        self.agent.swarm(event, context);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_calls_longer_than_the_limit_are_slow() {
        let calls = AgentCalls::default();
        calls.end("timer", SLOW_AFTER);
        assert_eq!(calls.status().slow_calls, 0);
        calls.end("timer", Duration::from_millis(200));
        calls.end("timer", Duration::from_millis(70));
        let expected = AgentStatus {
            slow_calls: 2,
            longest_call_s: 0.2,
        };
        assert_eq!(calls.status(), expected);
    }
}
