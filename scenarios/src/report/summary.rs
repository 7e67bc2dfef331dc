use std::collections::BTreeSet;
use std::time::Duration;

use muster_machines::identity::NodeId;
use muster_machines::mission::{Holds, LandingReason, State};
use muster_transport::sim::Access;

use super::figures::command;
use super::following::{distances_m, error};
use super::{
    AgentFailure, Barrier, Bridge, DroneReport, Election, Engine, Flight, FlightOfDrone,
    FormationChange, History, Means, MediumCounters, ObservedValue, PortReport, RelayReport,
    Report, Role, Violation,
};
use crate::scenario::{Joins, Scenario};
use crate::world::{Outcome, PortFigures, Record, Recorder, SwarmOutcome, track};

/// Report and flight of a finished run.
pub(crate) fn summary(
    scenario: &Scenario,
    engine: Option<Engine>,
    outcome: &Outcome,
    wall: Duration,
) -> (Report, Flight) {
    let overrides: Vec<_> = scenario.overrides.iter().map(ToString::to_string).collect();
    let mut command = command(&scenario.name, scenario.seed, engine, &overrides);
    if scenario.unchecked {
        command.push_str(" --unchecked");
    }
    let run = Run {
        scenario,
        engine,
        outcome,
        wall,
        command,
    };
    let swarms = scenario.swarms().zip(&outcome.swarms);
    let mut swarms = swarms.map(|((swarm, joins), flown)| {
        let report = run.report(swarm, joins, flown);
        (report, run.flight(swarm, joins, flown))
    });
    let (mut report, mut flight) = swarms.next().expect("a scenario has a swarm of its own");
    (report.others, flight.others) = swarms.unzip();
    report.overrides = overrides;
    (report, flight)
}

/// What the reports of all swarms of a run share.
struct Run<'a> {
    scenario: &'a Scenario,
    engine: Option<Engine>,
    outcome: &'a Outcome,
    wall: Duration,
    command: String,
}

impl Run<'_> {
    /// Report of one swarm, without overrides and other swarms.
    fn report(&self, swarm: &Scenario, joins: Joins, flown: &SwarmOutcome) -> Report {
        let outcome = self.outcome;
        let distances_m = distances_m(swarm, flown, outcome.ended);
        let drones: Vec<_> = (flown.recorder.drones())
            .zip(&distances_m)
            .zip(&flown.ports)
            .map(|(((id, _), distances_m), port)| DroneReport {
                following: error(distances_m.clone()),
                port: port.as_ref().map(PortReport::from),
                ..drone(id, &flown.recorder, &swarm.plan.holds)
            })
            .collect();
        let dropped = flown.recorder.dropped().iter();
        let never_met = if self.scenario.unchecked {
            // Links are looked at for the rules.
            Vec::new()
        } else {
            never_met(&flown.recorder)
        };
        Report {
            scenario: swarm.name.clone(),
            seed: self.scenario.seed,
            overrides: Vec::new(),
            engine: self.engine,
            command: self.command.clone(),
            trace: self.engine.map(|_| outcome.trace.clone()),
            simulated_s: outcome.ended.as_secs_f64(),
            wall_s: self.wall.as_secs_f64(),
            clock_uncertainty_s: None,
            firmware: None,
            firmware_stalls: None,
            means: means(&drones),
            drones,
            relays: relays(swarm, joins, flown),
            barriers: barriers(&flown.recorder, &swarm.plan.holds),
            changes: changes(swarm, &flown.recorder),
            following: error(distances_m.concat()),
            elections: elections(&flown.recorder),
            bridges: bridges(&flown.recorder),
            agent_failures: agent_failures(&flown.recorder),
            observed: observed(&flown.recorder),
            dropped: dropped
                .map(|(reason, count)| (reason.to_string(), *count))
                .collect(),
            medium: medium(self.scenario, outcome),
            min_separation_m: outcome.closest_m,
            mission_completed: is_completed(swarm, &flown.recorder) && never_met.is_empty(),
            never_met,
            never_injected: self.never_injected(swarm),
            interrupted: false,
            violations: outcome.violations.iter().map(Violation::from).collect(),
            unchecked: self.scenario.unchecked,
            others: Vec::new(),
        }
    }

    /// Faults that did not happen by the end of a simulation, by their place in the file, from 1. They are the own swarm's.
    fn never_injected(&self, swarm: &Scenario) -> Vec<usize> {
        let is_simulated = self.engine.is_some() && self.outcome.violations.is_empty();
        if !is_simulated || !std::ptr::eq(swarm, self.scenario) {
            return Vec::new();
        }
        let injected: BTreeSet<usize> = (self.outcome.injections.iter())
            .map(|it| it.fault)
            .collect();
        let faults = 0..self.scenario.faults.len();
        let never = faults.filter(|it| !injected.contains(it));
        never.map(|it| it + 1).collect()
    }

    /// What happened to one swarm, broken rules included: those of the run are marks of its own swarm.
    fn history(&self, swarm: &Scenario, flown: &SwarmOutcome) -> History {
        let is_own = std::ptr::eq(swarm, self.scenario);
        let mut history = History::of(self.scenario, swarm, is_own, flown);
        if is_own {
            history.add_violations(&self.outcome.violations);
        }
        history
    }

    /// Tracks and states of one swarm.
    fn flight(&self, swarm: &Scenario, joins: Joins, flown: &SwarmOutcome) -> Flight {
        let drones = flown.recorder.drones().zip(&flown.vehicles);
        let drones = drones.zip(&flown.controls);
        Flight {
            waypoints: swarm
                .plan
                .waypoints
                .iter()
                .map(|it| *it + joins.home)
                .collect(),
            range_m: self.scenario.radio.propagation.range_m(),
            drones: drones
                .map(|(((_, record), vehicle), control)| FlightOfDrone {
                    track: track(vehicle, record, self.outcome.ended),
                    states: record.states.clone(),
                    died_at: record.killed,
                    control: control.clone(),
                })
                .collect(),
            history: self.history(swarm, flown),
            others: Vec::new(),
        }
    }
}

