//! For how long drones are out of the master's reach while all fly as planned.

use std::collections::BTreeMap;
use std::time::Duration;

use super::{FlightPlan, Path, Paths, Phase, PhaseKind, SEARCHED_MAX};
use crate::geometry::Ned;
use crate::identity::NodeId;
use crate::motion::Leg;
use crate::navigation;

/// Time between two looks at who reaches whom, in seconds: of up to [`SEARCHED_MAX`] drones, and of more.
const STEPS_S: [f64; 2] = [1.0, 10.0];

/// Most looks in a phase, for slow vehicles.
const LOOKS_MAX: f64 = 600.0;

/// A flight in which all drones start each phase at once and none is late.
pub struct PlannedFlight<'a> {
    /// The plan.
    pub flight: FlightPlan<'a>,
    /// Speeds of the drones.
    pub vehicle: &'a navigation::Config,
    /// Time to come to rest at the end of a path.
    pub settle: Duration,
    /// Radio range, in metres.
    pub range_m: f64,
    /// Places of stationary relays.
    pub relays: &'a [Ned],
}

/// Drones that are out of the master's reach in a phase, though they would reach it if all were in their slots.
pub struct Unreached {
    /// What is flown.
    pub kind: PhaseKind,
    /// For how long each of them is out of reach by the end of the phase, without a break; since earlier phases, if it was so
    /// before.
    pub drones: Vec<(NodeId, Duration)>,
}

impl Unreached {
    /// The longest time for which one of them is out of reach; zero without one.
    #[must_use]
    pub fn longest(&self) -> Duration {
        let times = self.drones.iter().map(|(_, out)| *out);
        times.max().unwrap_or_default()
    }
}

impl PlannedFlight<'_> {
    /// Who is out of reach in each phase that is not a leg, for longer than `tolerated`. Takes time in proportion to the length of
    /// the flight and, for most formations, to the number of drones.
    pub fn unreached(
        &self,
        tolerated: impl Fn(PhaseKind) -> Duration,
    ) -> impl Iterator<Item = Unreached> {
        let drones = self.flight.layout.formation().drones() as usize;
        // Drones that links connect with the master in the slots of a formation.
        let mut in_slots: BTreeMap<u16, Vec<bool>> = BTreeMap::new();
        let mut out_s = vec![0.0; drones];
        let phases = self.flight.phases();
        let phases = phases.filter(|phase| !phase.is_translation());
        phases.map(move |phase| {
            let connected = in_slots.entry(phase.changes).or_insert_with(|| {
                let layout = self.flight.layout_after(phase.changes);
                let ids = (0..layout.formation().drones()).map(NodeId);
                let slots = ids.map(|id| layout.slot(id, self.flight.waypoints[phase.waypoint]));
                self.reached(slots.map(Some))
            });
            let longest_s = self.longest_s(&phase, &mut out_s);
            let tolerated = tolerated(phase.kind);
            let out = longest_s.into_iter().zip(connected).zip(0..);
            let out = out.filter(|((_, is_connected), _)| **is_connected);
            let duration = |seconds| Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX);
            let out = out.map(|((out_s, _), id)| (NodeId(id), duration(out_s)));
            Unreached {
                kind: phase.kind,
                drones: out.filter(|(_, out)| *out > tolerated).collect(),
            }
        })
    }

    /// For how long each drone is out of reach at most; `out_s` is the time before and, on return, at the end of the phase.
    fn longest_s(&self, phase: &Phase, out_s: &mut [f64]) -> Vec<f64> {
        let flown: Vec<Vec<TimedPath>> =
            (phase.paths.iter().map(|paths| self.timed(paths))).collect();
        let times_s = flown
            .iter()
            .map(|paths| paths.iter().map(|it| it.time_s).sum());
        let phase_s = times_s.fold(0.0, f64::max);
        let mut longest_s = out_s.to_vec();
        let step_s = STEPS_S[usize::from(out_s.len() > SEARCHED_MAX)].max(phase_s / LOOKS_MAX);
        let mut at_s = 0.0;
        while at_s < phase_s {
            at_s = phase_s.min(at_s + step_s);
            let places = phase.paths.iter().zip(&flown).map(|(paths, flown)| {
                let relays = !is_landed(phase.kind, paths);
                relays.then(|| place(flown, at_s))
            });
            let reached = self.reached(places);
            let each = out_s.iter_mut().zip(&mut longest_s);
            for ((out_s, longest_s), (paths, is_reached)) in
                each.zip(phase.paths.iter().zip(reached))
            {
                // A drone that is told to land needs no further order.
                let has_orders = matches!(phase.kind, PhaseKind::Land { .. })
                    && paths[paths.len() - 1].to.altitude_m() <= 0.0;
                let is_out = !is_reached && !has_orders;
                *out_s = if is_out { *out_s + step_s } else { 0.0 };
                *longest_s = longest_s.max(*out_s);
            }
        }
        longest_s
    }

    fn timed(&self, paths: &Paths) -> Vec<TimedPath> {
        let settle_s = self.settle.as_secs_f64();
        let timed = paths.iter().map(|path| {
            let leg = self.vehicle.profile(path.from, path.to);
            let flown_s = leg.duration_s();
            TimedPath {
                path: *path,
                leg,
                time_s: flown_s + if flown_s > 0.0 { settle_s } else { 0.0 },
            }
        });
        timed.collect()
    }

    /// Whether links connect each drone with the master, over other drones and relays. A drone without a place relays nothing.
    fn reached(&self, places: impl Iterator<Item = Option<Ned>>) -> Vec<bool> {
        let relays = self.relays.iter().copied().map(Some);
        let places: Vec<Option<Ned>> = places.chain(relays).collect();
        let master = self.flight.layout.formation().centre().0 as usize;
        // Drones not reached yet, by squares as wide as the range, so that each drone looks at those near it only.
        let square =
            |at: &Ned| [at.north_m(), at.east_m()].map(|m| (m / self.range_m).floor() as i64);
        let mut left: BTreeMap<[i64; 2], Vec<(usize, Ned)>> = BTreeMap::new();
        for (id, place) in (0..).zip(&places) {
            if let Some(place) = place.filter(|_| id != master) {
                left.entry(square(&place)).or_default().push((id, place));
            }
        }
        let mut reached = vec![false; places.len()];
        reached[master] = true;
        let mut next: Vec<Ned> = places[master].into_iter().collect();
        while let Some(from) = next.pop() {
            let around = |at: i64| at.saturating_sub(1)..=at.saturating_add(1);
            let [rows, columns] = square(&from).map(around);
            let squares = rows.flat_map(|row| columns.clone().map(move |column| [row, column]));
            for near in squares {
                let Some(left) = left.get_mut(&near) else {
                    continue;
                };
                left.retain(|(id, place)| {
                    let is_near = (*place - from).0.norm_squared() <= self.range_m * self.range_m;
                    if is_near {
                        reached[*id] = true;
                        next.push(*place);
                    }
                    !is_near
                });
            }
        }
        reached.truncate(self.flight.layout.formation().drones() as usize);
        reached
    }
}

