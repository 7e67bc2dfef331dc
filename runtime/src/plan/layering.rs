//! Vertical deconfliction of drones that cross: altitude layers if they fit below the ceiling, waves otherwise.

use std::collections::BTreeMap;
use std::time::Duration;

use crate::diagnostic::BadInput;
use muster_machines::formation::{
    Change, FlightPlan, Layering, Layout, PlannedFlight, SEARCHED_MAX, Separation, Unreached,
    WaveLimits,
};
use muster_machines::geometry::Ned;
use muster_machines::identity::NodeId;
use muster_machines::navigation;

use super::Protocol;
use super::file::Source;
use super::formation;
use super::limits::highest_layer_m;
use super::raw::Raw;
use super::separation::{describe_unreached, refuses_unreached, unreached_error};

/// Height above the mission that is available for altitude layers.
pub(super) struct Headroom {
    separation: Separation,
    /// Height up to the ceiling, in metres.
    below_ceiling_m: f64,
    /// Radio range, in metres.
    range_m: f64,
    /// Altitude of the slots above home at the first waypoint, in metres.
    begin_m: f64,
}

impl Headroom {
    pub(super) fn new(
        raw: &Raw,
        separation: Separation,
        waypoints: &[Ned],
        ceiling_m: f64,
    ) -> Self {
        let altitudes_m = waypoints.iter().map(|it| it.altitude_m());
        Self {
            separation,
            below_ceiling_m: ceiling_m - altitudes_m.fold(0.0, f64::max),
            range_m: raw.radio.range_m.0,
            begin_m: waypoints[0].altitude_m(),
        }
    }

    /// The room of a swarm that needs links of `link_m` metres over ground: up to the ceiling, and at most as high as
    /// drones so far apart, one in the lowest and one in the highest layer, are in radio range.
    fn with_links_of(&self, link_m: f64) -> Room {
        let mut room = Room {
            height_m: self.below_ceiling_m,
            range_m: self.range_m,
            begin_m: self.begin_m,
        };
        room.height_m = room.height_m.min(room.in_range_m(link_m));
        room
    }
}

/// Room for altitude layers.
struct Room {
    /// Height above the slots, in metres.
    height_m: f64,
    /// As in [`Headroom`].
    range_m: f64,
    begin_m: f64,
}

impl Room {
    /// Largest distance over ground of drones in range with a difference in height, or the reverse; in metres.
    fn in_range_m(&self, other_m: f64) -> f64 {
        let squared = self.range_m * self.range_m - other_m * other_m;
        squared.max(0.0).sqrt()
    }

    /// Limits to try with waves of an extent: as many layers as fit, half as many, and so on down to one.
    fn wave_limits(
        &self,
        layer_spacing_m: f64,
        (searches_on, hops_max): (bool, u32),
    ) -> impl Iterator<Item = WaveLimits> {
        let fit = (self.height_m / layer_spacing_m)
            .floor()
            .clamp(1.0, f64::from(u16::MAX));
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped"
        )]
        let fit = fit as u32;
        let ground_link_m = self.in_range_m(self.begin_m);
        std::iter::successors(Some(fit), |layers| Some(layers / 2))
            .take_while(|it| *it > 0)
            .map(move |layers_max| WaveLimits {
                layers_max,
                link_m: self.in_range_m(f64::from(layers_max) * layer_spacing_m),
                ground_link_m,
                hops_max,
                searches_on,
            })
    }
}

/// Most hops by which a wave may fly beyond the ones before: numbers to try, until all drones stay in the master's reach.
const HOPS_MAX: [u32; 4] = [u32::MAX, 4, 2, 1];

/// What the layers of a swarm are chosen for.
pub(super) struct Swarm<'a> {
    pub(super) waypoints: &'a [Ned],
    pub(super) headroom: Headroom,
    pub(super) vehicle: &'a navigation::Config,
    pub(super) settle: Duration,
    pub(super) protocol: &'a Protocol,
    pub(super) relays: &'a [Ned],
}

/// A layout, the changes of formation after it, and how well they do.
struct Candidate {
    layout: Layout,
    changes: Vec<Change>,
    /// Height of the highest layer above the room, in metres.
    above_m: f64,
    /// By how much longer than tolerated drones are out of the master's reach, all phases together.
    unreached: Duration,
}

impl Candidate {
    const fn is_flawless(&self) -> bool {
        self.above_m <= 0.0 && self.unreached.is_zero()
    }
}

