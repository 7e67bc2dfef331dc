//! What would be accepted at a place of a TOML file, told from a list of its fields.

use std::ops::Range;

use toml_edit::{Item, TableLike, Value};

/// Every field of a kind of file, tables included, as in `radio.range_m`, with what it accepts in words.
pub type Fields = [(&'static str, &'static str)];

/// What would be accepted at `span` of a TOML file, where a reader found `message` wrong; nothing when the file is no TOML.
#[must_use]
pub fn accepted(fields: &Fields, text: &str, span: &Range<usize>, message: &str) -> Option<String> {
    let missing = message
        .strip_prefix("missing field `")
        .and_then(|rest| rest.strip_suffix('`'));
    let document = toml_edit::Document::parse(text).ok()?;
    let mut path = Vec::new();
    path_to(document.as_table(), span, &mut path);
    path.extend(missing.map(str::to_owned));
    let key = path.join(".");
    // Of what is within a field that is no table of fields the field itself tells.
    let mut within = (1..=path.len()).rev().map(|depth| path[..depth].join("."));
    let known = within.find_map(|within| {
        let field = fields.iter().find(|(known, _)| *known == within);
        field.filter(|_| within == key || fields_of(fields, &within).is_empty())
    });
    Some(match known {
        Some((known, accepted)) => format!("`{known}` is {accepted}"),
        None => {
            let tables = (0..=path.len()).rev().map(|depth| path[..depth].join("."));
            let mut listed = tables.map(|table| fields_of(fields, &table));
            let listed = listed.find(|listed| !listed.is_empty()).unwrap_or_default();
            format!("the fields are {}", listed.join(", "))
        }
    })
}

/// The fields of a table, or of the whole file, by their own names.
fn fields_of(fields: &Fields, table: &str) -> Vec<&'static str> {
    let own_name = |field: &'static str| match table {
        "" => Some(field),
        _ => field.strip_prefix(table)?.strip_prefix('.'),
    };
    let names = fields.iter().filter_map(|(field, _)| own_name(field));
    names.filter(|field| !field.contains('.')).collect()
}

/// The keys that lead to the innermost value around `span`; whether there is one.
fn path_to(table: &dyn TableLike, span: &Range<usize>, path: &mut Vec<String>) -> bool {
    let around = |outer: Option<Range<usize>>| {
        outer.is_some_and(|outer| outer.start <= span.start && span.end <= outer.end)
    };
    for (key, item) in table.iter() {
        let inner: Vec<&dyn TableLike> = match item {
            Item::ArrayOfTables(tables) => tables.iter().map(|it| it as _).collect(),
            Item::Value(Value::Array(values)) => {
                let tables = values.iter().filter_map(Value::as_inline_table);
                tables.map(|it| it as _).collect()
            }
            _ => item.as_table_like().into_iter().collect(),
        };
        path.push(key.to_owned());
        let key_span = table.key(key).and_then(toml_edit::Key::span);
        if inner.into_iter().any(|inner| path_to(inner, span, path))
            || around(item.span())
            || around(key_span)
        {
            return true;
        }
        path.pop();
    }
    false
}
