//! The figures of runs that a campaign estimates.

use muster_scenarios::report::count;

use super::row::Row;

/// A figure of a run that a summary estimates.
#[derive(Debug)]
pub struct Figure {
    /// Column in `runs.csv`.
    pub column: &'static str,
    /// Name in headings.
    pub name: &'static str,
    /// Short name of two lines, with the unit.
    pub short: &'static str,
    /// Unit; empty for a count.
    pub unit: &'static str,
    /// How it is measured.
    pub about: &'static str,
    /// Number of decimals in texts.
    pub digits: usize,
    /// Whether it is estimated from all runs without violations, or from those of them that completed their missions.
    pub(super) scope: Scope,
    pub(super) of: fn(&Row) -> Option<f64>,
}

/// The runs that a figure is estimated from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Scope {
    /// Those that broke no rule.
    Unbroken,
    /// Those that broke no rule and completed their missions.
    Complete,
}

/// All figures of a summary, in the order of the columns.
pub const FIGURES: [Figure; 17] = [
    Figure {
        column: "finished",
        name: "Drones that finished",
        short: "drones\nfinished",
        unit: "",
        about: "Drones that flew the mission to its end. Others stayed on the ground, landed early or were lost.",
        digits: 1,
        scope: Scope::Unbroken,
        of: |row| Some(count(row.finished)),
    },
    Figure {
        column: "flight_time_master_s",
        name: "Flight time of the master",
        short: "flight s\nmaster",
        unit: "s",
        about: "From the start of neighbour discovery to the end of landing.",
        digits: 1,
        scope: Scope::Complete,
        of: |row| row.flight_time_master_s,
    },
    Figure {
        column: "flight_time_mean_s",
        name: "Flight time, mean of the drones",
        short: "flight s\nmean",
        unit: "s",
        about: "Mean over the drones of a run that flew and landed.",
        digits: 1,
        scope: Scope::Complete,
        of: |row| row.flight_time_mean_s,
    },
    Figure {
        column: "flight_time_max_s",
        name: "Flight time, longest",
        short: "flight s\nlongest",
        unit: "s",
        about: "Longest flight time of a drone in a run.",
        digits: 1,
        scope: Scope::Complete,
        of: |row| row.flight_time_max_s,
    },
    Figure {
        column: "messages_received_mean",
        name: "Messages received, mean of the drones",
        short: "messages\nreceived",
        unit: "",
        about: "Frames that a drone accepted during its flight time.",
        digits: 0,
        scope: Scope::Unbroken,
        of: |row| Some(row.messages_received_mean),
    },
    Figure {
        column: "waypoint_wait_mean_ms",
        name: "Barrier wait, mean",
        short: "barrier\nwait ms",
        unit: "ms",
        about: "From the last arrival to the last departure at a waypoint.",
        digits: 1,
        scope: Scope::Unbroken,
        of: |row| row.waypoint_wait_mean_ms,
    },
    Figure {
        column: "transmissions_per_barrier",
        name: "Transmissions per barrier, mean",
        short: "frames/\nbarrier",
        unit: "",
        about: "Frames of all drones from the first arrival to the last departure, without keep-alives.",
        digits: 1,
        scope: Scope::Unbroken,
        of: |row| row.transmissions_per_barrier,
    },
    Figure {
        column: "keep_alives_per_barrier",
        name: "Keep-alives per barrier, mean",
        short: "keep-\nalives",
        unit: "",
        about: "Periodic frames sent in the same time.",
        digits: 1,
        scope: Scope::Unbroken,
        of: |row| row.keep_alives_per_barrier,
    },
    Figure {
        column: "retries_per_barrier",
        name: "Retries per barrier, mean",
        short: "MAC\nretries",
        unit: "",
        about: "Unicast frames retransmitted by the medium in the same time, for lack of an acknowledgement.",
        digits: 1,
        scope: Scope::Unbroken,
        of: |row| row.retries_per_barrier,
    },
    Figure {
        column: "election_max_s",
        name: "Election, longest",
        short: "election\nlongest s",
        unit: "s",
        about: "From the loss of the master until each network segment has one master that all its drones follow; of elections that ended.",
        digits: 2,
        scope: Scope::Unbroken,
        of: |row| row.election_max_s,
    },
    Figure {
        column: "min_separation_m",
        name: "Closest approach",
        short: "closest\nm",
        unit: "m",
        about: "Smallest straight-line distance of two flying drones.",
        digits: 2,
        scope: Scope::Unbroken,
        of: |row| row.min_separation_m,
    },
    Figure {
        column: "following_mean_m",
        name: "Formation error, mean",
        short: "error m\nmean",
        unit: "m",
        about: "Distance of the following drones from their slots around the master.",
        digits: 2,
        scope: Scope::Unbroken,
        of: |row| row.following_mean_m,
    },
    Figure {
        column: "following_p95_m",
        name: "Formation error, 95th percentile",
        short: "error m\np95",
        unit: "m",
        about: "95 % of the distances of a run are at most this long.",
        digits: 2,
        scope: Scope::Unbroken,
        of: |row| row.following_p95_m,
    },
    Figure {
        column: "following_max_m",
        name: "Formation error, largest",
        short: "error m\nlargest",
        unit: "m",
        about: "Longest distance of a following drone from its slot in a run.",
        digits: 2,
        scope: Scope::Unbroken,
        of: |row| row.following_max_m,
    },
    Figure {
        column: "medium_collided",
        name: "Receptions lost to collisions",
        short: "collided",
        unit: "",
        about: "Receptions of all radios lost to a collision, or because the receiver was transmitting.",
        digits: 0,
        scope: Scope::Unbroken,
        of: |row| row.medium_collided.map(count),
    },
    Figure {
        column: "medium_lost",
        name: "Receptions lost by radio.loss",
        short: "lost",
        unit: "",
        about: "Receptions of all radios lost at random.",
        digits: 0,
        scope: Scope::Unbroken,
        of: |row| row.medium_lost.map(count),
    },
    Figure {
        column: "medium_given_up",
        name: "Unicast frames given up",
        short: "given\nup",
        unit: "",
        about: "Unicast frames of all radios given up by the medium after the last retry.",
        digits: 0,
        scope: Scope::Unbroken,
        of: |row| row.medium_given_up.map(count),
    },
];
