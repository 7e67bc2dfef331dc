//! Reads TOML into the structures that declare a kind of file, with the place of each value.
//!
//! All values, keys and places come from one type of deserializer, so each structure is compiled once. With the one of the
//! `toml` crate it would be three times.

use std::fmt;
use std::ops::Range;
use std::slice;

use serde::de::value::StrDeserializer;
use serde::de::{
    DeserializeOwned, DeserializeSeed, Deserializer, Error as _, IntoDeserializer as _, MapAccess,
    SeqAccess, Unexpected, Visitor,
};
use serde::forward_to_deserialize_any;
use toml::Spanned;
use toml::de::{DeFloat, DeInteger, DeString, DeTable, DeValue};

/// The name of a newtype that asks for the place of its value, too: start, end and value, as a sequence.
pub(super) const LOCATED: &str = "$muster::Located";

/// Why a text can't be read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ReadError {
    message: String,
    span: Option<Range<usize>>,
}

impl ReadError {
    /// What is wrong.
    #[must_use]
    pub fn message(&self) -> &str {
        &self.message
    }

    /// The place in the text, in bytes; its start if the error concerns the whole text.
    #[must_use]
    pub fn span(&self) -> Range<usize> {
        self.span.clone().unwrap_or_default()
    }

    /// The same error, at `span` unless it has a place.
    fn at(mut self, span: Range<usize>) -> Self {
        self.span.get_or_insert(span);
        self
    }
}

impl fmt::Display for ReadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for ReadError {}

impl serde::de::Error for ReadError {
    fn custom<M: fmt::Display>(message: M) -> Self {
        Self {
            message: message.to_string(),
            span: None,
        }
    }
}

/// Reads a TOML text.
///
/// # Errors
/// If it is not TOML, or has wrong fields or values. The error is one line.
pub fn from_toml<T: DeserializeOwned>(text: &str) -> Result<T, ReadError> {
    let read = || {
        let table = DeTable::parse(text).map_err(|error| ReadError {
            message: error.message().to_owned(),
            span: error.span(),
        })?;
        let root = DeValue::Table(table.into_inner());
        T::deserialize(Node {
            what: What::Value(&root),
            span: 0..0,
        })
    };
    read().map_err(|error| ReadError {
        message: error.message.trim().replace('\n', ", "),
        ..error
    })
}

/// A value, a key or a place, with its place in the text.
struct Node<'a> {
    what: What<'a>,
    span: Range<usize>,
}

enum What<'a> {
    Value(&'a DeValue<'a>),
    Key(&'a str),
    Place(usize),
}

impl<'a> Node<'a> {
    fn of(value: &'a Spanned<DeValue<'a>>) -> Self {
        Self {
            what: What::Value(value.get_ref()),
            span: value.span(),
        }
    }

    fn visit<'de, V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, ReadError> {
        let value = match self.what {
            What::Value(value) => value,
            What::Key(key) => return visitor.visit_str(key),
            What::Place(place) => return visitor.visit_u64(place as u64),
        };
        match value {
            DeValue::String(text) => visitor.visit_str(text),
            DeValue::Integer(number) => visit_whole(number, visitor),
            DeValue::Float(number) => visitor.visit_f64(fraction(number)?),
            DeValue::Boolean(it) => visitor.visit_bool(*it),
            DeValue::Datetime(_) => {
                Err(ReadError::invalid_type(Unexpected::Other("date"), &visitor))
            }
            DeValue::Array(values) => visitor.visit_seq(Items::Values(values.iter())),
            DeValue::Table(table) => visitor.visit_map(Entries {
                entries: table.iter(),
                value: None,
            }),
        }
    }
}

fn visit_whole<'de, V: Visitor<'de>>(
    number: &DeInteger<'_>,
    visitor: V,
) -> Result<V::Value, ReadError> {
    let (digits, radix) = (number.as_str(), number.radix());
    if let Ok(number) = i64::from_str_radix(digits, radix) {
        visitor.visit_i64(number)
    } else if let Ok(number) = u64::from_str_radix(digits, radix) {
        visitor.visit_u64(number)
    } else if let Ok(number) = i128::from_str_radix(digits, radix) {
        // No field is as large: the error names the number.
        visitor.visit_i128(number)
    } else {
        Err(ReadError::custom("integer number overflowed"))
    }
}

fn fraction(number: &DeFloat<'_>) -> Result<f64, ReadError> {
    let overflowed = || ReadError::custom("floating-point number overflowed");
    let fraction: f64 = number.as_str().parse().map_err(|_| overflowed())?;
    if fraction.is_infinite() && !number.as_str().contains("inf") {
        return Err(overflowed());
    }
    Ok(fraction)
}

