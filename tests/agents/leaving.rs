//! Drones whose agents leave the swarm.

use std::time::Duration;

use muster::NodeId;
use muster::agent::{Agent, Context, Destination, Reliability, TimerId};
use muster::report::Report;

use super::{fly, plain};

const SPEAKS: TimerId = TimerId(0);
const LANDS: TimerId = TimerId(1);
const PERIOD: Duration = Duration::from_secs(2);
const LEADER: u32 = 2;

/// Leaves the swarm if it is to, tells its neighbours so each other second, and lands after a minute.
struct Leaving {
    leaves: bool,
    heard: u32,
}

impl Agent for Leaving {
    fn start(&mut self, context: &mut Context<'_>) {
        if self.leaves {
            context.leave();
        }
        context.set_timer(SPEAKS, PERIOD);
        context.set_timer(LANDS, 30 * PERIOD);
    }

    fn message(&mut self, _from: NodeId, _payload: &[u8], context: &mut Context<'_>) {
        self.heard += 1;
        context.observe("heard", f64::from(self.heard));
    }

    fn timer(&mut self, timer: TimerId, context: &mut Context<'_>) {
        if timer == LANDS {
            return context.land();
        }
        let to = Destination::Neighbours;
        context.send(to, b"here", Reliability::BestEffort).unwrap();
        context.set_timer(SPEAKS, PERIOD);
    }
}

fn flown(leavers: &'static [u32], fields: &[(&str, &str)]) -> Report {
    let sim = (fields.iter()).fold(plain(), |sim, (name, value)| sim.set(name, value).unwrap());
    let new = move |id: NodeId| Leaving {
        leaves: leavers.contains(&id.0),
        heard: 0,
    };
    let run = fly(&sim.agents(move |id| Box::new(new(id))).unwrap());
    for node in &run.flight.history.nodes {
        let leaves = node.epochs.iter().any(|(_, epoch)| epoch.is_none());
        assert_eq!(leaves, leavers.contains(&node.id), "drone {}", node.id);
    }
    run.report
}

#[test]
fn any_drone_may_leave_and_the_others_have_a_leader_and_all_hear_each_other() {
    for leavers in [&[0_u32][..], &[LEADER], &[0, 1, 3, 4], &[0, 1, 2, 3, 4]] {
        for policy in ["tree", "flood"] {
            for loss in ["0.0", "0.3"] {
                let case = format!("{leavers:?}, {policy}, loss {loss}");
                let fields = [("protocol.policy", policy), ("radio.loss", loss)];
                let report = flown(leavers, &fields);
                assert!(report.mission_completed, "{case}");
                let elections = report.elections.len();
                match leavers.len() {
                    5 => assert_eq!(elections, 0, "{case}"),
                    1 if leavers == [LEADER] => assert_eq!(elections, 1, "{case}"),
                    // The others may elect while they land one after the other.
                    _ => {}
                }
                let spoken = |id: u32| {
                    let heard = report.observed.iter().filter(|it| it.drone == id);
                    heard.map(|it| it.value).fold(0.0, f64::max)
                };
                for id in 0..5 {
                    assert!(spoken(id) > 40.0, "{case}: drone {id} heard {}", spoken(id));
                }
            }
        }
    }
}

#[test]
fn independent_drones_send_fewer_frames() {
    let sent = |leavers: &'static [u32]| -> f64 {
        let report = flown(leavers, &[]);
        let sent = report.drones.iter().map(|it| it.messages_sent);
        sent.map(|it| f64::from(u32::try_from(it).unwrap())).sum()
    };
    let (members, independent) = (sent(&[]), sent(&[0, 1, 2, 3, 4]));
    assert!(independent < 0.6 * members, "{independent} of {members}");
}

#[test]
fn restarts_and_deaths_of_independent_drones_break_no_rule() {
    for fault in [
        r#"[{kind = "restart", drone = 2, at_s = 60, for_s = 2}]"#,
        r#"[{kind = "crash-actor", drone = 2, actor = "routing", at_s = 60}]"#,
        r#"[{kind = "crash-actor", drone = 2, actor = "mission", at_s = 60}]"#,
        r#"[{kind = "hang", drone = 1, actor = "routing", at_s = 60}]"#,
        r#"[{kind = "kill", drone = 2, at_s = 60}]"#,
    ] {
        let fields = [("faults", fault), ("limits.flight_time_s", "300")];
        let report = flown(&[0, 1, 2, 3, 4], &fields);
        assert!(report.mission_completed, "{fault}");
    }
}
