//! The preview of a scenario, printed by `muster check`.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use muster_machines::formation::{Change, Paths, Phase, PhaseKind, PlannedFlight, Unreached};
use muster_machines::geometry::Ned;
use muster_machines::identity::NodeId;
use muster_machines::mission::{Holds, Succession};
use muster_machines::time::Timestamp;
use muster_transport::sim::Medium;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::Scenario;
use super::exposure::{bare_table, lines};
use crate::segments::{Link, Segment, Segments};
use muster_runtime::plan::layering::WavePace;
use muster_runtime::text::{drones, figure, plural};

/// Largest swarm whose connectivity is computed. Larger ones are taken to have the largest possible diameter.
const DIAMETER_NODES_MAX: u32 = 1_000;

impl Scenario {
    /// Separation, time to re-elect, bound of the run, holds, altitude layers, waves, fence and drones out of reach: one line
    /// each.
    #[must_use]
    pub fn preview(&self) -> Vec<String> {
        let connected = self.connected();
        let mut lines = self.describe_separation(self.out_of_reach_counter());
        lines.extend([
            self.describe_settling(connected.as_ref()),
            self.describe_bound(),
        ]);
        lines.extend(describe_holds(&self.plan.holds));
        lines.extend(self.describe_layers());
        lines.extend(self.describe_waves());
        lines.extend(self.plan.fence.iter().cloned());
        if let Some(in_slots) = &connected {
            lines.extend(self.describe_unreached(in_slots));
            lines.extend(self.describe_unreached_in_layers(in_slots));
        }
        let mut first = self.plan.nodes();
        for (swarm, joins) in &self.others {
            let last = first + swarm.plan.layout.formation().drones() - 1;
            lines.push(format!(
                "{} of {}: home {} m north and {} m east of this one, started after {} s",
                drones(&(first..=last).collect::<Vec<_>>()),
                swarm.name,
                joins.home.north_m(),
                joins.home.east_m(),
                joins.after.as_secs_f64(),
            ));
            first += swarm.plan.nodes();
        }
        lines
    }

    fn describe_settling(&self, connected: Option<&Segments>) -> String {
        let settling = self.settling();
        let known = connected.map(|segments| {
            self.masters_segment(segments)
                .map_or(0, |it| segments.diameter(it))
        });
        let (diameter, is_at_most) = (known.unwrap_or(self.plan.nodes() - 1), known.is_none());
        let seconds = |time: Duration, digits| figure(time.as_secs_f64(), digits);
        if let Some(hops_max) = settling.hops_max.filter(|hops| diameter > *hops) {
            return format!(
                "worst-case time to re-elect: none. With these losses, heartbeats of policy `flood` arrive in time over {}, \
                 and the swarm is {} across: drones beyond miss a live master again and again. Policy `tree` has no such \
                 limit",
                plural(hops_max as usize, "hop"),
                plural(diameter as usize, "hop"),
            );
        }
        format!(
            "worst-case time to re-elect: {} s (detection {} s, propagation 2 × {}{} of {} s, retransmissions {} s){}",
            seconds(settling.time(diameter), 1),
            seconds(settling.detection, 2),
            if is_at_most { "at most " } else { "" },
            plural(diameter as usize, "hop"),
            seconds(settling.hop, 3),
            seconds(settling.retransmission, 2),
            match settling.spreading {
                Duration::ZERO => String::new(),
                more => format!(
                    "; {} s more during take-off and changes of formation",
                    seconds(more, 1)
                ),
            }
        )
    }

    /// The segments with all drones in their slots; `None` if the swarm is too large.
    pub(super) fn connected(&self) -> Option<Segments> {
        let nodes = self.plan.nodes();
        (nodes <= DIAMETER_NODES_MAX)
            .then(|| self.connected_at(|_| self.plan.waypoints[0].altitude_m()))
    }

    /// Counts the drones out of the master's reach in a phase: at the places where they are farthest apart, and on the way there
    /// for longer than the protocol tolerates. `None` if the swarm is too large.
    fn out_of_reach_counter(&self) -> impl FnMut(&Phase) -> Option<usize> {
        let is_small = self.plan.nodes() <= DIAMETER_NODES_MAX;
        // All legs in one formation have the same count.
        let mut on_legs: BTreeMap<u16, Option<usize>> = BTreeMap::new();
        let on_the_way: BTreeMap<PhaseKind, BTreeSet<u32>> = self
            .unreached_on_the_way()
            .into_iter()
            .map(|it| (it.kind, it.drones.iter().map(|(id, _)| id.0).collect()))
            .collect();
        move |phase| {
            if !is_small {
                return None;
            }
            let count = || {
                let above = |paths: &Paths| paths.get(1).unwrap_or(&paths[0]).to;
                let places = phase.paths.iter().map(above);
                let places: Vec<_> = places.chain(self.plan.relays.iter().copied()).collect();
                let at_the_ends = self.out_of_reach(&self.connected_among(&places))?;
                let mut all = on_the_way.get(&phase.kind).cloned().unwrap_or_default();
                all.extend(at_the_ends);
                Some(all.len())
            };
            match phase.kind {
                PhaseKind::Leg { .. } => *on_legs.entry(phase.changes).or_insert_with(count),
                _ => count(),
            }
        }
    }