impl Swarm<'_> {
    fn planned<'a>(&'a self, layout: &'a Layout, changes: &'a [Change]) -> PlannedFlight<'a> {
        PlannedFlight {
            flight: FlightPlan {
                layout,
                changes,
                waypoints: self.waypoints,
            },
            vehicle: self.vehicle,
            settle: self.settle,
            range_m: self.headroom.range_m,
            relays: self.relays,
        }
    }

    /// The error of a candidate that leaves drones out of the master's reach for longer than tolerated.
    fn unreached_error(&self, plan: (&Source, &Raw), candidate: &Candidate) -> BadInput {
        let planned = self.planned(&candidate.layout, &candidate.changes);
        let phases = planned.unreached(|kind| self.protocol.tolerated(kind));
        let longest = phases.max_by_key(Unreached::longest);
        let (apart, when) = longest.as_ref().map(describe_unreached).unwrap_or_default();
        unreached_error(plan, &apart, &when)
    }

    /// Rates a candidate after others: one that is too high, or worse than one of those, need not be known exactly.
    fn rated(
        &self,
        (layout, changes): (Layout, Vec<Change>),
        room: &Room,
        tried: &[Candidate],
    ) -> Candidate {
        let highest_m = highest_layer_m(&layout, &changes, self.waypoints);
        let above_m = (highest_m - room.height_m).max(0.0);
        let fitting = tried.iter().filter(|it| it.above_m <= 0.0);
        let best = if above_m > 0.0 {
            Some(Duration::ZERO)
        } else {
            fitting.map(|it| it.unreached).min()
        };
        let planned = self.planned(&layout, &changes);
        let tolerated = |kind| self.protocol.tolerated(kind);
        let phases = planned.unreached(tolerated);
        let mut excess = phases.map(|phase| phase.longest().saturating_sub(tolerated(phase.kind)));
        let mut unreached = Duration::ZERO;
        while best.is_none_or(|best| unreached < best)
            && let Some(excess) = excess.next()
        {
            unreached = unreached.saturating_add(excess);
        }
        drop(excess);
        Candidate {
            above_m,
            unreached,
            layout,
            changes,
        }
    }

    /// Rates what takes the least time first, up to the first without a flaw.
    fn try_quickest_first(
        &self,
        candidates: Vec<(Layout, Vec<Change>)>,
        room: &Room,
        tried: &mut Vec<Candidate>,
    ) {
        let pace = WavePace {
            vehicle: self.vehicle,
            waypoints: self.waypoints,
        };
        let timed = candidates.into_iter();
        let mut timed: Vec<_> = timed.map(|it| (pace.takes_s(&it.0, &it.1), it)).collect();
        timed.sort_by(|(a_s, _), (b_s, _)| a_s.total_cmp(b_s));
        for (_, candidate) in timed {
            tried.push(self.rated(candidate, room, tried));
            if tried.last().is_some_and(Candidate::is_flawless) {
                return;
            }
        }
    }
}

/// Builds the layout and the changes of formation with the first of these that fits into the headroom and leaves no drone out
/// of the master's reach for longer than the protocol tolerates:
///
/// 1. A layer of its own for each drone out of lockstep.
/// 2. Shared layers.
/// 3. Waves of any extent; up to [`SEARCHED_MAX`] drones also of fewer and fewer hops, and all that again with more places on
///    the ground and another order. Each with the number of layers that takes the least time for take-off, changes and landing.
///
/// If none does, the one that is least above the headroom, then least out of reach. One above the headroom is refused later,
/// with the lowest height in the error. Drones that share layers must not be out of reach: then each has a layer of its own, or, if
/// there is no room for that, the plan is refused.
pub(super) fn assign_layers(
    (source, raw): (&Source, &Raw),
    swarm: &Swarm<'_>,
) -> Result<(Layout, Vec<Change>), BadInput> {
    let waypoints = swarm.waypoints;
    let with_changes = |layering, limits: Option<WaveLimits>| {
        let layout = formation::layout(source, raw, swarm.headroom.separation)?;
        let layout = layout.with_layers(layering);
        let layout = match limits {
            Some(limits) => layout.in_waves(limits),
            None => layout,
        };
        let layout = layout.for_mission(waypoints);
        let changes = formation::changes(source, raw, &layout, waypoints.len())?;
        Ok((layout, changes))
    };
    let each = with_changes(Layering::PerDrone, None)?;
    let formations = all_layouts(&each).map(Layout::formation);
    let links_m = formations.map(|it| it.longest_link_m(swarm.headroom.range_m));
    let room = swarm.headroom.with_links_of(links_m.fold(0.0, f64::max));
    let mut tried = vec![swarm.rated(each, &room, &[])];
    if !tried[0].is_flawless() {
        let shared = with_changes(Layering::Shared, None)?;
        tried.push(swarm.rated(shared, &room, &tried));
    }
    let is_searched = tried[0].layout.formation().slots().len() <= SEARCHED_MAX;
    let hops = |searches_on| HOPS_MAX.map(|hops_max| (searches_on, hops_max));
    let extents = [false, true].into_iter().flat_map(hops);
    for extent in extents.take(if is_searched { usize::MAX } else { 1 }) {
        if tried.iter().any(Candidate::is_flawless) {
            break;
        }
        let mut in_waves = Vec::new();
        for limits in room.wave_limits(tried[0].layout.layer_spacing_m(), extent) {
            in_waves.push(with_changes(Layering::Shared, Some(limits))?);
        }
        swarm.try_quickest_first(in_waves, &room, &mut tried);
    }
    let best = tried.iter().enumerate().min_by(|(_, a), (_, b)| {
        let by_height = a.above_m.total_cmp(&b.above_m);
        by_height.then(a.unreached.cmp(&b.unreached))
    });
    let (mut chosen, _) = best.expect("one at least is tried");
    let it = &tried[chosen];
    let is_unreached = it.above_m <= 0.0 && !it.unreached.is_zero();
    if is_unreached && refuses_unreached(raw, it.layout.layering()) {
        // Out of reach drones need a layer each, even if that leaves them out of reach for a little longer.
        if tried[0].above_m > 0.0 {
            return Err(swarm.unreached_error((source, raw), it));
        }
        chosen = 0;
    }
    let best = tried.swap_remove(chosen);
    Ok((best.layout, best.changes))
}

