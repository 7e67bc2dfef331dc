//! What is searched: a scenario's file, what may vary, and the plans that their seeds stand for.

use std::path::{Path, PathBuf};

use muster_runtime::diagnostic::{BadInput, read_text};
use rand::SeedableRng;
use rand::seq::IndexedRandom;
use rand_chacha::ChaCha8Rng;

use super::grammar;
use crate::campaign::Seeds;
use crate::report::figures::quoted;
use crate::scenario::{self, Chaos, Fault, Override, Scenario, written};

/// What an operator asks for.
#[derive(Debug, Clone)]
pub struct Request {
    /// The scenario file.
    pub scenario: PathBuf,
    /// Fields that are set in every plan.
    pub set: Vec<Override>,
    /// The seeds of the plans.
    pub seeds: Seeds,
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

/// The generator of plans; those of the worlds are drawn from the same seeds by other numbers.
const PLAN_STREAM: u64 = u64::MAX - 1;

impl Search {
    /// Reads the scenario, once with each value of what varies.
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
        let chaos = base.chaos.clone();
        for variation in &chaos.vary {
            let key = variation.key();
            if request.set.iter().any(|change| change.key() == key) {
                let help = "leave --set out, or the field of `chaos.vary`";
                return refuse(format!("{key} is both set and varied"), help);
            }
        }
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
        for (place, variation) in search.chaos.vary.iter().enumerate() {
            for value in 0..variation.values().len() {
                let mut values = vec![0; search.chaos.vary.len()];
                values[place] = value;
                take_in(search.varied(0, &values)?);
            }
        }
        search.content = content.finalize().to_hex().to_string();
        Ok(search)
    }

    /// Which plans.
    #[must_use]
    pub const fn seeds(&self) -> Seeds {
        self.request.seeds
    }

    /// The command that makes the search, to be typed into a POSIX shell.
    #[must_use]
    pub fn command(&self, seeds: Seeds) -> String {
        let path = quoted(&self.request.scenario.display().to_string());
        let mut command = format!("muster chaos {path} --seeds {seeds}");
        for change in &self.request.set {
            command.push_str(&format!(" --set {}", quoted(&change.to_string())));
        }
        command
    }

    /// The plan of a seed, and what is flown by it.
    ///
    /// # Errors
    /// When the values that were drawn don't fit each other.
    pub(super) fn draw(&self, seed: u64) -> Result<(Plan, Scenario), BadInput> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(PLAN_STREAM);
        let values = self.chaos.vary.iter().map(|variation| {
            let places: Vec<_> = (0..variation.values().len()).collect();
            *places.choose(&mut rng).expect("a variation has values")
        });
        let values: Vec<_> = values.collect();
        let mut scenario = self.varied(seed, &values)?;
        let faults = grammar::draw(&scenario, self.chaos.faults_max, &mut rng);
        scenario.faults.extend(faults.iter().cloned());
        let plan = Plan {
            seed,
            values,
            faults,
        };
        Ok((plan, scenario))
    }

    /// What is flown by a plan.
    pub(super) fn scenario(&self, plan: &Plan) -> Result<Scenario, BadInput> {
        let mut scenario = self.varied(plan.seed, &plan.values)?;
        scenario.faults.extend(plan.faults.iter().cloned());
        Ok(scenario)
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
        let path = &self.request.scenario;
        let set = self.set(seed, values);
        scenario::load_from(path, &set, &|file| {
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
