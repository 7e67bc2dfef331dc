//! Changes of a scenario for one run.

use std::path::Path;

use clap::Args;
use muster_runtime::diagnostic::BadInput;
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
    /// All of them, the seed last. Refuses a field that is set twice.
    pub(crate) fn all(&self, scenario: &Path) -> Result<Vec<Override>, BadInput> {
        check_distinct(scenario, &self.fields)?;
        let field = self.fields.iter().find(|field| field.is_seed());
        if let (Some(field), Some(seed)) = (field, &self.seed) {
            let message = format!("the seed is given twice, by --seed {seed} and by --set {field}");
            let help = "leave out one of them";
            return Err(BadInput::without_excerpt(scenario, message, help));
        }
        let seed = self.seed.as_deref().map(Override::seed);
        Ok(self.fields.iter().cloned().chain(seed).collect())
    }
}

/// Refuses fields of a scenario of which one is set twice.
pub(crate) fn check_distinct(scenario: &Path, fields: &[Override]) -> Result<(), BadInput> {
    for (place, field) in fields.iter().enumerate() {
        let earlier = fields[..place].iter().find(|it| it.key() == field.key());
        if let Some(earlier) = earlier {
            let key = field.key();
            let message =
                format!("`{key}` is given twice, by --set {earlier} and by --set {field}");
            let help = "give each field once";
            return Err(BadInput::without_excerpt(scenario, message, help));
        }
    }
    Ok(())
}
