//! The list of runs of a campaign. It depends only on the arguments and the files.

use std::path::{Path, PathBuf};

use muster_runtime::diagnostic::BadInput;
use muster_scenarios::report::{Engine, program, quoted};
use muster_scenarios::scenario::{self, Override, Scenario, Variation};

use super::seeds::Seeds;
use super::shard::Shard;

/// Maximum number of runs of a campaign, over all shards.
pub const RUNS_MAX: u64 = 10_000_000;
/// Maximum number of combinations of varied values. The scenario of each is held in memory.
pub const COMBINATIONS_MAX: u64 = 10_000;

/// Arguments of a campaign.
#[derive(Debug, Clone)]
pub struct Request {
    /// Path of the scenario file.
    pub scenario: PathBuf,
    /// Simulation engine.
    pub engine: Engine,
    /// Fields set in every run.
    pub set: Vec<Override>,
    /// Varied fields; the first changes slowest.
    pub vary: Vec<Variation>,
    /// Seeds of each combination.
    pub seeds: Seeds,
    /// The shard to run.
    pub shard: Shard,
}

/// A list of runs, and this process's shard of it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Campaign {
    pub(super) program: String,
    /// Path of the scenario file; not part of the campaign's identity.
    pub(super) scenario: String,
    /// BLAKE3 of the parsed scenarios.
    pub(super) content: String,
    pub(super) engine: Engine,
    pub(super) set: Vec<Override>,
    pub(super) vary: Vec<Variation>,
    pub(super) seeds: Seeds,
    pub(super) shard: Shard,
}

/// Program and version, as written to campaign folders.
pub(crate) const PROGRAM: &str = concat!("muster ", env!("CARGO_PKG_VERSION"));

impl Campaign {
    /// Loads the scenario and its mission for each combination, in the order of the combinations.
    ///
    /// # Errors
    /// If the request is contradictory, exceeds the limits, or a file can't be used.
    pub fn load(request: &Request) -> Result<(Self, Vec<Scenario>), BadInput> {
        let refuse = |message: String, help: &str| {
            Err(BadInput::without_excerpt(&request.scenario, message, help))
        };
        if request.set.iter().any(Override::is_seed) {
            return refuse(
                "the seed is set by both --set and --seeds".to_owned(),
                "remove --set seed=…",
            );
        }
        for (place, variation) in request.vary.iter().enumerate() {
            let key = variation.key();
            if request.set.iter().any(|change| change.key() == key) {
                return refuse(
                    format!("{key} is both set and varied"),
                    "remove --set or --vary for this field",
                );
            }
            if request.vary[..place].iter().any(|other| other.key() == key) {
                return refuse(
                    format!("{key} is varied twice"),
                    "list all values in one option, as in --vary radio.loss=0,0.1,0.2",
                );
            }
        }
        let mut campaign = Self {
            program: PROGRAM.to_owned(),
            scenario: request.scenario.display().to_string(),
            content: String::new(),
            engine: request.engine,
            set: request.set.clone(),
            vary: request.vary.clone(),
            seeds: request.seeds,
            shard: request.shard,
        };
        if let Err(message) = campaign.check_size() {
            return refuse(message, "split the campaign, or remove values or seeds");
        }
        let scenarios = (0..campaign.combinations())
            .map(|combination| scenario::load(&request.scenario, &campaign.overrides(combination)))
            .collect::<Result<Vec<_>, _>>()?;
        campaign.content = content(&scenarios);
        Ok((campaign, scenarios))
    }

    /// Checks [`COMBINATIONS_MAX`] and [`RUNS_MAX`].
    pub(super) fn check_size(&self) -> Result<(), String> {
        let combinations = self
            .vary
            .iter()
            .try_fold(1_u64, |product, it| {
                product.checked_mul(it.values().len() as u64)
            })
            .filter(|combinations| *combinations <= COMBINATIONS_MAX);
        let Some(combinations) = combinations else {
            return Err(format!(
                "the varied values make more than {COMBINATIONS_MAX} combinations"
            ));
        };
        let runs = combinations.checked_mul(self.seeds.number());
        if runs.is_none_or(|runs| runs > RUNS_MAX) {
            return Err(format!(
                "{combinations} combinations with {} seeds each are more than {RUNS_MAX} runs",
                self.seeds.number()
            ));
        }
        Ok(())
    }

