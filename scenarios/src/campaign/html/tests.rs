use scraper::{Html, Selector};

use super::page;
use crate::campaign::plan::{self, Campaign};
use crate::campaign::row;
use crate::campaign::summary::{Broken, FIGURES, Summary, Tally};

fn summaries(campaign: &Campaign, broken: u64) -> (Vec<Summary>, Vec<Broken>) {
    let mut listed = Vec::new();
    let summaries = (0..campaign.combinations()).map(|combination| {
        let mut tally = Tally::default();
        for seed in 0..8 {
            let row = row::tests::row(campaign, combination, seed < broken);
            if row.is_broken() {
                listed.push(Broken::new(campaign, &row));
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
fn every_combination_has_its_row_and_its_place_in_every_plot() {
    let html = parsed(&plan::tests::campaign(), 0);
    assert_eq!(number(&html, "tbody tr"), 6);
    assert_eq!(number(&html, ".plots svg"), FIGURES.len());
    assert_eq!(number(&html, ".median"), 6 * FIGURES.len());
    assert_eq!(number(&html, ".interval"), 6 * FIGURES.len());
    assert_eq!(
        number(&html, ".legend li"),
        2,
        "two ranges, three losses along the axis"
    );
    assert_eq!(number(&html, ".through"), 2 * FIGURES.len());
}

#[test]
fn a_campaign_that_varies_nothing_has_its_plots() {
    let mut campaign = plan::tests::campaign();
    campaign.vary.clear();
    let html = parsed(&campaign, 0);
    assert_eq!(number(&html, ".median"), FIGURES.len());
    assert_eq!(number(&html, ".run"), 8 * FIGURES.len());
    assert_eq!(number(&html, ".legend"), 0);
}

#[test]
fn values_that_are_words_stand_side_by_side_without_a_line() {
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
fn broken_runs_are_shown_with_their_commands() {
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
        "nothing is left to estimate from"
    );
}

#[test]
fn the_page_asks_the_network_for_nothing_and_shows_text_as_text() {
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
fn more_combinations_than_can_be_drawn_are_listed() {
    let mut campaign = plan::tests::campaign();
    let values: Vec<_> = (1..=201).map(|it| it.to_string()).collect();
    campaign.vary = vec![
        format!("radio.range_m={}", values.join(","))
            .parse()
            .unwrap(),
    ];
    let html = parsed(&campaign, 0);
    assert_eq!(number(&html, "tbody tr"), 201);
    assert_eq!(number(&html, "svg"), 0);
}
