//! What is searched: a scenario's file, what may vary, and the plans that their seeds stand for.

use std::path::{Path, PathBuf};

use muster_runtime::diagnostic::{BadInput, read_text};
use rand::SeedableRng;
use rand::seq::IndexedRandom;
use rand_chacha::ChaCha8Rng;

use super::grammar;
use crate::campaign::Seeds;
use crate::report::figures::quoted;
use crate::scenario::{self, Chaos, Fault, Override, Scenario, Variation, written};

/// What an operator asks for.
#[derive(Debug, Clone)]
pub struct Request {
    /// The scenario file.
    pub scenario: PathBuf,
    /// Fields that are set in every plan.
    pub set: Vec<Override>,
    /// The seeds of the plans.
    pub seeds: Seeds,
    /// Whether the search goes on past plans that break a rule, and lists them.
    pub keeps_going: bool,
}

/// A search that can be made.
#[derive(Debug, Clone)]
pub struct Search {
    pub(super) request: Request,
    /// What the scenario's file says.
    text: String,
    chaos: Chaos,
    /// How many faults the scenario has of its own; they are in every plan.
    own_faults: usize,
    /// BLAKE3 of what the files say.
    pub(super) content: String,
}

/// What befalls a swarm, and which swarm: all that is drawn for one seed.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Plan {
    pub(super) seed: u64,
    /// The place of each varied field's value among its values.
    pub(super) values: Vec<usize>,
    pub(super) faults: Vec<Fault>,
}

/// What is drawn for a seed.
#[derive(Debug)]
pub(super) struct Drawn {
    pub(super) plan: Plan,
    /// What is flown by it.
    pub(super) scenario: Scenario,
    /// How many times its values were drawn anew, as they did not fit each other.
    pub(super) redrawn: u64,
}

/// How often values are drawn anew for a plan: enough where one combination of a hundred fits, but for one plan in 20,000.
const REDRAWS_MAX: u64 = 1_000;

/// The generator of plans; those of the worlds are drawn from the same seeds by other numbers.
const PLAN_STREAM: u64 = u64::MAX - 1;

impl Search {
    /// Reads the scenario as it is asked for, and as its file has it with each value of what varies. A field that is set
    /// does not vary.
    ///
    /// # Errors
    /// When the request contradicts itself or a file can't be used.
    pub fn load(request: &Request) -> Result<Self, BadInput> {
        let path = &request.scenario;
        let refuse =
            |message: String, help: &str| Err(BadInput::without_excerpt(path, message, help));
        if request.set.iter().any(Override::is_seed) {
            let help = "leave --set seed=… out";
            return refuse("the seed is set, and --seeds gives it".to_owned(), help);
        }
        let base = scenario::load(path, &request.set)?;
        if !base.others.is_empty() {
            let help = "leave `swarms` out";
            return refuse(
                "has other swarms, and a search is about one".to_owned(),
                help,
            );
        }
        let mut chaos = base.chaos.clone();
        let is_set = |key: &str| request.set.iter().any(|change| change.key() == key);
        chaos.vary.retain(|variation| !is_set(variation.key()));
        let mut content = blake3::Hasher::new();
        let mut take_in = |scenario: Scenario| {
            let name = String::new();
            content.update(format!("{:?}", Scenario { name, ..scenario }).as_bytes());
        };
        take_in(base.clone());
        let mut search = Self {
            request: request.clone(),
            text: read_text(path)?,
            own_faults: base.faults.len(),
            chaos,
            content: String::new(),
        };
        for value in base.chaos.vary.iter().flat_map(Variation::values) {
            take_in(search.with(std::slice::from_ref(value))?);
        }
        search.content = content.finalize().to_hex().to_string();
        Ok(search)
    }

    /// Which plans.
    #[must_use]
    pub const fn seeds(&self) -> Seeds {
        self.request.seeds
    }

    /// Whether it goes on past plans that break a rule.
    pub(super) const fn keeps_going(&self) -> bool {
        self.request.keeps_going
    }

    /// The command that makes the search, up to the first plan that breaks a rule, to be typed into a POSIX shell.
    #[must_use]
    pub fn command(&self, seeds: Seeds) -> String {
        let path = quoted(&self.request.scenario.display().to_string());
        let mut command = format!("muster chaos {path} --seeds {seeds}");
        for change in &self.request.set {
            command.push_str(&format!(" --set {}", quoted(&change.to_string())));
        }
        command
    }

