//! The verdict of `muster check`: one line.

use std::time::Duration;

use muster_machines::formation::{Change, Path, PhaseKind, Tube};
use muster_machines::geometry::Ned;
use muster_machines::identity::NodeId;
use muster_machines::mission::Succession;
use muster_runtime::plan::separation::{describe_phase, describe_unreached};
use muster_runtime::text::{drones, figure, plural};

use super::Scenario;
use crate::segments::Segments;

/// Longest time that is told in seconds.
const SECONDS_MAX: f64 = 120.0;

impl Scenario {
    /// The verdict of `muster check` in one line: whether the swarm is connected, how many drones fly for how long, and how
    /// many need relays.
    #[must_use]
    pub fn verdict(&self) -> String {
        let connected = self.connected();
        let mut warnings = connected
            .as_ref()
            .map_or_else(Vec::new, |in_slots| self.warnings(in_slots));
        warnings.extend(self.passed_relay().map(|(kind, drone, relay)| {
            format!(
                "drone {drone} comes too near relay {relay} {}: move the relay in `relays`",
                describe_phase(kind)
            )
        }));
        let mut facts = vec![
            plural(self.plan.layout.formation().drones() as usize, "drone"),
            about(self.expected()),
        ];
        match connected.as_ref().map(|in_slots| self.relayed(in_slots)) {
            Some(0) if !warnings.is_empty() => {}
            Some(0) => facts.push("all in the master's range".to_owned()),
            Some(relayed) => facts.push(format!("{relayed} need relays")),
            None => {}
        }
        let (word, facts) = (
            if warnings.is_empty() { "OK" } else { "WARNING" },
            facts.join(", "),
        );
        let warnings: String = warnings.iter().map(|it| format!("; {it}")).collect();
        format!("{word}: {facts}{warnings}")
    }

    /// The first drone, and the phase, that comes nearer to a relay than drones in lockstep may come to each other.
    fn passed_relay(&self) -> Option<(PhaseKind, NodeId, NodeId)> {
        let separation = self.plan.limits.separation;
        let relays = (self.plan.layout.formation().drones()..).zip(self.plan.relays.iter());
        let relays: Vec<_> = relays
            .map(|(id, place)| {
                let stays = Path {
                    from: *place,
                    to: *place,
                };
                (NodeId(id), Tube::from(stays))
            })
            .collect();
        let passed = |path: Path| {
            let passed = relays
                .iter()
                .find(|(_, relay)| Tube::from(path).violates(*relay, separation));
            passed.map(|(id, _)| *id)
        };
        self.flown().phases().find_map(|phase| {
            let mut paths = (0..).map(NodeId).zip(&phase.paths);
            paths.find_map(|(id, paths)| {
                let relay = paths.iter().find_map(|path| passed(*path))?;
                Some((phase.kind, id, relay))
            })
        })
    }

    /// What to change so that drones reach each other.
    fn remedy(&self) -> &'static str {
        if self.radio.loss >= 1.0 {
            "lower `radio.loss`"
        } else {
            "raise `radio.range_m` or lower `formation.spacing_m`"
        }
    }

    /// What may surprise an operator, though it can be flown.
    fn warnings(&self, in_slots: &Segments) -> Vec<String> {
        let mut warnings = Vec::new();
        let apart = self.out_of_reach(in_slots).unwrap_or_default();
        if !apart.is_empty() {
            let will = match self.plan.protocol.succession {
                Succession::Elect => "will fly on their own",
                Succession::Land => "will land",
            };
            warnings.push(format!(
                "{} can't reach the master, not even over others, and {will}: {}",
                drones(&apart),
                self.remedy()
            ));
        }
        let on_the_way = self.unreached_on_the_way();
        if let Some(longest) = on_the_way.iter().max_by_key(|it| it.longest()) {
            let (ids, when) = describe_unreached(longest);
            warnings.push(format!(
                "{} can't reach the master{when}: {}",
                drones(&ids),
                self.remedy(),
            ));
        }
        let diameter = self
            .masters_segment(in_slots)
            .map_or(0, |it| in_slots.diameter(it));
        if self.settling().hops_max.is_some_and(|hops| diameter > hops) {
            warnings.push(format!(
                "with these losses, policy `flood` does not carry heartbeats over {}: set `protocol.policy` to \"tree\"",
                plural(diameter as usize, "hop")
            ));
        }
        warnings
    }

    /// Number of drones that reach the master only over others.
    fn relayed(&self, in_slots: &Segments) -> usize {
        let master = self.plan.layout.formation().centre();
        let drones = self.plan.layout.formation().drones();
        let Some(segment) = self.masters_segment(in_slots) else {
            return 0;
        };
        let members = segment
            .members
            .iter()
            .filter(|id| id.0 < drones && **id != master);
        members
            .filter(|id| !in_slots.are_neighbours(**id, master))
            .count()
    }
}