    /// Number of combinations of varied values; 1 without varied fields.
    #[must_use]
    pub fn combinations(&self) -> u64 {
        self.vary
            .iter()
            .map(|it| it.values().len() as u64)
            .product()
    }

    /// Number of runs over all shards.
    #[must_use]
    pub fn runs(&self) -> u64 {
        self.combinations() * self.seeds.number()
    }

    /// Number of runs of this shard.
    #[must_use]
    pub fn shard_runs(&self) -> u64 {
        self.shard.number(self.runs())
    }

    /// Combination and seed of a run.
    #[must_use]
    pub fn run(&self, run: u64) -> (u64, u64) {
        let seeds = self.seeds.number();
        (run / seeds, self.seeds.at(run % seeds))
    }

    /// Values of the varied fields in a combination, in the order of the variations.
    #[must_use]
    pub fn varied(&self, combination: u64) -> Vec<&Override> {
        let mut rest = combination;
        let mut values: Vec<_> = self
            .vary
            .iter()
            .rev()
            .map(|variation| {
                let number = variation.values().len() as u64;
                let place = usize::try_from(rest % number).expect("below the number of values");
                rest /= number;
                &variation.values()[place]
            })
            .collect();
        values.reverse();
        values
    }

    /// File name of the scenario without folder and extension.
    #[must_use]
    pub fn name(&self) -> &str {
        let stem = Path::new(&self.scenario).file_stem();
        stem.and_then(|stem| stem.to_str())
            .unwrap_or(&self.scenario)
    }

    /// This process's shard.
    #[must_use]
    pub const fn shard(&self) -> Shard {
        self.shard
    }

    /// Command that runs this shard of the campaign, quoted for a POSIX shell.
    #[must_use]
    pub fn command(&self) -> String {
        let mut command = format!(
            "{} campaign {} --seeds {} --engine {}",
            program(),
            quoted(&self.scenario),
            self.seeds,
            self.engine
        );
        let vary = self.vary.iter().map(|it| ("vary", it.to_string()));
        let set = self.set.iter().map(|it| ("set", it.to_string()));
        let shard = (self.shard != Shard::WHOLE).then(|| ("shard", self.shard.to_string()));
        for (name, value) in vary.chain(set).chain(shard) {
            command.push_str(&format!(" --{name} {}", quoted(&value)));
        }
        command
    }

    /// All overrides of a combination, without the seed.
    #[must_use]
    pub fn overrides(&self, combination: u64) -> Vec<Override> {
        let varied = self.varied(combination);
        self.set.iter().chain(varied).cloned().collect()
    }
}