    /// Phases in which drones are out of the master's reach for longer than the protocol tolerates, though none is late. Empty if
    /// the swarm is too large.
    pub(super) fn unreached_on_the_way(&self) -> Vec<Unreached> {
        if self.plan.nodes() > DIAMETER_NODES_MAX {
            return Vec::new();
        }
        let planned = PlannedFlight {
            flight: self.flown(),
            vehicle: &self.plan.vehicle,
            settle: self.plan.settle,
            range_m: self.radio.propagation.range_m(),
            relays: &self.plan.relays,
        };
        let phases = planned.unreached(|kind| self.plan.protocol.tolerated(kind));
        phases.filter(|it| !it.drones.is_empty()).collect()
    }

    /// The segments with each drone above its first slot, at its own height in metres above home.
    fn connected_at(&self, altitude_m: impl Fn(NodeId) -> f64) -> Segments {
        let drones = (0..self.plan.layout.formation().drones()).map(NodeId);
        let above = drones.map(|id| {
            let slot = self.plan.layout.slot(id, self.plan.waypoints[0]);
            slot.at_altitude(altitude_m(id))
        });
        let places: Vec<_> = above.chain(self.plan.relays.iter().copied()).collect();
        self.connected_among(&places)
    }

    fn connected_among(&self, places: &[Ned]) -> Segments {
        // No random number is drawn.
        let mut medium = Medium::new(self.radio, ChaCha8Rng::seed_from_u64(0), places);
        let mut segments = Segments::default();
        let live = vec![Some(0); places.len()];
        segments.look(Timestamp::ZERO, live, Link::all(&mut medium, |_| [0.0; 2]));
        segments
    }

    pub(super) fn masters_segment<'a>(&self, segments: &'a Segments) -> Option<&'a Segment> {
        let master = self.plan.layout.formation().centre();
        segments
            .iter()
            .find(|segment| segment.members.contains(&master))
    }

    /// The drones that no links that are up connect with the master, in ascending order.
    pub(super) fn out_of_reach(&self, segments: &Segments) -> Option<Vec<u32>> {
        let with_master = self.masters_segment(segments)?;
        let all = (0..self.plan.layout.formation().drones()).map(NodeId);
        let apart = all.filter(|id| !with_master.members.contains(id));
        Some(apart.map(|id| id.0).collect())
    }

    /// The drones that are in reach in their slots, but not in their altitude layers.
    fn describe_unreached_in_layers(&self, in_slots: &Segments) -> Vec<String> {
        let apart = self.out_of_reach(in_slots).unwrap_or_default();
        let flown = self.flown();
        let begin = self.plan.waypoints[0];
        let on_the_way_up = self.connected_at(|id| {
            begin.altitude_m() + self.plan.layout.take_off_layers_m()[id.0 as usize]
        });
        let alone = self.connected_at(|id| flown.altitude_alone_m(id, 0, begin));
        let lines = [
            ("in their layers on the way up", on_the_way_up),
            ("in their layers out of lockstep", alone),
        ];
        let lines = lines.into_iter().filter_map(|(when, segments)| {
            let mut out_of_reach = self.out_of_reach(&segments)?;
            out_of_reach.retain(|id| !apart.contains(id));
            (!out_of_reach.is_empty()).then(|| {
                format!(
                    "out of the master's reach {when}: {}; raise `radio.range_m`, or lower `formation.spacing_m` or \
                     `limits.separation_vertical_m`",
                    drones(&out_of_reach)
                )
            })
        });
        lines.collect()
    }

    /// The drones in slots that no links that are up connect with the master's, in ascending order. `None` if there are none,
    /// or the swarm is too large.
    pub(super) fn unreached(&self) -> Option<Vec<u32>> {
        let apart = self.out_of_reach(&self.connected()?)?;
        (!apart.is_empty()).then_some(apart)
    }

    fn describe_unreached(&self, segments: &Segments) -> Option<String> {
        let apart = self.out_of_reach(segments)?;
        let led = match self.plan.protocol.succession {
            Succession::Elect => "elect masters of their own",
            Succession::Land => "land",
        };
        (!apart.is_empty()).then(|| {
            let who = drones(&apart);
            format!("out of the master's reach, over other drones too: {who} will {led}")
        })
    }

    fn describe_bound(&self) -> String {
        let limits = &self.plan.limits;
        let seconds = |time: Duration| figure(time.as_secs_f64(), 0);
        let formula = format!(
            "set-up {} s + flight time {} s + two legs of {} s + landing {} s",
            seconds(limits.set_up),
            seconds(limits.flight_time),
            seconds(limits.leg),
            seconds(limits.landing),
        );
        let default = limits.default_duration();
        if self.bound() != limits.duration {
            format!(
                "all landed by {} s, the bound of another swarm",
                seconds(self.bound())
            )
        } else if limits.duration == default {
            format!("all landed by {} s: {formula}", seconds(limits.duration))
        } else {
            format!(
                "all landed by {} s (`limits.duration_s`); default {} s: {formula}",
                seconds(limits.duration),
                seconds(default)
            )
        }
    }

    fn describe_layers(&self) -> Vec<String> {
        let first = &self.plan.layout;
        let last = self.plan.changes.last().map_or(&**first, Change::layout);
        let mut lines = describe_altitudes([
            ("taking off", first.take_off_layers_m()),
            ("out of lockstep", &first.layers_m(&self.plan.waypoints)),
            ("going to land", last.landing_layers_m()),
        ]);
        let sectors_m = self
            .plan
            .changes
            .iter()
            .flat_map(Change::sectors_m)
            .copied();
        if let Some(highest_m) = sectors_m.reduce(f64::max) {
            lines.push(format!(
                "altitude sectors of {} of formation: up to {} m",
                plural(self.plan.changes.len(), "change"),
                to_millimetres(highest_m)
            ));
        }
        lines
    }
}

