//! Help for errors in TOML files: what the field at a place accepts.

use std::ops::Range;

use toml::de::{DeTable, DeValue};

use crate::schema::FieldList;

/// Describes what is accepted at `span` of a TOML file, where a reader reported `message`. `None` if the file is not TOML and
/// the line has no known field. The span `0..0` is the whole file.
#[must_use]
pub fn accepted(
    fields: FieldList,
    text: &str,
    span: &Range<usize>,
    message: &str,
) -> Option<String> {
    let missing = message
        .strip_prefix("missing field `")
        .and_then(|rest| rest.strip_suffix('`'));
    let Ok(document) = DeTable::parse(text) else {
        return accepted_on_line(fields, text, span.start);
    };
    let mut path = Vec::new();
    // An error on the whole file has the empty span at its beginning, where a key may stand.
    if *span != (0..0) {
        find_path(document.get_ref(), span, &mut path);
    }
    path.extend(missing.map(str::to_owned));
    let key = path.join(".");
    // A place inside a field that has no fields of its own is described by that field.
    let mut ancestors = (1..=path.len()).rev().map(|depth| path[..depth].join("."));
    let known = ancestors.find_map(|ancestor| {
        let field = fields.iter().find(|(path, _)| *path == ancestor);
        field.filter(|_| ancestor == key || fields_of(fields, &ancestor).is_empty())
    });
    Some(match known {
        Some((path, accepted)) => format!("`{path}` takes {accepted}"),
        None => {
            let tables = (0..=path.len()).rev().map(|depth| path[..depth].join("."));
            let mut listed = tables.map(|table| fields_of(fields, &table));
            let listed = listed.find(|listed| !listed.is_empty()).unwrap_or_default();
            format!("the fields are {}", listed.join(", "))
        }
    })
}

/// Describes the field on the line of a file that is not TOML, by its name and the table above it.
fn accepted_on_line(fields: FieldList, text: &str, place: usize) -> Option<String> {
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
    let (_, accepted) = fields.iter().find(|(known, _)| *known == path)?;
    Some(format!("`{path}` takes {accepted}"))
}

/// The names of a table's fields; of the top-level fields if `table` is empty.
fn fields_of(fields: FieldList, table: &str) -> Vec<&'static str> {
    let own_name = |field: &'static str| match table {
        "" => Some(field),
        _ => field.strip_prefix(table)?.strip_prefix('.'),
    };
    let names = fields.iter().filter_map(|(path, _)| own_name(path));
    names.filter(|field| !field.contains('.')).collect()
}

/// Writes the keys of the innermost value around `span` to `path`. Returns whether there is one.
fn find_path(table: &DeTable<'_>, span: &Range<usize>, path: &mut Vec<String>) -> bool {
    let contains = |outer: Range<usize>| outer.start <= span.start && span.end <= outer.end;
    for (key, value) in table {
        let tables = match value.get_ref() {
            DeValue::Array(values) => &values[..],
            _ => std::slice::from_ref(value),
        };
        let mut inner = tables.iter().filter_map(|it| it.get_ref().as_table());
        path.push(key.get_ref().to_string());
        if inner.any(|inner| find_path(inner, span, path))
            || contains(value.span())
            || contains(key.span())
        {
            return true;
        }
        path.pop();
    }
    false
}
