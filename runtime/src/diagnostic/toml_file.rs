//! Reading of TOML files, with errors that show the place and what is accepted.

use std::ops::Range;
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;

use super::{BadInput, accepted, plain, read_text};
use crate::schema::{FieldList, Located, from_toml};

/// Description of a file format, for error messages.
#[derive(Debug, Clone, Copy)]
pub struct FileFormat {
    /// Every field. Empty for files that only programs write.
    pub fields: FieldList,
    /// One sentence on the format, shown if no field matches.
    pub description: &'static str,
}

/// A TOML file with its parsed fields, for errors found later in their values.
#[derive(Debug)]
pub struct TomlFile<T> {
    path: PathBuf,
    text: String,
    format: FileFormat,
    /// The parsed fields.
    pub raw: T,
}

impl<T: DeserializeOwned> TomlFile<T> {
    /// Reads a file.
    ///
    /// # Errors
    /// If the file is missing, not text or not TOML, or has wrong fields. The error shows the place and what is accepted.
    pub fn read(path: &Path, format: FileFormat) -> Result<Self, BadInput> {
        Self::parse(path, read_text(path)?, format)
    }

    /// Parses a file's text. Errors name `path`.
    ///
    /// # Errors
    /// As [`Self::read`], except for missing files.
    pub fn parse(path: &Path, text: String, format: FileFormat) -> Result<Self, BadInput> {
        match from_toml(&text) {
            Ok(raw) => Ok(Self {
                path: path.to_owned(),
                text,
                format,
                raw,
            }),
            Err(error) => {
                let message = plain(error.message());
                Err(format.refusal(path, &text, error.span(), &message))
            }
        }
    }
}

impl<T> TomlFile<T> {
    /// An error at `span`; the help is the description of the field there.
    pub fn error(&self, span: Range<usize>, message: &str) -> BadInput {
        self.format.refusal(&self.path, &self.text, span, message)
    }

    /// An error at `span` with its own help text.
    pub fn error_with(&self, span: Range<usize>, message: &str, help: &str) -> BadInput {
        BadInput::new(&self.path, &self.text, span, message, help)
    }

    /// The place in the file of a part of a string's value, in bytes of the value. It is the whole string if the value does not
    /// stand in the file as it is.
    #[must_use]
    pub fn place_of(&self, string: &Located<String>, part: Range<usize>) -> Range<usize> {
        let whole = string.span();
        match self.text[whole.clone()].find(string.get_ref().as_str()) {
            Some(start) => whole.start + start + part.start..whole.start + start + part.end,
            None => whole,
        }
    }

    /// Resolves a path against this file's folder.
    #[must_use]
    pub fn resolve(&self, path: &Path) -> PathBuf {
        self.path.parent().unwrap_or(Path::new("")).join(path)
    }
}

impl FileFormat {
    fn refusal(self, path: &Path, text: &str, span: Range<usize>, message: &str) -> BadInput {
        let fields = self.fields;
        let accepted = (!fields.is_empty()).then(|| accepted(fields, text, &span, message));
        let help = accepted
            .flatten()
            .unwrap_or_else(|| self.description.to_owned());
        BadInput::new(path, text, span, message, help)
    }
}
