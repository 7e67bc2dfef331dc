//! Changes of a scenario for one run.

use clap::Args;
use muster_scenarios::scenario::Override;

#[derive(Debug, Args)]
pub(crate) struct Overrides {
    /// Random seed; overrides the scenario's.
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    seed: Option<String>,
    /// Set a field of the scenario, for example radio.range_m=250; may be repeated. A path starts at the current folder.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    fields: Vec<Override>,
}

impl Overrides {
    /// All of them, the seed last.
    pub(crate) fn all(&self) -> Vec<Override> {
        let seed = self.seed.as_deref().map(Override::seed);
        self.fields.iter().cloned().chain(seed).collect()
    }
}
