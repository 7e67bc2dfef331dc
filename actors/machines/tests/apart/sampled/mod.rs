//! Random plans with sampled motion, compared with the separation model.

mod motion;
mod plan;

use std::collections::BTreeSet;
use std::fmt;

use muster_machines::formation::{
    Exposure, FlightPlan, Phase, PhaseKind, PhaseSeparation, Proximity, Separation,
};
use muster_machines::geometry::Ned;
use muster_machines::identity::NodeId;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use motion::Motion;
use plan::Plan;

/// Sampling interval, in seconds.
const STEP_S: f64 = 0.05;
/// Longest sampled time of a phase, in seconds.
const LONGEST_S: f64 = 240.0;
/// Tolerance of a prediction, for rounding.
const ROUNDING: f64 = 1e-6;

/// Sampled pairs of drones out of lockstep in a phase.
const PAIRS: usize = 20;

/// Exposures of one phase.
type Exposures = Vec<(Exposure, Proximity)>;

/// Results of comparisons.
#[derive(Debug, Default)]
pub(crate) struct Tally {
    /// Number of plans.
    pub(crate) plans: usize,
    /// Number of sampled phases.
    pub(crate) phases: usize,
    /// Number of sampled pairs of positions.
    pub(crate) samples: usize,
    /// Phases with a closest approach in lockstep within 20 % of the predicted one.
    pub(crate) lockstep_tight: usize,
    /// Predicted conflicts of a drone out of lockstep that occurred.
    pub(crate) conflicts: usize,
    /// Predicted conflicts of two drones out of lockstep that occurred.
    pub(crate) both_apart: usize,
    /// Approaches closer than predicted.
    pub(crate) violations: Vec<String>,
}

impl Tally {
    /// Adds another tally.
    pub(crate) fn add(&mut self, other: &Self) {
        self.plans += other.plans;
        self.phases += other.phases;
        self.samples += other.samples;
        self.lockstep_tight += other.lockstep_tight;
        self.conflicts += other.conflicts;
        self.both_apart += other.both_apart;
        self.violations.extend(other.violations.iter().cloned());
    }
}

impl fmt::Display for Tally {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} plans, {} phases, {} sampled pairs; {} phases with a closest approach in lockstep within 20 % of the \
             prediction; {} predicted conflicts of one drone out of lockstep occurred, {} of two; {} predictions violated",
            self.plans,
            self.phases,
            self.samples,
            self.lockstep_tight,
            self.conflicts,
            self.both_apart,
            self.violations.len(),
        )
    }
}

/// Draws a plan, samples motion in each phase, and compares it with the predictions.
pub(crate) fn compare(seed: u64) -> Tally {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let drawn = Plan::draw(&mut rng);
    let plan = drawn.flight_plan();
    let mut compared = Comparison {
        seed,
        separation: drawn.separation,
        tally: Tally {
            plans: 1,
            ..Tally::default()
        },
    };
    let phases: Vec<PhaseSeparation> = plan.in_lockstep().collect();
    let exposures: Vec<Exposures> = plan.exposures().collect();
    for (index, exposed) in phases.iter().enumerate() {
        compared.tally.phases += 1;
        compared.in_lockstep(&mut rng, exposed);
        let id = NodeId(rng.random_range(0..drawn.drones()));
        let of = (&phases[..], &exposures[..], index);
        for exposure in Exposure::ALL {
            if exposure == Exposure::BothApart {
                for _ in 0..PAIRS {
                    compared.both_apart(&mut rng, plan, of);
                }
            } else {
                compared.out_of_lockstep(&mut rng, plan, of, id, exposure);
            }
        }
    }
    compared.tally
}

struct Comparison {
    seed: u64,
    separation: Separation,
    tally: Tally,
}

impl Comparison {
    fn room(&self, a: Ned, b: Ned) -> f64 {
        let level = a.horizontal_distance_m(b) / self.separation.horizontal_m;
        level.max(a.vertical_distance_m(b) / self.separation.vertical_m)
    }

    fn in_lockstep(&mut self, rng: &mut ChaCha8Rng, exposed: &PhaseSeparation) {
        let PhaseSeparation {
            phase,
            lockstep,
            time_separated,
        } = exposed;
        let motions = others_motions(rng, phase);
        let mut nearest = f64::INFINITY;
        for time_s in times(&motions) {
            let places: Vec<Ned> = motions.iter().map(|motion| motion.at(time_s)).collect();
            for (a, one) in places.iter().enumerate() {
                for (b, other) in places[..a].iter().enumerate() {
                    self.tally.samples += 1;
                    let room = self.room(*one, *other);
                    if room < nearest && !time_separated.contains(&pair(b, a)) {
                        nearest = room;
                    }
                }
            }
        }
        let predicted = predicted(lockstep);
        self.tally.lockstep_tight += usize::from(nearest < predicted * 1.2);
        if nearest < predicted - ROUNDING {
            let Self { seed, .. } = self;
            self.tally.violations.push(format!(
                "seed {seed}, {:?}, in lockstep: {nearest}, predicted {predicted}",
                phase.kind
            ));
        }
    }

