//! The page on results says what the comments on their fields say.

use std::fmt::Write as _;

use muster_experiments::campaign::FIGURES;
use muster_experiments::output::TRACK_COLUMNS;

use super::{Document, assert_generated};

/// The public fields of a struct in a source file, each with its comment.
fn fields(file: &str, name: &str) -> Vec<(String, String)> {
    let source = Document::read(file).text;
    let begin = format!("pub struct {name} {{");
    let body = source
        .lines()
        .skip_while(|line| *line != begin)
        .skip(1)
        .take_while(|line| *line != "}");
    let (mut fields, mut comment) = (Vec::new(), String::new());
    for line in body.map(str::trim) {
        if let Some(text) = line.strip_prefix("/// ") {
            comment.push_str(if comment.is_empty() { "" } else { " " });
            comment.push_str(text);
        } else if let Some((field, _)) = line.strip_prefix("pub ").and_then(|it| it.split_once(':'))
        {
            fields.push((field.to_owned(), std::mem::take(&mut comment)));
        }
    }
    assert!(!fields.is_empty(), "{file} has no fields of {name}");
    for (field, comment) in &fields {
        assert!(!comment.is_empty(), "{file}: {field} has no comment");
    }
    fields
}

fn table(page: &mut String, heading: &str, rows: impl IntoIterator<Item = (String, String)>) {
    writeln!(page, "\n| {heading} | meaning |\n| --- | --- |").unwrap();
    for (name, meaning) in rows {
        assert!(!meaning.contains("[`"), "{name} has a link: {meaning}");
        writeln!(page, "| `{name}` | {} |", meaning.replace('|', "\\|")).unwrap();
    }
}

fn campaigns(page: &mut String) {
    page.push_str(
        "\n## `runs.csv` and `runs.jsonl` of a campaign\n\n\
         A row a run. In `runs.csv` each varied field has a column of its own in the place of `varied`, and `observed` is left\n\
         out.\n",
    );
    table(
        page,
        "column",
        fields("scenarios/experiments/src/campaign/row.rs", "Row"),
    );
    page.push_str(
        "\n## `summary.csv` of a campaign\n\n\
         A row a combination of varied values. Each varied field has a column of its own in the place of `values`.\n",
    );
    let counts = fields("scenarios/experiments/src/campaign/summary.rs", "Summary");
    let counts = counts
        .into_iter()
        .filter(|it| it.0 != "estimates" && it.0 != "observed");
    table(page, "column", counts);
    page.push_str(
        "\nThen there are five columns for each figure, and for each value that agents observed; one with the name of a figure\n\
         has the prefix `observed.`:\n",
    );
    let estimate = [
        (
            "…_median",
            "Median over the runs that broke no rule; of flight times, over those of them that completed their missions.",
        ),
        (
            "…_low",
            "Lower end of the interval that contains the median with at least 95 % confidence. Empty below six values.",
        ),
        ("…_high", "Its upper end."),
        ("…_p99", "99th percentile. Empty below 100 values."),
        ("…_n", "Number of values: of runs that have the figure."),
    ];
    table(
        page,
        "column",
        estimate.map(|(name, about)| (name.to_owned(), about.to_owned())),
    );
    let figures = FIGURES.iter().map(|figure| {
        let unit = match figure.unit {
            "" => String::new(),
            unit => format!(", in {unit}"),
        };
        let about = format!("{}{unit}. {}", figure.name, figure.about);
        (figure.column.to_owned(), about)
    });
    table(page, "figure", figures);
}

#[test]
fn page_on_results_is_what_their_fields_say() {
    let mut page = String::from(
        "# What do the results mean?\n\n\
         Names end in their unit: `_s` is seconds, `_ms` milliseconds, `_m` metres. Where a value is `None`, a field of a CSV file\n\
         is empty and one of a JSON file is `null` or left out. This page is generated from the program.\n",
    );
    campaigns(&mut page);
    page.push_str(
        "\n## `report.json` of a run\n\nThe top level. `muster sim --json` prints the same.\n",
    );
    table(
        &mut page,
        "field",
        fields("scenarios/src/report/mod.rs", "Report"),
    );
    page.push_str("\nEach of `drones`:\n");
    table(
        &mut page,
        "field",
        fields("scenarios/src/report/mod.rs", "DroneReport"),
    );
    page.push_str(
        "\n## `tracks.csv` of a run\n\n\
         The positions of all drones: each second, and at each turn. Ordered by time, then by drone.\n",
    );
    let columns = TRACK_COLUMNS.map(|(name, about)| (name.to_owned(), about.to_owned()));
    table(&mut page, "column", columns);
    assert_generated("docs/src/reference/results.md", &page);
}
