//! The reference of scenario files: their fields, the kinds of faults and the sets of parameters.

use super::{FaultKindName, ParametersName};
use crate::schema::{Field, Row, page, table};

const INTRODUCTION: &str = "A scenario file is a TOML file. A field that is marked as required must be there; others may \
                            be left out. `--set table.field=value` replaces a field for one run.";

/// A page in Markdown.
pub(in crate::plan) fn reference(fields: &[Field]) -> String {
    let mut text = page("Scenario file", INTRODUCTION, fields);
    text.push_str(&fault_kinds(fields));
    text.push_str(&parameter_sets());
    text
}

/// What each kind of fault does and takes.
fn fault_kinds(fields: &[Field]) -> String {
    let field = fields.iter().find(|field| field.path == "faults.kind");
    let meanings = field.map_or(&[][..], |field| &field.meanings);
    let named = |keys: &[&str]| {
        let keys: Vec<String> = keys.iter().map(|key| format!("`{key}`")).collect();
        keys.join(", ")
    };
    let rows = FaultKindName::ALL.map(|kind| -> Row<4> {
        let meaning = meanings.iter().find(|(name, _)| name == kind.name());
        [
            format!("`{}`", kind.name()),
            meaning.map_or_else(String::new, |(_, meaning)| meaning.clone()),
            named(kind.keys().required),
            named(kind.keys().optional),
        ]
    });
    let table = table(["kind", "what happens", "required", "optional"], &rows);
    format!(
        "\n## Kinds of faults\n\nA kind without `for_s` is momentary or lasts for good.\n\n{table}"
    )
}

fn parameter_sets() -> String {
    let rows = ParametersName::ALL.map(|(name, parameters)| -> Row<6> {
        let set = parameters.set();
        [
            format!("`{name}`"),
            set.period_ms.to_string(),
            set.keep_alive_ms.to_string(),
            set.time_to_live_ms.to_string(),
            set.heartbeat_ms.to_string(),
            set.repair_ms.to_string(),
        ]
    });
    let heads = [
        "`protocol.parameters`",
        "`period_ms`",
        "`keep_alive_ms`",
        "`time_to_live_ms`",
        "`heartbeat_ms`",
        "`repair_ms`",
    ];
    format!("\n## Sets of parameters\n\n{}", table(heads, &rows))
}