impl Scenario {
    /// How long the flight takes if nothing goes wrong, from take-off to the ground. An estimate: vehicles stop at each
    /// waypoint, and what the protocol takes there is left out.
    pub(super) fn expected(&self) -> Duration {
        let plan = &self.plan;
        let home = plan.waypoints[0];
        let last = plan.changes.last().map_or(&*plan.layout, Change::layout);
        let above = |place: Ned| place.at_altitude(home.altitude_m());
        let spread_s = self.longest_s(|id| {
            let on_ground = plan.layout.take_off_place(id, home);
            [above(on_ground), plan.layout.slot(id, home)]
        });
        let gather_s = self.longest_s(|id| {
            let on_ground = last.landing_place(id, home);
            [last.slot(id, home), above(on_ground)]
        });
        let climb_s = home.altitude_m() / plan.vehicle.climb_mps;
        let landing = plan.landing;
        let touch_down_s = landing.final_altitude_m.min(home.altitude_m()) / landing.final_mps
            + (home.altitude_m() - landing.final_altitude_m).max(0.0) / landing.descent_mps;
        let changes_s = plan.changes.iter().map(|change| {
            let at = plan.waypoints[usize::from(change.waypoint())];
            let across = |id| {
                let [above_old, above_new, _] = change.path(id, at);
                [above_old, above_new]
            };
            self.longest_s(across) * f64::from(change.waves())
        });
        let steered = plan.follow.as_ref().and_then(|follow| follow.land_after);
        let course_s = match steered {
            Some(after) => after.as_secs_f64(),
            None => plan
                .waypoints
                .windows(2)
                .map(|it| self.leg_s([it[0], it[1]]))
                .sum(),
        };
        let seconds = f64::from(plan.layout.take_off_waves()) * (climb_s + spread_s)
            + f64::from(last.landing_waves()) * (gather_s + touch_down_s)
            + course_s
            + changes_s.sum::<f64>()
            + plan.holds.total().as_secs_f64();
        plan.protocol.discovery * 2 + Duration::from_secs_f64(seconds)
    }

    /// The longest of the drones' legs, in seconds.
    fn longest_s(&self, leg: impl Fn(NodeId) -> [Ned; 2]) -> f64 {
        let ids = (0..self.plan.layout.formation().drones()).map(NodeId);
        ids.map(|id| self.leg_s(leg(id))).fold(0.0, f64::max)
    }

    /// Duration of a leg from rest to rest, in seconds.
    fn leg_s(&self, [from, to]: [Ned; 2]) -> f64 {
        let follow = self.plan.follow.as_ref();
        let vehicle = follow.map_or(&self.plan.vehicle, |follow| &follow.master);
        vehicle.profile(from, to).duration_s()
    }
}

/// A duration in words, rounded.
fn about(duration: Duration) -> String {
    let seconds = duration.as_secs_f64();
    if seconds <= SECONDS_MAX {
        format!("about {} s", figure((seconds / 10.0).ceil() * 10.0, 0))
    } else {
        format!("about {} min", figure(seconds / 60.0, 0))
    }
}
