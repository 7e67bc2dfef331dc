//! Errors in input files: message, excerpt with the place marked, and what is accepted.

mod fields;
mod near;
mod toml_file;
mod wording;

use std::fmt;
use std::fs::File;
use std::io::{self, Read};
use std::ops::Range;
use std::path::Path;

pub use fields::accepted;
use miette::{
    Diagnostic, GraphicalReportHandler, LabeledSpan, NamedSource, SourceCode, SourceSpan,
};
pub use near::{did_you_mean, did_you_mean_file, nearest};
pub use toml_file::{FileFormat, TomlFile};
pub(crate) use wording::{names, plain};

/// The largest file that [`read_text`] reads, in bytes. A mission of a thousand items takes a tenth of it.
pub const FILE_SIZE_MAX: u64 = 4 * 1024 * 1024;

/// The longest excerpt that an error shows, in bytes: three lines of 150. A longer one is replaced by line and column.
const EXCERPT_MAX: usize = 450;

/// An input file that can't be used: what is wrong, where, and what is accepted.
///
/// `Display` names the file only if there is no excerpt, for the excerpt's heading names it.
#[derive(Debug, thiserror::Error)]
#[error("{}", .0.message)]
pub struct BadInput(Box<Report>);

#[derive(Debug)]
struct Report {
    message: String,
    help: String,
    excerpt: Option<Excerpt>,
}

#[derive(Debug)]
struct Excerpt {
    source: NamedSource<String>,
    span: SourceSpan,
}

impl BadInput {
    /// An error at `span` of the text, in bytes. The file is shown under `path` as given.
    ///
    /// Only the span's first line is underlined. A span outside of the text is moved to its end.
    #[must_use]
    pub fn new(
        path: &Path,
        text: &str,
        span: Range<usize>,
        message: impl fmt::Display,
        help: impl Into<String>,
    ) -> Self {
        let span = shown_span(text, span);
        if excerpt_length(text, &span) > EXCERPT_MAX {
            let (line, column) = line_and_column(text, span.start);
            return Self::without_excerpt(
                path,
                format_args!("line {line}, column {column}: {message}"),
                help,
            );
        }
        Self(Box::new(Report {
            message: printable(&message.to_string()),
            help: printable(&help.into()),
            excerpt: Some(Excerpt {
                source: NamedSource::new(printable(&path.display().to_string()), text.to_owned()),
                span: span.into(),
            }),
        }))
    }

    /// An error in the file as a whole, or in a file without text.
    #[must_use]
    pub fn without_excerpt(
        path: &Path,
        message: impl fmt::Display,
        help: impl Into<String>,
    ) -> Self {
        Self(Box::new(Report {
            message: printable(&format!("{}: {message}", path.display())),
            help: printable(&help.into()),
            excerpt: None,
        }))
    }
}

impl BadInput {
    /// The error for a terminal: message, excerpt with the place marked, and help.
    #[must_use]
    pub fn rendered(&self) -> String {
        let mut text = String::new();
        match GraphicalReportHandler::new().render_report(&mut text, self) {
            Ok(()) => text,
            Err(fmt::Error) => format!("Error: {self}\n"),
        }
    }
}

impl Diagnostic for BadInput {
    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        Some(Box::new(&self.0.help))
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.0
            .excerpt
            .as_ref()
            .map(|excerpt| &excerpt.source as &dyn SourceCode)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let excerpt = self.0.excerpt.as_ref()?;
        let label = LabeledSpan::new_primary_with_span(Some("here".into()), excerpt.span);
        Some(Box::new(std::iter::once(label)))
    }
}

/// Escapes control characters, except line feeds, which a terminal would interpret.
fn printable(text: &str) -> String {
    let mut shown = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '\n' => shown.push(c),
            c if c.is_control() => shown.extend(c.escape_default()),
            c => shown.push(c),
        }
    }
    shown
}

/// The text of a file of at most [`FILE_SIZE_MAX`] bytes, without a byte order mark.
///
/// # Errors
///
/// If the file is missing, not a regular file, unreadable, too large, not UTF-8, empty, or has control characters other than
/// tabs and line ends.
pub fn read_text(path: &Path) -> Result<String, BadInput> {
    decode_text(path, read_bytes(path, FILE_SIZE_MAX)?)
}

