//! Breadth-first search of the model.

use std::num::NonZeroUsize;

use stateright::{Checker, Expectation, HasDiscoveries, Model};

use super::Swarm;

/// Result of a search.
#[derive(Debug)]
pub(crate) struct Found {
    /// Reached states, with repetitions.
    pub(crate) reached: usize,
    /// Distinct states.
    pub(crate) states: usize,
    /// Largest shortest distance of a state from the first one, in steps.
    pub(crate) depth: usize,
    /// Whether all reachable states were searched.
    pub(crate) is_exhausted: bool,
    /// Violated rules, with the steps that lead there.
    pub(crate) violated: Vec<(&'static str, String)>,
    /// Properties expected in some state and found in none.
    pub(crate) unreached: Vec<&'static str>,
}

/// Searches all states up to `depth_max` steps from the first; stops at a violated rule.
pub(crate) fn search(swarm: Swarm, depth_max: Option<NonZeroUsize>) -> Found {
    let mut checker = swarm.checker().finish_when(HasDiscoveries::AnyFailures);
    if let Some(max) = depth_max {
        // The first state counts, and the last level is not checked.
        checker = checker.target_max_depth(max.get() + 2);
    }
    let checker = checker.spawn_bfs().join();
    let (mut violated, mut unreached) = (Vec::new(), Vec::new());
    for property in checker.model().properties() {
        let name = property.name;
        match (property.expectation, checker.discovery(name)) {
            (Expectation::Sometimes, None) => unreached.push(name),
            (Expectation::Always, Some(path)) => {
                let steps = path.into_actions().into_iter();
                let steps: Vec<_> = steps.map(|action| format!("{action:?}")).collect();
                violated.push((name, steps.join(", ")));
            }
            _ => {}
        }
    }
    let depth = checker.max_depth() - 1;
    Found {
        reached: checker.state_count(),
        states: checker.unique_state_count(),
        depth: depth_max.map_or(depth, |max| depth.min(max.get())),
        is_exhausted: violated.is_empty() && depth_max.is_none_or(|max| depth <= max.get()),
        unreached,
        violated,
    }
}
