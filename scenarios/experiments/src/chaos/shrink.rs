//! Shrinking of a plan: removes and simplifies everything that is not needed to break the same rule.

use std::sync::Arc;
use std::time::Duration;

use muster_machines::time::Timestamp;
use muster_scenarios::scenario::{Fault, FaultKind, Links, Scenario, Target, When};

use super::run::Progress;
use super::search::{Plan, Search};
use crate::campaign::CampaignError;

/// Maximum number of plans tried.
const TRIED_MAX: u64 = 600;

/// Returns a smaller plan for which `breaks` still holds, and the number of plans tried.
///
/// Tries to remove faults, then to simplify the swarm's values, then to simplify the remaining faults. Starts again after
/// each success.
pub(super) fn shrink(
    search: &Search,
    plan: &Plan,
    breaks: impl Fn(&Scenario) -> Result<bool, CampaignError>,
    watcher: &mut impl FnMut(Progress),
) -> Result<(Plan, u64), CampaignError> {
    let mut small = plan.clone();
    let mut tried = 0;
    loop {
        let mut candidates = smaller(&small).into_iter();
        let found = loop {
            let Some(candidate) = candidates.next().filter(|_| tried < TRIED_MAX) else {
                break None;
            };
            tried += 1;
            watcher(Progress::Shrinking {
                seed: plan.seed,
                faults: small.faults.len(),
                tried,
            });
            // Incompatible values, or faults on drones that don't exist, make no valid plan.
            let Ok(scenario) = search.scenario(&candidate) else {
                continue;
            };
            if has_unknown_drones(&candidate, scenario.plan.nodes()) {
                continue;
            }
            if breaks(&scenario)? {
                break Some(candidate);
            }
        };
        match found {
            Some(candidate) => small = candidate,
            None => return Ok((small, tried)),
        }
    }
}

/// Plans that are one step smaller, the largest steps first.
fn smaller(plan: &Plan) -> Vec<Plan> {
    let mut all = Vec::new();
    for index in 0..plan.faults.len() {
        let mut less = plan.clone();
        less.faults.remove(index);
        all.push(less);
    }
    for place in 0..plan.values.len() {
        for value in 0..plan.values[place] {
            let mut simpler = plan.clone();
            simpler.values[place] = value;
            all.push(simpler);
        }
    }
    for (index, fault) in plan.faults.iter().enumerate() {
        for fault in simpler(fault) {
            let mut simpler = plan.clone();
            simpler.faults[index] = fault;
            all.push(simpler);
        }
    }
    all
}

/// Simpler versions of a fault: fewer injections, rounded times and durations, fewer links.
fn simpler(fault: &Fault) -> Vec<Fault> {
    let mut all = Vec::new();
    let mut with = |change: &dyn Fn(&mut Fault)| {
        let mut changed = fault.clone();
        change(&mut changed);
        if changed != *fault {
            all.push(changed);
        }
    };
    with(&|it| (it.times, it.every) = (1, Duration::ZERO));
    if fault.times > 2 {
        with(&|it| it.times = 2);
    }
    for step in [Duration::from_secs(1), Duration::from_millis(100)] {
        with(&|it| {
            it.when = match it.when {
                When::At(at) => {
                    When::At(Timestamp::ZERO + rounded(at.since(Timestamp::ZERO), step))
                }
                When::After(trigger, after) => When::After(trigger, rounded(after, step)),
            }
        });
        with(&|it| {
            it.duration = it
                .duration
                .map(|lasts| rounded(lasts, step))
                .filter(|it| !it.is_zero())
                .or(it.duration);
        });
    }
    if let FaultKind::Links(links, link) = &fault.kind {
        for fewer in fewer_links(links) {
            with(&|it| it.kind = FaultKind::Links(fewer.clone(), *link));
        }
    }
    all
}

fn rounded(time: Duration, step: Duration) -> Duration {
    let steps = (time + step / 2).as_millis() / step.as_millis();
    step * u32::try_from(steps).unwrap_or(u32::MAX)
}

/// The links without one drone on either side.
fn fewer_links(links: &Links) -> Vec<Links> {
    let without = |ids: &Arc<[_]>| -> Vec<Arc<[_]>> {
        if ids.len() < 2 {
            return Vec::new();
        }
        (0..ids.len())
            .map(|left_out| {
                let others = ids
                    .iter()
                    .enumerate()
                    .filter(|(place, _)| *place != left_out);
                others.map(|(_, id)| *id).collect()
            })
            .collect()
    };
    let (from, to) = (without(&links.from), without(&links.to));
    let from = from.into_iter().map(|from| Links {
        from,
        to: Arc::clone(&links.to),
    });
    let to = to.into_iter().map(|to| Links {
        from: Arc::clone(&links.from),
        to,
    });
    from.chain(to).collect()
}

/// Whether a fault names a drone that a swarm of `nodes` does not have.
fn has_unknown_drones(plan: &Plan, nodes: u32) -> bool {
    plan.faults.iter().any(|fault| match &fault.kind {
        FaultKind::Drone(Target::Drone(drone), _) => drone.0 >= nodes,
        FaultKind::Links(links, _) => links
            .from
            .iter()
            .chain(&*links.to)
            .any(|drone| drone.0 >= nodes),
        FaultKind::Tamper(tampered) => tampered.from.is_some_and(|drone| drone.0 >= nodes),
        FaultKind::Drone(Target::Master, _) | FaultKind::Jam { .. } => false,
    })
}

#[cfg(test)]
mod tests {
    use muster_machines::identity::NodeId;
    use muster_scenarios::scenario::{DroneFault, LinkFault};

    use super::*;

    #[test]
    fn every_step_changes_the_plan() {
        let links = Links {
            from: [0, 1].map(NodeId).into(),
            to: [2].map(NodeId).into(),
        };
        let mut cut = Fault::at(
            Timestamp::from_secs_f64(1.26),
            FaultKind::Links(links, LinkFault::Cut),
        );
        cut.duration = Some(Duration::from_millis(30));
        cut.times = 3;
        let kill = FaultKind::Drone(Target::Master, DroneFault::Kill);
        let plan = Plan {
            seed: 1,
            values: vec![0, 2],
            faults: vec![cut, Fault::at(Timestamp::from_secs_f64(4.0), kill)],
        };
        let all = smaller(&plan);
        assert!(all.iter().all(|it| *it != plan));
        // Without one of two faults; two simpler swarms; the cut once or twice, at 1 s or 1.3 s, with either drone alone.
        assert_eq!(all.len(), 2 + 2 + 2 + 2 + 2, "{all:?}");
    }

    #[test]
    fn faults_on_unknown_drones_are_detected() {
        let kill = |drone| FaultKind::Drone(Target::Drone(NodeId(drone)), DroneFault::Kill);
        let plan = Plan {
            seed: 1,
            values: Vec::new(),
            faults: vec![Fault::at(Timestamp::ZERO, kill(4))],
        };
        assert!(has_unknown_drones(&plan, 4) && !has_unknown_drones(&plan, 5));
    }
}
