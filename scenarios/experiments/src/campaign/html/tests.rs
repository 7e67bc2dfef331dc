use scraper::{Html, Selector};

use super::page;
use crate::campaign::figures::FIGURES;
use crate::campaign::plan::{self, Campaign};
use crate::campaign::row;
use crate::campaign::statistics::Estimate;
use crate::campaign::summary::{BrokenRun, Summary, Tally};

fn summaries(campaign: &Campaign, broken: u64) -> (Vec<Summary>, Vec<BrokenRun>) {
    let mut listed = Vec::new();
    let summaries = (0..campaign.combinations()).map(|combination| {
        let mut tally = Tally::default();
        for seed in 0..8 {
            let mut row = row::tests::row(campaign, combination, seed < broken);
            row.retries_per_barrier = Some(2.0);
            if row.is_broken() {
                listed.push(BrokenRun::new(campaign, &row));
            }
            tally.add(&row);
        }
        tally.summary(campaign, combination)
    });
    (summaries.collect(), listed)
}

fn parsed(campaign: &Campaign, broken: u64) -> Html {
    let (summaries, broken) = summaries(campaign, broken);
    let html = Html::parse_document(&page(campaign, &summaries, &broken));
    assert_eq!(html.errors, Vec::<std::borrow::Cow<'static, str>>::new());
    html
}

fn number(html: &Html, selector: &str) -> usize {
    html.select(&Selector::parse(selector).unwrap()).count()
}

#[test]
fn every_combination_has_a_row_and_a_median_in_every_plot() {
    let html = parsed(&plan::tests::campaign(), 0);
    assert_eq!(number(&html, "table.medians tbody tr"), 6);
    assert_eq!(number(&html, "table.observed tbody tr"), 6);
    assert_eq!(number(&html, ".plots svg"), FIGURES.len());
    assert_eq!(number(&html, ".median"), 6 * FIGURES.len());
    assert_eq!(number(&html, ".interval"), 6 * FIGURES.len());
    assert_eq!(
        number(&html, ".legend li"),
        2,
        "two ranges as series, three losses on the axis"
    );
    assert_eq!(number(&html, ".through"), 2 * FIGURES.len());
}

#[test]
fn number_of_values_is_shown_where_not_every_run_has_the_figure() {
    let campaign = plan::tests::campaign();
    let (mut summaries, _) = summaries(&campaign, 0);
    let all = page(&campaign, &summaries, &[]);
    assert!(!all.contains("n=8") && !all.contains("n=5"));
    let elections = FIGURES.iter().position(|it| it.column == "election_max_s");
    summaries[0].estimates[elections.unwrap()] = Estimate::of(vec![0.5; 5]);
    let page = page(&campaign, &summaries, &[]);
    assert_eq!(page.matches("n=5").count(), 1);
    let html = Html::parse_document(&page);
    let method = html.root_element().text().collect::<String>();
    assert!(method.contains("binomial of the number of values"));
}

#[test]
fn campaign_without_varied_fields_has_plots() {
    let mut campaign = plan::tests::campaign();
    campaign.vary.clear();
    let html = parsed(&campaign, 0);
    assert_eq!(number(&html, ".median"), FIGURES.len());
    assert_eq!(number(&html, ".run"), 8 * FIGURES.len());
    assert_eq!(number(&html, ".legend"), 0);
}

#[test]
fn figures_that_are_zero_in_every_run_are_named_and_not_plotted() {
    let campaign = plan::tests::campaign();
    let mut summaries = summaries(&campaign, 0).0;
    let zero = FIGURES
        .iter()
        .position(|it| it.column == "retries_per_barrier");
    for summary in &mut summaries {
        summary.estimates[zero.unwrap()] = Estimate::of(vec![0.0; 8]);
    }
    let page = page(&campaign, &summaries, &[]);
    assert_eq!(
        number(&Html::parse_document(&page), ".plots svg"),
        FIGURES.len() - 1
    );
    assert!(page.contains("Zero in every run, and not plotted: Retries per barrier, mean."));
}

#[test]
fn figures_that_no_run_has_are_named_and_have_no_column() {
    let campaign = plan::tests::campaign();
    let mut summaries = summaries(&campaign, 0).0;
    let absent = FIGURES
        .iter()
        .position(|it| it.column == "following_mean_m");
    for summary in &mut summaries {
        summary.estimates[absent.unwrap()] = None;
    }
    let page = page(&campaign, &summaries, &[]);
    assert!(page.contains("In no run: Formation error, mean."));
    let columns = number(&Html::parse_document(&page), "table.medians th");
    assert_eq!(columns, 2 + 4 + FIGURES.len() - 1);
}

#[test]
fn medians_of_text_values_have_no_connecting_line() {
    let mut campaign = plan::tests::campaign();
    campaign.vary = vec![
        "mission.file=a.plan,a-rather-long-name.plan"
            .parse()
            .unwrap(),
    ];
    let html = parsed(&campaign, 0);
    assert_eq!(number(&html, ".median"), 2 * FIGURES.len());
    assert_eq!(number(&html, ".through"), 0);
}

#[test]
fn broken_runs_are_listed_with_their_commands() {
    let html = parsed(&plan::tests::campaign(), 2);
    let commands = Selector::parse("section.bad code").unwrap();
    let commands: String = html.select(&commands).flat_map(|it| it.text()).collect();
    assert_eq!(commands.matches("\nmuster sim ").count(), 12);
    assert_eq!(number(&html, ".card.bad"), 1);
    assert_eq!(number(&html, "td.broken"), 6);
    let html = parsed(&plan::tests::campaign(), 8);
    assert_eq!(
        number(&html, ".median"),
        0,
        "no run without violation is left"
    );
}

#[test]
fn incomplete_runs_have_a_card_and_are_marked_in_the_table() {
    let campaign = plan::tests::campaign();
    let (mut summaries, _) = summaries(&campaign, 0);
    let complete = Html::parse_document(&page(&campaign, &summaries, &[]));
    assert_eq!(number(&complete, ".card.good"), 2);
    summaries[1].incomplete = 3;
    let html = Html::parse_document(&page(&campaign, &summaries, &[]));
    assert_eq!(number(&html, ".card.bad"), 1);
    assert_eq!(number(&html, "td.incomplete"), 1);
    let card = Selector::parse(".card.bad").unwrap();
    let text: String = html.select(&card).flat_map(|it| it.text()).collect();
    assert!(
        text.contains("Missions incomplete") && text.contains("in 3 runs"),
        "{text}"
    );
}

#[test]
fn elections_that_did_not_end_are_counted_below_all() {
    let campaign = plan::tests::campaign();
    let mut tally = Tally::default();
    for run in 0..2 {
        let mut row = row::tests::row(&campaign, run, false);
        (row.elections, row.elections_unsettled) = (3, 1);
        tally.add(&row);
    }
    let summary = tally.summary(&campaign, 0);
    assert_eq!((summary.elections, summary.elections_unsettled), (6, 2));
    let page = page(&campaign, &[summary], &[]);
    assert_eq!(page.matches(">2 unsettled<").count(), 1);
}

#[test]
fn runs_with_a_fault_that_never_happened_are_counted_in_a_card() {
    let campaign = plan::tests::campaign();
    let (mut summaries, _) = summaries(&campaign, 0);
    let card = "Faults never injected";
    assert!(!page(&campaign, &summaries, &[]).contains(card));
    summaries[0].never_injected = 2;
    assert!(page(&campaign, &summaries, &[]).contains(card));
}

#[test]
fn page_loads_nothing_from_the_network_and_escapes_text() {
    let mut campaign = plan::tests::campaign();
    campaign.scenario = "<script>alert(1)</script>&\"'.toml".to_owned();
    let (summaries, broken) = summaries(&campaign, 1);
    let page = page(&campaign, &summaries, &broken);
    for outside in [
        "http://", "https://", "<script", "@import", "url(", " src=", "<link",
    ] {
        assert!(!page.contains(outside), "{outside}");
    }
}

#[test]
fn too_many_combinations_are_listed_but_not_plotted() {
    let mut campaign = plan::tests::campaign();
    let values: Vec<_> = (1..=201).map(|it| it.to_string()).collect();
    campaign.vary = vec![
        format!("radio.range_m={}", values.join(","))
            .parse()
            .unwrap(),
    ];
    let html = parsed(&campaign, 0);
    assert_eq!(number(&html, "table.medians tbody tr"), 201);
    assert_eq!(number(&html, "svg"), 0);
}