/// The layout of the first formation, and those after each change.
fn all_layouts((first, changes): &(Layout, Vec<Change>)) -> impl Iterator<Item = &Layout> {
    std::iter::once(first).chain(changes.iter().map(Change::layout))
}

/// Estimates how long waves take.
pub struct WavePace<'a> {
    /// Speeds of the drones.
    pub vehicle: &'a navigation::Config,
    /// Waypoints of the formation's centre.
    pub waypoints: &'a [Ned],
}

impl WavePace<'_> {
    /// Time of all waves of take-off, changes and landing one after the other, in seconds.
    fn takes_s(&self, layout: &Layout, changes: &[Change]) -> f64 {
        self.times_s(layout, changes)
            .map(|waves_s| waves_s.iter().sum::<f64>())
            .sum()
    }

    /// Extra time of waves, compared with all drones at once in the same layers, in seconds.
    #[must_use]
    pub fn extra_s(&self, layout: &Layout, changes: &[Change]) -> f64 {
        let times_s = self.times_s(layout, changes);
        times_s
            .map(|waves_s| {
                let longest_s = waves_s.iter().copied().fold(0.0, f64::max);
                waves_s.iter().sum::<f64>() - longest_s
            })
            .sum()
    }

    /// Time of each wave: of each change, of take-off, of landing; in seconds.
    fn times_s(&self, layout: &Layout, changes: &[Change]) -> impl Iterator<Item = Vec<f64>> {
        let drones = || (0..layout.formation().drones()).map(NodeId);
        let (begin, end) = (self.waypoints[0], self.waypoints[self.waypoints.len() - 1]);
        let last = changes.last().map_or(layout, Change::layout);
        let up = drones().map(|id| {
            let layer_m = layout.take_off_layers_m()[id.0 as usize];
            let (stand, slot) = (layout.take_off_place(id, begin), layout.slot(id, begin));
            let over_ground_m = stand.horizontal_distance_m(slot);
            let up_and_down_s = self.vertical_s(begin.altitude_m() + layer_m, layer_m);
            (layout.take_off_wave(id), over_ground_m, up_and_down_s)
        });
        let down = drones().map(|id| {
            let layer_m = last.landing_layers_m()[id.0 as usize];
            let over_ground_m = last
                .slot(id, end)
                .horizontal_distance_m(last.landing_place(id, end));
            let up_and_down_s = self.vertical_s(layer_m, end.altitude_m() + layer_m);
            (last.landing_wave(id), over_ground_m, up_and_down_s)
        });
        let across = changes.iter().map(move |change| {
            let at = self.waypoints[usize::from(change.waypoint())];
            let paths = drones().map(|id| {
                let [from, to, _] = change.path(id, at);
                (change.wave(id), from.horizontal_distance_m(to), 0.0)
            });
            self.longest_s(paths)
        });
        let ends = [self.longest_s(up), self.longest_s(down)];
        across.chain(ends).collect::<Vec<_>>().into_iter()
    }

    fn longest_s(&self, paths: impl Iterator<Item = (u16, f64, f64)>) -> Vec<f64> {
        let mut longest_s: BTreeMap<u16, f64> = BTreeMap::new();
        for (wave, over_ground_m, up_and_down_s) in paths {
            let takes_s = over_ground_m / self.vehicle.speed_mps + up_and_down_s;
            let longest_s = longest_s.entry(wave).or_default();
            *longest_s = longest_s.max(takes_s);
        }
        longest_s.into_values().collect()
    }

    fn vertical_s(&self, up_m: f64, down_m: f64) -> f64 {
        up_m / self.vehicle.climb_mps + down_m / self.vehicle.descent_mps
    }
}
