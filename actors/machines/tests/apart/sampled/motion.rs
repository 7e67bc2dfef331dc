//! Motion of drones: straight from corner to corner, with random delays and stops.

use muster_machines::formation::{Exposure, FlightPlan, Layering, Path, Phase, PhaseKind};
use muster_machines::geometry::Ned;
use muster_machines::identity::NodeId;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Start delay, speed and stop of a drone.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pace {
    delay_s: f64,
    speed_mps: f64,
    /// Position of the stop, as a fraction of the whole path.
    stop_at: f64,
    stop_s: f64,
}

impl Pace {
    pub(super) fn draw(rng: &mut ChaCha8Rng) -> Self {
        Self {
            delay_s: rng.random_range(0.0..8.0),
            speed_mps: rng.random_range(2.0..12.0),
            stop_at: rng.random_range(0.0..1.0),
            stop_s: rng.random_range(0.0..8.0),
        }
    }
}

/// Timed positions of a drone, with straight and even motion in between.
#[derive(Debug, Clone)]
pub(super) struct Motion {
    stations: Vec<(f64, Ned)>,
    offset_s: f64,
}

impl Motion {
    pub(super) fn new(corners: &[Ned], pace: Pace) -> Self {
        let mut stations = vec![(0.0, corners[0])];
        let mut motion = Self {
            stations: Vec::new(),
            offset_s: 0.0,
        };
        let mut time_s = pace.delay_s;
        stations.push((time_s, corners[0]));
        let legs = || corners.windows(2).map(|leg| leg[0].distance_m(leg[1]));
        let stop_m = legs().sum::<f64>() * pace.stop_at;
        let mut flown_m = 0.0;
        for leg in corners.windows(2) {
            let length_m = leg[0].distance_m(leg[1]);
            let stops = (flown_m..flown_m + length_m).contains(&stop_m);
            if stops {
                let share = (stop_m - flown_m) / length_m;
                let at = Ned(leg[0].0.lerp(&leg[1].0, share));
                let stop_at_s = time_s + length_m * share / pace.speed_mps;
                stations.extend([(stop_at_s, at), (stop_at_s + pace.stop_s, at)]);
            }
            time_s += length_m / pace.speed_mps + if stops { pace.stop_s } else { 0.0 };
            flown_m += length_m;
            stations.push((time_s, leg[1]));
        }
        motion.stations = stations;
        motion
    }

    /// Shifts the start by `time_s`.
    pub(super) fn advance(&mut self, time_s: f64) {
        self.offset_s += time_s;
    }

    pub(super) fn ends_s(&self) -> f64 {
        self.stations[self.stations.len() - 1].0 - self.offset_s
    }

    pub(super) fn at(&self, time_s: f64) -> Ned {
        let time_s = time_s + self.offset_s;
        let next = self.stations.partition_point(|(at_s, _)| *at_s <= time_s);
        match (
            next.checked_sub(1).map(|last| self.stations[last]),
            self.stations.get(next),
        ) {
            (None, _) => self.stations[0].1,
            (Some((_, last)), None) => last,
            (Some((from_s, from)), Some((to_s, to))) => {
                Ned(from.0.lerp(&to.0, (time_s - from_s) / (to_s - from_s)))
            }
        }
    }

    /// Replaces the motion from `time_s` on: hovers, then flies these corners.
    fn then(mut self, time_s: f64, hover_s: f64, corners: &[Ned], speed_mps: f64) -> Self {
        let here = self.at(time_s);
        self.stations.retain(|(at_s, _)| *at_s < time_s);
        let mut now_s = time_s + hover_s;
        self.stations.extend([(time_s, here), (now_s, here)]);
        let mut last = here;
        for corner in corners {
            now_s += last.distance_m(*corner) / speed_mps;
            self.stations.push((now_s, *corner));
            last = *corner;
        }
        self
    }
}

pub(super) fn corners(paths: &[Path]) -> Vec<Ned> {
    let ends = paths.iter().map(|path| path.to);
    std::iter::once(paths[0].from).chain(ends).collect()
}

