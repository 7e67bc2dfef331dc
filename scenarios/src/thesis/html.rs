//! The page that sets our runs beside the thesis's tables and figures, in the style of that of a run.

use maud::{Markup, html};

use super::compare::{Comparison, Delays, Experiment, Quantity, SingleHop, Wait};
use super::table::{DIGITS, off};
use super::write::THESIS_JSON;
use crate::report::figures::count;
use crate::report::html::bars::{Bars, Chart, Level, chart};
use crate::report::html::map::kinds;
use crate::report::html::{card, document};
use muster_runtime::text::{figure, figure_or_nothing, plural};

const STYLE: &str = include_str!("thesis.css");

/// The thesis's figures of flight times and of messages, experiment by experiment.
const FIGURES: [[u8; 2]; 5] = [[20, 21], [23, 24], [26, 27], [29, 30], [32, 33]];

/// The page of a comparison, as HTML; every text that comes from the runs is escaped.
pub(super) fn page(comparison: &Comparison) -> String {
    let experiments = comparison.experiments.iter();
    let content = html! {
        (head(comparison))
        section {
            h2 { "Tables 9 to 13" }
            p.about {
                "From the start of neighbour discovery to the end of the landing. The master's time is the one that "
                "all five experiments of the thesis share."
            }
            (tables(comparison))
        }
        @for ((place, experiment), [of_times, of_messages]) in experiments.enumerate().zip(FIGURES) {
            section {
                h2 { "Experiment " (place + 1) ": " (experiment.swarm) }
                ul.legend { (kinds()) }
                div.figures {
                    figure {
                        figcaption {
                            "Flight time" span { "figure " (of_times) ": ours, and the thesis's law in pale" }
                        }
                        (flight_times(experiment))
                    }
                    figure {
                        figcaption {
                            "Messages received" span { "figure " (of_messages) ": ours, and the means of both" }
                        }
                        (messages(experiment))
                    }
                }
            }
        }
        section {
            h2 { "The experiments side by side" }
            div.figures {
                figure {
                    figcaption { "Mean flight time" span { "figure 34: ours, and the thesis's in pale" } }
                    (means(comparison, "seconds", 2))
                }
                figure {
                    figcaption { "Mean of the messages received" span { "figure 35: ours, and the thesis's in pale" } }
                    (means(comparison, "messages", 3))
                }
            }
        }
        section {
            h2 { "Waits at a waypoint, 15 drones in line" }
            p.about {
                "From a drone's own arrival to its own departure, the mean over its waypoints; in full colour where "
                "the master waits for all, in pale where it waits only for those that it hears itself and vehicles "
                "take different times to come to rest, as the ancestor's do (figure 36, which has one waypoint). Where "
                "vehicles are at rest at once and nothing is lost, that wait is two periods at most, below the "
                "thesis's. The bars are of seed " (comparison.seed) "; the table has the means of "
                (comparison.waits_runs.about()) ", those of the runs in which they are lowest and highest, and the "
                "waits of the drones that wait least and most, in the mean of the runs."
            }
            ul.legend { (kinds()) }
            div.figures { figure { (waits(comparison)) } (waits_table(comparison)) }
        }
        section {
            h2 { "Waits at a waypoint, 5 drones that all hear each other" }
            p.about {
                "How long vehicles take to come to rest is chosen such that the mean over many runs is that which was "
                "measured on the thesis's ancestor, in one hop. This is the mean of "
                (comparison.waits_runs.number()) ", as above; the longest wait is the mean of each run's longest."
            }
            (single_hop_table(comparison))
        }
        (method(comparison))
    };
    document("The thesis's experiments", STYLE, &content)
}

