//! Where a swarm may fly, and how near its flight comes to where it may not.

use std::sync::Arc;

use crate::diagnostic::BadInput;
use crate::mission_file::FenceZone;
use muster_machines::formation::{Flown, Layout};
use muster_machines::geometry::Ned;
use muster_machines::identity::NodeId;
use muster_machines::navigation::{Area, Fence, Zone};
use toml::Spanned;

use super::file::Source;
use super::raw::Raw;
use crate::text::figure;
use crate::text::rounded_down;

/// The nearest that anybody's way comes to the boundary of an area over ground.
struct Nearest {
    /// How near, in metres; 0 where the way leaves the fence.
    room_m: f64,
    zone: usize,
    drone: NodeId,
    on: Part,
}

/// A part of a flight.
#[derive(Debug, Clone, Copy)]
enum Part {
    TakeOff,
    Leg(usize),
    Change(usize),
    Landing,
}

impl Part {
    fn in_words(self) -> String {
        match self {
            Self::TakeOff => "on its way to its first slot".to_owned(),
            Self::Leg(from) => {
                format!("on the way from waypoint {from} to waypoint {}", from + 1)
            }
            Self::Change(at) => format!("changing formation at waypoint {at}"),
            Self::Landing => "on its way to its landing place".to_owned(),
        }
    }
}

/// A fence, and what its areas are called.
pub(super) struct Fenced<'a> {
    fence: Arc<Fence>,
    /// That of the scenario comes first.
    has_own: bool,
    of_mission: &'a [FenceZone],
}

impl<'a> Fenced<'a> {
    /// The fence of a scenario, that of its mission, or both as one; `None` without either. A mission's has no ceiling.
    pub(super) fn of(raw: &Raw, altitude_max_m: f64, of_mission: &'a [FenceZone]) -> Option<Self> {
        let own = raw.geofence.as_ref().map(Spanned::get_ref);
        if own.is_none() && of_mission.is_empty() {
            return None;
        }
        let of_own = own.map(|fields| {
            let ceiling_m = fields.altitude_max_m.map_or(altitude_max_m, |it| it.0);
            Fence::cylinder(fields.radius_m.0, ceiling_m)
        });
        let ceiling_m = of_own.as_ref().map_or(f64::INFINITY, Fence::altitude_max_m);
        let zones = of_own.iter().flat_map(Fence::zones);
        let zones = zones.chain(of_mission.iter().map(|it| &it.zone));
        Some(Self {
            fence: Arc::new(Fence::new(zones.cloned().collect(), ceiling_m)),
            has_own: own.is_some(),
            of_mission,
        })
    }

    pub(super) fn fence(&self) -> Arc<Fence> {
        Arc::clone(&self.fence)
    }

    /// How high drones may fly, in metres above home, if the fence says so.
    pub(super) fn ceiling_m(&self) -> Option<f64> {
        let ceiling_m = self.fence.altitude_max_m();
        ceiling_m.is_finite().then_some(ceiling_m)
    }

    fn name(&self, zone: usize) -> &str {
        match zone.checked_sub(usize::from(self.has_own)) {
            Some(of_mission) => &self.of_mission[of_mission].name,
            None => "`[geofence]`",
        }
    }

    /// Refuses a flight that comes so near to the fence at `speed_mps` that drones would be stopped; what is told of one
    /// that does not.
    pub(super) fn check(
        &self,
        source: &Source,
        raw: &Raw,
        flown: Flown<'_>,
        speed_mps: f64,
    ) -> Result<Vec<String>, BadInput> {
        self.check_slots(source, raw, flown, speed_mps)?;
        let nearest = self.nearest(flown);
        let margin_m = Fence::margin_m(speed_mps);
        if let Some(nearest) = nearest.as_ref().filter(|it| it.room_m <= margin_m) {
            let (name, part) = (self.name(nearest.zone), nearest.on.in_words());
            let room = if nearest.room_m > 0.0 {
                format!("comes within {} m of", rounded_down(nearest.room_m, 1))
            } else {
                "leaves".to_owned()
            };
            let message = format!(
                "{part}, drone {} {room} the fence, {name}; at {speed_mps} m/s it is to stay more than {margin_m} m within",
                nearest.drone
            );
            let own = raw
                .geofence
                .as_ref()
                .filter(|_| self.has_own && nearest.zone == 0);
            let span = own.map_or_else(|| raw.mission.file.span(), Spanned::span);
            return Err(source.error(span, &message));
        }
        Ok(self.in_words(nearest.as_ref()))
    }

