//! A swarm's fence, and the check that its flight stays inside.

use std::sync::Arc;

use crate::diagnostic::BadInput;
use crate::mission_file::FenceZone;
use muster_machines::formation::{FlightPlan, Layout};
use muster_machines::geometry::Ned;
use muster_machines::identity::NodeId;
use muster_machines::navigation::{Area, Fence, Zone};

use super::file::Source;
use super::raw::Raw;
use crate::text::figure;
use crate::text::rounded_down;

/// A drone's closest horizontal approach to the boundary of a zone.
struct Nearest {
    /// Distance in metres; 0 if the path leaves the fence.
    clearance_m: f64,
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
    fn describe(self) -> String {
        match self {
            Self::TakeOff => "during take-off".to_owned(),
            Self::Leg(from) => {
                format!("on the leg from waypoint {from} to waypoint {}", from + 1)
            }
            Self::Change(at) => format!("in the change of formation at waypoint {at}"),
            Self::Landing => "during the landing".to_owned(),
        }
    }
}

/// A fence with the names of its zones.
pub(super) struct Fenced<'a> {
    fence: Arc<Fence>,
    /// Whether the first zone is the scenario's `[geofence]`.
    has_own: bool,
    of_mission: &'a [FenceZone],
}

impl<'a> Fenced<'a> {
    /// The scenario's fence and its mission's, combined. `None` if neither has one. A mission's fence has no ceiling.
    pub(super) fn of(raw: &Raw, altitude_max_m: f64, of_mission: &'a [FenceZone]) -> Option<Self> {
        let own = raw.geofence.as_ref().map(|it| it.get_ref());
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

    /// The fence's ceiling, in metres above home. `None` if it has none.
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

    /// Refuses a flight so close to the fence that drones would be stopped at `speed_mps`. Returns the description of the
    /// fence and of the closest approach.
    pub(super) fn check(
        &self,
        source: &Source,
        raw: &Raw,
        flight: FlightPlan<'_>,
        speed_mps: f64,
    ) -> Result<Vec<String>, BadInput> {
        self.check_slots(source, raw, flight, speed_mps)?;
        let nearest = self.nearest(flight);
        let margin_m = Fence::margin_m(speed_mps);
        if let Some(nearest) = nearest.as_ref().filter(|it| it.clearance_m <= margin_m) {
            let (name, part) = (self.name(nearest.zone), nearest.on.describe());
            let relation = if nearest.clearance_m > 0.0 {
                format!("comes within {} m of", rounded_down(nearest.clearance_m, 1))
            } else {
                "leaves".to_owned()
            };
            let message = format!(
                "drone {} {relation} the fence, {name}, {part}; at {speed_mps} m/s it must stay more than {margin_m} m inside",
                nearest.drone
            );
            let own = raw
                .geofence
                .as_ref()
                .filter(|_| self.has_own && nearest.zone == 0);
            let span = own.map_or_else(|| raw.mission.file.span(), |it| it.span());
            return Err(source.error(span, &message));
        }
        Ok(self.describe(nearest.as_ref()))
    }

    /// Refuses slots, with their altitude layers, that are too close to the scenario's fence or above its ceiling.
    fn check_slots(
        &self,
        source: &Source,
        raw: &Raw,
        flight: FlightPlan<'_>,
        speed_mps: f64,
    ) -> Result<(), BadInput> {
        let (Some(table), Some(own)) = (&raw.geofence, self.fence.zones().first()) else {
            return Ok(());
        };
        let own = Fence::new(vec![own.clone()], self.fence.altitude_max_m());
        let margin_m = Fence::margin_m(speed_mps);
        let altitudes_m = flight.waypoints.iter().map(|it| it.altitude_m());
        let highest_m = altitudes_m.fold(f64::NEG_INFINITY, f64::max);
        for (number, waypoint) in flight.waypoints.iter().enumerate() {
            let (first, last) = (
                flight.changes_before(number),
                flight.changes_before(number + 1),
            );
            for layout in (first..=last).map(|changes| flight.layout_after(changes)) {
                let altitude_m = highest_m + layout.highest_layer_m(flight.waypoints);
                let slots = drones(layout).map(|id| {
                    let slot = layout.slot(id, *waypoint);
                    (id, slot.at_altitude(altitude_m))
                });
                let clearance = |(id, slot): (NodeId, Ned)| (own.clearance_m(slot), id);
                let least = slots.map(clearance).min_by(|a, b| a.0.total_cmp(&b.0));
                if let Some((clearance_m, id)) =
                    least.filter(|(clearance_m, _)| *clearance_m <= margin_m)
                {
                    let message = format!(
                        "the slot of drone {id} at waypoint {number}, with its altitude layers, is {} m inside the fence; \
                         at {speed_mps} m/s it must be more than {margin_m} m inside",
                        rounded_down(clearance_m, 1)
                    );
                    return Err(source.error(table.span(), &message));
                }
            }
        }
        Ok(())
    }

    /// The closest approach of any path to a zone's boundary; exact if all paths stay inside.
    fn nearest(&self, flight: FlightPlan<'_>) -> Option<Nearest> {
        let mut search = Search {
            zones: self.fence.zones(),
            drones: flight.layout.formation().drones(),
            reach_m: reach_m(flight),
            nearest: None,
        };
        let last = flight.waypoints.len().checked_sub(1)?;
        let slot = |id, changes: u16, at: usize| {
            let layout = flight.layout_after(changes);
            layout.slot(id, flight.waypoints[at])
        };
        search.check(Part::TakeOff, (Ned::HOME, Ned::HOME), |id| {
            (flight.layout.take_off_place(id, Ned::HOME), slot(id, 0, 0))
        });
        for at in 0..=last {
            let centre = flight.waypoints[at];
            let (first, changed) = (flight.changes_before(at), flight.changes_before(at + 1));
            for before in first..changed {
                search.check(Part::Change(at), (centre, centre), |id| {
                    (slot(id, before, at), slot(id, before + 1, at))
                });
            }
            if at == last {
                let layout = flight.layout_after(changed);
                search.check(Part::Landing, (centre, centre), |id| {
                    (slot(id, changed, at), layout.landing_place(id, centre))
                });
                break;
            }
            // A drone that was late for a change flies from a slot before it to the slot after it.
            for changes in first..=changed {
                search.check(Part::Leg(at), (centre, flight.waypoints[at + 1]), |id| {
                    (slot(id, changes, at), slot(id, changed, at + 1))
                });
            }
        }
        search.nearest
    }

    fn describe(&self, nearest: Option<&Nearest>) -> Vec<String> {
        let zones = self.fence.zones().iter().enumerate();
        let zones = zones.map(|(index, zone)| describe_zone(self.name(index), zone));
        let ceiling = self.ceiling_m().map(|it| format!("below {it} m"));
        let parts: Vec<_> = zones.chain(ceiling).collect();
        let nearest = nearest.map(|nearest| {
            format!(
                "closest approach to the fence: {} m, by drone {} {} ({})",
                figure(nearest.clearance_m, 1),
                nearest.drone,
                nearest.on.describe(),
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

/// The largest horizontal distance of a slot or a place on the ground from the formation's centre, in metres.
fn reach_m(flight: FlightPlan<'_>) -> f64 {
    let changes = flight.changes.iter().map(|change| change.layout());
    let layouts = std::iter::once(flight.layout).chain(changes);
    let places = layouts.flat_map(|layout| {
        drones(layout).flat_map(move |id| {
            [
                layout.slot(id, Ned::HOME),
                layout.take_off_place(id, Ned::HOME),
                layout.landing_place(id, Ned::HOME),
            ]
        })
    });
    let reaches_m = places.map(|place| place.horizontal_distance_m(Ned::HOME));
    reaches_m.fold(0.0, f64::max)
}

/// A search for the closest approach to a zone's boundary.
struct Search<'a> {
    zones: &'a [Zone],
    drones: u32,
    reach_m: f64,
    nearest: Option<Nearest>,
}

impl Search<'_> {
    /// Checks the paths of all drones on a part of the flight, on which the formation's centre flies along `centre`. Skips
    /// zones that are too far away to be closer than the result so far.
    fn check(&mut self, on: Part, centre: (Ned, Ned), path: impl Fn(NodeId) -> (Ned, Ned)) {
        for (zone, area) in self.zones.iter().enumerate() {
            // At least 0, so that of several drones outside the fence the first is reported.
            let at_least_m = area.clearance_along_m(centre.0, centre.1) - self.reach_m;
            let at_least_m = at_least_m.max(0.0);
            let is_nearer = |nearest: &Option<Nearest>, clearance_m: f64| {
                nearest
                    .as_ref()
                    .is_none_or(|it| clearance_m < it.clearance_m)
            };
            if !is_nearer(&self.nearest, at_least_m) {
                continue;
            }
            for drone in (0..self.drones).map(NodeId) {
                let (from, to) = path(drone);
                let clearance_m = area.clearance_along_m(from, to).max(0.0);
                if is_nearer(&self.nearest, clearance_m) {
                    self.nearest = Some(Nearest {
                        clearance_m,
                        zone,
                        drone,
                        on,
                    });
                }
            }
        }
    }
}

fn describe_zone(name: &str, zone: &Zone) -> String {
    let side = if zone.is_inclusion {
        "within"
    } else {
        "outside of"
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

/// One line on a mission's fence. `None` without a fence.
#[must_use]
pub fn describe_fence(zones: &[FenceZone]) -> Option<String> {
    let zones: Vec<_> = zones
        .iter()
        .map(|it| describe_zone(&it.name, &it.zone))
        .collect();
    (!zones.is_empty()).then(|| format!("fence: {}", zones.join("; ")))
}
