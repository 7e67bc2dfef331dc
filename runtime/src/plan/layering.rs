//! Vertical deconfliction of drones that cross: altitude layers if they fit below the ceiling, waves otherwise.

use std::collections::BTreeMap;

use crate::diagnostic::BadInput;
use muster_machines::formation::{Change, Layering, Layout, Separation};
use muster_machines::geometry::Ned;
use muster_machines::identity::NodeId;
use muster_machines::navigation;

use super::file::Source;
use super::formation;
use super::limits::highest_layer_m;
use super::raw::Raw;

/// Height above the mission that is available for altitude layers.
pub(super) struct Headroom {
    separation: Separation,
    /// Height up to the ceiling, and at most as far as neighbours in different layers are in radio range; in metres.
    height_m: f64,
}

impl Headroom {
    pub(super) fn new(
        raw: &Raw,
        separation: Separation,
        waypoints: &[Ned],
        ceiling_m: f64,
    ) -> Self {
        let altitudes_m = waypoints.iter().map(|it| it.altitude_m());
        let below_ceiling_m = ceiling_m - altitudes_m.fold(0.0, f64::max);
        let (range_m, spacing_m) = (raw.radio.range_m.0, raw.formation.spacing_m.get_ref().0);
        // NaN if adjacent slots are out of range.
        let within_reach_m = (range_m * range_m - spacing_m * spacing_m).sqrt();
        Self {
            separation,
            height_m: below_ceiling_m.min(within_reach_m.max(0.0)),
        }
    }

    fn takes(&self, layout: &Layout, changes: &[Change], waypoints: &[Ned]) -> bool {
        highest_layer_m(layout, changes, waypoints) <= self.height_m
    }

    /// Numbers of layers to try with waves: as many as fit, half as many, and so on down to one.
    fn layers(&self, layer_spacing_m: f64) -> impl Iterator<Item = u32> + use<> {
        let fit = (self.height_m / layer_spacing_m)
            .floor()
            .clamp(1.0, f64::from(u16::MAX));
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped"
        )]
        let fit = fit as u32;
        std::iter::successors(Some(fit), |layers| Some(layers / 2)).take_while(|it| *it > 0)
    }
}

/// Builds the layout and the changes of formation with the first of these that fits into the headroom:
///
/// 1. A layer of its own for each drone out of lockstep.
/// 2. Shared layers.
/// 3. Waves, with the number of layers that takes the least time for take-off, changes and landing.
pub(super) fn assign_layers(
    (source, raw): (&Source, &Raw),
    waypoints: &[Ned],
    headroom: &Headroom,
    vehicle: &navigation::Config,
) -> Result<(Layout, Vec<Change>), BadInput> {
    let layout = |layering| {
        let layout = formation::layout(source, raw, headroom.separation)?;
        Ok(layout.with_layers(layering))
    };
    let with_changes = |layout: Layout| {
        let layout = layout.for_mission(waypoints);
        let changes = formation::changes(source, raw, &layout, waypoints.len())?;
        Ok((layout, changes))
    };
    let each = with_changes(layout(Layering::PerDrone)?)?;
    if headroom.takes(&each.0, &each.1, waypoints) {
        return Ok(each);
    }
    let shared = with_changes(layout(Layering::Shared)?)?;
    if headroom.takes(&shared.0, &shared.1, waypoints) {
        return Ok(shared);
    }
    let mut tried = Vec::new();
    for layers_max in headroom.layers(shared.0.layer_spacing_m()) {
        tried.push(with_changes(
            layout(Layering::Shared)?.in_waves(layers_max),
        )?);
    }
    let height_m =
        |(layout, changes): &(Layout, Vec<Change>)| highest_layer_m(layout, changes, waypoints);
    let pace = WavePace { vehicle, waypoints };
    // If none fits, the plan is refused later, with the lowest height in the error.
    let rate = |it: &(Layout, Vec<Change>)| {
        let above_m = (height_m(it) - headroom.height_m).max(0.0);
        (above_m, pace.takes_s(&it.0, &it.1))
    };
    let by_rate = |a: &_, b: &_| {
        let ((a_m, a_s), (b_m, b_s)) = (rate(a), rate(b));
        a_m.total_cmp(&b_m).then(a_s.total_cmp(&b_s))
    };
    Ok(tried.into_iter().min_by(by_rate).unwrap_or(shared))
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
