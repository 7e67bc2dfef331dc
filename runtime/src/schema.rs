//! What files may say, as JSON Schemas: for editors, and for whoever writes such files by a program.

use schemars::JsonSchema;
use schemars::generate::SchemaSettings;
use serde_json::{Map, Value};

use crate::diagnostic::Fields;

/// The schema of a file's fields, each described by what it accepts.
#[must_use]
pub fn of<T: JsonSchema>(title: &str, fields: &Fields) -> Value {
    let generator = SchemaSettings::draft2020_12().into_generator();
    let mut schema = generator.into_root_schema_for::<T>().to_value();
    leave_out_null(&mut schema);
    schema["title"] = Value::from(title);
    for (field, accepted) in fields {
        describe(&mut schema, field, accepted);
    }
    schema
}

/// A field that is left out is not there; no file says that it is nothing.
fn leave_out_null(schema: &mut Value) {
    match schema {
        Value::Object(object) => {
            object.remove("default");
            if let Some(Value::Array(types)) = object.get_mut("type") {
                types.retain(|it| it != "null");
                if let [only] = &types[..] {
                    object["type"] = only.clone();
                }
            }
            if let Some(Value::Array(any)) = object.get_mut("anyOf") {
                any.retain(|it| it["type"] != "null");
                if let [Value::Object(only)] = &mut any[..] {
                    let only = std::mem::take(only);
                    object.remove("anyOf");
                    object.extend(only);
                }
            }
            object.values_mut().for_each(leave_out_null);
        }
        Value::Array(values) => values.iter_mut().for_each(leave_out_null),
        _ => {}
    }
}

/// Describes a field by its path, as in `radio.range_m`; one that the schema does not have is left out.
fn describe(schema: &mut Value, field: &str, accepted: &str) {
    let mut place = String::new();
    let mut names = field.split('.').peekable();
    while let Some(name) = names.next() {
        place = format!("{}/properties/{name}", resolved(schema, &place));
        if names.peek().is_none()
            && let Some(Value::Object(property)) = schema.pointer_mut(&place)
        {
            describe_once(property, accepted);
        }
    }
}

fn describe_once(property: &mut Map<String, Value>, accepted: &str) {
    property
        .entry("description")
        .or_insert_with(|| Value::from(accepted));
}

/// Where the fields of what stands at a place are: behind its reference, and in the entries of a list.
fn resolved(schema: &Value, place: &str) -> String {
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
