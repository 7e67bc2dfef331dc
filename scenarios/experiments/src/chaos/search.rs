//! The plans of a search: a scenario file, its varied fields, and one plan per seed.

use std::path::PathBuf;

use muster_runtime::diagnostic::BadInput;
use muster_runtime::plan::file::Source;
use muster_scenarios::report::{program, quoted};
use muster_scenarios::scenario::{self, Chaos, Fault, Override, Scenario, Variation, written};
use rand::SeedableRng;
use rand::seq::IndexedRandom;
use rand_chacha::ChaCha8Rng;

use super::grammar;
use crate::campaign::{PROGRAM, Seeds};

/// Arguments of a search.
#[derive(Debug, Clone)]
pub struct Request {
    /// Path of the scenario file.
    pub scenario: PathBuf,
    /// Fields set in every plan.
    pub set: Vec<Override>,
    /// Seeds of the plans.
    pub seeds: Seeds,
    /// Whether to continue after plans that break a rule, and list them.
    pub keeps_going: bool,
}

/// A loaded search.
#[derive(Debug, Clone)]
pub struct Search {
    pub(super) request: Request,
    /// The scenario file.
    path: PathBuf,
    /// Text of the scenario file.
    text: String,
    chaos: Chaos,
    /// Number of the scenario's own faults; every plan has them.
    own_faults: usize,
    /// The most redraws per plan.
    redraws_max: u64,
    /// BLAKE3 of the parsed scenarios.
    pub(super) content: String,
}

/// What is drawn for one seed: the values of the varied fields and the faults.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Plan {
    pub(super) seed: u64,
    /// Index of each varied field's value.
    pub(super) values: Vec<usize>,
    pub(super) faults: Vec<Fault>,
}

/// A plan with its scenario.
#[derive(Debug)]
pub(super) struct DrawnPlan {
    pub(super) plan: Plan,
    /// The scenario to run.
    pub(super) scenario: Scenario,
    /// Number of redraws because its values were incompatible.
    pub(super) redrawn: u64,
}

/// Maximum number of redraws per plan. If one combination in 100 is compatible, this fails for one plan in 20,000.
const REDRAWS_MAX: u64 = 1_000;

/// Random stream of plans; the simulation uses other streams of the same seed.
const PLAN_STREAM: u64 = u64::MAX - 1;

impl Search {
    /// Loads the scenario with the requested overrides, and checks it with each value of each varied field. A field that
    /// is set does not vary.
    ///
    /// # Errors
    /// If the request is contradictory or a file can't be used.
    pub fn load(request: &Request) -> Result<Self, BadInput> {
        let path = &request.scenario;
        let refuse =
            |message: String, help: &str| Err(BadInput::without_excerpt(path, message, help));
        if request.set.iter().any(Override::is_seed) {
            let help = "remove --set seed=…";
            return refuse("the seed is set by both --set and --seeds".to_owned(), help);
        }
        let base = scenario::load(path, &request.set)?;
        if !base.others.is_empty() {
            let help = "remove `swarms`";
            let message = "has several swarms; a search needs a scenario with one".to_owned();
            return refuse(message, help);
        }
        let mut chaos = base.chaos.clone();
        let is_set = |key: &str| request.set.iter().any(|change| change.key() == key);
        chaos.vary.retain(|variation| !is_set(variation.key()));
        let mut content = blake3::Hasher::new();
        let mut add_to_hash = |mut scenario: Scenario| {
            scenario.name.clear();
            content.update(format!("{scenario:?}").as_bytes());
        };
        add_to_hash(base.clone());
        let file = scenario::scenario_file(path)?.into_owned();
        let mut search = Self {
            request: request.clone(),
            text: scenario::read(&file)?,
            path: file,
            own_faults: base.faults.len(),
            redraws_max: REDRAWS_MAX,
            chaos,
            content: String::new(),
        };
        for value in base.chaos.vary.iter().flat_map(Variation::values) {
            add_to_hash(search.with(std::slice::from_ref(value))?);
        }
        search.content = content.finalize().to_hex().to_string();
        Ok(search)
    }

    /// The program with its version, and the hash of the parsed scenario, as [`CHAOS_JSON`](super::CHAOS_JSON) has them.
    #[must_use]
    pub fn identity(&self) -> (&'static str, &str) {
        (PROGRAM, &self.content)
    }

    /// Seeds of the plans.
    #[must_use]
    pub const fn seeds(&self) -> Seeds {
        self.request.seeds
    }

    /// Whether to continue after plans that break a rule.
    pub(super) const fn keeps_going(&self) -> bool {
        self.request.keeps_going
    }

    /// Command that runs the search with these seeds, quoted for a POSIX shell.
    #[must_use]
    pub fn command(&self, seeds: Seeds) -> String {
        let path = quoted(&self.request.scenario.display().to_string());
        let mut command = format!("{} chaos {path} --seeds {seeds}", program());
        for change in &self.request.set {
            command.push_str(&format!(" --set {}", quoted(&change.to_string())));
        }
        command
    }