fn head(comparison: &Comparison) -> Markup {
    let broken: usize = comparison.reports().map(|it| it.violations.len()).sum();
    let runs = comparison.waits_runs.number();
    let farthest = |of: fn(&str) -> bool| {
        let quantities = comparison.experiments.iter().flat_map(|it| &it.quantities);
        let off = quantities
            .filter(|it| of(it.name))
            .filter_map(|it| it.off_percent);
        off.map(f64::abs).reduce(f64::max)
    };
    html! {
        header {
            p.kind { "muster · the thesis's experiments" }
            h1 { "Five experiments, the thesis's and ours" }
            dl.facts {
                div { dt { "Seed" } dd { (comparison.seed) } }
                div { dt { "Engine" } dd { (comparison.engine) } }
                div { dt { "Runs" } dd { (comparison.reports().count()) } }
            }
        }
        div.cards {
            (card("Flight times, off by at most", farthest(|name| name.starts_with("flight_time")), 1, "%"))
            (card("Messages, off by at most", farthest(|name| name.starts_with("messages")), 1, "%"))
            (card(&format!("Wait for all, {runs}"), comparison.waits.strict.mean_s, 2, "s"))
            (card(&format!("Wait for neighbours, {runs}"), comparison.waits.neighbours.mean_s, 2, "s"))
            (card(&format!("Likewise, settling, {runs}"), comparison.waits.settling.mean_s, 2, "s"))
            (card("Wait in the thesis", comparison.waits.thesis.mean_s, 2, "s"))
            div.card.{ @if broken == 0 { "good" } @else { "bad" } } {
                p { "Rules broken" }
                p.value {
                    @if broken == 0 { span.sign { "✓" } " none" }
                    @else { span.sign { "✕" } " " (plural(broken, "time")) }
                }
            }
        }
    }
}

fn tables(comparison: &Comparison) -> Markup {
    html! {
        div.scroll {
            table {
                thead {
                    tr {
                        th { "Experiment" }
                        th {}
                        th.n { "Flight time of the master,\u{a0}s" }
                        th.n { "Longest,\u{a0}s" }
                        th.n { "Mean,\u{a0}s" }
                        th.n { "Messages received, mean" }
                    }
                }
                tbody {
                    @for (place, experiment) in comparison.experiments.iter().enumerate() {
                        @let quantities = || experiment.quantities.iter().zip(DIGITS);
                        tr.same {
                            td { (place + 1) ": " (experiment.swarm) }
                            td { "thesis, table " (experiment.table) }
                            @for (quantity, digits) in quantities() { td.n { (figure(quantity.thesis, digits)) } }
                        }
                        tr.same {
                            td {} td { "ours" }
                            @for (quantity, digits) in quantities() {
                                td.n { (figure_or_nothing(quantity.ours, digits)) }
                            }
                        }
                        tr {
                            td {} td.off { "off by" }
                            @for quantity in &experiment.quantities { td.n.off { (off(quantity)) "\u{a0}%" } }
                        }
                    }
                }
            }
        }
    }
}

/// Each drone's flight time, and how long it would fly by the thesis's law.
fn flight_times(experiment: &Experiment) -> Markup {
    let drones = experiment.report.drones.iter().zip(&experiment.law_s);
    let bars = drones.map(|(drone, law_s)| {
        let about = format!(
            "{} s, by the thesis's law {} s",
            figure_or_nothing(drone.flight_time_s, 1),
            figure(*law_s, 1)
        );
        Bars::of_drone(drone, &about, vec![drone.flight_time_s, Some(*law_s)])
    });
    chart(&Chart {
        about: format!("Flight time of each of {}", experiment.swarm),
        axis: "flight time in seconds",
        places: "drone",
        digits: 1,
        levels: Vec::new(),
        bars: bars.collect(),
    })
}

/// The messages that each drone received; of the thesis's there is the mean.
fn messages(experiment: &Experiment) -> Markup {
    let bars = experiment.report.drones.iter().map(|drone| {
        let received = count(drone.messages_received);
        let about = format!("received {}", figure(received, 0));
        Bars::of_drone(drone, &about, vec![Some(received)])
    });
    let Quantity { thesis, ours, .. } = experiment.quantities[3];
    let level = |name, height| Level { name, height };
    let ours = ours.map(|ours| level("ours", ours));
    chart(&Chart {
        about: format!("Messages that each of {} received", experiment.swarm),
        axis: "messages",
        places: "drone",
        digits: 0,
        levels: [level("thesis", thesis)].into_iter().chain(ours).collect(),
        bars: bars.collect(),
    })
}

/// One of the quantities, experiment by experiment.
fn means(comparison: &Comparison, axis: &'static str, quantity: usize) -> Markup {
    let digits = DIGITS[quantity];
    let experiments = comparison.experiments.iter().enumerate();
    let bars = experiments.map(|(place, experiment)| {
        let Quantity { thesis, ours, .. } = experiment.quantities[quantity];
        Bars {
            label: (place + 1).to_string(),
            colour: "all",
            title: format!(
                "{}: {}, in the thesis {}",
                experiment.swarm,
                figure_or_nothing(ours, digits),
                figure(thesis, digits)
            ),
            heights: vec![ours, Some(thesis)],
        }
    });
    chart(&Chart {
        about: format!("Mean of the {axis} of each experiment"),
        axis,
        places: "experiment",
        digits,
        levels: Vec::new(),
        bars: bars.collect(),
    })
}

