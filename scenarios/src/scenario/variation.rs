use std::fmt;
use std::str::FromStr;

use super::Override;

/// A field of a scenario and the values that it takes in turn: at least one, without duplicates.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Variation {
    values: Vec<Override>,
}

impl Variation {
    /// A field and its values, each as it is given to `--set`. A value may be a list, such as `[{ north_m = 1 }]`.
    ///
    /// # Errors
    /// If there is no such field, there are no values, or one is there twice.
    pub fn new(key: &str, list: &[impl AsRef<str>]) -> Result<Self, String> {
        let mut values: Vec<Override> = Vec::new();
        for value in list.iter().map(AsRef::as_ref) {
            if value.is_empty() {
                return Err(format!("`{key}` has an empty value; use key=value,value"));
            }
            let value: Override = format!("{key}={value}").parse()?;
            if values.contains(&value) {
                return Err(format!("`{key}` has the value {} twice", value.value()));
            }
            values.push(value);
        }
        match values.first() {
            None => Err(format!("`{key}` has no values")),
            Some(first) if first.is_seed() => {
                Err("`seed` can't be varied; use --seeds, as in --seeds 0..100".to_owned())
            }
            Some(_) => Ok(Self { values }),
        }
    }

    /// The same values, given by the scenario file: paths in them start at the file's folder.
    #[must_use]
    pub(super) fn in_file(self) -> Self {
        let values = self.values.into_iter().map(Override::in_file).collect();
        Self { values }
    }

    /// The field with its table, such as `radio.loss`.
    #[must_use]
    pub fn key(&self) -> &str {
        self.values[0].key()
    }

    /// The values in their given order.
    #[must_use]
    pub fn values(&self) -> &[Override] {
        &self.values
    }
}

impl fmt::Display for Variation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let values: Vec<_> = self.values.iter().map(Override::value).collect();
        write!(f, "{}={}", self.key(), values.join(","))
    }
}

impl FromStr for Variation {
    type Err = String;

    /// Parses `key=v1,v2,…`. The key includes its table; a value has no comma.
    fn from_str(text: &str) -> Result<Self, String> {
        let (key, list) = text.split_once('=').ok_or_else(|| {
            format!("`{text}` has no `=`; use key=value,value, as in radio.loss=0,0.1")
        })?;
        let values: Vec<_> = list.split(',').map(str::trim).collect();
        Self::new(key, &values)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_keep_their_order_without_spaces() {
        let variation: Variation = "radio.loss = 0.2, 0,0.1".parse().unwrap();
        assert_eq!(variation.key(), "radio.loss");
        assert_eq!(variation.to_string(), "radio.loss=0.2,0,0.1");
        assert_eq!(variation.to_string().parse(), Ok(variation));
    }

    #[test]
    fn value_may_be_a_list() {
        let relay = "[{ north_m = 1, east_m = 2, altitude_m = 3 }]";
        let variation = Variation::new("relays", &["[]", relay]).unwrap();
        assert_eq!(variation.values()[1].to_string(), format!("relays={relay}"));
        let none: [&str; 0] = [];
        assert!(Variation::new("relays", &none).is_err());
    }

    #[test]
    fn variation_without_values_or_of_an_unknown_field_is_refused() {
        for text in [
            "",
            "radio.loss",
            "radio.loss=",
            "radio.loss=0,",
            "radio.loss=,0",
            "radio.loss=0,0",
            "loss=0,1",
            "seed=1,2",
            "faults.at_s=1",
        ] {
            assert!(text.parse::<Variation>().is_err(), "{text}");
        }
    }
}
