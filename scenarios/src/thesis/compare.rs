//! What our runs come to, beside what the thesis says.

use serde::Serialize;

use super::Published;
use crate::report::{Engine, Report, Role};
use crate::scenario::Scenario;

/// The five experiments, the waits of the second and of a single hop, the figures of others and ours: what `--json` prints and
/// `thesis.json` holds. All times are simulated seconds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// The seed of every run.
    pub seed: u64,
    /// What ran the drones.
    pub engine: Engine,
    /// The experiments, in their order.
    pub experiments: Vec<Experiment>,
    /// The waits at the waypoints of the second experiment.
    pub waits: Waits,
    /// The waits at the waypoints where all hear the master.
    pub single_hop: SingleHop,
    /// Our run of the second experiment in which the master waits for its neighbours only.
    pub neighbours: Report,
    /// Likewise, with vehicles that come to rest as the ancestor's.
    pub settling: Report,
    /// Our run of the ancestor's swarm.
    pub ancestor: Report,
}

impl Comparison {
    /// Every run of ours.
    pub fn reports(&self) -> impl Iterator<Item = &Report> {
        let strict = self.experiments.iter().map(|it| &it.report);
        strict.chain([&self.neighbours, &self.settling, &self.ancestor])
    }
}

/// An experiment.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Experiment {
    /// Who flies, in words.
    pub swarm: String,
    /// The number of the thesis's table.
    pub table: u8,
    /// What the table says, and what ours come to.
    pub quantities: [Quantity; 4],
    /// How long each drone flies by the law that the thesis's tables obey.
    pub law_s: Vec<f64>,
    /// Our run.
    pub report: Report,
}

impl Experiment {
    pub(super) fn new(published: &Published, scenario: &Scenario, report: Report) -> Self {
        let flight_times = report.drones.iter().filter_map(|drone| drone.flight_time_s);
        let master = report.master().and_then(|drone| drone.flight_time_s);
        let quantities = [
            Quantity::new("flight_time_master_s", published.master_s, master),
            Quantity::new(
                "flight_time_maximum_s",
                published.maximum_s,
                flight_times.reduce(f64::max),
            ),
            Quantity::new(
                "flight_time_mean_s",
                published.mean_s,
                report.means.flight_time_s,
            ),
            Quantity::new(
                "messages_received_mean",
                published.messages_received,
                Some(report.means.messages_received),
            ),
        ];
        let slots = scenario.layout.formation().slots();
        let law_s = report.drones.iter().zip(slots).map(|(drone, slot)| {
            if drone.role == Role::Master {
                published.master_s
            } else {
                published.slave_s(slot.0.norm())
            }
        });
        Self {
            swarm: published.swarm.clone(),
            table: published.table,
            quantities,
            law_s: law_s.collect(),
            report,
        }
    }
}

/// Something that the thesis and we have measured.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Quantity {
    /// What.
    pub name: &'static str,
    /// The thesis's figure.
    pub thesis: f64,
    /// Ours; nothing if no drone came down.
    pub ours: Option<f64>,
    /// How far ours is off, in per cent of the thesis's.
    pub off_percent: Option<f64>,
}

impl Quantity {
    fn new(name: &'static str, thesis: f64, ours: Option<f64>) -> Self {
        Self {
            name,
            thesis,
            ours,
            off_percent: ours.map(|ours| (ours / thesis - 1.0) * 100.0),
        }
    }
}

/// How long drones wait at a waypoint, from their own arrival to their own departure.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Waits {
    /// The thesis's, at one waypoint (figure 36).
    pub thesis: Wait,
    /// Ours where the master waits for all, over all waypoints.
    pub strict: Wait,
    /// Ours where it waits for those that it hears itself, likewise.
    pub neighbours: Wait,
    /// Likewise, with vehicles that come to rest as the ancestor's.
    pub settling: Wait,
}

impl Waits {
    pub(super) fn new(strict: &Report, neighbours: &Report, settling: &Report) -> Self {
        Self {
            thesis: Wait {
                mean_s: Some(0.43),
                least_s: Some(0.3),
                most_s: Some(0.8),
            },
            strict: Wait::of(strict),
            neighbours: Wait::of(neighbours),
            settling: Wait::of(settling),
        }
    }
}

/// A wait, in simulated seconds; nothing where nobody waited.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Wait {
    /// The mean over the drones.
    pub mean_s: Option<f64>,
    /// That of the drone that waits least.
    pub least_s: Option<f64>,
    /// That of the drone that waits most.
    pub most_s: Option<f64>,
}

impl Wait {
    fn of(report: &Report) -> Self {
        let waits = || {
            let drones = report.drones.iter();
            drones.filter_map(|drone| drone.waypoint_delay_s)
        };
        Self {
            mean_s: report.mean_waypoint_delay_s(),
            least_s: waits().reduce(f64::min),
            most_s: waits().reduce(f64::max),
        }
    }
}

/// How long five drones in line that all hear each other wait at a waypoint, from their own arrival to their own
/// departure. The vehicles' settling is calibrated on it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SingleHop {
    /// As measured on the thesis's ancestor.
    pub ancestor: Delays,
    /// Ours.
    pub ours: Delays,
}

impl SingleHop {
    pub(super) fn new(report: &Report) -> Self {
        let longest = report.drones.iter().map(|drone| drone.waypoint_delay_max_s);
        Self {
            ancestor: Delays {
                mean_s: Some(0.504),
                longest_s: Some(1.101),
            },
            ours: Delays {
                mean_s: report.mean_waypoint_delay_s(),
                longest_s: longest.flatten().reduce(f64::max),
            },
        }
    }
}

/// The waits of all drones at all waypoints, in simulated seconds; nothing where nobody waited.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Delays {
    /// Their mean.
    pub mean_s: Option<f64>,
    /// The longest.
    pub longest_s: Option<f64>,
}
