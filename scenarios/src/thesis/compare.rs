//! What our runs come to, beside what the thesis says.

use serde::Serialize;

use super::Published;
use crate::report::figures::mean;
use crate::report::{Engine, Report, Role};
use crate::scenario::Scenario;
use muster_runtime::text::plural;

/// The five experiments, the waits of the second and of a single hop, the figures of others and ours: what `--json`
/// prints and `thesis.json` holds, apart from the reports of further runs. All times are simulated seconds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// The seed of every run whose report is here, and the first of those of the waits.
    pub seed: u64,
    /// What ran the drones in those runs.
    pub engine: Engine,
    /// The experiments, in their order.
    pub experiments: Vec<Experiment>,
    /// The runs that our waits are the means of.
    pub waits_runs: WaitsRuns,
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
    /// The runs with further seeds, for the waits.
    #[serde(skip)]
    pub further: Vec<Report>,
}

impl Comparison {
    /// Every run of ours.
    pub fn reports(&self) -> impl Iterator<Item = &Report> {
        self.of_first_seed().chain(&self.further)
    }

    /// Those with the first seed, whose reports are shown.
    pub(super) fn of_first_seed(&self) -> impl Iterator<Item = &Report> {
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
        let slots = scenario.plan.layout.formation().slots();
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

/// Which runs our waits are the means of.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct WaitsRuns {
    /// Their seeds; the first is that of the experiments.
    pub seeds: Vec<u64>,
    /// What ran the drones in all but the first, which is flown like the experiments. The flights are the same on both
    /// engines.
    pub engine_after_first: Engine,
}

impl WaitsRuns {
    /// Their number, in words.
    pub(super) fn number(&self) -> String {
        plural(self.seeds.len(), "run")
    }

    /// Which ones, and what flew them, in words.
    pub(super) fn about(&self) -> String {
        match self.seeds[..] {
            [first, .., last] => format!(
                "{}, seeds {first} to {last}, after the first on engine {}",
                self.number(),
                self.engine_after_first
            ),
            _ => self.number(),
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

/// A wait, in simulated seconds; nothing where nobody waited.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Wait {
    /// The mean over the drones and the runs.
    pub mean_s: Option<f64>,
    /// The mean over the drones of the run in which it is lowest; nothing where there is one run only, as in the thesis.
    pub lowest_run_s: Option<f64>,
    /// Likewise, highest.
    pub highest_run_s: Option<f64>,
    /// That of the drone that waits least, in the mean of the runs.
    pub least_s: Option<f64>,
    /// That of the drone that waits most, likewise.
    pub most_s: Option<f64>,
}

impl Wait {
    pub(super) const THESIS: Self = Self {
        mean_s: Some(0.43),
        lowest_run_s: None,
        highest_run_s: None,
        least_s: Some(0.3),
        most_s: Some(0.8),
    };

    pub(super) fn of(first: &Report, further: &[Report]) -> Self {
        let delays = |report: &Report| -> Vec<f64> {
            let drones = report.drones.iter();
            drones.filter_map(|it| it.waypoint_delay_s).collect()
        };
        let means = OverRuns::of(first, further, Report::mean_waypoint_delay_s);
        let least = |report: &Report| delays(report).into_iter().reduce(f64::min);
        let most = |report: &Report| delays(report).into_iter().reduce(f64::max);
        Self {
            mean_s: means.mean,
            lowest_run_s: means.lowest,
            highest_run_s: means.highest,
            least_s: OverRuns::of(first, further, least).mean,
            most_s: OverRuns::of(first, further, most).mean,
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

/// The waits of all drones at all waypoints, in simulated seconds; nothing where nobody waited.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Delays {
    /// Their mean over the runs.
    pub mean_s: Option<f64>,
    /// Their mean in the run in which it is lowest; nothing of the ancestor, and where there is one run only.
    pub lowest_run_s: Option<f64>,
    /// Likewise, highest.
    pub highest_run_s: Option<f64>,
    /// The longest of a run, in the mean of the runs.
    pub longest_s: Option<f64>,
}

impl Delays {
    pub(super) const ANCESTOR: Self = Self {
        mean_s: Some(0.504),
        lowest_run_s: None,
        highest_run_s: None,
        longest_s: Some(1.101),
    };

    pub(super) fn of(first: &Report, further: &[Report]) -> Self {
        let longest = |report: &Report| {
            let longest = report.drones.iter().map(|it| it.waypoint_delay_max_s);
            longest.flatten().reduce(f64::max)
        };
        let means = OverRuns::of(first, further, Report::mean_waypoint_delay_s);
        Self {
            mean_s: means.mean,
            lowest_run_s: means.lowest,
            highest_run_s: means.highest,
            longest_s: OverRuns::of(first, further, longest).mean,
        }
    }
}

/// What some figure comes to over runs; nothing where no run has it.
struct OverRuns {
    mean: Option<f64>,
    /// Nothing of one run.
    lowest: Option<f64>,
    highest: Option<f64>,
}

impl OverRuns {
    fn of(first: &Report, further: &[Report], figure: impl Fn(&Report) -> Option<f64>) -> Self {
        let runs = || [first].into_iter().chain(further).filter_map(&figure);
        let many = !further.is_empty();
        Self {
            mean: mean(runs()),
            lowest: runs().reduce(f64::min).filter(|_| many),
            highest: runs().reduce(f64::max).filter(|_| many),
        }
    }
}
