//! The replay of a run: its record as JSON, and a script that plays it.

mod record;
#[cfg(test)]
mod tests;
mod values;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use maud::{Markup, PreEscaped, html};
use muster_scenarios::report::{Flight, Report};
use sha2::{Digest as _, Sha256};

/// Style sheet of the replay.
pub(super) const STYLE: &str = include_str!("replay.css");

/// The script, with a scope of its own.
const SCRIPT: &str = concat!(
    "(() => {\n\"use strict\";\n",
    include_str!("record.js"),
    include_str!("theme.js"),
    include_str!("ground.js"),
    include_str!("map.js"),
    include_str!("plots.js"),
    include_str!("values.js"),
    include_str!("panel.js"),
    include_str!("pointers.js"),
    include_str!("player.js"),
    "})();\n",
);

/// Source of the content security policy that allows the script, and no other.
pub(super) fn script_source() -> String {
    format!("'sha256-{}'", STANDARD.encode(Sha256::digest(SCRIPT)))
}

/// The replay; hidden until its script runs.
pub(super) fn section(report: &Report) -> Markup {
    html! {
        section.replay hidden aria-label="Replay" {
            div.replay-title {
                h2 { "Replay" }
                p.about {
                    "Drag the time, or press play. Click a drone for its state. "
                    span.replay-keys {
                        "Keys, after a press in the replay: " kbd { "space" } " play, " kbd { "←" } " " kbd { "→" } " a second (with " kbd { "shift" } " ten), "
                        kbd { "home" } " " kbd { "end" } ", " kbd { "n" } " " kbd { "p" } " next and previous mark."
                    }
                }
            }
            div.replay-stage {
                (ground())
                div.replay-controls { (transport()) (time()) }
                (side())
            }
            (plots())
            (legend(report.swarms().any(|it| !it.relays.is_empty())))
        }
        noscript { p.about { "The replay of this run needs JavaScript. Everything below does not." } }
    }
}

/// The record and the script. They stand at the end of the page, which is complete when the script runs.
pub(super) fn script(report: &Report, flight: &Flight) -> Markup {
    let record = serde_json::to_string(&record::record(report, flight));
    // Only texts can have a `<`, which could end the element.
    let record = record
        .expect("a record holds no fallible values")
        .replace('<', "\\u003c");
    html! {
        script id="record" type="application/json" { (PreEscaped(record)) }
        script { (PreEscaped(SCRIPT)) }
    }
}

fn ground() -> Markup {
    html! {
        div.replay-ground {
            canvas.replay-map tabindex="0" role="img"
                aria-label="Map of the drones at the chosen time, north up. What it shows is written beside it." {}
            div.replay-tools {
                button.replay-whole type="button" title="Show the whole flight" { "whole" }
                button.replay-swarm type="button" title="Follow the swarm" { "swarm" }
                button.replay-in type="button" aria-label="Zoom in" { "+" }
                button.replay-out type="button" aria-label="Zoom out" { "−" }
            }
            p.replay-caption aria-live="polite" {}
        }
    }
}

fn side() -> Markup {
    html! {
        div.replay-side {
            div {
                h3 { "Who leads" }
                ul.replay-leaders {}
            }
            div {
                label.replay-pick { "Drone" select.replay-drone {} }
                dl.replay-facts hidden {}
            }
            div.replay-happened {
                h3 { "What happened" }
                ol.replay-list {}
            }
        }
    }
}

fn transport() -> Markup {
    html! {
        div.replay-transport {
            button.replay-previous type="button" aria-label="Previous mark" {}
            button.replay-play type="button" aria-label="Play" {}
            button.replay-next type="button" aria-label="Next mark" {}
            span.replay-clock { b.replay-clock-now {} " s of " span.replay-clock-end {} " s" }
            label.replay-speed-label { "Speed" select.replay-speed {} }
            div.replay-shows {
                @for (name, text) in [("links", "links"), ("tree", "parents"), ("trails", "trails"), ("names", "ids")] {
                    label { input.{ "replay-shows-" (name) } type="checkbox" checked; (text) }
                }
            }
        }
    }
}

fn time() -> Markup {
    html! {
        div.replay-time {
            div.replay-tip role="tooltip" hidden {}
            div.replay-marks {}
            input.replay-slider type="range" min="0" max="1" step="any" value="0" aria-label="Time";
            canvas.replay-plot.replay-strip role="img"
                aria-label="Share of the drones that follow each leader, over time, with the waypoints left" {}
        }
    }
}

fn plots() -> Markup {
    html! {
        div.replay-plots {
            div {
                h3 { "Altitude above home" span.replay-now.replay-altitude-now {} }
                canvas.replay-plot.replay-altitudes role="img" aria-label="Altitude of each drone over time" {}
            }
            div {
                h3 { "Closest pair, logarithmic scale" span.replay-now.replay-closest-now {} }
                canvas.replay-plot.replay-closest role="img"
                    aria-label="Distance of the closest two flying drones over time, and the least that is required over ground" {}
            }
            div.replay-values {}
        }
    }
}

fn legend(has_masts: bool) -> Markup {
    html! {
        ul.legend.replay-legend {
            li { span.replay-key.leader {} "leader" }
            li { span.replay-key {} "relays" }
            @if has_masts {
                li { "▲ relay that stands" }
            }
            li { span.replay-key.member {} "member" }
            li { span.replay-key.dead {} "dead" }
            li { span.replay-key.out {} "landed, off or hanging" }
            li { span.replay-key.line {} "radio link" }
            li { span.replay-key.line.tree {} "to its parent" }
            li { "A colour is a leader epoch: all who follow the same leader have it." }
        }
    }
}
