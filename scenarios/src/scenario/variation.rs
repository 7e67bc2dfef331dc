use std::fmt;
use std::str::FromStr;

use toml::Value;

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
            if let Some(earlier) = values.iter().find(|it| is_same(it.value(), value.value())) {
                let (earlier, value) = (earlier.value(), value.value());
                return Err(match earlier == value {
                    true => format!("`{key}` has the value {value} twice"),
                    false => format!("`{key}` has the value {value} twice: {earlier} is the same"),
                });
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

    /// Parses `key=v1,v2,…`. The key includes its table. A comma within brackets, braces or quotes belongs to its value.
    fn from_str(text: &str) -> Result<Self, String> {
        let (key, list) = text.split_once('=').ok_or_else(|| {
            format!("`{text}` has no `=`; use key=value,value, as in radio.loss=0,0.1")
        })?;
        let values = split(list).map_err(|open| {
            format!("`{text}` has an unclosed {open}; use key=value,value, as in relays=[],[{{ north_m = 1 }}]")
        })?;
        Self::new(key, &values)
    }
}

/// The values between the commas that are not within brackets, braces or quotes. A value that does not begin with one of
/// these has none: it is a number or a name. `Err` is what is not closed.
fn split(list: &str) -> Result<Vec<&str>, char> {
    let mut values = Vec::new();
    let (mut from, mut quote, mut is_escaped) = (0, None, false);
    let mut open: Vec<char> = Vec::new();
    for (at, c) in list.char_indices() {
        if let Some(end) = quote {
            let is_end = c == end && !is_escaped;
            is_escaped = c == '\\' && end == '"' && !is_escaped;
            if is_end {
                quote = None;
            }
            continue;
        }
        let may_open = !open.is_empty() || list[from..at].trim().is_empty();
        match c {
            '"' | '\'' if may_open => quote = Some(c),
            '[' | '{' if may_open => open.push(c),
            ']' | '}' => {
                open.pop();
            }
            ',' if open.is_empty() => {
                values.push(list[from..at].trim());
                from = at + 1;
            }
            _ => {}
        }
    }
    if let Some(unclosed) = quote.or(open.pop()) {
        return Err(unclosed);
    }
    values.push(list[from..].trim());
    Ok(values)
}

/// Whether two texts are the same value of a field: 0.1 and 0.10, or 1 and 1.0.
fn is_same(a: &str, b: &str) -> bool {
    let value = |text: &str| {
        let table: Option<toml::Table> = toml::from_str(&format!("value = {text}")).ok();
        let value = table.and_then(|mut it| it.remove("value"));
        value.unwrap_or_else(|| Value::String(text.to_owned()))
    };
    are_equal(&value(a), &value(b))
}

fn are_equal(a: &Value, b: &Value) -> bool {
    match (a, b) {
        (Value::Array(a), Value::Array(b)) => {
            a.len() == b.len() && a.iter().zip(b).all(|(a, b)| are_equal(a, b))
        }
        (Value::Table(a), Value::Table(b)) => {
            let is_in_b = |(key, a): (&String, &Value)| b.get(key).is_some_and(|b| are_equal(a, b));
            a.len() == b.len() && a.iter().all(is_in_b)
        }
        (Value::Float(a), Value::Float(b)) => (a + 0.0).total_cmp(&(b + 0.0)).is_eq(),
        (Value::Float(float), Value::Integer(whole))
        | (Value::Integer(whole), Value::Float(float)) => {
            whole.to_string() == (float + 0.0).to_string()
        }
        (a, b) => a == b,
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
    fn commas_within_brackets_braces_and_quotes_belong_to_the_value() {
        let values = |text: &str| {
            let variation: Variation = text.parse().unwrap();
            assert_eq!(variation.to_string().parse(), Ok(variation.clone()));
            let values = variation.values().iter();
            values.map(|it| it.value().to_owned()).collect::<Vec<_>>()
        };
        let relay = "[{ north_m = 1, east_m = 2 }, { north_m = 3, east_m = 4 }]";
        assert_eq!(values(&format!("relays=[], {relay}")), ["[]", relay]);
        assert_eq!(
            values(r#"mission.file="a, b.plan",'c,d',it's.plan,x[1].plan"#),
            [r#""a, b.plan""#, "'c,d'", "it's.plan", "x[1].plan"]
        );
        let escaped = r#"["a\",b", "c"]"#;
        assert_eq!(values(&format!("faults={escaped},[]")), [escaped, "[]"]);
        for text in ["relays=[],[1", r#"mission.file="a,b"#, "faults=[{ a = 1 ]"] {
            let refused = text.parse::<Variation>().unwrap_err();
            assert!(refused.contains("unclosed"), "{text}: {refused}");
        }
    }

    #[test]
    fn value_is_there_twice_in_whichever_way_it_is_written() {
        for text in [
            "radio.loss=0.1,0.10",
            "radio.loss=1,1.0",
            "radio.loss=0,-0.0",
            "radio.loss=0.1,1e-1",
            "mission.file=river,\"river\"",
            "relays=[{ north_m = 1, east_m = 2 }],[{ east_m = 2.0, north_m = 1 }]",
        ] {
            let refused = text.parse::<Variation>().unwrap_err();
            assert!(refused.contains("twice: "), "{text}: {refused}");
        }
        assert!("radio.loss=0.1,0.2".parse::<Variation>().is_ok());
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
