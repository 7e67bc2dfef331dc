//! JSON values with their places in the file.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::ops::Range;

use serde::de::{DeserializeOwned, Error, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};
use serde_json::value::RawValue;

use super::document::{Document, Parsed, quoted};
use crate::diagnostic::BadInput;

const SAVE_AGAIN: &str = "save the plan again with QGroundControl 4, or add the field";

/// An unparsed value of a JSON document.
#[derive(Debug)]
pub(super) struct Node<'a> {
    document: Document<'a>,
    text: &'a str,
    path: String,
}

/// The fields of a JSON object.
#[derive(Debug)]
pub(super) struct Object<'a> {
    node: Node<'a>,
    fields: BTreeMap<String, &'a RawValue>,
}

impl<'a> Node<'a> {
    /// The whole document, if it is JSON and no object has two fields of the same name.
    pub(super) fn root(document: Document<'a>) -> Result<Self, BadInput> {
        let raw: &RawValue =
            serde_json::from_str(document.text).map_err(|error| not_json(document, &error))?;
        let distinct: Result<Distinct, _> = serde_json::from_str(document.text);
        // Other errors, such as a number too large for an `f64`, matter only if the value is needed.
        if let Err(error) = distinct
            && error.is_data()
        {
            return Err(not_distinct(document, &error));
        }
        Ok(Self {
            document,
            text: raw.get(),
            path: String::new(),
        })
    }

    /// Path of the value: `mission.items[3].frame`. Empty for the root.
    pub(super) fn path(&self) -> &str {
        &self.path
    }

    /// The text for errors at this value: its opening bracket, or the whole scalar.
    pub(super) fn pointer(&self) -> &'a str {
        match self.text.as_bytes() {
            [b'{' | b'[', ..] => &self.text[..1],
            _ => self.text,
        }
    }

    pub(super) fn object(self) -> Result<Object<'a>, BadInput> {
        match serde_json::from_str(self.text) {
            Ok(fields) => Ok(Object { node: self, fields }),
            Err(_) => Err(self.expected("an object")),
        }
    }

    /// The elements of an array of at most `max`.
    pub(super) fn elements(&self, max: usize) -> Result<Vec<Node<'a>>, BadInput> {
        let elements: Vec<&'a RawValue> =
            serde_json::from_str(self.text).map_err(|_| self.expected("an array"))?;
        if elements.len() > max {
            return Err(self.document.refuse(
                self.pointer(),
                format_args!("`{}` has {} values", self.path, elements.len()),
                format!("at most {max} are accepted"),
            ));
        }
        let element = |(index, raw): (usize, &&'a RawValue)| Node {
            document: self.document,
            text: raw.get(),
            path: format!("{}[{index}]", self.path),
        };
        Ok(elements.iter().enumerate().map(element).collect())
    }

    /// A finite number. `None` for `null`, which stands for `NaN`.
    pub(super) fn number_or_null(&self) -> Result<Parsed<'a, Option<f64>>, BadInput> {
        self.scalar("a finite number")
    }

    /// A command, frame or version number.
    pub(super) fn code(&self) -> Result<Parsed<'a, u16>, BadInput> {
        self.scalar("a whole number from 0 to 65535")
    }

    pub(super) fn boolean(&self) -> Result<Parsed<'a, bool>, BadInput> {
        self.scalar("`true` or `false`")
    }

    pub(super) fn string(&self) -> Result<Parsed<'a, String>, BadInput> {
        self.scalar("a string")
    }

    fn scalar<T: DeserializeOwned>(&self, accepted: &str) -> Result<Parsed<'a, T>, BadInput> {
        let value = serde_json::from_str(self.text).map_err(|_| self.expected(accepted))?;
        Ok(Parsed {
            value,
            text: self.text,
        })
    }

    fn expected(&self, accepted: &str) -> BadInput {
        let message = match self.text.as_bytes() {
            [b'{', ..] => format!("`{}` is an object", self.path),
            [b'[', ..] => format!("`{}` is an array", self.path),
            _ => format!("`{}` is {}", self.path, quoted(self.text)),
        };
        let help = format!("`{}` must be {accepted}", self.path);
        self.document.refuse(self.pointer(), message, help)
    }
}

impl<'a> Object<'a> {
    pub(super) fn node(&self) -> &Node<'a> {
        &self.node
    }

    /// A required field.
    pub(super) fn field(&self, name: &str) -> Result<Node<'a>, BadInput> {
        self.optional_field(name).ok_or_else(|| {
            let message = format_args!("`{}` is missing", self.path_of(name));
            let pointer = self.node.pointer();
            self.node.document.refuse(pointer, message, SAVE_AGAIN)
        })
    }

    /// An optional field.
    pub(super) fn optional_field(&self, name: &str) -> Option<Node<'a>> {
        Some(Node {
            document: self.node.document,
            text: self.fields.get(name)?.get(),
            path: self.path_of(name),
        })
    }

    fn path_of(&self, name: &str) -> String {
        match self.node.path.as_str() {
            "" => name.to_owned(),
            parent => format!("{parent}.{name}"),
        }
    }
}

/// A document without duplicate fields, of which programs take either the first or the last.
struct Distinct;

impl<'de> Deserialize<'de> for Distinct {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Self)
    }
}

impl<'de> Visitor<'de> for Distinct {
    type Value = Self;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("JSON")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self, A::Error> {
        let mut names = BTreeSet::new();
        while let Some(name) = map.next_key::<String>()? {
            if names.contains(&name) {
                return Err(A::Error::custom(format_args!("`{name}` is given twice")));
            }
            names.insert(name);
            map.next_value::<Self>()?;
        }
        Ok(self)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Self, A::Error> {
        while seq.next_element::<Self>()?.is_some() {}
        Ok(self)
    }

    fn visit_bool<E>(self, _: bool) -> Result<Self, E> {
        Ok(self)
    }

    fn visit_i64<E>(self, _: i64) -> Result<Self, E> {
        Ok(self)
    }

    fn visit_u64<E>(self, _: u64) -> Result<Self, E> {
        Ok(self)
    }

    fn visit_f64<E>(self, _: f64) -> Result<Self, E> {
        Ok(self)
    }

    fn visit_str<E>(self, _: &str) -> Result<Self, E> {
        Ok(self)
    }

    fn visit_unit<E>(self) -> Result<Self, E> {
        Ok(self)
    }
}

fn not_distinct(document: Document<'_>, error: &serde_json::Error) -> BadInput {
    document.refuse_at(
        byte_at(document, error),
        problem(error),
        "remove one of them",
    )
}

/// An error's message without its place.
fn problem(error: &serde_json::Error) -> String {
    let place = format!(" at line {} column {}", error.line(), error.column());
    let described = error.to_string();
    match described.strip_suffix(&place) {
        Some(problem) => problem.to_owned(),
        None => described,
    }
}

fn not_json(document: Document<'_>, error: &serde_json::Error) -> BadInput {
    let problem = problem(error);
    if error.is_eof() {
        return document.refuse(
            document.end(),
            format_args!("the file ends inside its JSON: {problem}"),
            "the file is incomplete: save or copy it again",
        );
    }
    document.refuse_at(
        byte_at(document, error),
        format_args!("this is not JSON: {problem}"),
        "give a `.plan` saved by QGroundControl",
    )
}

/// The byte of an error. serde_json's column counts bytes from one.
fn byte_at(document: Document<'_>, error: &serde_json::Error) -> Range<usize> {
    let start = document.line_start(error.line()) + error.column().saturating_sub(1);
    start..start + 1
}
