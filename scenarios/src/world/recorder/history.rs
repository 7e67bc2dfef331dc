//! What happened in a swarm, in order of time. Replays and exports are made of it.

use muster_machines::identity::{Ballot, NodeId};
use muster_machines::mission::LandingReason;
use muster_machines::node::Address;
use muster_machines::time::Timestamp;

use crate::segments::{Link, Segments};

/// Most happenings, and most changes of links, that are kept. Later ones are left out.
const KEPT_MAX: usize = 1_000_000;

/// Links and segments are kept of swarms with at most this many nodes: in a denser swarm they are too many to be drawn.
pub(crate) const LINKED_NODES_MAX: usize = 300;

/// The history of a swarm. It is only written during a run: nothing in a world depends on it.
#[derive(Debug, Default)]
pub(crate) struct History {
    happenings: Vec<Happening>,
    /// All links that are not down, sorted, as at the last look.
    links: Vec<Link>,
    link_changes: Vec<LinkChange>,
    /// The members of each segment, whenever they changed.
    segments: Vec<(Timestamp, Vec<Vec<NodeId>>)>,
    faults: Vec<InjectedFault>,
}

/// Something that happened to a node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Happening {
    pub(crate) at: Timestamp,
    pub(crate) node: NodeId,
    pub(crate) what: Incident,
}

/// What happened to a node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Incident {
    /// Its route to the master changed.
    Routes {
        hops: Option<u16>,
        parent: Option<NodeId>,
        relay: bool,
    },
    /// It follows this leader, perhaps itself.
    Follows(Ballot),
    /// It leaves the swarm, to follow nobody.
    Leaves,
    /// It flies out of lockstep, to its own altitude layer.
    LeavesLockstep,
    /// It goes to land.
    Lands(LandingReason),
    /// Its companion computer died.
    Killed,
    /// Its battery is empty.
    RanEmpty,
    /// Its aircraft fell.
    Fell,
    /// Its process ended, and is to be started again.
    Stopped,
    /// Its process started again.
    Rebooted,
    /// An actor hangs, or its whole process (`None`).
    Hangs(Option<Address>),
    /// A hang is over.
    Resumed,
    /// An actor failed, and is restarted.
    Restarts(Address),
    /// An actor failed for good.
    GivenUp(Address),
}

impl Incident {
    /// Whether the flight controller hears nothing from then on, so that it brings the aircraft down. `None` if this changes
    /// nothing.
    pub(crate) const fn ends_commands(&self) -> Option<bool> {
        match self {
            Self::Killed
            | Self::RanEmpty
            | Self::Fell
            | Self::Stopped
            | Self::Hangs(None | Some(Address::Msp))
            | Self::GivenUp(_) => Some(true),
            Self::Rebooted | Self::Resumed => Some(false),
            Self::Routes { .. }
            | Self::Follows(_)
            | Self::Leaves
            | Self::LeavesLockstep
            | Self::Lands(_)
            | Self::Hangs(Some(_))
            | Self::Restarts(_) => None,
        }
    }
}

/// A link that came, changed or went.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct LinkChange {
    pub(crate) at: Timestamp,
    /// The lower id first.
    pub(crate) ends: (NodeId, NodeId),
    /// Whether it is up or grey; `None` if it is down.
    pub(crate) is_up: Option<bool>,
}

/// A fault of the plan that was injected.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct InjectedFault {
    pub(crate) at: Timestamp,
    /// Index in the fault plan.
    pub(crate) index: usize,
    /// The drone that it affects; `None` if it affects links, or the master while nobody leads.
    pub(crate) target: Option<NodeId>,
}

impl History {
    pub(super) fn happens(&mut self, at: Timestamp, node: NodeId, what: Incident) {
        if self.happenings.len() < KEPT_MAX {
            self.happenings.push(Happening { at, node, what });
        }
    }

    pub(super) fn injected(&mut self, fault: InjectedFault) {
        if self.faults.len() < KEPT_MAX {
            self.faults.push(fault);
        }
    }

    /// The links or segments of a swarm with this many nodes have changed.
    pub(super) fn looked(&mut self, now: Timestamp, nodes: usize, segments: &Segments) {
        if nodes > LINKED_NODES_MAX {
            return;
        }
        let links = segments.links();
        let went = (self.links.iter()).filter(|link| find(links, link.ends()).is_none());
        let went = went.map(|link| (link.ends(), None));
        let came = links.iter().filter(|link| {
            let before = find(&self.links, link.ends());
            before.is_none_or(|before| before.is_up() != link.is_up())
        });
        let came = came.map(|link| (link.ends(), Some(link.is_up())));
        let room = KEPT_MAX.saturating_sub(self.link_changes.len());
        let changes = went.chain(came).take(room).map(|(ends, is_up)| LinkChange {
            at: now,
            ends,
            is_up,
        });
        self.link_changes.extend(changes);
        self.links.clear();
        self.links.extend_from_slice(links);
        let members: Vec<_> = segments.iter().map(|it| it.members.clone()).collect();
        let is_new = self
            .segments
            .last()
            .is_none_or(|(_, before)| *before != members);
        if is_new && self.segments.len() < KEPT_MAX / LINKED_NODES_MAX {
            self.segments.push((now, members));
        }
    }

    pub(crate) fn happenings(&self) -> &[Happening] {
        &self.happenings
    }

    pub(crate) fn link_changes(&self) -> &[LinkChange] {
        &self.link_changes
    }

    pub(crate) fn segments(&self) -> &[(Timestamp, Vec<Vec<NodeId>>)] {
        &self.segments
    }

    pub(crate) fn faults(&self) -> &[InjectedFault] {
        &self.faults
    }
}

/// The link between these nodes in a sorted list.
fn find(links: &[Link], ends: (NodeId, NodeId)) -> Option<&Link> {
    let at = links.binary_search_by_key(&ends, |link| link.ends()).ok()?;
    links.get(at)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::segments::tests::{at, line, link};

    fn looked(history: &mut History, seconds: f64, segments: &mut Segments, links: Vec<Link>) {
        segments.look(at(seconds), vec![Some(0); 4], links);
        history.looked(at(seconds), 4, segments);
    }

    #[test]
    fn links_are_kept_as_changes() {
        let (mut history, mut segments) = (History::default(), Segments::default());
        looked(&mut history, 1.0, &mut segments, line(3));
        let weak = vec![link(0, 1, 0.7), link(2, 3, 0.0)];
        looked(&mut history, 2.0, &mut segments, weak);
        let changes: Vec<_> = history.link_changes().iter().collect();
        let seen: Vec<_> = (changes.iter())
            .map(|it| (it.at, it.ends.0.0, it.ends.1.0, it.is_up))
            .collect();
        assert_eq!(
            seen,
            [
                (at(1.0), 0, 1, Some(true)),
                (at(1.0), 1, 2, Some(true)),
                (at(2.0), 1, 2, None),
                (at(2.0), 0, 1, Some(false)),
                (at(2.0), 2, 3, Some(true)),
            ]
        );
        assert_eq!(history.segments().len(), 2);
    }

    #[test]
    fn links_of_a_large_swarm_are_not_kept() {
        let (mut history, mut segments) = (History::default(), Segments::default());
        segments.look(at(1.0), vec![Some(0); 4], line(4));
        history.looked(at(1.0), LINKED_NODES_MAX + 1, &segments);
        assert!(history.link_changes().is_empty() && history.segments().is_empty());
    }
}
