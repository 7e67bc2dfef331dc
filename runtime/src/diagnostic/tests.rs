use std::fs;

use miette::{GraphicalReportHandler, GraphicalTheme};

use super::*;
use crate::plan::file::Source;
use crate::schema::FieldList;

/// An error as shown on a terminal, without colours.
pub(crate) fn rendered(error: &BadInput) -> String {
    let mut shown = String::new();
    GraphicalReportHandler::new_themed(GraphicalTheme::unicode_nocolor())
        .with_width(100)
        .render_report(&mut shown, error)
        .unwrap();
    shown
}

/// Reads a file with this content; errors show its name without the directory.
fn read(content: &[u8]) -> Result<String, String> {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("given.toml");
    fs::write(&path, content).unwrap();
    read_text(&path).map_err(|error| {
        error
            .to_string()
            .replace(&format!("{}/", directory.path().display()), "")
    })
}

#[test]
fn text_is_read_unchanged_without_byte_order_mark() {
    assert_eq!(read(b"a = 1\r\n\tb\n").unwrap(), "a = 1\r\n\tb\n");
    assert_eq!(read("\u{feff}año".as_bytes()).unwrap(), "año");
}

#[test]
fn content_that_is_not_text_is_refused_with_the_reason() {
    let refused = |content: &[u8]| read(content).unwrap_err();
    assert_eq!(refused(b""), "given.toml: the file is empty");
    assert_eq!(refused(b" \n\t\r\n"), "given.toml: the file is empty");
    assert_eq!(
        refused(b"abc\xff\xfe"),
        "given.toml: this is not a text file: byte 3 is not UTF-8"
    );
    assert_eq!(
        refused(b"ab\0c"),
        "given.toml: this is not a text file: byte 2 is a control character"
    );
}

#[test]
fn missing_file_and_directory_give_different_errors() {
    let directory = tempfile::tempdir().unwrap();
    let missing = read_text(&directory.path().join("missing.toml")).unwrap_err();
    assert!(missing.to_string().ends_with("there is no such file"));
    let a_directory = read_text(directory.path()).unwrap_err();
    assert!(a_directory.to_string().ends_with("this is a directory"));
}

#[cfg(unix)]
#[test]
fn device_is_refused_before_it_is_read() {
    let refused = read_text(Path::new("/dev/zero")).unwrap_err();
    assert_eq!(refused.to_string(), "/dev/zero: this is not a regular file");
}

#[test]
fn file_of_maximum_size_is_read_and_a_larger_one_refused() {
    let limit = usize::try_from(FILE_SIZE_MAX).unwrap();
    assert_eq!(read(&vec![b'a'; limit]).unwrap().len(), limit);
    assert_eq!(
        read(&vec![b'a'; limit + 1]).unwrap_err(),
        "given.toml: the file is larger than 4194304 bytes"
    );
}

#[test]
fn help_on_what_a_whole_file_lacks_is_not_that_of_its_first_field() {
    const FIELDS: FieldList = FieldList::new("seed\ta number\nprotocol\ta table\nname\ta text\n");
    let help = |message| accepted(FIELDS, "seed = 1\n", &(0..0), message).unwrap();
    let missing = help("missing field `protocol`");
    assert_eq!(missing, "`protocol` takes a table");
    let lacking = help("the file has no name");
    assert_eq!(lacking, "the fields are seed, protocol, name");
    let scenario = Source::new(Path::new("a.toml"), "seed = 1\n".to_owned());
    let shown = rendered(&scenario.parse().unwrap_err());
    assert!(!shown.contains("`seed` takes"), "{shown}");
}

#[test]
fn error_shows_file_place_and_what_is_accepted() {
    let text = "[swarm]\ndrones = \"six\"\nspacing_m = 160\n";
    let error = BadInput::new(
        Path::new("six.toml"),
        text,
        17..22,
        "`drones` is a string",
        "`drones` must be a whole number",
    );
    insta::assert_snapshot!(rendered(&error));
}

#[test]
fn span_over_several_lines_marks_the_first() {
    let error = BadInput::new(Path::new("a"), "one\ntwo\nthree\nfour\n", 4..14, "m", "h");
    assert!(!rendered(&error).contains("four"), "{}", rendered(&error));
}

#[test]
fn line_too_long_to_show_is_given_by_line_and_column() {
    let text = format!("first\n{}ñ!", "x".repeat(2_000));
    let error = BadInput::new(Path::new("a.plan"), &text, 2_008..2_009, "wrong", "help");
    assert_eq!(error.to_string(), "a.plan: line 2, column 2002: wrong");
}

#[test]
fn any_span_of_any_text_is_rendered() {
    let text = "ñandú\r\nñu\n";
    for start in 0..=text.len() + 2 {
        for end in 0..=text.len() + 2 {
            let error = BadInput::new(Path::new("a"), text, start..end, "wrong", "help");
            assert!(rendered(&error).contains("[a:"), "{start}..{end}");
        }
    }
}
