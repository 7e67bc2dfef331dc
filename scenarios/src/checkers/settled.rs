use std::time::Duration;

use muster_machines::identity::{Ballot, NodeId};
use muster_machines::time::Timestamp;

use super::Violation;
use crate::scenario::Settling;
use crate::segments::{Segment, Segments};

/// Rule 1, (c): once links have been still for the settling time, and while no grey link decides who is connected, each
/// part has exactly one master, obeyed by all its members. Not owed over more hops than policy `flood` carries a sign of the
/// master ([`Settling::hops_max`]).
///
/// A part is whoever is connected by links that are up; it is still while none of its links changes and none of its
/// members fails, hangs, takes off, begins or ends a change of formation, goes to land or falls silent. Its members are
/// those in the air that fly the mission; drones on the ground or going to land only pass on. Their master is the one
/// drone that they all obey, itself included; it must be one of them. Where a swarm does not elect, drones without a
/// master are to be landing by then. The instant at which anyone turns to another ballot counts like any other: a false election is found even if
/// all agree again a moment later.
#[derive(Debug)]
pub(crate) struct SettledChecker {
    settling: Settling,
}

/// What a drone does, as far as this rule is about it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct MemberState {
    /// Whether it is in the air and flies the mission.
    pub(crate) flies: bool,
    /// Whether it can lead others that do.
    pub(crate) leads: bool,
    /// Whether it takes off or changes formation.
    pub(crate) spreads: bool,
    /// Whom it obeys.
    pub(crate) obeys: Option<Ballot>,
}

impl SettledChecker {
    pub(crate) const fn new(settling: Settling) -> Self {
        Self { settling }
    }

    /// How long a part may take to settle.
    pub(crate) const fn settling(&self) -> Settling {
        self.settling
    }

    /// Looks at every part.
    pub(crate) fn look(
        &self,
        now: Timestamp,
        segments: &Segments,
        member_state: impl Fn(NodeId) -> MemberState,
    ) -> Option<Violation> {
        // The diameter, which is long to find, is asked for only where something is wrong.
        let is_settled = |segment: &Segment, diameter| {
            let spreads = segment.members.iter().any(|id| member_state(*id).spreads);
            let more = if spreads {
                self.settling.spreading
            } else {
                Duration::ZERO
            };
            let settling = self.settling;
            let is_owed = segment.is_decided && settling.is_owed(diameter);
            is_owed && now.since(segment.still_since) > settling.time(diameter) + more
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
                    "{what}, though no link of their segment has changed for {:.1} s",
                    now.since(segment.still_since).as_secs_f64()
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

/// What is wrong with who leads a part; nothing if it has its one master, or nobody who needs one.
fn disagreement(
    segment: &Segment,
    member_state: &impl Fn(NodeId) -> MemberState,
) -> Option<String> {
    let first = flying(segment, member_state).next()?;
    let Some(ballot) = member_state(first).obeys else {
        return Some(format!("drone {first} obeys nobody"));
    };
    let master = ballot.master;
    if let Some(other) =
        flying(segment, member_state).find(|id| member_state(*id).obeys != Some(ballot))
    {
        let leader = member_state(other).obeys;
        let leader = leader.map_or_else(|| "nobody".to_owned(), |it| it.to_string());
        return Some(format!(
            "drone {first} obeys {ballot} and drone {other} {leader}"
        ));
    }
    if !segment.members.contains(&master) {
        return Some(format!(
            "drone {first} obeys drone {master}, which no link leads to"
        ));
    }
    (!member_state(master).leads)
        .then(|| format!("drone {first} obeys {ballot}, which does not fly"))
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
        back_off: Duration::from_secs(1),
        hops_max: None,
    });

    fn under(term: u32, master: u32) -> MemberState {
        MemberState {
            flies: true,
            leads: true,
            spreads: false,
            obeys: Some(Ballot {
                term,
                rank: master,
                master: NodeId(master),
            }),
        }
    }

    /// Three in line, still since the start.
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
    fn one_master_obeyed_by_all_is_right_at_any_time() {
        assert_eq!(found(100.0, &segments(), &[under(2, 1); 3]), None);
    }

    #[test]
    fn two_masters_are_found_once_the_part_has_settled_and_not_before() {
        let drones = [under(1, 0), under(2, 2), under(2, 2)];
        assert_eq!(found(6.0, &segments(), &drones), None);
        assert!(found(6.1, &segments(), &drones).is_some());
    }

    #[test]
    fn nothing_is_owed_over_more_hops_than_the_master_is_heard_of() {
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
    fn the_time_starts_anew_with_every_change_of_a_link() {
        let mut segments = segments();
        let mut links = line(3);
        links.push(link(0, 2, 0.5));
        segments.look(at(5.0), vec![Some(0); 3], links);
        let drones = [under(1, 0), under(2, 2), under(2, 2)];
        assert_eq!(found(7.0, &segments, &drones), None);
        assert!(found(12.0, &segments, &drones).is_some());
    }

    #[test]
    fn nothing_is_found_while_a_grey_link_decides() {
        let mut segments = Segments::default();
        let links = vec![link(0, 1, 0.0), link(1, 2, 0.6)];
        segments.look(at(0.0), vec![Some(0); 3], links);
        assert_eq!(found(100.0, &segments, &[under(1, 2); 3]), None);
    }

    #[test]
    fn a_master_that_is_not_in_the_part_is_found() {
        let mut segments = segments();
        segments.look(at(0.0), vec![Some(0), Some(0), None], line(3));
        let what = found(100.0, &segments, &[under(1, 2); 3]).unwrap();
        assert!(what.contains("which no link leads to"), "{what}");
    }

    #[test]
    fn a_master_that_obeys_another_or_goes_to_land_is_found() {
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
    fn a_part_that_spreads_has_longer_to_settle() {
        let spreads = MemberState {
            spreads: true,
            ..under(2, 2)
        };
        let drones = [under(1, 0), under(2, 2), spreads];
        assert_eq!(found(16.0, &segments(), &drones), None);
        assert!(found(16.1, &segments(), &drones).is_some());
    }

    #[test]
    fn whoever_is_on_the_ground_or_landing_needs_no_master() {
        let down = MemberState {
            flies: false,
            leads: false,
            spreads: false,
            obeys: None,
        };
        assert_eq!(
            found(100.0, &segments(), &[under(1, 0), down, under(1, 0)]),
            None
        );
        assert_eq!(found(100.0, &segments(), &[down; 3]), None);
        let lost = MemberState {
            obeys: None,
            ..under(1, 0)
        };
        assert!(found(100.0, &segments(), &[under(1, 0), lost, down]).is_some());
    }
}
