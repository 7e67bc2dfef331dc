//! The part of YAML that maps use: one mapping of keys to scalars and nested lists of scalars, with the place of each.
//!
//! Aliases are refused: a few lines of them stand for any amount of data.

use std::ops::Range;

use saphyr_parser::{Event, Parser, ScanError, Span};

use crate::refusal::Refusal;

/// Most scalars of a document.
const SCALARS_MAX: usize = 10_000;
/// Lists in lists: a keep-out zone is a list of corners in a list of zones.
const DEPTH_MAX: usize = 3;

/// A scalar or a list, and where it is, in bytes of the text.
pub(super) struct Value {
    pub(super) span: Range<usize>,
    pub(super) content: Content,
}

pub(super) enum Content {
    Scalar(String),
    List(Vec<Value>),
}

/// A key and its value.
pub(super) struct Entry {
    pub(super) key: String,
    pub(super) key_span: Range<usize>,
    pub(super) value: Value,
}

/// Parses a document. Keys may repeat.
pub(super) fn parse(text: &str) -> Result<Vec<Entry>, Refusal> {
    let mut reader = Reader {
        events: Parser::new_from_str(text),
        places: text.char_indices().map(|(place, _)| place).collect(),
        length: text.len(),
        scalars: 0,
    };
    reader.document()
}

struct Reader<'a> {
    events: Parser<'a, saphyr_parser::StrInput<'a>>,
    /// The byte at which each character begins.
    places: Vec<usize>,
    length: usize,
    scalars: usize,
}

impl<'a> Reader<'a> {
    fn document(&mut self) -> Result<Vec<Entry>, Refusal> {
        loop {
            match self.next()? {
                (Event::StreamStart | Event::DocumentStart(_) | Event::Nothing, _) => {}
                (Event::MappingStart(..), _) => break,
                (_, span) => {
                    return Err(Refusal::new(
                        span,
                        "this is no list of fields",
                        "a map begins with a line like `image: floor.pgm`",
                    ));
                }
            }
        }
        let mut entries = Vec::new();
        loop {
            let (key, key_span) = match self.next()? {
                (Event::MappingEnd, _) => break,
                (Event::Scalar(key, ..), span) => (key.into_owned(), span),
                (_, span) => {
                    return Err(Refusal::new(
                        span,
                        "this is no name of a field",
                        "names are plain text",
                    ));
                }
            };
            let (event, span) = self.next()?;
            let value = self.value(event, span, 0)?;
            entries.push(Entry {
                key,
                key_span,
                value,
            });
        }
        self.end()?;
        Ok(entries)
    }

    fn end(&mut self) -> Result<(), Refusal> {
        loop {
            match self.next()? {
                (Event::DocumentEnd, _) => {}
                (Event::StreamEnd, _) => return Ok(()),
                (_, span) => {
                    return Err(Refusal::new(
                        span,
                        "the file has a second document",
                        "one map a file",
                    ));
                }
            }
        }
    }

    fn value(
        &mut self,
        event: Event<'a>,
        span: Range<usize>,
        depth: usize,
    ) -> Result<Value, Refusal> {
        self.scalars += 1;
        if self.scalars > SCALARS_MAX {
            let message = format!("the file has more than {SCALARS_MAX} values");
            return Err(Refusal::new(span, message, "fewer corners of zones"));
        }
        match event {
            Event::Scalar(text, ..) => Ok(Value {
                span,
                content: Content::Scalar(text.into_owned()),
            }),
            Event::SequenceStart(..) if depth < DEPTH_MAX => self.list(span, depth),
            Event::SequenceStart(..) => Err(Refusal::new(
                span,
                "this list is nested too deeply",
                "a list of zones, which are lists of corners [x, y]",
            )),
            Event::MappingStart(..) => Err(Refusal::new(
                span,
                "fields have no fields of their own",
                "a value or a list",
            )),
            Event::Alias(_) => Err(Refusal::new(
                span,
                "aliases are not accepted",
                "write the value itself",
            )),
            _ => Err(Refusal::new(
                span,
                "a value is missing",
                "a value or a list",
            )),
        }
    }

    fn list(&mut self, start: Range<usize>, depth: usize) -> Result<Value, Refusal> {
        let mut values = Vec::new();
        loop {
            match self.next()? {
                (Event::SequenceEnd, span) => {
                    return Ok(Value {
                        span: start.start..span.end,
                        content: Content::List(values),
                    });
                }
                (event, span) => values.push(self.value(event, span, depth + 1)?),
            }
        }
    }

    fn next(&mut self) -> Result<(Event<'a>, Range<usize>), Refusal> {
        match self.events.next_event() {
            Some(Ok((event, span))) => {
                let span = self.bytes(span);
                Ok((event, span))
            }
            Some(Err(error)) => Err(self.malformed(&error)),
            None => Err(Refusal::new(
                self.length..self.length,
                "the file ends too early",
                "a complete YAML document",
            )),
        }
    }

    fn malformed(&self, error: &ScanError) -> Refusal {
        let place = self.byte(error.marker().index());
        let message = format!("this is no YAML: {}", error.info());
        Refusal::new(place..place, message, "lines like `resolution: 0.05`")
    }

    fn bytes(&self, span: Span) -> Range<usize> {
        let start = self.byte(span.start.index());
        start..self.byte(span.end.index()).max(start)
    }

    fn byte(&self, character: usize) -> usize {
        self.places.get(character).copied().unwrap_or(self.length)
    }
}