    /// The plan of a seed, and what is flown by it. Values that don't fit each other are drawn anew, all of them.
    ///
    /// # Errors
    /// When values did not fit each other so often that none may.
    pub(super) fn draw(&self, seed: u64) -> Result<Drawn, BadInput> {
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
                Err(error) if redrawn == REDRAWS_MAX => return Err(error),
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
        Ok(Drawn {
            plan,
            scenario,
            redrawn,
        })
    }

    /// What is flown by a plan.
    pub(super) fn scenario(&self, plan: &Plan) -> Result<Scenario, BadInput> {
        let mut scenario = self.varied(plan.seed, &plan.values)?;
        scenario.faults.extend(plan.faults.iter().cloned());
        Ok(scenario)
    }

    /// How many combinations the values of what varies have, those included that don't fit each other.
    pub(super) fn combinations(&self) -> u64 {
        let values = self.chaos.vary.iter().map(|it| it.values().len() as u64);
        values.fold(1, u64::saturating_mul)
    }

    /// The faults that every plan has besides what was drawn for it.
    pub(super) const fn own_faults(&self) -> usize {
        self.own_faults
    }

    /// A plan as a scenario file, whose mission's file has that name.
    pub(super) fn written(&self, plan: &Plan, mission: &str) -> Result<String, BadInput> {
        let set = self.set(plan.seed, &plan.values);
        written(
            (&self.request.scenario, &self.text),
            &set,
            &plan.faults,
            mission,
        )
    }

    /// Where the mission of a plan is.
    pub(super) fn mission(&self, plan: &Plan) -> Result<PathBuf, BadInput> {
        let folder = self.request.scenario.parent().unwrap_or(Path::new(""));
        let set = self.set(plan.seed, &plan.values);
        Ok(folder.join(scenario::mission_file(
            (&self.request.scenario, &self.text),
            &set,
        )?))
    }

    fn varied(&self, seed: u64, values: &[usize]) -> Result<Scenario, BadInput> {
        self.with(&self.set(seed, values))
    }

    /// The scenario with fields set.
    fn with(&self, set: &[Override]) -> Result<Scenario, BadInput> {
        let path = &self.request.scenario;
        scenario::load_from(path, set, &|file| {
            if file == path {
                Ok(self.text.clone())
            } else {
                read_text(file)
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

    use super::*;

    fn search(set: &[&str]) -> Search {
        let scenario = Path::new(env!("CARGO_MANIFEST_DIR")).join("chaos.toml");
        Search::load(&Request {
            scenario,
            set: set.iter().map(|it| it.parse().unwrap()).collect(),
            seeds: "0..1".parse().unwrap(),
            keeps_going: false,
        })
        .unwrap()
    }

    #[test]
    fn values_that_do_not_fit_each_other_are_drawn_anew_from_the_same_seed() {
        let (search, again) = (search(&[]), search(&[]));
        let mut drawn = BTreeSet::new();
        let mut redrawn = 0;
        for seed in 0..300 {
            let plan = search.draw(seed).unwrap();
            redrawn += plan.redrawn;
            assert_eq!(plan.plan, again.draw(seed).unwrap().plan, "seed {seed}");
            drawn.extend(plan.plan.values.iter().copied().enumerate());
        }
        // Of relays with `flood` and of changes on the way with `follow`, five combinations of twelve fit.
        assert!((300..600).contains(&redrawn), "{redrawn}");
        let values = search.chaos.vary.iter().map(|it| it.values().len());
        assert_eq!(
            drawn.len(),
            values.sum::<usize>(),
            "some value is never drawn"
        );
    }

    #[test]
    fn a_field_that_is_set_is_not_varied() {
        let set = ["protocol.kind=follow", "relays=[]"];
        let (search, all) = (search(&set), search(&[]));
        assert_eq!(search.combinations() * 2 * 3, all.combinations());
        for seed in 0..20 {
            assert!(search.draw(seed).unwrap().scenario.plan.follow.is_some());
        }
    }

    #[test]
    fn values_of_which_none_fit_are_refused_with_the_reason() {
        // All that is varied fits the simplest swarm, and no swarm fits the limit.
        let mut search = search(&["protocol.policy=tree", "protocol.kind=muscop"]);
        search.request.set = vec!["limits.altitude_max_m=1".parse().unwrap()];
        let error = search.draw(1).unwrap_err().to_string();
        assert!(error.contains("limit of 1 m"), "{error}");
    }
}
