//! The figures of a run as tables for a browser.

use maud::{Markup, html};

use super::map::swatch;
use crate::report::figures::count;
use crate::report::{DroneReport, FormationError, Kind, Report};
use muster_runtime::text::{NOTHING, drones, figure, figure_or_nothing, plural, ranges};

/// Above this many drones, their table is folded.
const OPEN_MAX: usize = 40;

/// Every rule that was broken.
pub(super) fn violations(report: &Report) -> Markup {
    html! {
        div.scroll {
            table {
                thead { tr { th.n { "Rule" } th.n { "At,\u{a0}s" } th { "Who" } th { "What happened" } } }
                tbody {
                    @for violation in &report.violations {
                        tr {
                            td.n { (violation.rule) }
                            td.n { (figure(violation.at_s, 1)) }
                            td { (drones(&violation.drones)) }
                            td { (violation.what) }
                        }
                    }
                }
            }
        }
    }
}

/// Every wait for the swarm.
pub(super) fn barriers(report: &Report) -> Markup {
    if report.barriers.is_empty() {
        return html! { p.none { "The swarm waited at no waypoint." } };
    }
    html! {
        div.scroll {
            table {
                thead {
                    tr {
                        th.n { "Waypoint" }
                        th.n { "All arrived,\u{a0}s" }
                        th.n { "All moving,\u{a0}s" }
                        th.n { "Wait,\u{a0}s" }
                        th.n { "Transmissions" }
                    }
                }
                tbody {
                    @for barrier in &report.barriers {
                        tr {
                            td.n { (barrier.waypoint) }
                            td.n { (figure(barrier.arrived_s, 2)) }
                            td.n { (figure(barrier.moving_s, 2)) }
                            td.n { (figure(barrier.wait_s(), 2)) }
                            td.n { (figure(count(barrier.transmissions), 0)) }
                        }
                    }
                }
                tfoot {
                    tr {
                        th { "Mean" } td {} td {}
                        td.n { (figure_or_nothing(report.mean_wait_s(), 2)) }
                        td.n { (figure_or_nothing(report.mean_of_barriers(|it| it.transmissions), 0)) }
                    }
                }
            }
        }
    }
}

/// How well each drone kept formation on the master.
pub(super) fn following(report: &Report) -> Markup {
    let row = |error: &FormationError| {
        html! {
            td.n { (figure(error.mean_m, 2)) }
            td.n { (figure(error.p95_m, 2)) }
            td.n { (figure(error.max_m, 2)) }
            td.n { (figure(error.followed_s, 1)) }
        }
    };
    html! {
        details open[report.drones.len() <= OPEN_MAX] {
            summary { "Each drone" }
            div.scroll {
                table {
                    thead {
                        tr {
                            th.n { "Drone" }
                            th.n { "Mean,\u{a0}m" }
                            th.n { "95\u{a0}of\u{a0}100 within,\u{a0}m" }
                            th.n { "Most,\u{a0}m" }
                            th.n { "Followed,\u{a0}s" }
                        }
                    }
                    tbody {
                        @for drone in &report.drones {
                            @if let Some(error) = &drone.following {
                                tr { td.n { (drone.id) } (row(error)) }
                            }
                        }
                    }
                    tfoot {
                        @if let Some(error) = &report.following { tr { th { "All" } (row(error)) } }
                    }
                }
            }
        }
    }
}

/// Every change of formation.
pub(super) fn changes(report: &Report) -> Markup {
    html! {
        details open[report.changes.len() <= OPEN_MAX] {
            summary { (plural(report.changes.len(), "change")) }
            div.scroll {
                table {
                    thead {
                        tr {
                            th { "To" }
                            th.n { "At waypoint" }
                            th.n { "Begun,\u{a0}s" }
                            th.n { "Took,\u{a0}s" }
                            th.n { "Drones there" }
                            th.n { "Highest sector,\u{a0}m" }
                        }
                    }
                    tbody {
                        @for change in &report.changes {
                            tr {
                                td { (change.to) }
                                td.n { (change.waypoint) }
                                td.n { (figure(change.begun_s, 1)) }
                                td.n { (figure_or_nothing(change.took_s(), 1)) }
                                td.n { (change.drones) }
                                td.n { (figure(change.sector_max_m, 1)) }
                            }
                        }
                    }
                }
            }
        }
    }
}

/// Every drone's figures.
pub(super) fn swarm(report: &Report) -> Markup {
    html! {
        details open[report.drones.len() <= OPEN_MAX] {
            summary { "All figures of each drone" }
            div.scroll {
                table {
                    thead {
                        tr {
                            th.n { "Drone" }
                            th { "Role" }
                            th.n { "Hops" }
                            th.n { "Through" }
                            th { "Hears master" }
                            th { "Routes for" }
                            th.n { "Flight time,\u{a0}s" }
                            th.n { "Sent" }
                            th.n { "Received" }
                            th.n { "Waypoint delay,\u{a0}s" }
                            th.n { "Restarts" }
                            th { "At the end" }
                        }
                    }
                    tbody { @for drone in &report.drones { (row(drone)) } }
                    tfoot {
                        tr {
                            th { "Mean" } td {} td {} td {} td {} td {}
                            td.n { (figure_or_nothing(report.means.flight_time_s, 1)) }
                            td.n { (figure_or_nothing(report.mean_messages_sent(), 0)) }
                            td.n { (figure(report.means.messages_received, 0)) }
                            td.n { (figure_or_nothing(report.mean_waypoint_delay_s(), 2)) }
                            td {} td {}
                        }
                    }
                }
            }
        }
    }
}

fn row(drone: &DroneReport) -> Markup {
    let kind = drone.kind();
    let number = |value: Option<u32>| value.map_or_else(|| NOTHING.to_owned(), |v| v.to_string());
    html! {
        tr.leads[kind == Kind::Master] {
            td.n { (drone.id) }
            td.role { (swatch(kind)) (kind.name()) }
            td.n { (number(drone.hops.map(u32::from))) }
            td.n { (number(drone.parent)) }
            td { @if drone.out_of_range { "no" } @else { "yes" } }
            td { (ranges(&drone.routing_list)) }
            td.n { (figure_or_nothing(drone.flight_time_s, 1)) }
            td.n { (figure(count(drone.messages_sent), 0)) }
            td.n { (figure(count(drone.messages_received), 0)) }
            td.n { (figure_or_nothing(drone.waypoint_delay_s, 2)) }
            td.n { (drone.restarts) }
            td {
                (drone.state)
                @if let Some(why) = &drone.landed_because { span.why { "came down early: " (why) } }
            }
        }
    }
}