fn drone(id: NodeId, recorder: &Recorder, holds: &Holds) -> DroneReport {
    let (record, traffic) = (recorder.of(id), recorder.traffic(id));
    let waits = record
        .stays()
        .map(|(waypoint, stay)| stay - held(stay, holds.at(waypoint)));
    let waits: Vec<Duration> = waits.collect();
    let routes = &record.routes;
    // Segments that meet while they land agree on a master, but the routes are those from before.
    let leads = [Some(recorder.leader_of(id)), record.landed_under].contains(&Some(id));
    DroneReport {
        id: id.0,
        role: if leads { Role::Master } else { Role::Member },
        hops: routes.hops,
        parent: routes.parent.map(|parent| parent.0),
        relay: routes.relay && !leads,
        out_of_range: routes.out_of_range && !leads,
        routing_list: routes.routing_list.iter().map(|id| id.0).collect(),
        flight_time_s: record
            .discovery()
            .zip(record.disarmed)
            .map(|(from, to)| (to - from).as_secs_f64()),
        messages_sent: traffic.sent,
        messages_received: traffic.received,
        messages_at_least: traffic.is_cut_off,
        waypoint_delay_s: mean(waits.iter().map(Duration::as_secs_f64)),
        waypoint_delay_max_s: waits.iter().max().map(Duration::as_secs_f64),
        following: None,
        state: state(record),
        landed: record.has_landed(),
        waypoints: record.waypoints(),
        landed_because: record.reason.and_then(unplanned).map(str::to_owned),
        restarts: record.restarts,
        port: None,
    }
}

impl From<&PortFigures> for PortReport {
    fn from(figures: &PortFigures) -> Self {
        Self {
            opened: figures.opened,
            frames: figures.frames,
            bad_frames: figures.bad_frames,
            noise_bytes: figures.noise_bytes,
            questions_lost: figures.questions_lost,
            rc_sent: figures.rc_sent,
            rc_acknowledged: figures.rc_acknowledged,
            rc_gap_max_s: figures.rc_gap_max.as_secs_f64(),
        }
    }
}

fn relays(scenario: &Scenario, joins: Joins, flown: &SwarmOutcome) -> Vec<RelayReport> {
    let relays = flown.recorder.relays().zip(scenario.plan.relays.iter());
    relays
        .map(|((id, record), place)| {
            let traffic = flown.recorder.traffic(id);
            (id, record, traffic, *place + joins.home)
        })
        .map(|(id, record, traffic, place)| RelayReport {
            id: id.0,
            north_m: place.north_m(),
            east_m: place.east_m(),
            // Never a negative zero.
            altitude_m: place.altitude_m() + 0.0,
            hops: record.routes.hops,
            parent: record.routes.parent.map(|parent| parent.0),
            messages_sent: traffic.sent,
            messages_received: traffic.received,
            messages_at_least: traffic.is_cut_off,
            restarts: record.restarts,
        })
        .collect()
}

