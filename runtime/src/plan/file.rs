//! A scenario file: its text, overridden fields, and errors that show the place.

use std::fmt;
use std::ops::Range;
use std::path::{Path, PathBuf};

use crate::diagnostic::{BadInput, accepted, did_you_mean, nearest, plain};
use crate::schema::from_toml;
use toml_edit::{DocumentMut, Item, TableLike, Value};

use super::FIELDS;
use super::raw::Raw;

/// A field that overrides a scenario file's.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Override {
    key: String,
    value: String,
    /// Whether the scenario file itself gives the value, so that a path in it starts at the file's folder.
    is_in_file: bool,
}

impl Override {
    /// Overrides the seed. An invalid value is refused when the scenario is parsed.
    #[must_use]
    pub fn seed(value: &str) -> Self {
        Self {
            key: "seed".to_owned(),
            value: value.to_owned(),
            is_in_file: false,
        }
    }

    /// The same value, given by the scenario file: a path in it starts at the file's folder, not at the current one.
    #[must_use]
    pub fn in_file(self) -> Self {
        Self {
            is_in_file: true,
            ..self
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
        let is_parameter = key.starts_with("agent.parameters.");
        if is_parameter || FIELDS.iter().any(|(known, _)| known == key) {
            Ok(Self {
                key: key.to_owned(),
                value: value.trim().to_owned(),
                is_in_file: false,
            })
        } else {
            let near = suggestion(key);
            Err(format!(
                "there is no field `{key}`{near}; {}",
                accepted_keys(key)
            ))
        }
    }
}

/// A hint at a field of the same or a similar name; empty if there is none.
fn suggestion(key: &str) -> String {
    let own_name = |path: &'static str| path.rsplit('.').next().unwrap_or(path);
    let field = key.rsplit('.').next().unwrap_or(key);
    let paths = || FIELDS.iter().map(|(known, _)| known);
    if let Some(same) = paths().find(|path| own_name(path) == field) {
        return format!("; did you mean `{same}`?");
    }
    let by_path = did_you_mean(key, paths());
    if !by_path.is_empty() {
        return by_path;
    }
    let similar = nearest(field, paths().map(own_name));
    let similar = similar.and_then(|name| paths().find(|path| own_name(path) == name));
    similar.map_or_else(String::new, |path| format!("; did you mean `{path}`?"))
}

/// The fields that can be set: those of the key's table if it names one, else the tables.
fn accepted_keys(key: &str) -> String {
    let table = key.rsplit_once('.').map_or("", |(table, _)| table);
    let own = |path: &'static str| path.strip_prefix(table)?.strip_prefix('.');
    let names = FIELDS.iter().filter_map(|(path, _)| own(path));
    let names: Vec<&str> = names.filter(|name| !name.contains('.')).collect();
    if !table.is_empty() && !names.is_empty() {
        return format!("the fields of `{table}` are {}", names.join(", "));
    }
    let mut tables: Vec<&str> = Vec::new();
    let all = FIELDS.iter().filter_map(|(path, _)| path.split_once('.'));
    for (table, _) in all.filter(|(table, _)| !LISTS.contains(table)) {
        if !tables.contains(&table) {
            tables.push(table);
        }
    }
    let tables = tables.join(", ");
    format!(
        "accepted are fields of {tables}, as in radio.range_m; `muster schema scenario` lists all"
    )
}

/// A scenario file's text with its overrides.
pub struct Source {
    /// The file and its overrides, as shown in errors.
    pub shown: PathBuf,
    /// The text with the overrides.
    pub text: String,
    /// The folder of the file.
    folder: PathBuf,
    /// Fields that were overridden from outside the file.
    given_outside: Vec<String>,
}

impl Source {
    /// A file as it is.
    #[must_use]
    pub fn new(path: &Path, text: String) -> Self {
        Self {
            shown: path.to_owned(),
            text,
            folder: path.parent().unwrap_or(Path::new("")).to_owned(),
            given_outside: Vec::new(),
        }
    }