/// BLAKE3 of the parsed scenarios without name and seed.
///
/// A changed comment gives the same campaign, a changed waypoint another one. The hashed text is that of `Debug`: it
/// includes all fields and exact floats, and one program version always writes the same.
fn content(scenarios: &[Scenario]) -> String {
    let mut hasher = blake3::Hasher::new();
    for scenario in scenarios {
        let mut scenario = scenario.clone();
        scenario.name.clear();
        scenario.seed = 0;
        hasher.update(format!("{scenario:?}\n").as_bytes());
    }
    hasher.finalize().to_hex().to_string()
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A campaign with two varied fields (three and two values) and five seeds.
    pub(in crate::campaign) fn campaign() -> Campaign {
        Campaign {
            program: PROGRAM.to_owned(),
            scenario: "scenarios/thesis-1.toml".to_owned(),
            content: "00".to_owned(),
            engine: Engine::Events,
            set: vec!["formation.drones=7".parse().unwrap()],
            vary: vec![
                "radio.loss=0,0.1,0.2".parse().unwrap(),
                "radio.range_m=250,300".parse().unwrap(),
            ],
            seeds: "10..15".parse().unwrap(),
            shard: Shard::WHOLE,
        }
    }

    fn request(vary: &[&str], set: &[&str], seeds: &str) -> Request {
        Request {
            scenario: concat!(env!("CARGO_MANIFEST_DIR"), "/../thesis-1.toml").into(),
            engine: Engine::Events,
            set: set.iter().map(|it| it.parse().unwrap()).collect(),
            vary: vary.iter().map(|it| it.parse().unwrap()).collect(),
            seeds: seeds.parse().unwrap(),
            shard: Shard::WHOLE,
        }
    }

    #[test]
    fn runs_are_ordered_by_combination_then_by_seed() {
        let campaign = campaign();
        assert_eq!(campaign.runs(), 30);
        let listed: Vec<_> = (0..campaign.runs()).map(|run| campaign.run(run)).collect();
        assert!(listed.is_sorted());
        assert_eq!(listed[0], (0, 10));
        assert_eq!(listed[29], (5, 14));
    }

    #[test]
    fn combinations_are_complete_and_the_first_field_changes_slowest() {
        let campaign = campaign();
        let combinations: Vec<_> = (0..campaign.combinations())
            .map(|it| {
                campaign
                    .overrides(it)
                    .iter()
                    .skip(1)
                    .map(ToString::to_string)
                    .collect::<Vec<_>>()
                    .join(" ")
            })
            .collect();
        assert_eq!(
            combinations,
            [
                "radio.loss=0 radio.range_m=250",
                "radio.loss=0 radio.range_m=300",
                "radio.loss=0.1 radio.range_m=250",
                "radio.loss=0.1 radio.range_m=300",
                "radio.loss=0.2 radio.range_m=250",
                "radio.loss=0.2 radio.range_m=300",
            ]
        );
    }

    #[test]
    fn each_combination_has_its_own_scenario() {
        let (campaign, scenarios) = Campaign::load(&request(
            &["radio.loss=0,0.5"],
            &["radio.range_m=200"],
            "1..3",
        ))
        .unwrap();
        assert_eq!(scenarios.len() as u64, campaign.combinations());
        let read: Vec<_> = scenarios
            .iter()
            .map(|it| (it.radio.loss, it.radio.propagation.range_m()))
            .collect();
        assert_eq!(read, [(0.0, 200.0), (0.5, 200.0)]);
    }

    #[test]
    fn contradictory_or_too_large_requests_are_refused() {
        let hundred: Vec<_> = (1..=101).map(|it| it.to_string()).collect();
        let many = |key: &str| format!("{key}={}", hundred.join(","));
        let (periods, discoveries) = (many("protocol.period_ms"), many("protocol.discovery_ms"));
        let cases: &[(&[&str], &[&str], &str, &str)] = &[
            (&[], &["seed=3"], "0..1", "the seed is set"),
            (
                &["radio.loss=0"],
                &["radio.loss=0.1"],
                "0..1",
                "both set and varied",
            ),
            (
                &["radio.loss=0", "radio.loss=1"],
                &[],
                "0..1",
                "varied twice",
            ),
            (&["radio.loss=0,2"], &[], "0..1", "2 is not a share"),
            (&[], &[], "0..10000001", "more than 10000000 runs"),
            (
                &["radio.loss=0,1"],
                &[],
                "0..9223372036854775807",
                "more than 10000000 runs",
            ),
            (
                &[&periods, &discoveries],
                &[],
                "0..1",
                "more than 10000 combinations",
            ),
        ];
        for (vary, set, seeds, words) in cases {
            let refusal = Campaign::load(&request(vary, set, seeds)).unwrap_err();
            assert!(refusal.to_string().contains(words), "{refusal}");
        }
    }

    #[test]
    fn campaign_identity_depends_on_file_content() {
        let content = |set: &[&str]| {
            Campaign::load(&request(&[], set, "0..1"))
                .unwrap()
                .0
                .content
        };
        assert_eq!(content(&[]), content(&[]));
        let river = "mission.file=../missions/river.waypoints";
        assert_ne!(content(&[]), content(&[river]));
    }
}
