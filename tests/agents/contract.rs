//! What an agent can rely on, whenever it fails and wherever it flies.

use std::time::Duration;

use muster::NodeId;
use muster::agent::{
    Agent, Context, Destination, Outcome, Reliability, SwarmEvent, Telemetry, TimerId,
};
use muster::report::Report;

use super::{fly, plain};

const SECOND: Duration = Duration::from_secs(1);
const KEEPS: TimerId = TimerId(0);
const FAILS: TimerId = TimerId(1);
const LANDS: TimerId = TimerId(2);

/// Greets all others, flies to where it is whenever it is there, and fails once, in a timer.
#[derive(Default)]
struct Staying {
    heard: u32,
    delivered: u32,
}

impl Agent for Staying {
    fn start(&mut self, context: &mut Context<'_>) {
        let here = context.position();
        context.go_to(here);
        if context.kept().is_some() {
            context.set_timer(LANDS, 5 * SECOND);
            return;
        }
        context.set_timer(KEEPS, 5 * SECOND);
        let own = context.id();
        for other in (0..5).map(NodeId).filter(|it| *it != own) {
            let to = Destination::Drone(other);
            let greeting = b"hello";
            context
                .send(to, greeting, Reliability::Acknowledged)
                .unwrap();
        }
    }

    fn telemetry(&mut self, telemetry: &Telemetry, context: &mut Context<'_>) {
        if telemetry.has_arrived {
            let here = context.position();
            context.go_to(here);
        }
    }

    fn message(&mut self, _from: NodeId, _payload: &[u8], context: &mut Context<'_>) {
        self.heard += 1;
        context.observe("heard", f64::from(self.heard));
    }

    fn timer(&mut self, timer: TimerId, context: &mut Context<'_>) {
        match timer {
            KEEPS => {
                context.keep(b"was here").unwrap();
                context.set_timer(FAILS, SECOND);
            }
            FAILS => std::panic::resume_unwind(Box::new("once")),
            _ => context.land(),
        }
    }

    fn swarm(&mut self, event: SwarmEvent, context: &mut Context<'_>) {
        if let SwarmEvent::MessageSent { outcome, .. } = event
            && outcome == Outcome::Delivered
        {
            self.delivered += 1;
            context.observe("delivered", f64::from(self.delivered));
        }
    }
}

/// The sum over all drones of the highest value of a name.
fn sum(report: &Report, name: &str) -> f64 {
    let highest = |id: u32| {
        let values = report.observed.iter();
        let values = values.filter(|it| it.name == name && it.drone == id);
        values.map(|it| it.value).fold(0.0, f64::max)
    };
    (0..5).map(highest).sum()
}

#[test]
fn what_is_delivered_is_heard_and_a_failure_in_a_timer_or_a_stay_breaks_no_rule() {
    for (policy, loss) in [("tree", 0.0), ("tree", 0.3), ("flood", 0.0), ("flood", 0.3)] {
        let sim = plain().set("protocol.policy", policy).unwrap();
        let sim = sim.set("radio.loss", loss).unwrap();
        let report = fly(&sim.agents(|_| Box::new(Staying::default())).unwrap()).report;
        assert!(report.mission_completed, "{policy}, loss {loss}");
        assert_eq!(report.agent_failures.len(), 5, "{policy}, loss {loss}");
        let [delivered, heard] = ["delivered", "heard"].map(|name| sum(&report, name));
        assert!(
            heard >= delivered && delivered > 10.0,
            "{policy}, loss {loss}: {delivered}, {heard}"
        );
    }
}
