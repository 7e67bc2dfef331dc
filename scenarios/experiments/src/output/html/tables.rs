//! The HTML tables of a run.

use maud::{Markup, html};
use muster_runtime::text::{NO_VALUE, drones, figure, figure_or_dash, plural, ranges};
use muster_scenarios::report::{DroneReport, FormationError, Report, count};

use super::map::swatch;
use crate::output::figures::{Kind, final_state};

/// Tables with more rows than this are folded.
const OPEN_MAX: usize = 40;

/// Table of the violations.
pub(super) fn violations(report: &Report) -> Markup {
    html! {
        div.scroll {
            table {
                thead { tr { th.n { "Rule" } th.n { "Time,\u{a0}s" } th { "Drones" } th { "Violation" } } }
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

/// Table of the barriers.
pub(super) fn barriers(report: &Report) -> Markup {
    if report.barriers.is_empty() {
        return html! { p.none { "No barriers." } };
    }
    html! {
        div.scroll {
            table {
                thead {
                    tr {
                        th.n { "Waypoint" }
                        th.n { "Last arrival,\u{a0}s" }
                        th.n { "Last departure,\u{a0}s" }
                        th.n { "Barrier wait,\u{a0}s" }
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
                        td.n { (figure_or_dash(report.mean_wait_s(), 2)) }
                        td.n { (figure_or_dash(report.mean_of_barriers(|it| it.transmissions), 0)) }
                    }
                }
            }
        }
    }
}

/// Table of the formation errors.
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
                            th.n { "95th percentile,\u{a0}m" }
                            th.n { "Maximum,\u{a0}m" }
                            th.n { "Following time,\u{a0}s" }
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

/// Table of the formation changes.
pub(super) fn changes(report: &Report) -> Markup {
    html! {
        details open[report.changes.len() <= OPEN_MAX] {
            summary { (plural(report.changes.len(), "change")) }
            div.scroll {
                table {
                    thead {
                        tr {
                            th { "New formation" }
                            th.n { "Waypoint" }
                            th.n { "Start,\u{a0}s" }
                            th.n { "Duration,\u{a0}s" }
                            th.n { "Drones completed" }
                            th.n { "Highest layer,\u{a0}m" }
                        }
                    }
                    tbody {
                        @for change in &report.changes {
                            tr {
                                td { (change.to) }
                                td.n { (change.waypoint) }
                                td.n { (figure(change.begun_s, 1)) }
                                td.n { (figure_or_dash(change.took_s(), 1)) }
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

/// Table of the drones.
pub(super) fn swarm(report: &Report) -> Markup {
    html! {
        details open[report.drones.len() <= OPEN_MAX] {
            summary { "All drones" }
            div.scroll {
                table {
                    thead {
                        tr {
                            th.n { "Drone" }
                            th { "Role" }
                            th.n { "Hops" }
                            th.n { "Parent" }
                            th { "In master's range" }
                            th { "Routing list" }
                            th.n { "Flight time,\u{a0}s" }
                            th.n { "Sent" }
                            th.n { "Received" }
                            th.n { "Waypoint delay,\u{a0}s" }
                            th.n { "Restarts" }
                            th { "Final state" }
                        }
                    }
                    tbody { @for drone in &report.drones { (row(drone)) } }
                    tfoot {
                        tr {
                            th { "Mean" } td {} td {} td {} td {} td {}
                            td.n { (figure_or_dash(report.means.flight_time_s, 1)) }
                            td.n { (figure_or_dash(report.mean_messages_sent(), 0)) }
                            td.n { (figure(report.means.messages_received, 0)) }
                            td.n { (figure_or_dash(report.mean_waypoint_delay_s(), 2)) }
                            td {} td {}
                        }
                    }
                }
            }
        }
    }
}

fn row(drone: &DroneReport) -> Markup {
    let kind = Kind::of(drone);
    let [sent, received] = drone.messages();
    let number = |value: Option<u32>| value.map_or_else(|| NO_VALUE.to_owned(), |v| v.to_string());
    html! {
        tr.leads[kind == Kind::Master] {
            td.n { (drone.id) }
            td.role { (swatch(kind)) (kind.name()) }
            td.n { (number(drone.hops.map(u32::from))) }
            td.n { (number(drone.parent)) }
            td { @if drone.out_of_range { "no" } @else { "yes" } }
            td { (ranges(&drone.routing_list)) }
            td.n { (figure_or_dash(drone.flight_time_s, 1)) }
            td.n { (sent) }
            td.n { (received) }
            td.n { (figure_or_dash(drone.waypoint_delay_s, 2)) }
            td.n { (drone.restarts) }
            td.state {
                (final_state(drone))
                @if let Some(why) = &drone.landed_because {
                    span.why { @if final_state(drone) == drone.state { "landed early: " } (why) }
                }
            }
        }
    }
}
