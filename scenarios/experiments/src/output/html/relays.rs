//! The table of pure relays.

use maud::{Markup, html};
use muster_runtime::text::{NO_VALUE, figure};
use muster_scenarios::report::{RelayReport, Report};

/// Position, route and traffic of the relays; empty without relays.
pub(super) fn relays(report: &Report) -> Markup {
    html! {
        @if !report.relays.is_empty() {
            section {
                h2 { "Relays" }
                p.about { "Relays forward frames and fly no mission. The swarm does not wait for them." }
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
    let or_dash = |value: Option<u32>| value.map_or(NO_VALUE.to_owned(), |it| it.to_string());
    let [sent, received] = relay.messages();
    html! {
        tr {
            td.n { (relay.id) }
            td.n { (figure(relay.north_m, 0)) }
            td.n { (figure(relay.east_m, 0)) }
            td.n { (figure(relay.altitude_m, 0)) }
            td.n { (or_dash(relay.hops.map(u32::from))) }
            td.n { (or_dash(relay.parent)) }
            td.n { (sent) }
            td.n { (received) }
        }
    }
}
