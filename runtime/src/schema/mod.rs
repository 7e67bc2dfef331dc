//! What a kind of file may hold. It is declared once, by the serde structure that the file is read into: types give the
//! accepted values and the defaults, doc comments the descriptions. The list of fields, the JSON Schema and the reference
//! follow from that.
//! Errors read a list that is generated from it.

mod fields;
mod list;
mod located;
mod page;
mod read;

use schemars::JsonSchema;
use schemars::generate::SchemaSettings;
use serde_json::Value;

pub use self::fields::Field;
pub use self::list::FieldList;
pub use self::located::{FromRatio, Located, Or};
pub use self::page::{Row, page, table};
pub use self::read::{ReadError, from_toml};

/// What a kind of file may hold.
#[derive(Debug)]
pub struct FileSchema {
    /// Every field, tables included, in the order of their declaration.
    pub fields: Vec<Field>,
    /// The JSON Schema, for editors and programs.
    pub json: Value,
}

impl FileSchema {
    /// Of files that are read into a `T`.
    #[must_use]
    pub fn of<T: JsonSchema>(title: &str) -> Self {
        let generator = SchemaSettings::draft2020_12().into_generator();
        let mut json = generator.into_root_schema_for::<T>().to_value();
        json["title"] = Value::from(title);
        remove_null(&mut json);
        let fields = fields::fields(&json);
        for field in &fields {
            describe(&mut json, field);
        }
        remove_extensions(&mut json);
        Self { fields, json }
    }

    /// The text of the [`FieldList`] of this kind of file.
    #[must_use]
    pub fn list(&self) -> String {
        let line = |field: &Field| format!("{}\t{}\n", field.path, field.accepted);
        self.fields.iter().map(line).collect()
    }
}

/// Removes `null`: TOML has no such value, a field without a value is left out.
fn remove_null(schema: &mut Value) {
    match schema {
        Value::Object(object) => {
            if object.get("default").is_some_and(Value::is_null) {
                object.remove("default");
            }
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
            object.values_mut().for_each(remove_null);
        }
        Value::Array(values) => values.iter_mut().for_each(remove_null),
        _ => {}
    }
}

/// Writes what a field is, accepts and defaults to into its description, which editors show.
fn describe(schema: &mut Value, field: &Field) {
    let mut place = String::new();
    for name in field.path.split('.') {
        place = format!("{}/properties/{name}", fields::resolved(schema, &place));
    }
    if let Some(Value::Object(property)) = schema.pointer_mut(&place) {
        let default = field.default.as_ref();
        let default = default.map_or_else(String::new, |it| format!(" Default: {it}."));
        let description = format!(
            "{} Accepted: {}.{default}",
            field.description, field.accepted
        );
        property.insert("description".to_owned(), Value::from(description));
    }
}

fn remove_extensions(schema: &mut Value) {
    match schema {
        Value::Object(object) => {
            object.retain(|key, _| !key.starts_with("x-"));
            if let Some(Value::String(description)) = object.get_mut("description") {
                *description = description.replace('\n', " ");
            }
            object.values_mut().for_each(remove_extensions);
        }
        Value::Array(values) => values.iter_mut().for_each(remove_extensions),
        _ => {}
    }
}
