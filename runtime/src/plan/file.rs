//! A scenario file: its text, overridden fields, and errors that show the place.

use std::fmt;
use std::ops::Range;
use std::path::{Path, PathBuf};

use crate::diagnostic::{BadInput, accepted};
use crate::schema::from_toml;
use toml_edit::{DocumentMut, Item, TableLike, Value};

use super::FIELDS;
use super::raw::Raw;

/// A field that overrides a scenario file's.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Override {
    key: String,
    value: String,
}

impl Override {
    /// Overrides the seed. An invalid value is refused when the scenario is parsed.
    #[must_use]
    pub fn seed(value: &str) -> Self {
        Self {
            key: "seed".to_owned(),
            value: value.to_owned(),
        }
    }

    /// The field with its table: `radio.range_m`.
    #[must_use]
    pub fn key(&self) -> &str {
        &self.key
    }

    /// The value as given.
    #[must_use]
    pub fn value(&self) -> &str {
        &self.value
    }

    /// Whether the field is the seed.
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

    /// Parses `key=value`, the key with its table: `radio.range_m=250`.
    fn from_str(text: &str) -> Result<Self, String> {
        let (key, value) = text.split_once('=').ok_or_else(|| {
            format!("`{text}` has no `=`; give key=value, for example radio.range_m=250")
        })?;
        let key = key.trim();
        let of_a_list = |list: &str| key.strip_prefix(list).is_some_and(|it| it.starts_with('.'));
        if let Some(list) = LISTS.into_iter().find(|list| of_a_list(list)) {
            return Err(format!(
                "`{list}` is a list, and single entries can't be set; write them into the scenario file"
            ));
        }
        if FIELDS.iter().any(|(known, _)| known == key) {
            Ok(Self {
                key: key.to_owned(),
                value: value.trim().to_owned(),
            })
        } else {
            Err(format!("there is no field `{key}`{}", suggestion(key)))
        }
    }
}

/// A hint at a field of the same name in a table; empty if there is none.
fn suggestion(key: &str) -> String {
    let field = key.rsplit('.').next().unwrap_or(key);
    FIELDS
        .iter()
        .map(|(known, _)| known)
        .find(|known| known.rsplit('.').next() == Some(field))
        .map_or_else(String::new, |known| format!("; did you mean `{known}`?"))
}

/// A scenario file's text with its overrides.
pub struct Source {
    /// The file and its overrides, as shown in errors.
    pub shown: PathBuf,
    /// The text with the overrides.
    pub text: String,
}

impl Source {
    /// A file as it is.
    #[must_use]
    pub fn new(path: &Path, text: String) -> Self {
        let shown = path.to_owned();
        Self { shown, text }
    }

    /// Writes overrides into a file's text.
    ///
    /// # Errors
    /// If there are overrides and the text is not TOML.
    pub fn overridden(path: &Path, text: String, overrides: &[Override]) -> Result<Self, BadInput> {
        if overrides.is_empty() {
            return Ok(Self::new(path, text));
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

    /// Parses the fields.
    ///
    /// # Errors
    /// If a field is missing, unknown or of the wrong type.
    pub fn parse(&self) -> Result<Raw, BadInput> {
        from_toml(&self.text).map_err(|error| self.error(error.span(), error.message()))
    }

    /// An error at `span`; the help is the description of the field there.
    pub fn error(&self, span: Range<usize>, message: &str) -> BadInput {
        let accepted = accepted(FIELDS, &self.text, &span, message);
        let help = accepted.unwrap_or_else(|| NOT_TOML.to_owned());
        BadInput::new(&self.shown, &self.text, span, message, help)
    }
}

/// Fields that are lists of tables.
const LISTS: [&str; 5] = ["faults", "changes", "follow.pilot", "relays", "swarms"];

const NOT_TOML: &str = "a scenario is a TOML file: lines `key = value` in tables like `[radio]`";

/// Sets a field of a document, in a table or an inline table. A value in the place of a table is left, so that parsing
/// refuses it.
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