    /// Draws the plan of a seed. Incompatible values are all redrawn.
    ///
    /// # Errors
    /// If the values are still incompatible after [`REDRAWS_MAX`] redraws.
    pub(super) fn draw(&self, seed: u64) -> Result<DrawnPlan, BadInput> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(PLAN_STREAM);
        let mut redrawn = 0;
        let (values, mut scenario) = loop {
            let values = self.chaos.vary.iter().map(|variation| {
                let places: Vec<_> = (0..variation.values().len()).collect();
                *places.choose(&mut rng).expect("a variation has values")
            });
            let values: Vec<_> = values.collect();
            match self.varied(seed, &values) {
                Ok(scenario) => break (values, scenario),
                Err(error) if redrawn == self.redraws_max => return Err(error),
                Err(_) => redrawn += 1,
            }
        };
        let faults = grammar::draw(&scenario, self.chaos.faults_max, &mut rng);
        scenario.faults.extend(faults.iter().cloned());
        let plan = Plan {
            seed,
            values,
            faults,
        };
        Ok(DrawnPlan {
            plan,
            scenario,
            redrawn,
        })
    }

    /// The scenario of a plan.
    pub(super) fn scenario(&self, plan: &Plan) -> Result<Scenario, BadInput> {
        let mut scenario = self.varied(plan.seed, &plan.values)?;
        scenario.faults.extend(plan.faults.iter().cloned());
        Ok(scenario)
    }

    /// Number of combinations of varied values, including incompatible ones.
    pub(super) fn combinations(&self) -> u64 {
        let values = self.chaos.vary.iter().map(|it| it.values().len() as u64);
        values.fold(1, u64::saturating_mul)
    }

    /// Number of the scenario's own faults.
    pub(super) const fn own_faults(&self) -> usize {
        self.own_faults
    }

    /// A plan as the text of a scenario file that refers to the mission file `mission`.
    pub(super) fn written(&self, plan: &Plan, mission: &str) -> Result<String, BadInput> {
        let set = self.set(plan.seed, &plan.values);
        written((&self.path, &self.text), &set, &plan.faults, mission)
    }

    /// Path of a plan's mission file.
    pub(super) fn mission(&self, plan: &Plan) -> Result<PathBuf, BadInput> {
        let set = self.set(plan.seed, &plan.values);
        let source = Source::overridden(&self.path, self.text.clone(), &set)?;
        let mission = scenario::mission_file(&source)?;
        Ok(scenario::mission_path(&mission)?.into_owned())
    }

    fn varied(&self, seed: u64, values: &[usize]) -> Result<Scenario, BadInput> {
        self.with(&self.set(seed, values))
    }

    /// The scenario with overrides.
    fn with(&self, set: &[Override]) -> Result<Scenario, BadInput> {
        scenario::load_from(&self.path, set, &|file| {
            if file == self.path {
                Ok(self.text.clone())
            } else {
                scenario::read(file)
            }
        })
    }

    fn set(&self, seed: u64, values: &[usize]) -> Vec<Override> {
        let varied = self.chaos.vary.iter().zip(values);
        let varied = varied.map(|(variation, value)| variation.values()[*value].clone());
        let seed = Override::seed(&seed.to_string());
        self.request
            .set
            .iter()
            .cloned()
            .chain(varied)
            .chain([seed])
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::path::Path;

    use muster_scenarios::scenario::{Trigger, When};

    use super::*;

    fn search(set: &[&str]) -> Search {
        let scenario = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/..")).join("chaos.toml");
        Search::load(&Request {
            scenario,
            set: set.iter().map(|it| it.parse().unwrap()).collect(),
            seeds: "0..1".parse().unwrap(),
            keeps_going: false,
        })
        .unwrap()
    }

    #[test]
    fn incompatible_values_are_redrawn_from_the_same_seed() {
        let (search, same) = (search(&[]), search(&[]));
        let mut drawn = BTreeSet::new();
        let mut redrawn = 0;
        for seed in 0..50 {
            let plan = search.draw(seed).unwrap();
            redrawn += plan.redrawn;
            if seed < 10 {
                assert_eq!(plan.plan, same.draw(seed).unwrap().plan, "seed {seed}");
            }
            drawn.extend(plan.plan.values.iter().copied().enumerate());
        }
        // Relays exclude `flood`, and formation changes exclude `follow`: 5 of 12 combinations are compatible.
        assert!((50..125).contains(&redrawn), "{redrawn}");
        let values = search.chaos.vary.iter().map(|it| it.values().len());
        assert_eq!(
            drawn.len(),
            values.sum::<usize>(),
            "some value is never drawn"
        );
    }

    #[test]
    fn set_field_is_not_varied() {
        let set = ["protocol.kind=follow", "relays=[]"];
        let (search, all) = (search(&set), search(&[]));
        assert_eq!(search.combinations() * 2 * 3, all.combinations());
        for seed in 0..20 {
            assert!(search.draw(seed).unwrap().scenario.plan.follow.is_some());
        }
    }

    #[test]
    fn search_without_compatible_values_is_refused_with_the_reason() {
        // The limit is set after loading, so that loading succeeds.
        let mut search = search(&["protocol.policy=tree", "protocol.kind=muscop"]);
        search.request.set = vec!["limits.altitude_max_m=1".parse().unwrap()];
        search.redraws_max = 20;
        let error = search.draw(1).unwrap_err().to_string();
        assert!(error.contains("limit of 1 m"), "{error}");
    }

    #[test]
    fn faults_of_a_swarm_that_follows_wait_for_no_waypoint_but_the_first() {
        let search = search(&["protocol.kind=follow", "relays=[]"]);
        let mut drawn = 0;
        for seed in 0..100 {
            for fault in search.draw(seed).unwrap().plan.faults {
                if let When::After(Trigger::Waypoint(waypoint), _) = fault.when {
                    assert_eq!(waypoint, 0, "seed {seed}");
                    drawn += 1;
                }
            }
        }
        assert!(drawn > 0);
    }
}
