//! A mission file's text, and errors with a place in it.

use std::fmt;
use std::ops::Range;
use std::path::Path;

use crate::diagnostic::BadInput;

/// A text, and its path for errors.
#[derive(Debug, Clone, Copy)]
pub(super) struct Document<'a> {
    pub(super) path: &'a Path,
    pub(super) text: &'a str,
}

/// A parsed value with its text in the document.
#[derive(Debug, Clone, Copy)]
pub(super) struct Parsed<'a, T> {
    pub(super) value: T,
    pub(super) text: &'a str,
}

impl<'a> Document<'a> {
    /// An error at `part`, which must be a slice of the document's text.
    pub(super) fn refuse(
        self,
        part: &str,
        message: impl fmt::Display,
        help: impl Into<String>,
    ) -> BadInput {
        let start = (part.as_ptr() as usize).saturating_sub(self.text.as_ptr() as usize);
        self.refuse_at(start..start + part.len(), message, help)
    }

    /// An error at a byte range of the document.
    pub(super) fn refuse_at(
        self,
        span: Range<usize>,
        message: impl fmt::Display,
        help: impl Into<String>,
    ) -> BadInput {
        BadInput::new(self.path, self.text, span, message, help)
    }

    /// Byte offset of a line; lines are counted from one.
    pub(super) fn line_start(self, line: usize) -> usize {
        let lines_before = self.text.split_inclusive('\n').take(line.saturating_sub(1));
        lines_before.map(str::len).sum()
    }

    /// An empty slice at the text's end, for errors on something missing.
    pub(super) fn end(self) -> &'a str {
        let end = self.text.trim_end().len();
        &self.text[end..end]
    }
}

/// The first 40 characters of a text, in backquotes.
pub(super) fn quoted(text: &str) -> String {
    const QUOTED_MAX: usize = 40;
    match text.char_indices().nth(QUOTED_MAX) {
        Some((end, _)) => format!("`{}…`", &text[..end]),
        None => format!("`{text}`"),
    }
}