/// Decodes a file's bytes as [`read_text`] does. Errors name `path`.
///
/// # Errors
///
/// If the bytes are not UTF-8, are blank, or have control characters.
pub fn decode_text(path: &Path, bytes: Vec<u8>) -> Result<String, BadInput> {
    let text = String::from_utf8(bytes).map_err(|error| {
        let place = error.utf8_error().valid_up_to();
        not_text(path, format_args!("byte {place} is not UTF-8"))
    })?;
    if let Some((place, _)) = text.char_indices().find(|(_, c)| is_binary(*c)) {
        let problem = format_args!("byte {place} is a control character");
        return Err(not_text(path, problem));
    }
    if text.trim().is_empty() {
        return Err(BadInput::without_excerpt(
            path,
            "the file is empty",
            "check that the file was saved and that the path is right",
        ));
    }
    Ok(match text.strip_prefix('\u{feff}') {
        Some(rest) => rest.to_owned(),
        None => text,
    })
}

/// The content of a regular file of at most `size_max` bytes.
pub(crate) fn read_bytes(path: &Path, size_max: u64) -> Result<Vec<u8>, BadInput> {
    let unreadable = |error: io::Error| match error.kind() {
        io::ErrorKind::NotFound => BadInput::without_excerpt(
            path,
            format_args!("there is no such file{}", did_you_mean_file(path)),
            "check the path; a relative path starts at the current directory",
        ),
        _ => BadInput::without_excerpt(
            path,
            format_args!("the file can't be read: {error}"),
            "give a file that the current user can read",
        ),
    };
    let metadata = std::fs::metadata(path).map_err(unreadable)?;
    if metadata.is_dir() {
        return Err(BadInput::without_excerpt(
            path,
            "this is a directory",
            "give the path of a file in it",
        ));
    }
    if !metadata.is_file() {
        return Err(BadInput::without_excerpt(
            path,
            "this is not a regular file",
            "give the path of a file on a disk",
        ));
    }
    let too_large = || {
        BadInput::without_excerpt(
            path,
            format_args!("the file is larger than {size_max} bytes"),
            "check that the path is right",
        )
    };
    if metadata.len() > size_max {
        return Err(too_large());
    }
    let mut bytes = Vec::new();
    File::open(path)
        .and_then(|file| file.take(size_max + 1).read_to_end(&mut bytes))
        .map_err(unreadable)?;
    if bytes.len() as u64 > size_max {
        return Err(too_large());
    }
    Ok(bytes)
}

fn not_text(path: &Path, problem: impl fmt::Display) -> BadInput {
    BadInput::without_excerpt(
        path,
        format_args!("this is not a text file: {problem}"),
        "give a text file, saved as UTF-8",
    )
}

fn is_binary(c: char) -> bool {
    c.is_control() && !matches!(c, '\t' | '\n' | '\r')
}

/// The part of a span on its first line, inside the text and at character boundaries.
fn shown_span(text: &str, span: Range<usize>) -> Range<usize> {
    let boundary_from = |place: usize| {
        (place..text.len())
            .find(|place| text.is_char_boundary(*place))
            .unwrap_or(text.len())
    };
    let start = boundary_from(span.start);
    let end = boundary_from(span.end).max(start);
    let first_line = text[start..end].lines().next().unwrap_or_default();
    start..start + first_line.len()
}

/// Bytes in the lines before, at and after a span's start.
fn excerpt_length(text: &str, span: &Range<usize>) -> usize {
    let before: usize = text[..span.start].rsplit('\n').take(2).map(str::len).sum();
    let after: usize = text[span.start..].split('\n').take(2).map(str::len).sum();
    before + after
}

/// Line and column of a byte offset, from 1; the column counts characters.
fn line_and_column(text: &str, place: usize) -> (usize, usize) {
    let before = &text[..place];
    let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
    let line = before.matches('\n').count() + 1;
    (line, before[line_start..].chars().count() + 1)
}

#[cfg(test)]
pub(crate) mod tests;