    /// Writes overrides into a file's text.
    ///
    /// # Errors
    /// If there are overrides and the text is not TOML.
    pub fn overridden(path: &Path, text: String, overrides: &[Override]) -> Result<Self, BadInput> {
        let file = Self::new(path, text);
        if overrides.is_empty() {
            return Ok(file);
        }
        let (text, folder) = (file.text, file.folder);
        let mut document: DocumentMut = text.parse().map_err(|error: toml_edit::TomlError| {
            let span = error.span().unwrap_or_default();
            BadInput::new(path, &text, span, plain(error.message()), NOT_TOML)
        })?;
        let mut shown = path.display().to_string();
        let given_outside = overrides.iter().filter(|change| !change.is_in_file);
        let given_outside = given_outside.map(|change| change.key.clone()).collect();
        for change in overrides {
            if is_too_large(&change.value) {
                let known = FIELDS.iter().find(|(key, _)| *key == change.key);
                let help = known.map_or(NOT_TOML, |(_, accepted)| accepted);
                let message = format!("{change}: the number is too large");
                return Err(BadInput::without_excerpt(path, message, help));
            }
            set(&mut document, &change.key, &change.value);
            shown = format!("{shown} --set {change}");
        }
        Ok(Self {
            shown: shown.into(),
            text: document.to_string(),
            folder,
            given_outside,
        })
    }

    /// The path of a file that the field `key` names: relative to the scenario file's folder, or to the current folder if
    /// the field was overridden from outside. A name without a folder and a dot is that of a shipped file, and unchanged.
    #[must_use]
    pub fn resolve(&self, key: &str, named: &Path) -> PathBuf {
        if is_name(named) || self.is_given_outside(key) {
            return named.to_owned();
        }
        self.folder.join(named)
    }

    /// Whether a field was overridden from outside the file.
    #[must_use]
    pub fn is_given_outside(&self, key: &str) -> bool {
        self.given_outside.iter().any(|given| given == key)
    }

    /// Parses the fields.
    ///
    /// # Errors
    /// If a field is missing, unknown or of the wrong type.
    pub fn parse(&self) -> Result<Raw, BadInput> {
        from_toml(&self.text).map_err(|error| self.error(error.span(), &plain(error.message())))
    }

    /// An error at `span` with its own help.
    pub fn error_with(&self, span: Range<usize>, message: &str, help: String) -> BadInput {
        BadInput::new(&self.shown, &self.text, span, message, help)
    }

    /// An error at `span`; the help is the description of the field there.
    pub fn error(&self, span: Range<usize>, message: &str) -> BadInput {
        let accepted = accepted(FIELDS, &self.text, &span, message);
        let help = accepted.unwrap_or_else(|| NOT_TOML.to_owned());
        self.error_with(span, message, help)
    }

    /// What the field at `span` accepts, in words.
    #[must_use]
    pub fn accepted_at(&self, span: Range<usize>) -> String {
        accepted(FIELDS, &self.text, &span, "").unwrap_or_else(|| NOT_TOML.to_owned())
    }
}

/// What the field of this name accepts, in words.
#[must_use]
pub fn field_help(key: &str) -> String {
    let known = FIELDS.iter().find(|(known, _)| *known == key);
    known.map_or_else(
        || NOT_TOML.to_owned(),
        |(_, accepted)| format!("`{key}` takes {accepted}"),
    )
}

/// Whether this names a shipped scenario or mission, not a file: a single word without a dot.
#[must_use]
pub fn is_name(path: &Path) -> bool {
    let text = path.as_os_str().as_encoded_bytes();
    !text.is_empty() && !text.contains(&b'/') && !text.contains(&b'.')
}

/// Fields that are lists of tables.
const LISTS: [&str; 5] = ["faults", "changes", "follow.pilot", "relays", "swarms"];

const NOT_TOML: &str = "a scenario is a TOML file: lines `key = value` in tables like `[radio]`";

/// Whether this is a whole number of more than TOML's 64 bits.
fn is_too_large(value: &str) -> bool {
    let digits = value.strip_prefix(['+', '-']).unwrap_or(value);
    let is_number = !digits.is_empty() && digits.bytes().all(|it| it.is_ascii_digit());
    is_number && value.parse::<i64>().is_err()
}

/// Sets a field of a document, in tables or inline tables. A value in the place of a table is left, so that parsing
/// refuses it.
fn set(document: &mut DocumentMut, key: &str, value: &str) {
    let value: Value = value.parse().unwrap_or_else(|_| Value::from(value));
    let mut table: &mut dyn TableLike = document.as_table_mut();
    let mut field = key;
    while let Some((outer, inner)) = field.split_once('.') {
        let entry = table.entry(outer).or_insert_with(toml_edit::table);
        let Some(next) = entry.as_table_like_mut() else {
            return;
        };
        (table, field) = (next, inner);
    }
    table.insert(field, Item::Value(value));
}
