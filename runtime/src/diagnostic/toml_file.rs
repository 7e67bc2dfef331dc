//! Files in TOML: read in one way, and refused in one way.

use std::ops::Range;
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;

use super::{BadInput, Fields, accepted, read_text};

/// What files of a kind are like, for whoever has written one that can't be used.
#[derive(Debug, Clone, Copy)]
pub struct Form {
    /// Every field, with what it accepts; none of a file that only programs write.
    pub fields: &'static Fields,
    /// What such a file is.
    pub is: &'static str,
}

/// A TOML file that was read, and may yet be refused for what it says.
#[derive(Debug)]
pub struct TomlFile<T> {
    path: PathBuf,
    text: String,
    form: Form,
    /// What it says.
    pub raw: T,
}

impl<T: DeserializeOwned> TomlFile<T> {
    /// Reads a file.
    ///
    /// # Errors
    /// When it is not there, is no text or no TOML, or has other fields than it is to have: the error shows the place and
    /// says what would be accepted.
    pub fn read(path: &Path, form: Form) -> Result<Self, BadInput> {
        Self::of(path, read_text(path)?, form)
    }

    /// Reads the text of a file, which errors call by its path.
    ///
    /// # Errors
    /// As [`Self::read`], of the text.
    pub fn of(path: &Path, text: String, form: Form) -> Result<Self, BadInput> {
        match toml::from_str(&text) {
            Ok(raw) => Ok(Self {
                path: path.to_owned(),
                text,
                form,
                raw,
            }),
            Err(error) => {
                let span = error.span().unwrap_or_default();
                let message = error.message().trim().replace('\n', ", ");
                Err(form.refusal(path, &text, span, &message))
            }
        }
    }
}

impl<T> TomlFile<T> {
    /// What it says is wrong at `span`; what would be accepted follows from the field that is there.
    pub fn error(&self, span: Range<usize>, message: &str) -> BadInput {
        self.form.refusal(&self.path, &self.text, span, message)
    }

    /// What it says is wrong at `span`, and `help` says what to do.
    pub fn error_with(&self, span: Range<usize>, message: &str, help: &str) -> BadInput {
        BadInput::new(&self.path, &self.text, span, message, help)
    }

    /// A path as seen from this file's folder.
    #[must_use]
    pub fn beside(&self, path: &Path) -> PathBuf {
        self.path.parent().unwrap_or(Path::new("")).join(path)
    }
}

impl Form {
    fn refusal(self, path: &Path, text: &str, span: Range<usize>, message: &str) -> BadInput {
        let has_fields = !self.fields.is_empty();
        let accepted = has_fields.then(|| accepted(self.fields, text, &span, message));
        let help = accepted.flatten().unwrap_or_else(|| self.is.to_owned());
        BadInput::new(path, text, span, message, help)
    }
}