impl Scenario {
    /// Numbers of waves, if there is no room for all drones at once, and the additional time.
    fn describe_waves(&self) -> Option<String> {
        let last = self
            .plan
            .changes
            .last()
            .map_or(&*self.plan.layout, Change::layout);
        let crossing = self
            .plan
            .changes
            .iter()
            .map(Change::waves)
            .max()
            .unwrap_or(1);
        let (up, down) = (self.plan.layout.take_off_waves(), last.landing_waves());
        let pace = WavePace {
            vehicle: &self.plan.vehicle,
            waypoints: &self.plan.waypoints,
        };
        let extra_s = pace.extra_s(&self.plan.layout, &self.plan.changes);
        (up.max(down).max(crossing) > 1).then(|| {
            format!(
                "waves: {up} to take off, {crossing} to change formation, {down} to land; about {} s longer than all at once",
                figure(extra_s, 0)
            )
        })
    }
}

/// Most holds that are listed.
const LISTED_HOLDS_MAX: usize = 8;

/// Waypoints at which the swarm waits, and for how long. `None` if it waits at none.
#[must_use]
pub fn describe_holds(holds: &Holds) -> Option<String> {
    let each = holds.iter().take(LISTED_HOLDS_MAX);
    let each = each.map(|(waypoint, hold)| format!("{} s at {waypoint}", hold.as_secs_f64()));
    let more = if holds.iter().count() > LISTED_HOLDS_MAX {
        ", …"
    } else {
        ""
    };
    (!holds.is_empty()).then(|| {
        format!(
            "holds at {}, {} s in all: {}{more}",
            plural(holds.iter().count(), "waypoint"),
            holds.total().as_secs_f64(),
            each.collect::<Vec<_>>().join(", "),
        )
    })
}

/// Rounds to millimetres: a sum of decimal fractions has more digits.
fn to_millimetres(metres: f64) -> f64 {
    (metres * 1_000.0).round() / 1_000.0
}

/// Most drones of which the layers are listed.
const LISTED_DRONES_MAX: usize = 16;

/// Each drone's layers, one row a drone. Those of many drones are summed up: the number of layers and the highest.
fn describe_altitudes(phases: [(&'static str, &[f64]); 3]) -> Vec<String> {
    let height = |layer_m: f64| format!("+{} m", to_millimetres(layer_m));
    let drones = phases[0].1.len();
    if drones > LISTED_DRONES_MAX {
        let summed_up = |(when, layers_m): (&str, &[f64])| {
            // The bits of positive numbers have the order of the numbers.
            let layers: BTreeSet<u64> = layers_m.iter().map(|it| it.to_bits()).collect();
            let highest_m = layers.last().map_or(0.0, |it| f64::from_bits(*it));
            format!(
                "layers {when}: {}, up to {}",
                layers.len(),
                height(highest_m)
            )
        };
        return phases.map(summed_up).to_vec();
    }
    let header = ["layer of drone"].into_iter();
    let mut table = bare_table(header.chain(phases.map(|(when, _)| when)));
    for drone in 0..drones {
        let layers = phases.map(|(_, layers_m)| {
            layers_m
                .get(drone)
                .map_or_else(String::new, |it| height(*it))
        });
        table.add_row([drone.to_string()].into_iter().chain(layers));
    }
    lines(&table)
}
