use std::time::Duration;

use muster_machines::formation::{Change, Layout, Separation};
use muster_machines::geometry::Ned;
use muster_machines::identity::NodeId;
use muster_machines::mission::Holds;
use muster_machines::motion::Landing;
use muster_machines::navigation;
use muster_machines::supervision::RestartLimits;

use crate::diagnostic::BadInput;
use crate::mission_file;

use super::Limits;
use super::file::Source;
use super::load::to_usize;
use super::raw::{Raw, Seconds};

/// The longest run: a week.
pub(super) const DURATION_MAX: Duration = Duration::from_secs(604_800);

/// Legs between ground and slot: up, across, and up or down.
const LEGS_TO_SLOT: u32 = 3;

fn seconds(value: Option<Seconds>, default_s: f64) -> Duration {
    let seconds = value.map_or(default_s, |value| value.0);
    Duration::from_secs_f64(seconds.min(DURATION_MAX.as_secs_f64()))
}

/// Link timeout of the flight controllers, as ArduPilot's FS_GCS_TIMEOUT.
pub(super) fn controller(raw: &Raw) -> Duration {
    Duration::from_secs_f64(raw.limits.controller_s.0)
}

/// A swarm's flight, for estimates of its duration.
pub(super) struct Course<'a> {
    pub(super) layout: &'a Layout,
    pub(super) changes: &'a [Change],
    pub(super) waypoints: &'a [Ned],
    pub(super) holds: &'a Holds,
    /// The slowest vehicle's parameters.
    pub(super) vehicle: &'a navigation::Config,
    pub(super) landing: Landing,
    /// The longest time to come to rest at the end of a leg.
    pub(super) settle: Duration,
    /// When the operator ends the flight. `None`: it ends with the mission.
    pub(super) land_after: Option<Duration>,
}

/// The highest altitude layer or sector above the mission, in metres.
pub(super) fn highest_layer_m(layout: &Layout, changes: &[Change], waypoints: &[Ned]) -> f64 {
    let layouts = std::iter::once(layout).chain(changes.iter().map(Change::layout));
    let layers_m = layouts.map(|layout| layout.highest_layer_m(waypoints));
    let sectors_m = changes.iter().flat_map(Change::sectors_m).copied();
    layers_m.chain(sectors_m).fold(0.0, f64::max)
}

impl Course<'_> {
    fn highest_layer_m(&self) -> f64 {
        highest_layer_m(self.layout, self.changes, self.waypoints)
    }

    fn highest_waypoint_m(&self) -> f64 {
        let altitudes_m = self.waypoints.iter().map(|it| it.altitude_m());
        altitudes_m.fold(0.0, f64::max)
    }

    fn lowest_waypoint_m(&self) -> f64 {
        let altitudes_m = self.waypoints.iter().map(|it| it.altitude_m());
        altitudes_m.fold(f64::INFINITY, f64::min)
    }

    fn drones(&self) -> impl Iterator<Item = NodeId> + use<> {
        (0..self.layout.formation().drones()).map(NodeId)
    }

    fn slowest_mps(&self) -> f64 {
        let vehicle = self.vehicle;
        vehicle
            .speed_mps
            .min(vehicle.climb_mps)
            .min(vehicle.descent_mps)
    }

    /// Upper bound of a leg's duration, in seconds.
    fn leg_s(&self, from: Ned, to: Ned) -> f64 {
        let vehicle = self.vehicle;
        from.horizontal_distance_m(to) / vehicle.speed_mps
            + from.vertical_distance_m(to) / self.slowest_mps()
            + 2.0 * vehicle.speed_mps / vehicle.acceleration_mps2
            + self.settle.as_secs_f64()
    }

    /// Duration of each of the mission's legs, in seconds.
    fn legs_s(&self) -> impl Iterator<Item = f64> {
        let pairs = self.waypoints.windows(2);
        pairs.map(|pair| self.leg_s(pair[0], pair[1]))
    }

    /// Duration of the longest step of each change of formation, in seconds.
    fn changes_s(&self) -> impl Iterator<Item = f64> {
        self.changes.iter().map(|change| {
            let at = self.waypoints[usize::from(change.waypoint())];
            let steps = self.drones().flat_map(|id| {
                let [above_old, above_new, new] = change.path(id, at);
                [(above_old, above_new), (above_new, new)]
            });
            steps
                .map(|(from, to)| self.leg_s(from, to))
                .fold(0.0, f64::max)
        })
    }

    /// Duration of the longest path between ground and slot, in seconds.
    fn farthest_s(&self) -> f64 {
        let home = self.waypoints[0];
        let last = self.last_layout();
        let paths = self.drones().flat_map(|id| {
            [
                (
                    self.layout.take_off_place(id, home),
                    self.layout.slot(id, home),
                ),
                (last.slot(id, home), last.landing_place(id, home)),
            ]
        });
        let longest_s = paths
            .map(|(from, to)| self.leg_s(from, to))
            .fold(0.0, f64::max);
        longest_s
            + (home.altitude_m() + self.highest_layer_m()) / self.slowest_mps()
            + f64::from(LEGS_TO_SLOT - 1) * self.settle.as_secs_f64()
    }

    /// Extra duration of a leg for a drone out of lockstep, which flies above the highest waypoint; in seconds.
    fn climb_alone_s(&self) -> f64 {
        (self.highest_waypoint_m() - self.lowest_waypoint_m()) / self.slowest_mps()
    }

    /// Duration of the longest climb from a slot into an altitude layer, in seconds.
    fn climb_s(&self) -> f64 {
        let climb_mps = self.vehicle.climb_mps;
        let highest_m = self.highest_waypoint_m() + self.highest_layer_m();
        (highest_m - self.lowest_waypoint_m()) / climb_mps
            + climb_mps / self.vehicle.acceleration_mps2
    }

    fn landing_s(&self) -> f64 {
        let over_home_m = self.waypoints[0].altitude_m() + self.highest_layer_m();
        let highest_m = self.highest_waypoint_m().max(over_home_m) + self.highest_layer_m();
        highest_m / self.landing.final_mps.min(self.landing.descent_mps)
    }

    /// Expected duration from take-off to the ground, holds included; in seconds.
    fn flight_s(&self) -> f64 {
        let course_s = match self.land_after {
            // With a pilot, the swarm holds at waypoint 0 only.
            Some(after) => (after + self.holds.at(0)).as_secs_f64(),
            None => self.legs_s().sum::<f64>() + self.holds.total().as_secs_f64(),
        };
        let steps_s = self.changes_s().zip(self.changes);
        let changes_s = steps_s.map(|(step_s, change)| f64::from(change.waves() + 2) * step_s);
        let (take_off, landing) = (
            self.layout.take_off_waves(),
            self.last_layout().landing_waves(),
        );
        course_s
            + changes_s.sum::<f64>()
            + f64::from(take_off) * self.farthest_s()
            + f64::from(landing) * self.landing_s()
            + f64::from(landing - 1) * self.farthest_s()
    }

    /// The layout at the end of the mission.
    fn last_layout(&self) -> &Layout {
        self.changes.last().map_or(self.layout, Change::layout)
    }
}

