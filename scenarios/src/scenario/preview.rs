//! What can be told of a scenario before it is flown.

use std::collections::BTreeMap;
use std::time::Duration;

use muster_machines::formation::{Act, Change, Paths, Phase};
use muster_machines::geometry::Ned;
use muster_machines::identity::NodeId;
use muster_machines::mission::{Holds, Succession};
use muster_machines::time::Timestamp;
use muster_transport::sim::Medium;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::Scenario;
use crate::segments::{Link, Segment, Segments};
use muster_runtime::plan::room::Pace;
use muster_runtime::text::{drones, figure, plural};

/// For swarms of at most so many it is found who is connected; the diameter of larger ones is taken for the most that it
/// can be.
const DIAMETER_NODES_MAX: u32 = 1_000;

impl Scenario {
    /// How long it may take until each part has its one master, by when all are down, and who flies in which altitude
    /// layer: a line each.
    #[must_use]
    pub fn preview(&self) -> Vec<String> {
        let connected = self.connected();
        let mut lines = self.apart_in_words(self.counted_out_of_reach());
        lines.extend([
            self.settling_in_words(connected.as_ref()),
            self.bound_in_words(),
        ]);
        lines.extend(holds_in_words(&self.plan.holds));
        lines.extend(self.layers_in_words());
        lines.extend(self.waves_in_words());
        lines.extend(self.plan.fence.iter().cloned());
        if let Some(in_slots) = &connected {
            lines.extend(self.unreached_in_words(in_slots));
            lines.extend(self.apart_by_height_in_words(in_slots));
        }
        let mut first = self.plan.nodes();
        for (swarm, joins) in &self.others {
            let last = first + swarm.plan.layout.formation().drones() - 1;
            lines.push(format!(
                "{} of {}: home {} m north and {} m east of here, told to fly after {} s",
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

    fn settling_in_words(&self, connected: Option<&Segments>) -> String {
        let settling = self.settling();
        let known = connected.map(|segments| {
            self.masters_segment(segments)
                .map_or(0, |it| segments.diameter(it))
        });
        let (diameter, is_at_most) = (known.unwrap_or(self.plan.nodes() - 1), known.is_none());
        let seconds = |time: Duration, digits| figure(time.as_secs_f64(), digits);
        if let Some(hops_max) = settling.hops_max.filter(|hops| diameter > *hops) {
            return format!(
                "settles in no known time: the swarm is {} across, and where so many frames are lost `flood` brings signs \
                 of the master often enough over {} only; those beyond miss a master that incarnations (with `tree` they don't)",
                plural(diameter as usize, "hop"),
                plural(hops_max as usize, "hop"),
            );
        }
        format!(
            "settles in {} s: {} s until whoever has lost the master misses it, 2 × {}{} of {} s, {} s until what was \
             lost on the way has been said again{}",
            seconds(settling.time(diameter), 1),
            seconds(settling.detection, 2),
            if is_at_most { "at most " } else { "" },
            plural(diameter as usize, "hop"),
            seconds(settling.hop, 3),
            seconds(settling.back_off, 2),
            match settling.spreading {
                Duration::ZERO => String::new(),
                more => format!(
                    "; {} s more while it takes off or changes formation",
                    seconds(more, 1)
                ),
            }
        )
    }

    /// Who is connected with whom, as all are in their slots; nothing for a swarm that is too large.
    fn connected(&self) -> Option<Segments> {
        let nodes = self.plan.nodes();
        (nodes <= DIAMETER_NODES_MAX)
            .then(|| self.connected_at(|_| self.plan.waypoints[0].altitude_m()))
    }

    /// How many are out of the master's reach in a phase, where they are the farthest apart in it; `None` for a swarm that is
    /// too large. Relays are left out: they stay where the mission began.
    fn counted_out_of_reach(&self) -> impl FnMut(&Phase) -> Option<usize> {
        let is_small = self.plan.nodes() <= DIAMETER_NODES_MAX;
        // On each leg of one formation it is the same.
        let mut on_legs: BTreeMap<u16, Option<usize>> = BTreeMap::new();
        move |phase| {
            if !is_small {
                return None;
            }
            let look = || {
                let above = |paths: &Paths| paths.get(1).unwrap_or(&paths[0]).to;
                let places: Vec<_> = phase.paths.iter().map(above).collect();
                self.out_of_reach(&self.connected_among(&places))
                    .map(|it| it.len())
            };
            match phase.act {
                Act::Flies { .. } => *on_legs.entry(phase.changes).or_insert_with(look),
                _ => look(),
            }
        }
    }

    /// Who is connected with whom, as each is above its first slot, at a height of its own in metres above home.
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
        // Nothing is drawn from it.
        let mut medium = Medium::new(self.radio, ChaCha8Rng::seed_from_u64(0), places);
        let mut segments = Segments::default();
        let live = vec![Some(0); places.len()];
        segments.look(Timestamp::ZERO, live, Link::all(&mut medium, |_| 0.0));
        segments
    }

    fn masters_segment<'a>(&self, segments: &'a Segments) -> Option<&'a Segment> {
        let master = self.plan.layout.formation().centre();
        segments
            .iter()
            .find(|segment| segment.members.contains(&master))
    }

    /// Who is where no links that are up connect it with the master, lowest first.
    fn out_of_reach(&self, segments: &Segments) -> Option<Vec<u32>> {
        let with_master = self.masters_segment(segments)?;
        let all = (0..self.plan.layout.formation().drones()).map(NodeId);
        let apart = all.filter(|id| !with_master.members.contains(id));
        Some(apart.map(|id| id.0).collect())
    }

    /// Whom altitude layers lead out of the reach that they have in their slots.
    fn apart_by_height_in_words(&self, in_slots: &Segments) -> Vec<String> {
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
                    "out of the master's reach {when}: {}; larger `radio.range_m`, smaller `formation.spacing_m` or \
                     `limits.separation_vertical_m` would help",
                    drones(&out_of_reach)
                )
            })
        });
        lines.collect()
    }

    /// Who is in a slot that no links that are up connect with the master's, lowest first; nothing if nobody is, or the swarm
    /// is too large to know.
    pub(super) fn unreached(&self) -> Option<Vec<u32>> {
        let apart = self.out_of_reach(&self.connected()?)?;
        (!apart.is_empty()).then_some(apart)
    }

    fn unreached_in_words(&self, segments: &Segments) -> Option<String> {
        let apart = self.out_of_reach(segments)?;
        let led = match self.plan.protocol.succession {
            Succession::Elect => "elect masters of their own",
            Succession::Land => "land",
        };
        (!apart.is_empty()).then(|| {
            let who = drones(&apart);
            format!("out of the master's reach, over others too: {who} will {led}")
        })
    }

    fn bound_in_words(&self) -> String {
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
                "all down by {} s, as the bound of another swarm says",
                seconds(self.bound())
            )
        } else if limits.duration == default {
            format!("all down by {} s: {formula}", seconds(limits.duration))
        } else {
            format!(
                "all down by {} s, as `limits.duration_s` says; without it by {} s: {formula}",
                seconds(limits.duration),
                seconds(default)
            )
        }
    }

    fn layers_in_words(&self) -> Vec<String> {
        let first = &self.plan.layout;
        let last = self.plan.changes.last().map_or(&**first, Change::layout);
        let mut lines = vec![
            in_words("taking off", first.take_off_layers_m()),
            in_words("out of lockstep", &first.layers_m(&self.plan.waypoints)),
            in_words("going to land", last.landing_layers_m()),
        ];
        let sectors_m = self
            .plan
            .changes
            .iter()
            .flat_map(Change::sectors_m)
            .copied();
        if let Some(highest_m) = sectors_m.reduce(f64::max) {
            lines.push(format!(
                "sectors of {} of formation: up to {} m",
                plural(self.plan.changes.len(), "change"),
                to_millimetres(highest_m)
            ));
        }
        lines
    }
}

