//! Plans that are drawn, motion that is sampled, and what the model of who may be where says of both.

mod motion;
mod plan;

use std::collections::BTreeSet;
use std::fmt;

use muster_machines::formation::{Act, Exposed, Exposure, Flown, Nearness, Phase, Separation};
use muster_machines::geometry::Ned;
use muster_machines::identity::NodeId;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use motion::Motion;
use plan::Plan;

/// How often motion is sampled, in seconds.
const STEP_S: f64 = 0.05;
/// The longest that a phase is looked at, in seconds.
const LONGEST_S: f64 = 240.0;
/// What rounding may take off a promise.
const ROUNDING: f64 = 1e-6;

/// What one phase exposes drones to.
type Exposures = Vec<(Exposure, Nearness)>;

/// What came of comparisons.
#[derive(Debug, Default)]
pub(crate) struct Tally {
    /// Plans that were drawn.
    pub(crate) plans: usize,
    /// Phases in which motion was sampled.
    pub(crate) phases: usize,
    /// Places of two drones that were compared.
    pub(crate) samples: usize,
    /// Phases in which two in lockstep came as near as was promised, to a fifth.
    pub(crate) lockstep_tight: usize,
    /// Times that two came too near, one of them out of lockstep, as the model says that they may.
    pub(crate) too_near: usize,
    /// Where two came nearer than was promised.
    pub(crate) broken: Vec<String>,
}

impl Tally {
    /// Adds another.
    pub(crate) fn add(&mut self, other: &Self) {
        self.plans += other.plans;
        self.phases += other.phases;
        self.samples += other.samples;
        self.lockstep_tight += other.lockstep_tight;
        self.too_near += other.too_near;
        self.broken.extend(other.broken.iter().cloned());
    }
}

impl fmt::Display for Tally {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} plans, {} phases, {} samples of two drones; in {} phases two in lockstep came as near as was promised, to \
             a fifth; {} times two came too near of which one was out of lockstep, as promised; {} promises broken",
            self.plans,
            self.phases,
            self.samples,
            self.lockstep_tight,
            self.too_near,
            self.broken.len(),
        )
    }
}

/// Draws a plan, samples motion in each of its phases, and compares it with what is promised.
pub(crate) fn compare(seed: u64) -> Tally {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let plan = Plan::draw(&mut rng);
    let flown = plan.flown();
    let mut compared = Comparison {
        seed,
        separation: plan.separation,
        tally: Tally {
            plans: 1,
            ..Tally::default()
        },
    };
    let phases: Vec<Exposed> = flown.in_lockstep().collect();
    let exposures: Vec<Exposures> = flown.exposures().collect();
    for (index, exposed) in phases.iter().enumerate() {
        compared.tally.phases += 1;
        compared.in_lockstep(&mut rng, exposed);
        let id = NodeId(rng.random_range(0..plan.drones()));
        for exposure in Exposure::ALL {
            compared.out_of_lockstep(&mut rng, flown, (&phases, &exposures, index), id, exposure);
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

    fn in_lockstep(&mut self, rng: &mut ChaCha8Rng, exposed: &Exposed) {
        let Exposed {
            phase,
            lockstep,
            together,
        } = exposed;
        let motions = others_motions(rng, phase);
        let mut nearest = f64::INFINITY;
        for time_s in times(&motions) {
            let places: Vec<Ned> = motions.iter().map(|motion| motion.at(time_s)).collect();
            for (a, one) in places.iter().enumerate() {
                for (b, other) in places[..a].iter().enumerate() {
                    self.tally.samples += 1;
                    let room = self.room(*one, *other);
                    if room < nearest && !together.contains(&pair(b, a)) {
                        nearest = room;
                    }
                }
            }
        }
        let promised = promised(lockstep);
        self.tally.lockstep_tight += usize::from(nearest < promised * 1.2);
        if nearest < promised - ROUNDING {
            let Self { seed, .. } = self;
            self.tally.broken.push(format!(
                "seed {seed}, {:?}, in lockstep: {nearest}, promised {promised}",
                phase.act
            ));
        }
    }

    /// One drone falls out of lockstep in a phase, and is compared with the others until it can be told no more where they are.
    fn out_of_lockstep(
        &mut self,
        rng: &mut ChaCha8Rng,
        flown: Flown<'_>,
        (phases, exposures, index): (&[Exposed], &[Exposures], usize),
        id: NodeId,
        exposure: Exposure,
    ) {
        let phase = &phases[index].phase;
        let mut affected = motion::out_of_lockstep(rng, flown, phase, id, exposure);
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
                phases[now].phase.act,
                Act::Climbs { .. } | Act::Crosses { .. } | Act::Descends { .. }
            );
            let keeps_going = matches!(exposure, Exposure::Descends | Exposure::Killed);
            if is_last || !keeps_going || now > index && !is_step {
                break;
            }
            let next = &phases[now + 1].phase;
            others = if exposure == Exposure::Killed && motion::flies_alone(flown, next) {
                // They have missed it.
                motion::all_alone(rng, flown, &phases[now].phase, next)
            } else {
                others_motions(rng, next)
            };
            affected.go_on_from(until_s);
        }
    }

    /// When the others have done with it, in seconds after they began.
    fn compare(
        &mut self,
        (id, affected): (NodeId, &Motion),
        others: &[Motion],
        (phase, nearness, exposure): (&Phase, &Nearness, Exposure),
    ) -> f64 {
        let promised = promised(nearness);
        let mut nearest = f64::INFINITY;
        let mut seen: BTreeSet<[NodeId; 2]> = BTreeSet::new();
        // The others wait for one that is late, and not for one that comes down.
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
        self.tally.too_near += seen.len();
        let Self { seed, .. } = self;
        let what = format!("seed {seed}, {:?}, {id} {}", phase.act, exposure.name());
        if nearest < promised - ROUNDING {
            let broken = format!("{what}: {nearest}, promised {promised}");
            self.tally.broken.push(broken);
        }
        if let Some([_, other]) = seen.difference(&nearness.too_near).next() {
            let broken = format!("{what}: near {other}, of which nothing was said");
            self.tally.broken.push(broken);
        }
        until_s
    }
}

fn promised(nearness: &Nearness) -> f64 {
    let closest = nearness.closest;
    closest.map_or(f64::INFINITY, |closest| closest.clearance.room)
}

fn node(index: usize) -> NodeId {
    NodeId(u32::try_from(index).expect("a few drones"))
}

fn pair(a: usize, b: usize) -> [NodeId; 2] {
    [node(a), node(b)]
}

/// All in lockstep: alike on a leg, or else each with delays of its own.
fn others_motions(rng: &mut ChaCha8Rng, phase: &Phase) -> Vec<Motion> {
    let corners = phase.paths.iter().map(|paths| motion::corners(paths));
    if matches!(phase.act, Act::Flies { .. }) {
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