impl<'de> Deserializer<'de> for Node<'_> {
    type Error = ReadError;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, ReadError> {
        let span = self.span.clone();
        self.visit(visitor).map_err(|error| error.at(span))
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, ReadError> {
        // A field that is left out is not visited.
        visitor.visit_some(self)
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        name: &'static str,
        visitor: V,
    ) -> Result<V::Value, ReadError> {
        if name == LOCATED {
            visitor.visit_seq(Items::Located(Some(self), 0))
        } else {
            visitor.visit_newtype_struct(self)
        }
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _: &'static str,
        _: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, ReadError> {
        let name = match self.what {
            What::Value(DeValue::String(name)) => &**name,
            What::Key(name) => name,
            _ => return Err(ReadError::custom("wanted a string").at(self.span)),
        };
        let name: StrDeserializer<'_, ReadError> = name.into_deserializer();
        visitor
            .visit_enum(name)
            .map_err(|error| error.at(self.span))
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf unit unit_struct seq tuple
        tuple_struct map struct identifier ignored_any
    }
}

/// The values of a list, or a located value while it is read.
enum Items<'a> {
    Values(slice::Iter<'a, Spanned<DeValue<'a>>>),
    /// The value until it is taken, and the number of entries read.
    Located(Option<Node<'a>>, u8),
}

impl<'a> Items<'a> {
    fn next(&mut self) -> Option<Node<'a>> {
        match self {
            Self::Values(values) => values.next().map(Node::of),
            Self::Located(value, taken) => {
                let Range { start, end } = value.as_ref()?.span;
                *taken += 1;
                let what = match taken {
                    1 => What::Place(start),
                    2 => What::Place(end),
                    _ => return value.take(),
                };
                Some(Node {
                    what,
                    span: start..end,
                })
            }
        }
    }
}

impl<'de> SeqAccess<'de> for Items<'_> {
    type Error = ReadError;

    fn next_element_seed<S: DeserializeSeed<'de>>(
        &mut self,
        seed: S,
    ) -> Result<Option<S::Value>, ReadError> {
        self.next().map(|node| deserialize(node, seed)).transpose()
    }
}

/// The fields of a table.
struct Entries<'a> {
    entries: toml::map::Iter<'a, Spanned<DeString<'a>>, Spanned<DeValue<'a>>>,
    /// The value of the last key.
    value: Option<Node<'a>>,
}

impl<'de> MapAccess<'de> for Entries<'_> {
    type Error = ReadError;

    fn next_key_seed<S: DeserializeSeed<'de>>(
        &mut self,
        seed: S,
    ) -> Result<Option<S::Value>, ReadError> {
        let Some((key, value)) = self.entries.next() else {
            return Ok(None);
        };
        self.value = Some(Node::of(value));
        let key = Node {
            what: What::Key(key.get_ref()),
            span: key.span(),
        };
        deserialize(key, seed).map(Some)
    }

    fn next_value_seed<S: DeserializeSeed<'de>>(&mut self, seed: S) -> Result<S::Value, ReadError> {
        let value = self.value.take();
        deserialize(value.expect("a value follows its key"), seed)
    }
}

fn deserialize<'de, S: DeserializeSeed<'de>>(
    node: Node<'_>,
    seed: S,
) -> Result<S::Value, ReadError> {
    let span = node.span.clone();
    seed.deserialize(node).map_err(|error| error.at(span))
}

#[cfg(test)]
mod tests {
    use serde::Deserialize;

    use super::*;
    use crate::schema::Located;

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct File {
        #[serde(default)]
        share: f64,
        name: Option<Located<String>>,
        #[serde(default)]
        tables: Vec<Located<Table>>,
        #[serde(default)]
        numbers: Vec<i64>,
    }

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Table {
        level: Option<Level>,
    }

    #[derive(Debug, PartialEq, Deserialize)]
    #[serde(rename_all = "lowercase")]
    enum Level {
        Low,
    }

    #[test]
    fn values_have_their_place_in_the_text() {
        let text =
            "share = 0.5\nname = \"x\"\nnumbers = [1, -2, 0xff]\n[[tables]]\nlevel = \"low\"\n";
        let file: File = from_toml(text).unwrap();
        assert_eq!(&text[file.name.unwrap().span()], "\"x\"");
        assert_eq!(&text[file.tables[0].span()], "[[tables]]");
        assert_eq!(file.tables[0].get_ref().level, Some(Level::Low));
        assert_eq!(file.numbers, [1, -2, 255]);
        assert!((file.share - 0.5).abs() < f64::EPSILON);
    }

    /// Messages and places are those of the `toml` crate.
    #[test]
    fn errors_are_those_of_the_toml_crate() {
        #[derive(Debug, Deserialize)]
        #[serde(deny_unknown_fields)]
        #[expect(dead_code, reason = "read only")]
        struct Plain {
            #[serde(default)]
            share: f64,
            name: Option<String>,
            #[serde(default)]
            tables: Vec<Table>,
            #[serde(default)]
            numbers: Vec<i64>,
        }
        for (text, message) in [
            ("share = ", "string values must be quoted"),
            ("share = \"x\"", "invalid type: string \"x\", expected f64"),
            ("share = [1]", "invalid type: sequence, expected f64"),
            ("shore = 1", "unknown field `shore`"),
            (
                "numbers = [1, true]",
                "invalid type: boolean `true`, expected i64",
            ),
            ("numbers = [99999999999999999999]", "99999999999999999999"),
            ("share = 1e999", "floating-point number overflowed"),
            ("[[tables]]\nlevel = \"high\"", "unknown variant `high`"),
            ("[[tables]]\nlavel = 3", "unknown field `lavel`"),
            ("name = 1\nname = 2", "duplicate key"),
        ] {
            let ours = from_toml::<File>(text).unwrap_err();
            let theirs = toml::from_str::<Plain>(text).unwrap_err();
            assert!(ours.message().contains(message), "{text}: {ours}");
            assert_eq!(ours.message(), theirs.message(), "{text}");
            assert_eq!(Some(ours.span()), theirs.span(), "{text}");
        }
    }
}