    /// Compares one drone out of lockstep with the others, for as many phases as the exposure lasts.
    fn out_of_lockstep(
        &mut self,
        rng: &mut ChaCha8Rng,
        plan: FlightPlan<'_>,
        (phases, exposures, index): (&[PhaseSeparation], &[Exposures], usize),
        id: NodeId,
        exposure: Exposure,
    ) {
        let phase = &phases[index].phase;
        let mut affected = motion::out_of_lockstep(rng, plan, phase, id, exposure);
        let mut others = others_motions(rng, phase);
        let of = |index: usize| {
            let (_, nearness) = &exposures[index][exposure as usize];
            nearness
        };
        for now in index..phases.len() {
            let until_s = self.compare(
                (id, &affected),
                &others,
                (&phases[now].phase, of(now), exposure),
            );
            let is_last = now + 1 == phases.len();
            let is_step = matches!(
                phases[now].phase.kind,
                PhaseKind::Climb { .. } | PhaseKind::Cross { .. } | PhaseKind::Descend { .. }
            );
            let keeps_going = matches!(exposure, Exposure::Descends | Exposure::Killed);
            if is_last || !keeps_going || now > index && !is_step {
                break;
            }
            let next = &phases[now + 1].phase;
            others = if exposure == Exposure::Killed && motion::flies_alone(plan, next) {
                // The others have detected the loss.
                motion::all_alone(rng, plan, &phases[now].phase, next)
            } else {
                others_motions(rng, next)
            };
            affected.advance(until_s);
        }
    }

    /// Compares two drones out of lockstep, one of them in this or an earlier phase.
    fn both_apart(
        &mut self,
        rng: &mut ChaCha8Rng,
        plan: FlightPlan<'_>,
        (phases, exposures, index): (&[PhaseSeparation], &[Exposures], usize),
    ) {
        let drones = plan.layout.formation().drones();
        let id = NodeId(rng.random_range(0..drones));
        let other = NodeId((id.0 + rng.random_range(1..drones)) % drones);
        let earlier = rng.random_range(0..=index);
        let mut motion = |id: NodeId, phase: usize| {
            let phase = &phases[phase].phase;
            let mut motion = motion::out_of_lockstep(rng, plan, phase, id, Exposure::BothApart);
            motion.advance(rng.random_range(0.0..=motion.ends_s()));
            motion
        };
        let motions = [motion(id, index), motion(other, earlier)];
        let nearest = times(&motions).map(|time_s| {
            let [one, other] = [0, 1].map(|it| motions[it].at(time_s));
            self.room(one, other)
        });
        let nearest = nearest.fold(f64::INFINITY, f64::min);
        self.tally.samples += times(&motions).count();
        if nearest >= 1.0 - ROUNDING {
            return;
        }
        self.tally.both_apart += 1;
        let (_, nearness) = &exposures[index][Exposure::BothApart as usize];
        let predicted = predicted(nearness);
        let pair = [id, other];
        if nearest < predicted - ROUNDING || !nearness.conflicts.contains(&pair) {
            let (seed, kind) = (self.seed, phases[index].phase.kind);
            self.tally.violations.push(format!(
                "seed {seed}, {kind:?}, {pair:?} both apart: {nearest}, predicted {predicted}"
            ));
        }
    }

    /// Compares one phase; returns when the others finish it, in seconds after its start.
    fn compare(
        &mut self,
        (id, affected): (NodeId, &Motion),
        others: &[Motion],
        (phase, nearness, exposure): (&Phase, &Proximity, Exposure),
    ) -> f64 {
        let predicted = predicted(nearness);
        let mut nearest = f64::INFINITY;
        let mut seen: BTreeSet<[NodeId; 2]> = BTreeSet::new();
        // The others wait for a late drone, but not for one that descends.
        let awaited = matches!(exposure, Exposure::Late | Exposure::Apart).then_some(affected);
        let all = others.iter().chain(awaited);
        let until_s = all.map(Motion::ends_s).fold(0.0, f64::max);
        for time_s in steps(until_s) {
            let here = affected.at(time_s);
            for (index, other) in others
                .iter()
                .enumerate()
                .filter(|(it, _)| *it != id.0 as usize)
            {
                self.tally.samples += 1;
                let room = self.room(here, other.at(time_s));
                nearest = nearest.min(room);
                if room < 1.0 - ROUNDING {
                    seen.insert([id, node(index)]);
                }
            }
        }
        self.tally.conflicts += seen.len();
        let Self { seed, .. } = self;
        let what = format!("seed {seed}, {:?}, {id} {}", phase.kind, exposure.name());
        if nearest < predicted - ROUNDING {
            let violations = format!("{what}: {nearest}, predicted {predicted}");
            self.tally.violations.push(violations);
        }
        if let Some([_, other]) = seen.difference(&nearness.conflicts).next() {
            let violations = format!("{what}: near {other}, which was not predicted");
            self.tally.violations.push(violations);
        }
        until_s
    }
}

fn predicted(nearness: &Proximity) -> f64 {
    let closest = nearness.closest;
    closest.map_or(f64::INFINITY, |closest| closest.clearance.ratio)
}

fn node(index: usize) -> NodeId {
    NodeId(u32::try_from(index).expect("a few drones"))
}

fn pair(a: usize, b: usize) -> [NodeId; 2] {
    [node(a), node(b)]
}

/// Motions in lockstep: equal on a leg, otherwise with random delays.
fn others_motions(rng: &mut ChaCha8Rng, phase: &Phase) -> Vec<Motion> {
    let corners = phase.paths.iter().map(|paths| motion::corners(paths));
    if matches!(phase.kind, PhaseKind::Leg { .. }) {
        let alike = motion::Pace::draw(rng);
        return corners
            .map(|corners| Motion::new(&corners, alike))
            .collect();
    }
    corners
        .map(|corners| Motion::new(&corners, motion::Pace::draw(rng)))
        .collect()
}

fn times(motions: &[Motion]) -> impl Iterator<Item = f64> + use<> {
    steps(motions.iter().map(Motion::ends_s).fold(0.0, f64::max))
}

fn steps(until_s: f64) -> impl Iterator<Item = f64> {
    let until_s = until_s.min(LONGEST_S);
    (0_u32..)
        .map(|step| f64::from(step) * STEP_S)
        .take_while(move |time_s| *time_s <= until_s + STEP_S)
}