impl Scenario {
    /// In how many waves drones fly where there is no room for all at once, and how much longer that takes.
    fn waves_in_words(&self) -> Option<String> {
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
        let pace = Pace {
            vehicle: &self.plan.vehicle,
            waypoints: &self.plan.waypoints,
        };
        let extra_s = pace.extra_s(&self.plan.layout, &self.plan.changes);
        (up.max(down).max(crossing) > 1).then(|| {
            format!(
                "waves: {up} to take off, {crossing} to change formation, {down} to land, one after the other, about {} s \
                 longer than all at once",
                figure(extra_s, 0)
            )
        })
    }
}

/// As many holds are told one by one.
const HOLDS_TOLD_MAX: usize = 8;

/// How long the swarm waits at which waypoints, if it waits at any.
#[must_use]
pub fn holds_in_words(holds: &Holds) -> Option<String> {
    let each = holds.iter().take(HOLDS_TOLD_MAX);
    let each = each.map(|(waypoint, hold)| format!("{} s at {waypoint}", hold.as_secs_f64()));
    let more = if holds.iter().count() > HOLDS_TOLD_MAX {
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

/// Without the digits that a sum of decimal fractions leaves behind.
fn to_millimetres(metres: f64) -> f64 {
    (metres * 1_000.0).round() / 1_000.0
}

/// So many layers are told one by one.
const LISTED_LAYERS_MAX: usize = 16;

/// Who flies in which layer, the lowest first; of many layers only how many there are and how high.
fn in_words(when: &str, layers_m: &[f64]) -> String {
    let mut layers: BTreeMap<u64, Vec<u32>> = BTreeMap::new();
    for (id, layer_m) in (0..).zip(layers_m) {
        // Layers are not negative, so their bits are in their order.
        layers.entry(layer_m.to_bits()).or_default().push(id);
    }
    if layers.len() > LISTED_LAYERS_MAX
        && let Some((highest_m, _)) = layers.last_key_value()
    {
        let highest_m = to_millimetres(f64::from_bits(*highest_m));
        return format!("layers {when}: {}, up to +{highest_m} m", layers.len());
    }
    let layers = layers.iter().map(|(layer_m, ids)| {
        format!(
            "+{} m {}",
            to_millimetres(f64::from_bits(*layer_m)),
            drones(ids)
        )
    });
    format!("layers {when}: {}", layers.collect::<Vec<_>>().join("; "))
}
