//! A search through all that may happen.

use std::num::NonZeroUsize;

use stateright::{Checker, Expectation, HasDiscoveries, Model};

use super::Swarm;

/// What a search has come to.
#[derive(Debug)]
pub(crate) struct Found {
    /// States that were reached, each as often as it was.
    pub(crate) reached: usize,
    /// Different states.
    pub(crate) states: usize,
    /// Steps on the longest of the shortest ways to any of them.
    pub(crate) depth: usize,
    /// Whether there are no others.
    pub(crate) is_exhausted: bool,
    /// Rules that don't hold, and how it comes to that.
    pub(crate) broken: Vec<(&'static str, String)>,
    /// What was to happen in some state, and did in none.
    pub(crate) missing: Vec<&'static str>,
}

/// Looks at every state, up to so many steps away from the first; ends where a rule does not hold.
pub(crate) fn search(swarm: Swarm, depth_max: Option<NonZeroUsize>) -> Found {
    let mut checker = swarm.checker().finish_when(HasDiscoveries::AnyFailures);
    if let Some(max) = depth_max {
        // The first state is counted, and the last are not looked at.
        checker = checker.target_max_depth(max.get() + 2);
    }
    let checker = checker.spawn_bfs().join();
    let (mut broken, mut missing) = (Vec::new(), Vec::new());
    for property in checker.model().properties() {
        let name = property.name;
        match (property.expectation, checker.discovery(name)) {
            (Expectation::Sometimes, None) => missing.push(name),
            (Expectation::Always, Some(path)) => {
                let steps = path.into_actions().into_iter();
                let steps: Vec<_> = steps.map(|action| format!("{action:?}")).collect();
                broken.push((name, steps.join(", ")));
            }
            _ => {}
        }
    }
    let depth = checker.max_depth() - 1;
    Found {
        reached: checker.state_count(),
        states: checker.unique_state_count(),
        depth: depth_max.map_or(depth, |max| depth.min(max.get())),
        is_exhausted: broken.is_empty() && depth_max.is_none_or(|max| depth <= max.get()),
        missing,
        broken,
    }
}