/// The altitude limit, in metres above home.
pub(super) fn altitude_max_m(raw: &Raw) -> f64 {
    raw.limits.altitude_max_m.0
}

/// Refuses a mission whose formations need altitude layers above the altitude limit.
pub(super) fn check_layers(
    source: &Source,
    raw: &Raw,
    course: &Course<'_>,
) -> Result<(), BadInput> {
    let altitude_max_m = altitude_max_m(raw);
    let layer_m = course.highest_layer_m();
    let highest_m = course.highest_waypoint_m();
    if highest_m + layer_m <= altitude_max_m {
        return Ok(());
    }
    let message = format!(
        "the mission flies at up to {highest_m} m and its formations need altitude layers up to {layer_m} m above it, \
         more than the limit of {altitude_max_m} m"
    );
    Err(match raw.limits.altitude_max_m.span() {
        Some(span) => source.error(span, &message),
        None => {
            let help = format!(
                "set `limits.altitude_max_m` where you may fly higher, or let fewer drones fly: without it the limit is \
                 {altitude_max_m} m"
            );
            BadInput::without_excerpt(&source.shown, message, help)
        }
    })
}

pub(super) fn limits(raw: &Raw, separation: Separation, course: &Course<'_>) -> Limits {
    let farthest_s = course.farthest_s();
    let in_lockstep_s = course
        .legs_s()
        .chain(course.changes_s())
        .fold(farthest_s, f64::max);
    let longest_s = in_lockstep_s + course.climb_alone_s();
    let take_off = seconds(raw.limits.take_off_s, 2.0 * farthest_s + 60.0);
    let flight = seconds(None, course.flight_s());
    let flight_time_s = (take_off + flight * 2).as_secs_f64();
    let mut limits = Limits {
        separation,
        duration: Duration::ZERO,
        set_up: Duration::from_secs_f64(raw.limits.set_up_s.0),
        take_off,
        flight,
        flight_time: seconds(raw.limits.flight_time_s, flight_time_s),
        landing: seconds(None, course.landing_s()),
        climb: seconds(None, course.climb_s()),
        leg: seconds(raw.limits.leg_s, 2.0 * longest_s + 60.0),
        waypoints_max: mission_file::WAYPOINTS_MAX + 1,
        waiting_max: to_usize(raw.limits.waiting_max.0),
        hang: Duration::from_millis(raw.limits.hang_ms.0),
        watchdog: Duration::from_millis(raw.limits.watchdog_ms.0),
        controller: controller(raw),
        restarts: RestartLimits {
            restarts_max: u32::try_from(raw.limits.restarts_max.0).unwrap_or(u32::MAX),
            msp_restarts_max: u32::try_from(raw.limits.msp_restarts_max.0).unwrap_or(u32::MAX),
            window: Duration::from_secs_f64(raw.limits.restart_window_s.0),
            back_off: Duration::from_millis(10),
            back_off_max: Duration::from_secs(1),
        },
    };
    let default_s = limits.default_duration().as_secs_f64();
    limits.duration = seconds(raw.limits.duration_s, default_s);
    limits
}
