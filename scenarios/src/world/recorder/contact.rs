//! Which drones could hear each other during the mission.

/// Groups of nodes that links have connected during the mission, over others and at different times too.
///
/// Drones on the way to their slots or to their landing places do not count: there all of a swarm are close together.
/// Nodes go by their index in the swarm.
#[derive(Debug)]
pub(super) struct Contact {
    /// For each node one of its group with a lower index; itself if it is the lowest.
    towards: Vec<usize>,
}

impl Contact {
    /// Each of `nodes` nodes is alone.
    pub(super) fn new(nodes: usize) -> Self {
        Self {
            towards: (0..nodes).collect(),
        }
    }

    /// A link connects two nodes.
    pub(super) fn connect(&mut self, a: usize, b: usize) {
        let (a, b) = (self.shortened(a), self.shortened(b));
        self.towards[a.max(b)] = a.min(b);
    }

    /// The lowest node of a node's group.
    pub(super) fn group(&self, mut node: usize) -> usize {
        while self.towards[node] != node {
            node = self.towards[node];
        }
        node
    }

    /// As [`Self::group`]; makes the next search shorter.
    fn shortened(&mut self, node: usize) -> usize {
        let group = self.group(node);
        self.towards[node] = group;
        group
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_are_joined_over_others_and_at_different_times() {
        let mut contact = Contact::new(7);
        for (a, b) in [(5, 4), (1, 2), (4, 3), (1, 2)] {
            contact.connect(a, b);
        }
        let groups: Vec<_> = (1..7).map(|node| contact.group(node)).collect();
        assert_eq!(groups, [1, 1, 3, 3, 3, 6]);
        contact.connect(2, 5);
        assert!((1..6).all(|node| contact.group(node) == 1));
    }
}
