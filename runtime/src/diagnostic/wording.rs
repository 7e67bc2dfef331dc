//! Messages of the libraries that read files, in plain words: names of types mean nothing to who wrote the file.

use super::near::did_you_mean;

/// A message of `toml` or `serde` without names of types, with a suggestion for a misspelt name.
///
/// Messages of our own types pass unchanged, and so does "missing field".
pub(crate) fn plain(message: &str) -> String {
    let message = message.trim().replace('\n', ", ");
    if let Some((name, accepted)) = unknown(&message, "unknown field `") {
        return format!(
            "unknown field `{name}`{}",
            did_you_mean(name, names(accepted))
        );
    }
    if let Some((name, accepted)) = unknown(&message, "unknown variant `") {
        let suggestion = did_you_mean(name, names(accepted));
        return format!("unknown value `{name}`, {accepted}{suggestion}");
    }
    for kind in ["invalid type: ", "invalid value: "] {
        if let Some((found, wanted)) = (message.strip_prefix(kind)).and_then(found_and_wanted) {
            // A number that needs more than 64 bits.
            if found.ends_with("128") && found.starts_with("integer ") {
                return "the number is too large".to_owned();
            }
            return format!(
                "found {}, expected {}",
                found_in_words(found),
                wanted_in_words(wanted)
            );
        }
    }
    let known = LIBRARY_WORDS
        .iter()
        .find(|(theirs, _)| message.starts_with(theirs));
    match known {
        Some((_, ours)) => (*ours).to_owned(),
        None => message,
    }
}

/// Beginnings of messages of the TOML parser, and what is said instead.
const LIBRARY_WORDS: [(&str, &str); 15] = [
    ("string values must be quoted", NO_VALUE),
    ("invalid boolean", NO_VALUE),
    ("invalid integer", NO_VALUE),
    ("invalid float", NO_VALUE),
    (
        "invalid unquoted key",
        "a name can't have this character; put the name in quotes",
    ),
    ("wanted string or table", "expected text in quotes"),
    ("wanted a string", "expected text in quotes"),
    ("integer number overflowed", "the number is too large"),
    (
        "floating-point number overflowed",
        "the number is too large",
    ),
    ("u64 value was too large", "the number is too large"),
    ("cannot recurse further", "nested too deeply"),
    ("recursion limit", "nested too deeply"),
    (
        "data did not match any variant",
        "the value has none of the accepted forms",
    ),
    ("invalid length", "the list has the wrong number of values"),
    (
        "expected tuple with length",
        "the list has the wrong number of values",
    ),
];

/// The parser takes a word without quotes for a misspelt number or boolean, by its first letter.
const NO_VALUE: &str = "not a number, `true` or `false`; text must be in quotes, as in \"text\"";

/// The name that a message calls unknown, and the rest, which lists accepted ones.
fn unknown<'a>(message: &'a str, start: &str) -> Option<(&'a str, &'a str)> {
    message.strip_prefix(start)?.split_once("`, ")
}

/// The names between backticks.
pub(crate) fn names(list: &str) -> impl Iterator<Item = &str> {
    list.split('`').skip(1).step_by(2)
}

/// Splits "string \"x\", expected f64"; what was found may hold the separator, too.
fn found_and_wanted(rest: &str) -> Option<(&str, &str)> {
    rest.rsplit_once(", expected ")
}

fn found_in_words(found: &str) -> String {
    let (kind, value) = found.split_once(' ').unwrap_or((found, ""));
    let number = |value: &str| value.trim_matches('`').to_owned();
    match kind {
        "string" => format!("the text {value}"),
        "integer" => format!("the whole number {}", number(value)),
        "floating" => format!("the number {}", number(value.trim_start_matches("point "))),
        "boolean" => value.to_owned(),
        "sequence" => "a list".to_owned(),
        "map" | "newtype" => "a table".to_owned(),
        _ => "another value".to_owned(),
    }
}

fn wanted_in_words(wanted: &str) -> String {
    let whole = |min: &str, max: &str| format!("a whole number from {min} to {max}");
    match wanted {
        "f64" | "f32" => "a number".to_owned(),
        "i8" | "i16" | "i32" | "i64" | "isize" => "a whole number".to_owned(),
        "u8" => whole("0", &u8::MAX.to_string()),
        "u16" => whole("0", &u16::MAX.to_string()),
        "u32" => whole("0", &u32::MAX.to_string()),
        "u64" | "usize" => "a whole number from 0".to_owned(),
        "a boolean" => "`true` or `false`".to_owned(),
        "a string" | "a borrowed string" | "path string" | "string or table" | "a character"
        | "variant identifier" | "socket address" => "text in quotes".to_owned(),
        "a sequence" => "a list".to_owned(),
        "a map" => "a table".to_owned(),
        types if types.starts_with("struct ") || types.starts_with("enum ") => "a table".to_owned(),
        types if types.starts_with("a tuple") || types.starts_with("tuple") => "a list".to_owned(),
        ours => ours.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use serde::Deserialize;

    use super::plain;

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    #[expect(dead_code, reason = "only its errors are looked at")]
    struct Fields {
        speed: Option<f64>,
        id: Option<u32>,
        name: Option<String>,
        avoid: Option<bool>,
        list: Option<Vec<u8>>,
        policy: Option<Policy>,
        pair: Option<(u8, u8)>,
    }

    #[derive(Debug, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    enum Policy {
        Flood,
        Tree,
    }

    fn refused(text: &str) -> String {
        plain(toml::from_str::<Fields>(text).unwrap_err().message())
    }

    #[test]
    fn error_about_a_wrong_type_names_no_rust_type() {
        for (text, expected) in [
            (
                "speed = \"fast\"",
                "found the text \"fast\", expected a number",
            ),
            ("speed = [1]", "found a list, expected a number"),
            (
                "id = 1.5",
                "found the number 1.5, expected a whole number from 0 to 4294967295",
            ),
            (
                "id = -1",
                "found the whole number -1, expected a whole number from 0 to 4294967295",
            ),
            (
                "name = 5",
                "found the whole number 5, expected text in quotes",
            ),
            ("name = true", "found `true`, expected text in quotes"),
            (
                "avoid = 1",
                "found the whole number 1, expected `true` or `false`",
            ),
            ("list = \"a\"", "found the text \"a\", expected a list"),
            (
                "speed = \"a, expected b\"",
                "found the text \"a, expected b\", expected a number",
            ),
        ] {
            assert_eq!(refused(text), expected, "{text}");
        }
        for text in [
            "id = two",
            "id = fast",
            "id = x",
            "id = 99999999999999999999",
            "policy = 3",
            "pair = [1]",
        ] {
            let error = refused(text);
            let has_types = [
                "u32", "enum", "tuple", "boolean", "literal", "variant", "invalid",
            ];
            assert!(
                !has_types.iter().any(|it| error.contains(it)),
                "{text}: {error}"
            );
        }
    }

    #[test]
    fn misspelt_names_get_a_suggestion() {
        assert_eq!(
            refused("sped = 1"),
            "unknown field `sped`; did you mean `speed`?"
        );
        assert_eq!(refused("zzz = 1"), "unknown field `zzz`");
        assert_eq!(
            refused("policy = \"tre\""),
            "unknown value `tre`, expected `flood` or `tree`; did you mean `tree`?"
        );
    }
}
