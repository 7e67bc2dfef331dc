//! Help for errors in TOML files: what the field at a place accepts.

use std::ops::Range;

use toml_edit::{Item, TableLike, Value};

use crate::schema::Field;

/// Describes what is accepted at `span` of a TOML file, where a reader reported `message`. `None` if the file is not TOML and
/// the line has no known field.
#[must_use]
pub fn accepted(
    fields: &[Field],
    text: &str,
    span: &Range<usize>,
    message: &str,
) -> Option<String> {
    let missing = message
        .strip_prefix("missing field `")
        .and_then(|rest| rest.strip_suffix('`'));
    let Ok(document) = toml_edit::Document::parse(text) else {
        return accepted_on_line(fields, text, span.start);
    };
    let mut path = Vec::new();
    find_path(document.as_table(), span, &mut path);
    path.extend(missing.map(str::to_owned));
    let key = path.join(".");
    // A place inside a field that has no fields of its own is described by that field.
    let mut ancestors = (1..=path.len()).rev().map(|depth| path[..depth].join("."));
    let known = ancestors.find_map(|ancestor| {
        let field = fields.iter().find(|it| it.path == ancestor);
        field.filter(|_| ancestor == key || fields_of(fields, &ancestor).is_empty())
    });
    Some(match known {
        Some(field) => format!("`{}` takes {}", field.path, field.accepted),
        None => {
            let tables = (0..=path.len()).rev().map(|depth| path[..depth].join("."));
            let mut listed = tables.map(|table| fields_of(fields, &table));
            let listed = listed.find(|listed| !listed.is_empty()).unwrap_or_default();
            format!("the fields are {}", listed.join(", "))
        }
    })
}

/// Describes the field on the line of a file that is not TOML, by its name and the table above it.
fn accepted_on_line(fields: &[Field], text: &str, place: usize) -> Option<String> {
    let line_start = text
        .get(..place)?
        .rfind('\n')
        .map_or(0, |newline| newline + 1);
    let line = text[line_start..].lines().next()?;
    let key = line.split_once('=')?.0.trim();
    let mut above = text[..line_start].lines().map(str::trim);
    let table = above.rfind(|line| line.starts_with('['));
    let table = table.and_then(|line| line.split(']').next()?.rsplit('[').next());
    let path = table.map_or_else(|| key.to_owned(), |table| format!("{}.{key}", table.trim()));
    let field = fields.iter().find(|it| it.path == path)?;
    Some(format!("`{path}` takes {}", field.accepted))
}

/// The names of a table's fields; of the top-level fields if `table` is empty.
fn fields_of<'a>(fields: &'a [Field], table: &str) -> Vec<&'a str> {
    let own_name = |field: &'a str| match table {
        "" => Some(field),
        _ => field.strip_prefix(table)?.strip_prefix('.'),
    };
    let names = fields.iter().filter_map(|field| own_name(&field.path));
    names.filter(|field| !field.contains('.')).collect()
}

/// Writes the keys of the innermost value around `span` to `path`. Returns whether there is one.
fn find_path(table: &dyn TableLike, span: &Range<usize>, path: &mut Vec<String>) -> bool {
    let contains = |outer: Option<Range<usize>>| {
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
        if inner.into_iter().any(|inner| find_path(inner, span, path))
            || contains(item.span())
            || contains(key_span)
        {
            return true;
        }
        path.pop();
    }
    false
}