/// State of a drone at the end, or how it was lost.
fn state(record: &Record) -> String {
    let last = record
        .states
        .last()
        .map_or(State::Start, |(_, state)| *state);
    if record.fell {
        format!("fell {}", when(last))
    } else if record.ran_empty {
        format!("battery empty {}", when(last))
    } else if record.killed.is_some() {
        format!("killed {}", when(last))
    } else if record.given_up && record.disarmed.is_some() && last != State::Finished {
        format!("on the ground, an actor failed for good {}", when(last))
    } else {
        last.to_string()
    }
}

/// In which state something happened.
fn when(state: State) -> String {
    match state {
        State::Start => "at the start".to_owned(),
        State::SetUp | State::NeighbourDiscovery | State::HopUpdate => format!("during {state}"),
        State::WaypointReached { waypoint } => format!("at waypoint {waypoint}"),
        State::OnTask | State::Independent => "on task".to_owned(),
        State::Finished => "after its landing".to_owned(),
        _ => format!("while {state}"),
    }
}

/// Reason for an early landing, in words; `None` at the mission's end.
#[must_use]
pub const fn unplanned(reason: LandingReason) -> Option<&'static str> {
    match reason {
        LandingReason::MissionOver => None,
        LandingReason::MasterSilent => Some("the master was silent"),
        LandingReason::Late => Some("it reached its slot too late"),
        LandingReason::Overdue => Some("a leg exceeded its time limit"),
        LandingReason::ActorGivenUp => Some("an actor failed for good"),
        LandingReason::Alone => Some("it had no contact with other drones"),
        LandingReason::Geofence => Some("it was about to leave the geofence"),
        LandingReason::BatteryLow => Some("its battery was low"),
        LandingReason::PositionLost => Some("it lost its position"),
        LandingReason::BatteryCritical => Some("its battery was critically low"),
        LandingReason::FlightTime => Some("it reached its flight time limit"),
        LandingReason::Restarted => Some("its process restarted on the ground"),
        LandingReason::Recalled => Some("it was recalled"),
        LandingReason::NetworkLost => Some("its network task failed"),
        LandingReason::JournalLost => Some("its journal could not be written"),
        LandingReason::Controller => Some("its flight controller landed it"),
        LandingReason::TakenOver => Some("its pilot took it over"),
        LandingReason::Tilt => Some("it leant too far"),
        LandingReason::Thrust => Some("its throttle had no effect"),
        LandingReason::Motors => Some("its motors were at their limit or trembled"),
        LandingReason::Volts => Some("its voltage under load was too low"),
    }
}

fn means(drones: &[DroneReport]) -> Means {
    #[expect(
        clippy::cast_precision_loss,
        reason = "counts of messages are far below 2^52"
    )]
    let received = drones.iter().map(|drone| drone.messages_received as f64);
    Means {
        flight_time_s: mean(drones.iter().filter_map(|drone| drone.flight_time_s)),
        messages_received: mean(received).unwrap_or_default(),
    }
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0_u32), |(sum, count), value| (sum + value, count + 1));
    (count > 0).then(|| sum / f64::from(count))
}

fn elections(recorder: &Recorder) -> Vec<Election> {
    let all = recorder.elections().iter();
    all.map(|election| {
        let settled = election.settled.as_ref();
        Election {
            at_s: election.begun.as_secs_f64(),
            led_after_s: election
                .led
                .map(|at| at.since(election.begun).as_secs_f64()),
            settled_after_s: settled.map(|(at, _)| at.since(election.begun).as_secs_f64()),
            masters: settled.map_or_else(Vec::new, |(_, masters)| {
                masters.iter().map(|id| id.0).collect()
            }),
        }
    })
    .collect()
}

/// How much of a stay at a waypoint was a hold. One that is shorter was another, before or after a change of formation.
fn held(stay: Duration, hold: Duration) -> Duration {
    if stay < hold { Duration::ZERO } else { hold }
}

fn barriers(recorder: &Recorder, holds: &Holds) -> Vec<Barrier> {
    let crossings = recorder.barriers().iter();
    crossings
        .filter_map(|(waypoint, crossing)| {
            let (sent_before, left) = (crossing.begun?, crossing.left?);
            let sent_after = left.sent;
            Some(Barrier {
                waypoint: *waypoint,
                arrived_s: left.arrived.as_secs_f64(),
                moving_s: left.at.as_secs_f64(),
                hold_s: held(left.at - left.arrived, holds.at(*waypoint)).as_secs_f64(),
                transmissions: sent_after.news.saturating_sub(sent_before.news),
                keep_alives: sent_after
                    .keep_alives
                    .saturating_sub(sent_before.keep_alives),
                retries: sent_after.retries.saturating_sub(sent_before.retries),
            })
        })
        .collect()
}

