//! The flights of a drone, with a journal each, in the subfolders `flight-1`, `flight-2`, … of one folder.
//!
//! A flight starts only because its number is asked for, never because a process restarts: with the same number a process
//! always opens the same journal.

use std::path::{Path, PathBuf};
use std::{fs, io};

use super::{is_unused, peek};

/// Old flights that are kept beside the newest one.
const KEPT_MAX: usize = 16;

/// A flight in a folder has taken place and has a higher number than the requested one; nothing has changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the journal has flight {newest} already")]
pub struct OldFlight {
    /// Number of the newest flight that has taken place.
    pub newest: u32,
}

/// The folder of flight `number`.
#[must_use]
pub fn folder_of(root: &Path, number: u32) -> PathBuf {
    root.join(format!("flight-{number}"))
}

/// The flights in a folder, by number, the newest last. Empty if the folder can't be read.
#[must_use]
pub fn list(root: &Path) -> Vec<u32> {
    let entries = fs::read_dir(root).into_iter().flatten().flatten();
    let mut numbers: Vec<u32> = entries
        .filter_map(|it| number_of(&it.file_name()))
        .collect();
    numbers.sort_unstable();
    numbers
}

fn number_of(name: &std::ffi::OsStr) -> Option<u32> {
    let number = name.to_str()?.strip_prefix("flight-")?.parse().ok()?;
    (name.to_str() == Some(&format!("flight-{number}"))).then_some(number)
}

/// The flight that a process joins if `requested` is asked for: the newest one while that is not over, otherwise the
/// requested one, which may be new. A newer flight that never began counts for none: its number was taken back. Nothing is
/// created.
///
/// # Errors
/// If a flight with a higher number has taken place, or its journal is damaged.
pub fn choose(root: &Path, requested: u32) -> Result<u32, OldFlight> {
    for newest in list(root).into_iter().rev() {
        let folder = folder_of(root, newest);
        let checkpoints = peek(&folder).ok().flatten();
        if checkpoints.is_some_and(|it| it.is_flight_ongoing()) {
            // A process that restarts in flight goes on with it, whatever its file says by then.
            return Ok(newest);
        }
        if newest <= requested {
            break;
        }
        if !is_unused(&folder) {
            return Err(OldFlight { newest });
        }
    }
    Ok(requested)
}

/// Removes all but the newest old flights.
///
/// # Errors
/// If the system can't remove one; the others may be removed.
pub fn prune(root: &Path) -> io::Result<()> {
    let flights = list(root);
    let excess = flights.len().saturating_sub(KEPT_MAX + 1);
    (flights[..excess].iter()).try_for_each(|number| fs::remove_dir_all(folder_of(root, *number)))
}

#[cfg(test)]
mod tests {
    use muster_machines::mission::{self, State};
    use muster_machines::node::Checkpoint;

    use super::*;
    use crate::journal::{Folder, Journal};

    /// Writes a journal of flight `number` whose mission is in `state`.
    fn fly(root: &Path, number: u32, state: State) {
        let folder = Folder::open(&folder_of(root, number)).unwrap();
        let (mut journal, mut all) = Journal::open(folder).unwrap();
        let mission = mission::Checkpoint {
            state,
            ..mission::Checkpoint::default()
        };
        let checkpoint = Checkpoint::Mission(Box::new(mission));
        all.keep(checkpoint.clone());
        journal.add(&checkpoint, &all).unwrap();
    }

    #[test]
    fn new_flight_starts_only_after_the_last_is_over() {
        let root = tempfile::tempdir().unwrap();
        assert_eq!(choose(root.path(), 1), Ok(1));
        fly(root.path(), 1, State::TakingOff);
        assert_eq!(choose(root.path(), 1), Ok(1));
        assert_eq!(choose(root.path(), 2), Ok(1), "flight 1 is not over");
        fly(root.path(), 1, State::Finished);
        assert_eq!(
            choose(root.path(), 1),
            Ok(1),
            "a restart flies no second time"
        );
        assert_eq!(choose(root.path(), 7), Ok(7));
    }

    #[test]
    fn earlier_flight_is_refused() {
        let root = tempfile::tempdir().unwrap();
        fly(root.path(), 3, State::TakingOff);
        assert_eq!(choose(root.path(), 2), Ok(3), "flight 3 is not over");
        fly(root.path(), 3, State::Finished);
        assert_eq!(choose(root.path(), 2), Err(OldFlight { newest: 3 }));
    }

    #[test]
    fn newer_flight_that_never_began_is_ignored() {
        let root = tempfile::tempdir().unwrap();
        fly(root.path(), 1, State::Finished);
        fly(root.path(), 2, State::Start);
        assert_eq!(choose(root.path(), 1), Ok(1), "it was taken back");
        fly(root.path(), 1, State::TakingOff);
        assert_eq!(choose(root.path(), 1), Ok(1));
        fly(root.path(), 2, State::Finished);
        fly(root.path(), 3, State::Start);
        assert_eq!(choose(root.path(), 1), Err(OldFlight { newest: 2 }));
        // A damaged journal may have been of a flight.
        fs::write(folder_of(root.path(), 3).join("journal"), b"damaged").unwrap();
        assert_eq!(choose(root.path(), 1), Err(OldFlight { newest: 3 }));
    }

    #[test]
    fn damaged_journal_does_not_block_the_next_flight() {
        let root = tempfile::tempdir().unwrap();
        fly(root.path(), 1, State::Finished);
        fs::write(folder_of(root.path(), 1).join("journal"), b"damaged").unwrap();
        assert_eq!(choose(root.path(), 2), Ok(2));
    }

    #[test]
    fn old_flights_are_bounded_and_readable() {
        let root = tempfile::tempdir().unwrap();
        fs::write(root.path().join("flight-x"), b"").unwrap();
        for number in 1..=20 {
            fly(root.path(), number, State::Finished);
        }
        prune(root.path()).unwrap();
        let kept = list(root.path());
        assert_eq!((kept.first(), kept.len()), (Some(&4), KEPT_MAX + 1));
        let oldest = peek(&folder_of(root.path(), 4)).unwrap().unwrap();
        assert_eq!(oldest.state(), State::Finished);
    }
}
