//! The HTML page that compares our runs with the thesis's tables and figures.

use maud::{Markup, html};
use muster_runtime::text::{figure, figure_or_dash, plural};
use muster_scenarios::report::count;

use super::compare::{Comparison, Delays, Experiment, Quantity, SingleHop, Wait};
use super::table::{DIGITS, difference};
use super::write::THESIS_JSON;
use crate::output::html::bars::{Bars, Chart, Level, chart};
use crate::output::html::map::kinds;
use crate::output::html::{card, document};

const STYLE: &str = include_str!("thesis.css");

/// Numbers of the thesis's figures of flight times and messages, by experiment.
const FIGURES: [[u8; 2]; 5] = [[20, 21], [23, 24], [26, 27], [29, 30], [32, 33]];

/// The page of a comparison as HTML. All texts of the runs are escaped.
pub(super) fn page(comparison: &Comparison) -> String {
    let experiments = comparison.experiments.iter();
    let content = html! {
        (head(comparison))
        section {
            h2 { "Tables 9 to 13" }
            p.about {
                "Flight time: from the start of neighbour discovery to the end of landing. All five experiments of the "
                "thesis share one flight time of the master."
            }
            (tables(comparison))
        }
        @for ((place, experiment), figures) in experiments.enumerate().zip(FIGURES) {
            (experiment_section(place + 1, experiment, figures))
        }
        section {
            h2 { "All experiments" }
            div.figures {
                figure {
                    figcaption { "Mean flight time" span { "figure 34: ours, and the thesis in pale" } }
                    (means(comparison, "seconds", 2))
                }
                figure {
                    figcaption { "Mean of the messages received" span { "figure 35: ours, and the thesis in pale" } }
                    (means(comparison, "messages", 3))
                }
            }
        }
        (waits_section(comparison))
        (single_hop_section(comparison))
        (method(comparison))
    };
    document("The thesis's experiments", STYLE, &content)
}

fn experiment_section(number: usize, experiment: &Experiment, figures: [u8; 2]) -> Markup {
    let [of_times, of_messages] = figures;
    html! {
        section {
            h2 { "Experiment " (number) ": " (experiment.swarm) }
            ul.legend { (kinds()) }
            div.figures {
                figure {
                    figcaption { "Flight time" span { "figure " (of_times) ": ours, and the thesis's law in pale" } }
                    (flight_times(experiment))
                }
                figure {
                    figcaption { "Messages received" span { "figure " (of_messages) ": ours, and the means of both" } }
                    (messages(experiment))
                }
            }
        }
    }
}

fn waits_section(comparison: &Comparison) -> Markup {
    html! {
        section {
            h2 { "Waits at a waypoint, 15 drones in line" }
            p.about {
                "Wait: from a drone's arrival to its departure, mean over its waypoints. Full colour: the master waits for "
                "all drones. Pale: it waits for its neighbours only, and vehicles have the ancestor's settling time "
                "(figure 36, which has one waypoint). Without settling time and losses, the pale wait would be at most two "
                "periods, less than in the thesis. The bars show seed " (comparison.seed) ". The table shows means over "
                (comparison.waits_runs.about()) ", the lowest and the highest mean of a run, and the shortest and the "
                "longest wait of a drone, averaged over the runs."
            }
            ul.legend { (kinds()) }
            div.figures { figure { (waits(comparison)) } (waits_table(comparison)) }
        }
    }
}

fn single_hop_section(comparison: &Comparison) -> Markup {
    html! {
        section {
            h2 { "Waits at a waypoint, 5 drones in range of each other" }
            p.about {
                "The settling time is calibrated: the mean wait over many runs equals the wait measured on the thesis's "
                "ancestor, over one hop. The table shows the mean of " (comparison.waits_runs.number()) " and the mean of "
                "each run's longest wait."
            }
            (single_hop_table(comparison))
        }
    }
}