fn medium(scenario: &Scenario, outcome: &Outcome) -> Option<MediumCounters> {
    let Access::Csma { .. } = scenario.radio.access else {
        return None;
    };
    let counters = outcome.medium;
    Some(MediumCounters {
        sent: counters.datagrams,
        acknowledgements: counters.acknowledgements,
        retries: counters.retries,
        given_up: counters.given_up,
        dropped: counters.dropped,
        collided: counters.collided,
        lost: counters.lost,
    })
}

fn changes(scenario: &Scenario, recorder: &Recorder) -> Vec<FormationChange> {
    let made = recorder.changes().iter();
    made.map(|(index, made)| {
        let change = &scenario.plan.changes[usize::from(*index)];
        FormationChange {
            waypoint: change.waypoint(),
            to: change.layout().formation().kind().name(),
            begun_s: made.begun.as_secs_f64(),
            done_s: made.done.map(|at| at.as_secs_f64()),
            drones: made.drones,
            sector_max_m: change.sectors_m().iter().copied().fold(0.0, f64::max),
        }
    })
    .collect()
}

/// Whether the remaining swarm left the last waypoint to land; if it followed, whether it assembled around the master. No drone
/// may have stayed on the ground but those that were lost there.
pub(crate) fn is_completed(scenario: &Scenario, recorder: &Recorder) -> bool {
    if recorder.drones().any(|(_, record)| record.stayed_behind()) {
        return false;
    }
    if scenario.plan.agent.is_some() {
        let mut on_task = (recorder.drones())
            .map(|(_, record)| record)
            .filter(|record| record.was_on_task())
            .peekable();
        return on_task.peek().is_some() && on_task.all(Record::ended_its_task);
    }
    if scenario.plan.follow.is_some() {
        let master = recorder.of(recorder.centre());
        let assembled = |state: &State| *state == State::Assembling;
        return master.states.iter().any(|(_, state)| assembled(state))
            && master.reason == Some(LandingReason::MissionOver);
    }
    let last = u16::try_from(scenario.plan.waypoints.len() - 1).ok();
    let crossing = last.and_then(|last| recorder.barriers().get(&last));
    crossing.is_some_and(|crossing| crossing.left.is_some())
}

fn agent_failures(recorder: &Recorder) -> Vec<AgentFailure> {
    let failures = recorder.agent_failures().iter();
    failures
        .map(|(at, drone, what)| AgentFailure {
            at_s: at.as_secs_f64(),
            drone: drone.0,
            what: what.clone(),
        })
        .collect()
}

fn observed(recorder: &Recorder) -> Vec<ObservedValue> {
    let observed = recorder.observed().iter();
    let mut observed: Vec<_> = observed
        .map(|(at, drone, observed)| ObservedValue {
            at_s: at.as_secs_f64(),
            drone: drone.0,
            name: observed.name.clone(),
            value: observed.value,
        })
        .collect();
    observed.sort_by(|a, b| a.at_s.total_cmp(&b.at_s));
    observed
}

fn bridges(recorder: &Recorder) -> Vec<Bridge> {
    let mut bridges: Vec<Bridge> = Vec::new();
    for (member, via) in recorder.bridged() {
        match bridges.iter_mut().find(|bridge| bridge.bridge == via.0) {
            Some(bridge) => bridge.out_of_range.push(member.0),
            None => bridges.push(Bridge {
                bridge: via.0,
                out_of_range: vec![member.0],
            }),
        }
    }
    bridges.sort_by_key(|bridge| bridge.bridge);
    bridges
}

fn never_met(recorder: &Recorder) -> Vec<Vec<u32>> {
    let groups = recorder.groups();
    if groups.len() < 2 {
        return Vec::new();
    }
    let ids = |group: &Vec<NodeId>| group.iter().map(|id| id.0).collect();
    groups.iter().map(ids).collect()
}

impl From<&crate::checkers::Violation> for Violation {
    fn from(violation: &crate::checkers::Violation) -> Self {
        Self {
            rule: violation.rule,
            at_s: violation.at.as_secs_f64(),
            drones: violation.drones.iter().map(|id| id.0).collect(),
            what: violation.what.clone(),
        }
    }
}
