//! The fields of a kind of file, taken from its schema.

use serde_json::Value;

/// A field of a kind of file, or one of its tables.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Field {
    /// Its name with that of its table, as in `radio.range_m`.
    pub path: String,
    /// What it is.
    pub description: String,
    /// What the names mean that it takes, where that is described.
    pub meanings: Vec<(String, String)>,
    /// Whether it is a table, or a list of tables, with fields of its own.
    pub shape: Shape,
    /// The values that it takes.
    pub accepted: String,
    /// The value if it is left out; `None` if there is none.
    pub default: Option<String>,
    /// Whether it must be there.
    pub is_required: bool,
}

/// What a field holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shape {
    /// A value.
    Value,
    /// A table with fields.
    Table,
    /// Any number of tables with fields.
    Tables,
}

/// Every field of a schema, tables included, in their order.
pub(super) fn fields(schema: &Value) -> Vec<Field> {
    let mut found = Vec::new();
    add_fields(schema, "", "", &mut found);
    found
}

/// Adds the fields of the table at `place`, named `table`.
fn add_fields(schema: &Value, place: &str, table: &str, found: &mut Vec<Field>) {
    let place = resolved(schema, place);
    let Some(inner) = schema.pointer(&place) else {
        return;
    };
    let required = inner["required"].as_array();
    for name in inner["properties"]
        .as_object()
        .into_iter()
        .flat_map(|it| it.keys())
    {
        let at = format!("{place}/properties/{name}");
        let path = match table {
            "" => name.clone(),
            _ => format!("{table}.{name}"),
        };
        let is_required = required.is_some_and(|it| it.iter().any(|it| it == name));
        found.push(field(schema, &at, path.clone(), is_required));
        add_fields(schema, &at, &path, found);
    }
}

fn field(schema: &Value, place: &str, path: String, is_required: bool) -> Field {
    let property = &schema.pointer(place).expect("a property that was found");
    let inner = schema.pointer(&resolved(schema, place)).unwrap_or(property);
    let text = |key: &str| {
        let own = property.get(key).or(inner.get(key));
        own.and_then(Value::as_str).map(|it| it.replace('\n', " "))
    };
    let shape = match (inner.get("properties"), property.get("items")) {
        (None, _) => Shape::Value,
        (Some(_), None) => Shape::Table,
        (Some(_), Some(_)) => Shape::Tables,
    };
    let mut accepted =
        text("x-accepted").unwrap_or_else(|| accepted(&path, inner, property, shape));
    if let Some(condition) = text("x-condition") {
        accepted = format!("{accepted}; {condition}");
    }
    Field {
        description: text("description").unwrap_or_default(),
        meanings: meanings(inner).collect(),
        shape,
        accepted,
        default: text("x-default").or_else(|| property.get("default").map(shown)),
        is_required,
        path,
    }
}

/// The values that a type takes, in words.
fn accepted(path: &str, inner: &Value, property: &Value, shape: Shape) -> String {
    let required = inner["required"].as_array();
    let required = required.into_iter().flatten().filter_map(Value::as_str);
    let required: Vec<String> = required.map(|it| format!("`{it}`")).collect();
    match (shape, &required[..]) {
        (Shape::Table, []) => return "a table".to_owned(),
        (Shape::Table, _) => return format!("a table with {}", listed(&required, "and")),
        (Shape::Tables, _) => {
            let with = listed(&required, "and");
            return format!("tables, each begun by `[[{path}]]`, with {with}");
        }
        (Shape::Value, _) => {}
    }
    let names: Vec<String> = names(inner).map(|it| format!("\"{it}\"")).collect();
    if !names.is_empty() {
        return match property.get("items") {
            Some(_) => format!("a list of any of {}", listed(&names, "and")),
            None => listed(&names, "or"),
        };
    }
    let bounds = format!(
        "from {} to {}",
        shown(&inner["minimum"]),
        shown(&inner["maximum"])
    );
    let unit = unit(path).map_or_else(String::new, |unit| format!(", in {unit}"));
    match inner["type"].as_str() {
        Some("integer") => format!("a whole number {bounds}{unit}"),
        Some("number") => format!("a number {bounds}{unit}"),
        Some("boolean") => "true or false".to_owned(),
        _ => "a text".to_owned(),
    }
}

/// The unit that a field's name ends with.
fn unit(path: &str) -> Option<&'static str> {
    let units = [
        ("_per_s2", "1/s²"),
        ("_per_s", "1/s"),
        ("_rad", "radians"),
        ("_mps2", "m/s²"),
        ("_mps", "m/s"),
        ("_dps", "°/s"),
        ("_radps", "rad/s"),
        ("_ms", "milliseconds"),
        ("_us", "microseconds"),
        ("_s", "seconds"),
        ("_m", "metres"),
        ("_deg", "degrees"),
    ];
    // The one of these names whose end is no unit: a shape has none.
    let is_shape = path.ends_with("nakagami_m");
    let mut fitting = units
        .into_iter()
        .filter(|(end, _)| path.ends_with(end) && !is_shape);
    fitting.next().map(|(_, unit)| unit)
}

/// The names that an enumeration takes.
fn names(schema: &Value) -> impl Iterator<Item = &str> {
    let plain = schema["enum"].as_array().into_iter().flatten();
    let described = schema["oneOf"].as_array().into_iter().flatten();
    let described = described.flat_map(|it| {
        let several = it["enum"].as_array().into_iter().flatten();
        it.get("const").into_iter().chain(several)
    });
    plain.chain(described).filter_map(Value::as_str)
}

/// The names of an enumeration that are described.
fn meanings(schema: &Value) -> impl Iterator<Item = (String, String)> {
    let all = schema["oneOf"].as_array().into_iter().flatten();
    all.filter_map(|it| {
        let meaning = it["description"].as_str()?.replace('\n', " ");
        Some((it["const"].as_str()?.to_owned(), meaning))
    })
}

fn listed(items: &[String], last: &str) -> String {
    match items {
        [first @ .., end] if !first.is_empty() => format!("{} {last} {end}", first.join(", ")),
        _ => items.join(""),
    }
}

/// A value as it is written in TOML.
fn shown(value: &Value) -> String {
    match value.as_f64() {
        Some(number) if value.is_f64() => number.to_string(),
        _ => value.to_string(),
    }
}

/// The place of a table's fields: behind its reference, and in the entries of a list.
pub(super) fn resolved(schema: &Value, place: &str) -> String {
    let Some(it) = schema.pointer(place) else {
        return place.to_owned();
    };
    if let Some(Value::String(to)) = it.get("$ref") {
        return resolved(schema, to.trim_start_matches('#'));
    }
    if it.get("items").is_some() {
        return resolved(schema, &format!("{place}/items"));
    }
    place.to_owned()
}