    /// Refuses a slot that is too near to the fence of the scenario, or too high, its layers included.
    fn check_slots(
        &self,
        source: &Source,
        raw: &Raw,
        flown: Flown<'_>,
        speed_mps: f64,
    ) -> Result<(), BadInput> {
        let (Some(table), Some(own)) = (&raw.geofence, self.fence.zones().first()) else {
            return Ok(());
        };
        let own = Fence::new(vec![own.clone()], self.fence.altitude_max_m());
        let margin_m = Fence::margin_m(speed_mps);
        let altitudes_m = flown.waypoints.iter().map(|it| it.altitude_m());
        let highest_m = altitudes_m.fold(f64::NEG_INFINITY, f64::max);
        for (number, waypoint) in flown.waypoints.iter().enumerate() {
            let (first, last) = (
                flown.changes_before(number),
                flown.changes_before(number + 1),
            );
            for layout in (first..=last).map(|changes| flown.layout_after(changes)) {
                let altitude_m = highest_m + layout.highest_layer_m(flown.waypoints);
                let slots = drones(layout).map(|id| {
                    let slot = layout.slot(id, *waypoint);
                    (id, slot.at_altitude(altitude_m))
                });
                let room = |(id, slot): (NodeId, Ned)| (own.room_m(slot), id);
                let least = slots.map(room).min_by(|a, b| a.0.total_cmp(&b.0));
                if let Some((room_m, id)) = least.filter(|(room_m, _)| *room_m <= margin_m) {
                    let message = format!(
                        "at waypoint {number} the slot of drone {id}, its layers included, is {} m within the fence; at \
                         {speed_mps} m/s that takes more than {margin_m} m",
                        rounded_down(room_m, 1)
                    );
                    return Err(source.error(table.span(), &message));
                }
            }
        }
        Ok(())
    }

    /// The nearest that any way comes to the boundary of an area: exact, where all stay within.
    fn nearest(&self, flown: Flown<'_>) -> Option<Nearest> {
        let mut search = Search {
            zones: self.fence.zones(),
            drones: flown.layout.formation().drones(),
            reach_m: reach_m(flown),
            nearest: None,
        };
        let last = flown.waypoints.len().checked_sub(1)?;
        let slot = |id, changes: u16, at: usize| {
            let layout = flown.layout_after(changes);
            layout.slot(id, flown.waypoints[at])
        };
        search.look(Part::TakeOff, (Ned::HOME, Ned::HOME), |id| {
            (flown.layout.stand(id, Ned::HOME), slot(id, 0, 0))
        });
        for at in 0..=last {
            let centre = flown.waypoints[at];
            let (first, changed) = (flown.changes_before(at), flown.changes_before(at + 1));
            for before in first..changed {
                search.look(Part::Change(at), (centre, centre), |id| {
                    (slot(id, before, at), slot(id, before + 1, at))
                });
            }
            if at == last {
                let layout = flown.layout_after(changed);
                search.look(Part::Landing, (centre, centre), |id| {
                    (slot(id, changed, at), layout.place(id, centre))
                });
                break;
            }
            // Who was late for a change flies from its slot before it to the one after it.
            for changes in first..=changed {
                search.look(Part::Leg(at), (centre, flown.waypoints[at + 1]), |id| {
                    (slot(id, changes, at), slot(id, changed, at + 1))
                });
            }
        }
        search.nearest
    }

