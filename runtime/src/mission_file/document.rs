//! A mission file's text, and errors that point into it.

use std::fmt;
use std::ops::Range;
use std::path::Path;

use crate::diagnostic::BadInput;

/// A text and the path that errors name it by.
#[derive(Debug, Clone, Copy)]
pub(super) struct Document<'a> {
    pub(super) path: &'a Path,
    pub(super) text: &'a str,
}

/// A value, and the part of the document that says it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Written<'a, T> {
    pub(super) value: T,
    pub(super) text: &'a str,
}

impl<'a> Document<'a> {
    /// An error that points at `part`, which must be a slice of the document's text.
    pub(super) fn refuse(
        self,
        part: &str,
        message: impl fmt::Display,
        help: impl Into<String>,
    ) -> BadInput {
        let start = (part.as_ptr() as usize).saturating_sub(self.text.as_ptr() as usize);
        self.refuse_at(start..start + part.len(), message, help)
    }

    /// An error that points at a range of the document's bytes.
    pub(super) fn refuse_at(
        self,
        span: Range<usize>,
        message: impl fmt::Display,
        help: impl Into<String>,
    ) -> BadInput {
        BadInput::new(self.path, self.text, span, message, help)
    }

    /// Where a line begins, in bytes; lines are counted from one.
    pub(super) fn line_start(self, line: usize) -> usize {
        let lines_before = self.text.split_inclusive('\n').take(line.saturating_sub(1));
        lines_before.map(str::len).sum()
    }

    /// The text's end, to say that something is missing there.
    pub(super) fn end(self) -> &'a str {
        let end = self.text.trim_end().len();
        &self.text[end..end]
    }
}

/// As much of a text from a file as an error's message quotes.
pub(super) fn quoted(text: &str) -> String {
    const QUOTED_MAX: usize = 40;
    match text.char_indices().nth(QUOTED_MAX) {
        Some((end, _)) => format!("`{}…`", &text[..end]),
        None => format!("`{text}`"),
    }
}