/// A path, and how it is flown.
struct TimedPath {
    path: Path,
    leg: Leg,
    /// Time of the path and of the rest at its end, in seconds.
    time_s: f64,
}

/// Where a drone is at a time after the start of its paths.
fn place(paths: &[TimedPath], at_s: f64) -> Ned {
    let mut left_s = at_s;
    for TimedPath { path, leg, time_s } in paths {
        if left_s < *time_s {
            let share = leg.flown_m(left_s) / (path.to - path.from).0.norm();
            return Ned(path.from.0.lerp(&path.to.0, share));
        }
        left_s -= time_s;
    }
    paths[paths.len() - 1].path.to
}

/// Whether a drone has been on the ground since an earlier wave landed: it relays no longer.
fn is_landed(kind: PhaseKind, paths: &Paths) -> bool {
    matches!(kind, PhaseKind::Land { .. }) && paths[0].from.altitude_m() <= 0.0
}

#[cfg(test)]
mod tests {
    use std::num::NonZeroU32;

    use super::*;
    use crate::formation::{Change, Formation, Kind, Layout, Separation};

    /// The phases of a line of nine, 50 m apart, which becomes a matrix, in which a drone is out of a range of 60 m for over 10 s.
    fn unreached(vertical_m: f64, relays: &[Ned]) -> Vec<PhaseKind> {
        let formation = |kind| Formation::new(kind, NonZeroU32::new(9).unwrap(), 50.0, 0.0);
        let separation = Separation {
            horizontal_m: 5.0,
            vertical_m,
        };
        let layout = Layout::new(formation(Kind::Linear), 10.0, separation);
        let change = Change::new(1, &layout, formation(Kind::CompactMatrix));
        let waypoints = [0.0, 100.0].map(|north_m| Ned::new(north_m, 0.0, -20.0));
        let vehicle = navigation::Config {
            speed_mps: 10.0,
            climb_mps: 2.5,
            descent_mps: 2.5,
            acceleration_mps2: 1.0,
            failsafe: navigation::Failsafe {
                position_hold: Duration::ZERO,
                battery_low: 0.0,
                battery_critical: 0.0,
                fence: None,
            },
            avoid: None,
        };
        let planned = PlannedFlight {
            flight: FlightPlan {
                layout: &layout,
                changes: &[change],
                waypoints: &waypoints,
            },
            vehicle: &vehicle,
            settle: Duration::ZERO,
            range_m: 60.0,
            relays,
        };
        let phases = planned.unreached(|_| Duration::from_secs(10));
        let phases = phases.filter(|it| !it.drones.is_empty());
        phases.map(|it| it.kind).collect()
    }

    #[test]
    fn drones_in_sectors_far_above_each_other_are_out_of_reach() {
        let crosses = PhaseKind::Cross { change: 0, wave: 0 };
        assert!(unreached(40.0, &[]).contains(&crosses));
        assert_eq!(unreached(1.0, &[]), []);
    }

    #[test]
    fn relays_keep_drones_in_reach() {
        let between: Vec<Ned> = (-8..=8)
            .flat_map(|east| [-50, -90].map(|down| (east, down)))
            .map(|(east, down)| Ned::new(100.0, f64::from(east) * 25.0, f64::from(down)))
            .collect();
        assert_eq!(unreached(40.0, &between), []);
    }
}