/// Each drone's wait where the master waits for all, and where it waits for its neighbours and vehicles settle.
fn waits(comparison: &Comparison) -> Markup {
    let strict = comparison
        .experiments
        .iter()
        .find(|it| it.report.scenario == comparison.settling.scenario);
    let strict = strict.into_iter().flat_map(|it| &it.report.drones);
    let bars = strict
        .zip(&comparison.settling.drones)
        .map(|(all, settling)| {
            let waits = vec![all.waypoint_delay_s, settling.waypoint_delay_s];
            let about = format!(
                "{} s for all, {} s for the neighbours with vehicles that settle",
                figure_or_nothing(waits[0], 2),
                figure_or_nothing(waits[1], 2)
            );
            Bars::of_drone(all, &about, waits)
        });
    let thesis = comparison.waits.thesis.mean_s;
    chart(&Chart {
        about: "How long each drone waits at a waypoint".to_owned(),
        axis: "wait in seconds",
        places: "drone",
        digits: 2,
        levels: thesis
            .map(|height| Level {
                name: "thesis",
                height,
            })
            .into_iter()
            .collect(),
        bars: bars.collect(),
    })
}

fn waits_table(comparison: &Comparison) -> Markup {
    let row = |whose, wait: &Wait| {
        let Wait {
            mean_s,
            lowest_run_s,
            highest_run_s,
            least_s,
            most_s,
        } = *wait;
        (
            whose,
            [mean_s, lowest_run_s, highest_run_s, least_s, most_s],
        )
    };
    let waits = &comparison.waits;
    seconds_table(
        [
            "Mean",
            "Lowest run",
            "Highest run",
            "Least drone",
            "Most drone",
        ],
        [
            row("Thesis", &waits.thesis),
            row("Ours, for all", &waits.strict),
            row("Ours, for the master's neighbours", &waits.neighbours),
            row("Likewise, settling like the ancestor", &waits.settling),
        ],
    )
}

fn single_hop_table(comparison: &Comparison) -> Markup {
    let row = |whose, delays: &Delays| {
        let Delays {
            mean_s,
            lowest_run_s,
            highest_run_s,
            longest_s,
        } = *delays;
        (whose, [mean_s, lowest_run_s, highest_run_s, longest_s])
    };
    let SingleHop { ancestor, ours } = &comparison.single_hop;
    seconds_table(
        ["Mean", "Lowest run", "Highest run", "Longest"],
        [
            row("Ancestor", ancestor),
            row("Ours, settling like it", ours),
        ],
    )
}

/// A row for each, with as many times as there are columns.
fn seconds_table<const COLUMNS: usize, const ROWS: usize>(
    columns: [&str; COLUMNS],
    rows: [(&str, [Option<f64>; COLUMNS]); ROWS],
) -> Markup {
    html! {
        div.scroll {
            table {
                thead { tr { th {} @for name in columns { th.n { (name) ",\u{a0}s" } } } }
                tbody {
                    @for (whose, times) in rows {
                        tr { td { (whose) } @for seconds in times { td.n { (figure_or_nothing(seconds, 2)) } } }
                    }
                }
            }
        }
    }
}

fn method(comparison: &Comparison) -> Markup {
    html! {
        section {
            h2 { "What is compared" }
            p.about {
                "The thesis prints means and extremes as tables, and the figures of each drone as pictures only. All "
                "five tables obey one law, which stands here for those pictures: a slave whose slot is d metres from "
                "the master's flies d\u{a0}/\u{a0}10 + 12.4 seconds longer than the master, which flies 368."
            }
        }
        section {
            h2 { "Run it again" }
            pre {
                code {
                    "muster thesis --seed " (comparison.seed) " --runs " (comparison.waits_runs.seeds.len())
                    " --engine " (comparison.engine) "\n"
                    @for report in comparison.of_first_seed() { (report.command) "\n" }
                }
            }
            p.about {
                "The same program gives the same flights. All figures, with the reports of the runs with "
                "this seed, are in "
                a href=(THESIS_JSON) { (THESIS_JSON) } "."
            }
        }
    }
}
