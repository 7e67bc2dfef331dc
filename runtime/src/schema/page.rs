//! The fields of a kind of file as a page in Markdown.

use std::fmt::Write as _;

use super::fields::{Field, Shape};

/// More names than these are not described in a row.
const MEANINGS_MAX: usize = 8;

/// A row of a table.
pub type Row<const COLUMNS: usize> = [String; COLUMNS];

/// A page with a section for each table of the file, in the order of their declaration.
#[must_use]
pub fn page(title: &str, introduction: &str, fields: &[Field]) -> String {
    let mut text = format!("# {title}\n\n{introduction}\n");
    text.push_str(&section(fields, ""));
    for inner in fields.iter().filter(|field| field.shape != Shape::Value) {
        let heading = match inner.shape {
            Shape::Tables => format!("[[{}]]", inner.path),
            Shape::Table | Shape::Value => format!("[{}]", inner.path),
        };
        let _ = write!(text, "\n## `{heading}`\n\n{}\n", inner.description);
        text.push_str(&section(fields, &inner.path));
    }
    text
}

/// The values of one table, without the tables within it.
fn section(fields: &[Field], path: &str) -> String {
    let own = fields.iter().filter(|field| {
        let of = field.path.rsplit_once('.').map_or("", |(table, _)| table);
        of == path && field.shape == Shape::Value
    });
    let rows: Vec<Row<4>> = own
        .map(|field| {
            let default = match (&field.default, field.is_required) {
                (_, true) => "required".to_owned(),
                (Some(default), false) => default.clone(),
                (None, false) => String::new(),
            };
            [
                format!("`{}`", field.path),
                description(field),
                field.accepted.clone(),
                default,
            ]
        })
        .collect();
    if rows.is_empty() {
        return String::new();
    }
    let heads = ["field", "description", "accepted", "default"];
    format!("\n{}", table(heads, &rows))
}

/// What a field is; of names also what each means, unless they have a table of their own.
fn description(field: &Field) -> String {
    let mut text = field.description.clone();
    if field.meanings.len() <= MEANINGS_MAX {
        for (name, meaning) in &field.meanings {
            let _ = write!(text, " `{name}`: {meaning}");
        }
    }
    text
}

/// A table in Markdown.
#[must_use]
pub fn table<const COLUMNS: usize>(heads: [&str; COLUMNS], rows: &[Row<COLUMNS>]) -> String {
    let line = |cells: &[String]| {
        let cells: Vec<String> = cells.iter().map(|it| it.replace('|', "\\|")).collect();
        format!("| {} |\n", cells.join(" | "))
    };
    let mut text = line(&heads.map(str::to_owned));
    text.push_str(&format!("|{}\n", " --- |".repeat(COLUMNS)));
    text.extend(rows.iter().map(|row| line(row)));
    text
}
