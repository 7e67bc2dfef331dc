//! The patrols of a campaign for programs.

use serde::Serialize;

use crate::campaign::{Campaign, Row, cause_of};

/// Patrols of one flat, as printed by `muster map patrol --json`.
#[derive(Debug, Serialize)]
pub struct Patrols<'a> {
    /// Name of the flat.
    flat: &'a str,
    /// Time of the patrol without noise and people, in seconds.
    undisturbed_s: f64,
    /// One a seed, in order.
    patrols: Vec<Patrol>,
}

/// One patrol.
#[derive(Debug, Serialize)]
struct Patrol {
    seed: u64,
    /// Whether it ended where it was to, saw enough, and took no longer than it may.
    complete: bool,
    /// Whether the drone touched something, or moved where no sonar looks.
    rule_broken: bool,
    /// Whether the drone ended it.
    ended: bool,
    time_s: f64,
    /// Its time in times of the patrol among the same people without noise.
    times_without_noise: f64,
    /// Its time in times of the patrol without noise and people.
    times_without_noise_and_people: f64,
    /// Share of what can be seen that was seen.
    seen: f64,
    /// Least distance from walls and people.
    clearance_m: f64,
    touches_by_drone: usize,
    touches_by_people: usize,
    /// Why the drone landed early; `None` if it did not.
    landed_because: Option<&'static str>,
    stops_given_up: usize,
    /// Error of the believed position that 95 % of the steps stay below.
    position_error_p95_m: f64,
    blind_motions: u64,
}

impl<'a> Patrols<'a> {
    /// All patrols of a campaign in a flat.
    #[must_use]
    pub fn of(flat: &'a str, campaign: &Campaign) -> Self {
        Self {
            flat,
            undisturbed_s: campaign.undisturbed_s,
            patrols: campaign.rows.iter().map(Patrol::from).collect(),
        }
    }
}

impl From<&Row> for Patrol {
    fn from(row: &Row) -> Self {
        let [touches_by_drone, touches_by_people] = row.touches;
        Self {
            seed: row.seed,
            complete: row.is_complete() && !row.broke_rule(),
            rule_broken: row.broke_rule(),
            ended: row.is_done,
            time_s: row.time_s,
            times_without_noise: row.times,
            times_without_noise_and_people: row.times_alone,
            seen: row.seen,
            clearance_m: row.clearance_m,
            touches_by_drone,
            touches_by_people,
            landed_because: row.landed.map(cause_of),
            stops_given_up: row.given_up,
            position_error_p95_m: row.error_p95_m,
            blind_motions: row.blind_motions,
        }
    }
}
