//! Helpers of these tests.

use std::path::{Path, PathBuf};

use muster_scenarios::scenario::{Override, Scenario, load};

/// Path of a shipped file.
pub(crate) fn shipped(name: &str) -> PathBuf {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/..")).join(name)
}

/// A shipped scenario with overrides.
pub(crate) fn scenario(name: &str, overrides: &[&str]) -> Scenario {
    let overrides: Vec<Override> = overrides.iter().map(|it| it.parse().unwrap()).collect();
    load(&shipped(name), &overrides).unwrap_or_else(|error| panic!("{name}: {error}"))
}