fn head(comparison: &Comparison) -> Markup {
    let broken: usize = comparison.reports().map(|it| it.violations.len()).sum();
    let runs = comparison.waits_runs.number();
    let largest_difference = |of: fn(&str) -> bool| {
        let quantities = comparison.experiments.iter().flat_map(|it| &it.quantities);
        let off = quantities
            .filter(|it| of(it.name))
            .filter_map(|it| it.off_percent);
        off.map(f64::abs).reduce(f64::max)
    };
    html! {
        header {
            p.kind { "muster · the thesis's experiments" }
            h1 { "The thesis's five experiments and ours" }
            dl.facts {
                div { dt { "Seed" } dd { (comparison.seed) } }
                div { dt { "Engine" } dd { (comparison.engine) } }
                div { dt { "Runs" } dd { (comparison.reports().count()) } }
            }
        }
        div.cards {
            (card("Flight times, largest difference", largest_difference(|name| name.starts_with("flight_time")), 1, "%"))
            (card("Messages, largest difference", largest_difference(|name| name.starts_with("messages")), 1, "%"))
            (card(&format!("Wait for all drones, {runs}"), comparison.waits.strict.mean_s, 2, "s"))
            (card(&format!("Wait for neighbours, {runs}"), comparison.waits.neighbours.mean_s, 2, "s"))
            (card(&format!("Wait for neighbours, with settling, {runs}"), comparison.waits.settling.mean_s, 2, "s"))
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
                                td.n { (figure_or_dash(quantity.ours, digits)) }
                            }
                        }
                        tr {
                            td {} td.off { "difference" }
                            @for quantity in &experiment.quantities { td.n.off { (difference(quantity)) "\u{a0}%" } }
                        }
                    }
                }
            }
        }
    }
}

/// Chart of flight times: ours and by the thesis's law.
fn flight_times(experiment: &Experiment) -> Markup {
    let drones = experiment.report.drones.iter().zip(&experiment.law_s);
    let bars = drones.map(|(drone, law_s)| {
        let about = format!(
            "{} s, by the thesis's law {} s",
            figure_or_dash(drone.flight_time_s, 1),
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

/// Chart of the messages received. The thesis has only the mean.
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

/// Chart of one quantity by experiment.
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
                figure_or_dash(ours, digits),
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

/// Chart of each drone's wait: for all drones, and for neighbours with settling time.
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
                "{} s for all drones, {} s for neighbours with settling time",
                figure_or_dash(waits[0], 2),
                figure_or_dash(waits[1], 2)
            );
            Bars::of_drone(all, &about, waits)
        });
    let thesis = comparison.waits.thesis.mean_s;
    chart(&Chart {
        about: "Wait of each drone at a waypoint".to_owned(),
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
    let row = |name, wait: &Wait| {
        let Wait {
            mean_s,
            lowest_run_s,
            highest_run_s,
            least_s,
            most_s,
        } = *wait;
        (name, [mean_s, lowest_run_s, highest_run_s, least_s, most_s])
    };
    let waits = &comparison.waits;
    seconds_table(
        [
            "Mean",
            "Lowest run",
            "Highest run",
            "Shortest of a drone",
            "Longest of a drone",
        ],
        [
            row("Thesis", &waits.thesis),
            row("Ours, waiting for all drones", &waits.strict),
            row("Ours, waiting for neighbours", &waits.neighbours),
            row("Ours, neighbours + settling time", &waits.settling),
        ],
    )
}

fn single_hop_table(comparison: &Comparison) -> Markup {
    let row = |name, delays: &Delays| {
        let Delays {
            mean_s,
            lowest_run_s,
            highest_run_s,
            longest_s,
        } = *delays;
        (name, [mean_s, lowest_run_s, highest_run_s, longest_s])
    };
    let SingleHop { ancestor, ours } = &comparison.single_hop;
    seconds_table(
        ["Mean", "Lowest run", "Highest run", "Longest"],
        [
            row("Ancestor", ancestor),
            row("Ours, with settling time", ours),
        ],
    )
}

/// A table of times with two decimals.
fn seconds_table<const COLUMNS: usize, const ROWS: usize>(
    columns: [&str; COLUMNS],
    rows: [(&str, [Option<f64>; COLUMNS]); ROWS],
) -> Markup {
    html! {
        div.scroll {
            table {
                thead { tr { th {} @for column in columns { th.n { (column) ",\u{a0}s" } } } }
                tbody {
                    @for (name, times) in rows {
                        tr { td { (name) } @for seconds in times { td.n { (figure_or_dash(seconds, 2)) } } }
                    }
                }
            }
        }
    }
}

fn method(comparison: &Comparison) -> Markup {
    html! {
        section {
            h2 { "Method" }
            p.about {
                "The thesis gives means and extremes in tables, but the values of each drone in pictures only. All five "
                "tables follow one law, which replaces the pictures here: a member with its slot d metres from the "
                "master's slot flies d\u{a0}/\u{a0}10 + 12.4 seconds longer than the master, which flies 368 seconds."
            }
        }
        section {
            h2 { "Repeat the runs" }
            pre {
                code {
                    "muster thesis --seed " (comparison.seed) " --runs " (comparison.waits_runs.seeds.len())
                    " --engine " (comparison.engine) "\n"
                    @for report in comparison.of_first_seed() { (report.command) "\n" }
                }
            }
            p.about {
                "The same program version gives the same flights. Figures, and reports of the runs with this seed: "
                a href=(THESIS_JSON) { (THESIS_JSON) } "."
            }
        }
    }
}
