//! The pure relays of a run, as a table.

use maud::{Markup, html};

use crate::report::figures::count;
use crate::report::{RelayReport, Report};
use muster_runtime::text::{NOTHING, figure};

/// Where relays were and what they passed on; nothing without any.
pub(super) fn relays(report: &Report) -> Markup {
    html! {
        @if !report.relays.is_empty() {
            section {
                h2 { "Relays" }
                p.about { "They fly no mission and only pass on what others say; the swarm does not wait for them." }
                div.scroll {
                    table {
                        thead {
                            tr {
                                th.n { "Relay" }
                                th.n { "North,\u{a0}m" }
                                th.n { "East,\u{a0}m" }
                                th.n { "Altitude,\u{a0}m" }
                                th.n { "Hops" }
                                th.n { "Parent" }
                                th.n { "Sent" }
                                th.n { "Received" }
                            }
                        }
                        tbody { @for relay in &report.relays { (row(relay)) } }
                    }
                }
            }
        }
    }
}

fn row(relay: &RelayReport) -> Markup {
    let or_nothing = |value: Option<u32>| value.map_or(NOTHING.to_owned(), |it| it.to_string());
    html! {
        tr {
            td.n { (relay.id) }
            td.n { (figure(relay.north_m, 0)) }
            td.n { (figure(relay.east_m, 0)) }
            td.n { (figure(relay.altitude_m, 0)) }
            td.n { (or_nothing(relay.hops.map(u32::from))) }
            td.n { (or_nothing(relay.parent)) }
            td.n { (figure(count(relay.messages_sent), 0)) }
            td.n { (figure(count(relay.messages_received), 0)) }
        }
    }
}
