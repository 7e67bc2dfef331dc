use std::time::Duration;

use muster_machines::identity::{Ballot, NodeId};
use muster_machines::time::Timestamp;

use super::Violation;
use crate::scenario::Settling;
use crate::segments::{Segment, Segments};

/// Rule 1, (c): each segment has exactly one master, followed by all its members, once its links have not changed for the
/// settling time. The rule does not apply while a grey link decides who is connected, nor over more hops than policy `flood`
/// carries a heartbeat ([`Settling::hops_max`]).
///
/// The settling time starts again when a direction of a link of the segment changes, a delay of its frames begins or ends,
/// a frame arrives from another segment over a link that came and went between two looks, or when a member fails, hangs,
/// takes off, begins or ends a change of formation, goes to land or falls silent. Only drones in the air that fly the
/// mission need a master; those on the ground or going to land relay frames. The master must be a member of the segment and
/// follow itself. Where a swarm does not elect, drones without a master must be landing by then. A false election breaks
/// the rule even if all agree again a moment later.
#[derive(Debug)]
pub(crate) struct SettledChecker {
    settling: Settling,
}

/// The state of a drone, as far as this rule needs it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct MemberState {
    /// It is in the air and flies the mission.
    pub(crate) flies: bool,
    /// It can lead others that do.
    pub(crate) leads: bool,
    /// It takes off or changes formation.
    pub(crate) spreads: bool,
    /// The ballot that it follows.
    pub(crate) leader: Option<Ballot>,
}

impl SettledChecker {
    /// For a swarm with these settling times.
    pub(crate) const fn new(settling: Settling) -> Self {
        Self { settling }
    }

    /// How long a segment may take to settle.
    pub(crate) const fn settling(&self) -> Settling {
        self.settling
    }

    /// Checks every segment.
    pub(crate) fn look(
        &self,
        now: Timestamp,
        segments: &Segments,
        member_state: impl Fn(NodeId) -> MemberState,
    ) -> Option<Violation> {
        // The diameter is expensive, so it is computed only where something is wrong.
        let is_settled = |segment: &Segment, diameter| {
            let spreads = segment.members.iter().any(|id| member_state(*id).spreads);
            let more = if spreads {
                self.settling.spreading
            } else {
                Duration::ZERO
            };
            let settling = self.settling;
            let applies = segment.is_decided && settling.applies_to(diameter);
            applies && now.since(segment.unchanged_since) > settling.time(diameter) + more
        };
        segments.iter().find_map(|segment| {
            if !is_settled(segment, 0) {
                return None;
            }
            let what = disagreement(segment, &member_state)?;
            is_settled(segment, segments.diameter(segment)).then(|| Violation {
                rule: 1,
                at: now,
                drones: flying(segment, &member_state).collect(),
                what: format!(
                    "{what}, although no link of their segment has changed for {:.1} s",
                    now.since(segment.unchanged_since).as_secs_f64()
                ),
            })
        })
    }
}

fn flying(
    segment: &Segment,
    member_state: impl Fn(NodeId) -> MemberState,
) -> impl Iterator<Item = NodeId> {
    let members = segment.members.iter().copied();
    members.filter(move |id| member_state(*id).flies)
}