/// Motion of a drone out of lockstep in a phase: with `BothApart` from when it has left it, otherwise from the start.
pub(super) fn out_of_lockstep(
    rng: &mut ChaCha8Rng,
    plan: FlightPlan<'_>,
    phase: &Phase,
    id: NodeId,
    exposure: Exposure,
) -> Motion {
    let paths = &phase.paths[id.0 as usize];
    let own = Motion::new(&corners(paths), Pace::draw(rng));
    let when_s = rng.random_range(0.0..=own.ends_s());
    let speed_mps = rng.random_range(0.5..3.0);
    let here = own.at(when_s);
    match exposure {
        Exposure::Late => own,
        Exposure::Descends => own.then(when_s, 0.0, &[here.at_altitude(0.0)], speed_mps),
        Exposure::Killed => own.then(when_s, 5.0, &[here.at_altitude(0.0)], speed_mps),
        Exposure::Apart => match slot_near_ground(phase, id) {
            Some(slot) => Motion::new(&alone(plan, slot, phase, id), Pace::draw(rng)),
            None => own.then(
                when_s,
                0.0,
                &alone(plan, here, phase, id)[1..],
                3.0 * speed_mps,
            ),
        },
        Exposure::BothApart => {
            let from = slot_near_ground(phase, id).unwrap_or(here);
            let lands_here = !plan.layout.lands_below_slot() && rng.random_bool(0.3);
            let corners = if lands_here {
                landing(plan, phase.end(id), phase, id)
            } else {
                alone(plan, from, phase, id)
            };
            Motion::new(&corners, Pace::draw(rng))
        }
    }
}

/// The slot in which a drone falls out of lockstep while all take off or land. `None` in other phases.
fn slot_near_ground(phase: &Phase, id: NodeId) -> Option<Ned> {
    match phase.kind {
        PhaseKind::TakeOff { .. } => Some(phase.end(id)),
        PhaseKind::Land { .. } => Some(phase.paths[id.0 as usize][0].from),
        _ => None,
    }
}

/// Whether a drone out of lockstep flies in its altitude layer in a phase.
pub(super) fn flies_alone(plan: FlightPlan<'_>, phase: &Phase) -> bool {
    let is_step = matches!(
        phase.kind,
        PhaseKind::Climb { .. } | PhaseKind::Cross { .. } | PhaseKind::Descend { .. }
    );
    !is_step || plan.layout.layering() == Layering::PerDrone
}

/// Motions of all drones in their layers, from where they are after the previous phase.
pub(super) fn all_alone(
    rng: &mut ChaCha8Rng,
    plan: FlightPlan<'_>,
    before: &Phase,
    phase: &Phase,
) -> Vec<Motion> {
    let drones = (0..plan.layout.formation().drones()).map(NodeId);
    let motions = drones.map(|id| {
        let corners = alone(plan, before.end(id), phase, id);
        Motion::new(&corners, Pace::draw(rng))
    });
    motions.collect()
}

/// Corners of a path in the drone's layer from `from` to the end of a phase.
fn alone(plan: FlightPlan<'_>, from: Ned, phase: &Phase, id: NodeId) -> Vec<Ned> {
    if matches!(phase.kind, PhaseKind::Land { .. }) {
        return landing(plan, from, phase, id);
    }
    let altitude_m = plan.altitude_alone_m(id, phase.changes, plan.waypoints[phase.waypoint]);
    let [up, over] = [from, phase.end(id)].map(|it| it.at_altitude(altitude_m));
    vec![from, up, over]
}

/// Corners of a path in the drone's layer from `from` to its landing place around the waypoint of a phase.
fn landing(plan: FlightPlan<'_>, from: Ned, phase: &Phase, id: NodeId) -> Vec<Ned> {
    let centre = plan.waypoints[phase.waypoint];
    let altitude_m = plan.altitude_alone_m(id, phase.changes, centre);
    let layout = plan.layout_after(phase.changes);
    let place = if layout.lands_below_slot() {
        layout.slot(id, plan.landing_centre(id, phase.changes, centre))
    } else {
        layout.landing_place(id, centre)
    };
    let [up, over] = [from, place].map(|it| it.at_altitude(altitude_m));
    vec![from, up, over, place.at_altitude(0.0)]
}
