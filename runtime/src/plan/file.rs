//! A scenario's file: its text, fields set in the place of what it says, and errors that show where.

use std::fmt;
use std::ops::Range;
use std::path::{Path, PathBuf};

use crate::diagnostic::{BadInput, accepted};
use toml_edit::{DocumentMut, Item, TableLike, Value};

use super::fields::FIELDS;
use super::raw::Raw;

/// A field to be set in the place of what a scenario file says.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Override {
    key: String,
    value: String,
}

impl Override {
    /// Another seed, as it was written; refused like one in a file if it is none.
    #[must_use]
    pub fn seed(value: &str) -> Self {
        Self {
            key: "seed".to_owned(),
            value: value.to_owned(),
        }
    }

    /// The field, with its table, as in `radio.range_m`.
    #[must_use]
    pub fn key(&self) -> &str {
        &self.key
    }

    /// Its value as it was written.
    #[must_use]
    pub fn value(&self) -> &str {
        &self.value
    }

    /// Whether it is the seed.
    #[must_use]
    pub fn is_seed(&self) -> bool {
        self.key == "seed"
    }
}

impl fmt::Display for Override {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}={}", self.key, self.value)
    }
}

impl std::str::FromStr for Override {
    type Err = String;

    /// From `key=value`, the key with its table, as in `radio.range_m=250`.
    fn from_str(text: &str) -> Result<Self, String> {
        let (key, value) = text.split_once('=').ok_or_else(|| {
            format!("`{text}` has no `=`; use key=value, as in radio.range_m=250")
        })?;
        let key = key.trim();
        let of_a_list = |list: &str| key.strip_prefix(list).is_some_and(|it| it.starts_with('.'));
        if let Some(list) = LISTS.into_iter().find(|list| of_a_list(list)) {
            return Err(format!(
                "`{list}` is a list, whose entries are not set one by one; write them into the scenario file"
            ));
        }
        if FIELDS.iter().any(|(known, _)| *known == key) {
            Ok(Self {
                key: key.to_owned(),
                value: value.trim().to_owned(),
            })
        } else {
            Err(format!("there is no field `{key}` to be set{}", meant(key)))
        }
    }
}

/// The known field that was probably meant.
fn meant(key: &str) -> String {
    let field = key.rsplit('.').next().unwrap_or(key);
    FIELDS
        .iter()
        .map(|(known, _)| *known)
        .find(|known| known.rsplit('.').next() == Some(field))
        .map_or_else(String::new, |known| format!("; did you mean `{known}`?"))
}

/// A scenario file's text, with the overrides written into it.
pub struct Source {
    /// The file, as shown in errors.
    pub shown: PathBuf,
    /// What it says.
    pub text: String,
}

impl Source {
    /// The text of a file with fields set in the place of what it says.
    ///
    /// # Errors
    /// When something is to be set and the text is not TOML.
    pub fn new(path: &Path, text: String, overrides: &[Override]) -> Result<Self, BadInput> {
        if overrides.is_empty() {
            let shown = path.to_owned();
            return Ok(Self { shown, text });
        }
        let mut document: DocumentMut = text.parse().map_err(|error: toml_edit::TomlError| {
            let span = error.span().unwrap_or_default();
            BadInput::new(path, &text, span, error.message().trim(), NOT_TOML)
        })?;
        let mut shown = path.display().to_string();
        for change in overrides {
            set(&mut document, &change.key, &change.value);
            shown = format!("{shown} --set {change}");
        }
        Ok(Self {
            shown: shown.into(),
            text: document.to_string(),
        })
    }

    /// Its fields.
    ///
    /// # Errors
    /// When one is missing, unknown or of the wrong form.
    pub fn parse(&self) -> Result<Raw, BadInput> {
        toml::from_str(&self.text).map_err(|error| {
            let span = error.span().unwrap_or_default();
            let message = error.message().trim().replace('\n', ", ");
            self.error(span, &message)
        })
    }

    /// An error at a place of the file; what would be accepted follows from the field that is there.
    pub fn error(&self, span: Range<usize>, message: &str) -> BadInput {
        let accepted = accepted(FIELDS, &self.text, &span, message);
        let help = accepted.unwrap_or_else(|| NOT_TOML.to_owned());
        BadInput::new(&self.shown, &self.text, span, message, help)
    }
}

/// Fields that hold any number of tables.
const LISTS: [&str; 5] = ["faults", "changes", "follow.pilot", "relays", "swarms"];

const NOT_TOML: &str = "a scenario is a TOML file: lines `key = value` in tables like `[radio]`";

/// Writes a value into a document, whether its table is written in lines or inline. What stands in the place of a
/// table and is none is left, to be refused as it would be in the file.
fn set(document: &mut DocumentMut, key: &str, value: &str) {
    let value: Value = value.parse().unwrap_or_else(|_| Value::from(value));
    let table: &mut dyn TableLike = document.as_table_mut();
    match key.split_once('.') {
        None => {
            table.insert(key, Item::Value(value));
        }
        Some((outer, field)) => {
            let inner = table.entry(outer).or_insert_with(toml_edit::table);
            if let Some(inner) = inner.as_table_like_mut() {
                inner.insert(field, Item::Value(value));
            }
        }
    }
}