/// What is wrong with the leadership of a segment. `None` if it has one master, or no member that needs one.
fn disagreement(
    segment: &Segment,
    member_state: &impl Fn(NodeId) -> MemberState,
) -> Option<String> {
    let first = flying(segment, member_state).next()?;
    let Some(ballot) = member_state(first).leader else {
        return Some(format!("drone {first} follows no ballot"));
    };
    let master = ballot.master;
    if let Some(other) =
        flying(segment, member_state).find(|id| member_state(*id).leader != Some(ballot))
    {
        let leader = member_state(other).leader;
        let leader = leader.map_or_else(|| "no ballot".to_owned(), |it| it.to_string());
        return Some(format!(
            "drone {first} follows {ballot} and drone {other} {leader}"
        ));
    }
    if !segment.members.contains(&master) {
        return Some(format!(
            "drone {first} follows drone {master}, which is not in its segment"
        ));
    }
    (!member_state(master).leads)
        .then(|| format!("drone {first} follows drone {master}, which does not fly"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::segments::tests::{at, line, link};

    /// Two hops across, a swarm settles in 6 s.
    const CHECKER: SettledChecker = SettledChecker::new(Settling {
        detection: Duration::from_secs(1),
        spreading: Duration::from_secs(10),
        hop: Duration::from_secs(1),
        retransmission: Duration::from_secs(1),
        hops_max: None,
        tolerated_delay: Duration::MAX,
    });

    fn under(term: u32, master: u32) -> MemberState {
        MemberState {
            flies: true,
            leads: true,
            spreads: false,
            leader: Some(Ballot {
                term,
                rank: master,
                master: NodeId(master),
            }),
        }
    }

    /// Three in line, without changes since the start.
    fn segments() -> Segments {
        let mut segments = Segments::default();
        segments.look(at(0.0), vec![Some(0); 3], line(3));
        segments
    }

    fn found(now_s: f64, segments: &Segments, drones: &[MemberState]) -> Option<String> {
        let found = CHECKER.look(at(now_s), segments, |id| drones[id.0 as usize]);
        found.map(|violation| {
            assert_eq!(violation.rule, 1);
            violation.what
        })
    }

    #[test]
    fn one_master_followed_by_all_keeps_the_rule() {
        assert_eq!(found(100.0, &segments(), &[under(2, 1); 3]), None);
    }

    #[test]
    fn two_masters_break_the_rule_once_the_segment_must_have_settled() {
        let drones = [under(1, 0), under(2, 2), under(2, 2)];
        assert_eq!(found(6.0, &segments(), &drones), None);
        assert!(found(6.1, &segments(), &drones).is_some());
    }

    #[test]
    fn rule_does_not_apply_beyond_the_reach_of_heartbeats() {
        let drones = [under(1, 0), under(2, 2), under(2, 2)];
        let found_with = |hops_max| {
            let settling = Settling {
                hops_max: Some(hops_max),
                ..CHECKER.settling()
            };
            SettledChecker::new(settling).look(at(100.0), &segments(), |id| drones[id.0 as usize])
        };
        assert!(found_with(2).is_some());
        assert_eq!(found_with(1), None);
    }

    #[test]
    fn settling_time_starts_again_with_every_change_of_a_link() {
        let mut segments = segments();
        let mut links = line(3);
        links.push(link(0, 2, 0.5));
        segments.look(at(5.0), vec![Some(0); 3], links);
        let drones = [under(1, 0), under(2, 2), under(2, 2)];
        assert_eq!(found(7.0, &segments, &drones), None);
        assert!(found(12.0, &segments, &drones).is_some());
    }

    #[test]
    fn rule_does_not_apply_while_a_grey_link_decides() {
        let mut segments = Segments::default();
        let links = vec![link(0, 1, 0.0), link(1, 2, 0.6)];
        segments.look(at(0.0), vec![Some(0); 3], links);
        assert_eq!(found(100.0, &segments, &[under(1, 2); 3]), None);
    }

    #[test]
    fn a_master_outside_the_segment_breaks_the_rule() {
        let mut segments = segments();
        segments.look(at(0.0), vec![Some(0), Some(0), None], line(3));
        let what = found(100.0, &segments, &[under(1, 2); 3]).unwrap();
        assert!(what.contains("not in its segment"), "{what}");
    }

    #[test]
    fn a_master_that_follows_another_or_lands_breaks_the_rule() {
        let drones = [under(2, 2), under(3, 1), under(2, 2)];
        assert!(found(100.0, &segments(), &drones).is_some());
        let lands = MemberState {
            flies: false,
            leads: false,
            ..under(2, 2)
        };
        let drones = [under(2, 2), under(2, 2), lands];
        assert!(found(100.0, &segments(), &drones).is_some());
    }

    #[test]
    fn a_segment_that_spreads_has_longer_to_settle() {
        let spreads = MemberState {
            spreads: true,
            ..under(2, 2)
        };
        let drones = [under(1, 0), under(2, 2), spreads];
        assert_eq!(found(16.0, &segments(), &drones), None);
        assert!(found(16.1, &segments(), &drones).is_some());
    }

    #[test]
    fn drones_on_the_ground_or_landing_need_no_master() {
        let down = MemberState {
            flies: false,
            leads: false,
            spreads: false,
            leader: None,
        };
        assert_eq!(
            found(100.0, &segments(), &[under(1, 0), down, under(1, 0)]),
            None
        );
        assert_eq!(found(100.0, &segments(), &[down; 3]), None);
        let lost = MemberState {
            leader: None,
            ..under(1, 0)
        };
        assert!(found(100.0, &segments(), &[under(1, 0), lost, down]).is_some());
    }
}
