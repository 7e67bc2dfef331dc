//! How drones whose ways cross are kept apart: by altitude layers where there is room for them, by waves where there is not.

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

/// How high above the mission layers may be.
pub(super) struct Room {
    separation: Separation,
    /// Below the ceiling, and so that neighbours in different layers hear each other; in metres.
    height_m: f64,
}

impl Room {
    pub(super) fn new(
        raw: &Raw,
        separation: Separation,
        waypoints: &[Ned],
        ceiling_m: f64,
    ) -> Self {
        let altitudes_m = waypoints.iter().map(|it| it.altitude_m());
        let below_ceiling_m = ceiling_m - altitudes_m.fold(0.0, f64::max);
        let (range_m, spacing_m) = (raw.radio.range_m.0, raw.formation.spacing_m.get_ref().0);
        // Not a number where even the slots are out of reach.
        let within_reach_m = (range_m * range_m - spacing_m * spacing_m).sqrt();
        Self {
            separation,
            height_m: below_ceiling_m.min(within_reach_m.max(0.0)),
        }
    }

    fn takes(&self, layout: &Layout, changes: &[Change], waypoints: &[Ned]) -> bool {
        highest_layer_m(layout, changes, waypoints) <= self.height_m
    }

    /// Numbers of layers to weigh against waves: all that there is room for, half of them and so on, to one.
    fn layers(&self, pitch_m: f64) -> impl Iterator<Item = u32> + use<> {
        let fit = (self.height_m / pitch_m)
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

/// Who flies, stands and lands where, and the changes of formation: with a layer for each drone out of lockstep where there
/// is room, with shared ones where there is not; and where that does not fit either, in waves, with as many layers as take
/// off, change formation and land the soonest.
pub(super) fn arrange(
    (source, raw): (&Source, &Raw),
    waypoints: &[Ned],
    room: &Room,
    vehicle: &navigation::Config,
) -> Result<(Layout, Vec<Change>), BadInput> {
    let layout = |layering| {
        let layout = formation::layout(source, raw, room.separation)?;
        Ok(layout.with_layers(layering))
    };
    let with_changes = |layout: Layout| {
        let changes = formation::changes(source, raw, &layout, waypoints.len())?;
        Ok((layout, changes))
    };
    let each = with_changes(layout(Layering::Each)?)?;
    if room.takes(&each.0, &each.1, waypoints) {
        return Ok(each);
    }
    let shared = with_changes(layout(Layering::Shared)?)?;
    if room.takes(&shared.0, &shared.1, waypoints) {
        return Ok(shared);
    }
    let mut tried = Vec::new();
    for layers_max in room.layers(shared.0.pitch_m()) {
        tried.push(with_changes(
            layout(Layering::Shared)?.in_waves(layers_max),
        )?);
    }
    let height_m =
        |(layout, changes): &(Layout, Vec<Change>)| highest_layer_m(layout, changes, waypoints);
    let pace = Pace { vehicle, waypoints };
    // What has no room is refused; by how much is told of the lowest.
    let rate = |it: &(Layout, Vec<Change>)| {
        let above_m = (height_m(it) - room.height_m).max(0.0);
        (above_m, pace.takes_s(&it.0, &it.1))
    };
    let by_rate = |a: &_, b: &_| {
        let ((a_m, a_s), (b_m, b_s)) = (rate(a), rate(b));
        a_m.total_cmp(&b_m).then(a_s.total_cmp(&b_s))
    };
    Ok(tried.into_iter().min_by(by_rate).unwrap_or(shared))
}

/// How fast waves follow each other.
pub struct Pace<'a> {
    /// How drones fly.
    pub vehicle: &'a navigation::Config,
    /// Where they fly.
    pub waypoints: &'a [Ned],
}

impl Pace<'_> {
    /// How long all waves of the take-off, of the changes and of the landing take one after the other, in seconds.
    fn takes_s(&self, layout: &Layout, changes: &[Change]) -> f64 {
        self.times_s(layout, changes)
            .map(|waves_s| waves_s.iter().sum::<f64>())
            .sum()
    }

    /// How much longer they take than all drones at once would in the same layers, in seconds.
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

    /// How long each wave takes: of the take-off, of each change, of the landing; in seconds.
    fn times_s(&self, layout: &Layout, changes: &[Change]) -> impl Iterator<Item = Vec<f64>> {
        let drones = || (0..layout.formation().drones()).map(NodeId);
        let (begin, end) = (self.waypoints[0], self.waypoints[self.waypoints.len() - 1]);
        let last = changes.last().map_or(layout, Change::layout);
        let up = drones().map(|id| {
            let layer_m = layout.take_off_layers_m()[id.0 as usize];
            let (stand, slot) = (layout.stand(id, begin), layout.slot(id, begin));
            let over_ground_m = stand.horizontal_distance_m(slot);
            let up_and_down_s = self.vertical_s(begin.altitude_m() + layer_m, layer_m);
            (layout.take_off_wave(id), over_ground_m, up_and_down_s)
        });
        let down = drones().map(|id| {
            let layer_m = last.landing_layers_m()[id.0 as usize];
            let over_ground_m = last
                .slot(id, end)
                .horizontal_distance_m(last.place(id, end));
            let up_and_down_s = self.vertical_s(layer_m, end.altitude_m() + layer_m);
            (last.landing_wave(id), over_ground_m, up_and_down_s)
        });
        let across = changes.iter().map(move |change| {
            let at = self.waypoints[usize::from(change.waypoint())];
            let ways = drones().map(|id| {
                let [from, to, _] = change.path(id, at);
                (change.wave(id), from.horizontal_distance_m(to), 0.0)
            });
            self.longest_s(ways)
        });
        let ends = [self.longest_s(up), self.longest_s(down)];
        across.chain(ends).collect::<Vec<_>>().into_iter()
    }

    fn longest_s(&self, ways: impl Iterator<Item = (u16, f64, f64)>) -> Vec<f64> {
        let mut longest_s: BTreeMap<u16, f64> = BTreeMap::new();
        for (wave, over_ground_m, up_and_down_s) in ways {
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
