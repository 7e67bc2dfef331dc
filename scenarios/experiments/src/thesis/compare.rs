//! Comparison of our runs with the thesis.

use muster_runtime::text::plural;
use muster_scenarios::report::{Engine, Report, Role, mean};
use muster_scenarios::scenario::Scenario;
use serde::Serialize;

use super::Published;

/// The five experiments, the waits of the second experiment and the single-hop waits: published figures and ours.
///
/// Printed by `--json` and written to `thesis.json`, without the further runs. Times are simulated seconds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// Seed of the included reports, and first seed of the waits.
    pub seed: u64,
    /// Engine of these runs.
    pub engine: Engine,
    /// The experiments, in order.
    pub experiments: Vec<Experiment>,
    /// The runs over which our waits are averaged.
    pub waits_runs: WaitsRuns,
    /// Waits at waypoints in the second experiment.
    pub waits: Waits,
    /// Waits at waypoints if all drones are in the master's range.
    pub single_hop: SingleHop,
    /// Our run of the second experiment in which the master waits for its neighbours only.
    pub neighbours: Report,
    /// The same with the ancestor's settling time.
    pub settling: Report,
    /// Our run of the ancestor's swarm.
    pub ancestor: Report,
    /// Runs with further seeds, for the waits.
    #[serde(skip)]
    pub further: Vec<Report>,
}

impl Comparison {
    /// All our runs.
    pub fn reports(&self) -> impl Iterator<Item = &Report> {
        self.of_first_seed().chain(&self.further)
    }

    /// The runs with the first seed, which are shown.
    pub(super) fn of_first_seed(&self) -> impl Iterator<Item = &Report> {
        let strict = self.experiments.iter().map(|it| &it.report);
        strict.chain([&self.neighbours, &self.settling, &self.ancestor])
    }
}

/// One experiment of the thesis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Experiment {
    /// Description of the swarm.
    pub swarm: String,
    /// Number of the table in the thesis.
    pub table: u8,
    /// Published figures and ours.
    pub quantities: [Quantity; 4],
    /// Flight time of each drone by the law of the thesis's tables; see [`Published::member_s`].
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
                published.member_s(slot.0.norm())
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

/// A quantity measured in the thesis and in our run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Quantity {
    /// Name of the quantity.
    pub name: &'static str,
    /// Value in the thesis.
    pub thesis: f64,
    /// Our value; `None` if no drone landed.
    pub ours: Option<f64>,
    /// Difference of our value, in per cent of the thesis's.
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

/// The runs over which our waits are averaged.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct WaitsRuns {
    /// Seeds; the first is that of the experiments.
    pub seeds: Vec<u64>,
    /// Engine of all runs but the first, which uses the engine of the experiments. Both engines give the same flights.
    pub engine_after_first: Engine,
}

impl WaitsRuns {
    /// Number of runs, in words.
    pub(super) fn number(&self) -> String {
        plural(self.seeds.len(), "run")
    }

    /// Number, seeds and engine, in words.
    pub(super) fn about(&self) -> String {
        match self.seeds[..] {
            [first, .., last] => format!(
                "{}, seeds {first} to {last}, all but the first on engine {}",
                self.number(),
                self.engine_after_first
            ),
            _ => self.number(),
        }
    }
}

/// Waits at a waypoint, from a drone's arrival to its departure.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Waits {
    /// The thesis, at one waypoint (figure 36).
    pub thesis: Wait,
    /// Ours if the master waits for all drones, over all waypoints.
    pub strict: Wait,
    /// Ours if the master waits for its neighbours only.
    pub neighbours: Wait,
    /// The same with the ancestor's settling time.
    pub settling: Wait,
}

/// Statistics of a wait, in simulated seconds; `None` if no drone waited.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Wait {
    /// Mean over drones and runs.
    pub mean_s: Option<f64>,
    /// Lowest mean of a run; `None` for a single run, as in the thesis.
    pub lowest_run_s: Option<f64>,
    /// Highest mean of a run; `None` for a single run.
    pub highest_run_s: Option<f64>,
    /// Shortest mean wait of a drone, averaged over the runs.
    pub least_s: Option<f64>,
    /// Longest mean wait of a drone, averaged over the runs.
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

/// Waits at a waypoint of five drones in line, all within range of each other.
///
/// The vehicles' settling time is calibrated on the ancestor's wait.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SingleHop {
    /// Measured on the thesis's ancestor.
    pub ancestor: Delays,
    /// Ours.
    pub ours: Delays,
}

/// Statistics of the waits of all drones at all waypoints, in simulated seconds; `None` if no drone waited.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Delays {
    /// Mean over the runs.
    pub mean_s: Option<f64>,
    /// Lowest mean of a run; `None` for the ancestor and for a single run.
    pub lowest_run_s: Option<f64>,
    /// Highest mean of a run; `None` for the ancestor and for a single run.
    pub highest_run_s: Option<f64>,
    /// Longest wait of a run, averaged over the runs.
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

/// Mean and range of a figure over runs; `None` if no run has it.
struct OverRuns {
    mean: Option<f64>,
    /// `None` for a single run, like `highest`.
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
