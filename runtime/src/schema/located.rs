//! Values of a TOML file with their place in it.

use std::borrow::Cow;
use std::fmt;
use std::marker::PhantomData;
use std::ops::{Deref, Range};

use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::de::{Error as _, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::read::LOCATED;

/// A value that is in the file, with its place. In a JSON Schema, and where it is written, it is the value alone.
#[derive(Debug, Clone)]
pub struct Located<T> {
    value: T,
    span: Range<usize>,
}

impl<T> Located<T> {
    /// The place in the file, in bytes.
    pub fn span(&self) -> Range<usize> {
        self.span.clone()
    }

    /// The value.
    pub const fn get_ref(&self) -> &T {
        &self.value
    }

    /// The value, to be replaced.
    pub const fn get_mut(&mut self) -> &mut T {
        &mut self.value
    }

    /// The value alone.
    pub fn into_inner(self) -> T {
        self.value
    }
}

/// A value that is to be written; it has no place yet.
impl<T> From<T> for Located<T> {
    fn from(value: T) -> Self {
        Self { value, span: 0..0 }
    }
}

/// The default of a field that is not in the file.
impl<T: Default> Default for Located<T> {
    fn default() -> Self {
        T::default().into()
    }
}

impl<T: Serialize> Serialize for Located<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.value.serialize(serializer)
    }
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Located<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_newtype_struct(LOCATED, Parts(PhantomData))
    }
}

/// Reads start, end and value.
struct Parts<T>(PhantomData<T>);

impl<'de, T: Deserialize<'de>> Visitor<'de> for Parts<T> {
    type Value = Located<T>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a value with its place")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut parts: A) -> Result<Located<T>, A::Error> {
        let missing = || A::Error::custom("a value without its place");
        let start = parts.next_element()?.ok_or_else(missing)?;
        let end = parts.next_element()?.ok_or_else(missing)?;
        Ok(Located {
            value: parts.next_element()?.ok_or_else(missing)?,
            span: start..end,
        })
    }
}

impl<T: JsonSchema> JsonSchema for Located<T> {
    fn inline_schema() -> bool {
        T::inline_schema()
    }

    fn schema_name() -> Cow<'static, str> {
        T::schema_name()
    }

    fn schema_id() -> Cow<'static, str> {
        T::schema_id()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        T::json_schema(generator)
    }
}

/// A number that can be made from a fraction.
pub trait FromRatio {
    /// `numerator / denominator`.
    fn from_ratio(numerator: u64, denominator: u64) -> Self;
}

/// A number of the file, or the default `N / D` if the file has none. Fields of this type need `#[serde(default)]`.
#[derive(Debug, Clone)]
pub struct Or<T, const N: u64, const D: u64 = 1> {
    value: T,
    span: Option<Range<usize>>,
}

impl<T, const N: u64, const D: u64> Or<T, N, D> {
    /// The place in the file; `None` if this is the default.
    #[must_use]
    pub fn span(&self) -> Option<Range<usize>> {
        self.span.clone()
    }

    /// The number.
    pub const fn get_ref(&self) -> &T {
        &self.value
    }
}

impl<T, const N: u64, const D: u64> Deref for Or<T, N, D> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.value
    }
}

impl<T: FromRatio, const N: u64, const D: u64> Default for Or<T, N, D> {
    fn default() -> Self {
        Self {
            value: T::from_ratio(N, D),
            span: None,
        }
    }
}

impl<'de, T: Deserialize<'de>, const N: u64, const D: u64> Deserialize<'de> for Or<T, N, D> {
    fn deserialize<F: Deserializer<'de>>(deserializer: F) -> Result<Self, F::Error> {
        let value = Located::<T>::deserialize(deserializer)?;
        Ok(Self {
            span: Some(value.span()),
            value: value.into_inner(),
        })
    }
}

/// The number alone, also as the default in a JSON Schema.
impl<T: Serialize, const N: u64, const D: u64> Serialize for Or<T, N, D> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.value.serialize(serializer)
    }
}

impl<T: JsonSchema, const N: u64, const D: u64> JsonSchema for Or<T, N, D> {
    fn inline_schema() -> bool {
        T::inline_schema()
    }

    fn schema_name() -> Cow<'static, str> {
        T::schema_name()
    }

    fn schema_id() -> Cow<'static, str> {
        T::schema_id()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        T::json_schema(generator)
    }
}