    fn in_words(&self, nearest: Option<&Nearest>) -> Vec<String> {
        let zones = self.fence.zones().iter().enumerate();
        let zones = zones.map(|(index, zone)| zone_in_words(self.name(index), zone));
        let ceiling = self.ceiling_m().map(|it| format!("below {it} m"));
        let parts: Vec<_> = zones.chain(ceiling).collect();
        let nearest = nearest.map(|nearest| {
            format!(
                "nearest to the fence: {} m, drone {} {} ({})",
                figure(nearest.room_m, 1),
                nearest.drone,
                nearest.on.in_words(),
                self.name(nearest.zone),
            )
        });
        let fence = format!("fence: {}", parts.join("; "));
        std::iter::once(fence).chain(nearest).collect()
    }
}

fn drones(layout: &Layout) -> impl Iterator<Item = NodeId> + use<> {
    (0..layout.formation().drones()).map(NodeId)
}

/// How far over ground any place of a drone is from the centre of its formation, in metres: slots, and places on the ground.
fn reach_m(flown: Flown<'_>) -> f64 {
    let changes = flown.changes.iter().map(|change| change.layout());
    let layouts = std::iter::once(flown.layout).chain(changes);
    let places = layouts.flat_map(|layout| {
        drones(layout).flat_map(move |id| {
            [
                layout.slot(id, Ned::HOME),
                layout.stand(id, Ned::HOME),
                layout.place(id, Ned::HOME),
            ]
        })
    });
    let reaches_m = places.map(|place| place.horizontal_distance_m(Ned::HOME));
    reaches_m.fold(0.0, f64::max)
}

/// A search for the way that comes the nearest to a boundary.
struct Search<'a> {
    zones: &'a [Zone],
    drones: u32,
    reach_m: f64,
    nearest: Option<Nearest>,
}

impl Search<'_> {
    /// Looks at the ways of all drones while the centre of the formation flies its own; only where they can be nearer than
    /// what was found before.
    fn look(&mut self, on: Part, centre: (Ned, Ned), way: impl Fn(NodeId) -> (Ned, Ned)) {
        for (zone, area) in self.zones.iter().enumerate() {
            // Of those who leave the fence the first one is told.
            let at_least_m = area.room_along_m(centre.0, centre.1) - self.reach_m;
            let at_least_m = at_least_m.max(0.0);
            let is_nearer = |nearest: &Option<Nearest>, room_m: f64| {
                nearest.as_ref().is_none_or(|it| room_m < it.room_m)
            };
            if !is_nearer(&self.nearest, at_least_m) {
                continue;
            }
            for drone in (0..self.drones).map(NodeId) {
                let (from, to) = way(drone);
                let room_m = area.room_along_m(from, to).max(0.0);
                if is_nearer(&self.nearest, room_m) {
                    self.nearest = Some(Nearest {
                        room_m,
                        zone,
                        drone,
                        on,
                    });
                }
            }
        }
    }
}

/// What an area of a fence is, and what it is called.
fn zone_in_words(name: &str, zone: &Zone) -> String {
    let side = if zone.is_inclusion {
        "within"
    } else {
        "out of"
    };
    match &zone.area {
        Area::Circle { centre, radius_m } if centre.0.xy().norm() > 0.0 => format!(
            "{side} {} m of {} m north and {} m east ({name})",
            figure(*radius_m, 1),
            figure(centre.north_m(), 1),
            figure(centre.east_m(), 1),
        ),
        Area::Circle { radius_m, .. } => {
            format!("{side} {} m of home ({name})", figure(*radius_m, 1))
        }
        Area::Polygon(polygon) => format!(
            "{side} a polygon of {} corners ({name})",
            polygon.corners().len()
        ),
    }
}

/// What a mission's fence is, if it has one.
#[must_use]
pub fn fence_in_words(zones: &[FenceZone]) -> Option<String> {
    let zones: Vec<_> = zones
        .iter()
        .map(|it| zone_in_words(&it.name, &it.zone))
        .collect();
    (!zones.is_empty()).then(|| format!("fence: {}", zones.join("; ")))
}
