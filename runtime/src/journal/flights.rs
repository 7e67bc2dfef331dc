//! The flights of a drone, with a journal each, in the subfolders `flight-1`, `flight-2`, … of one folder.
//!
//! A flight starts only because its number is asked for, never because a process restarts: with the same number a process
//! always opens the same journal.

use std::path::{Path, PathBuf};
use std::{fs, io};

use muster_machines::node::Checkpoints;

use super::peek;

/// Old flights that are kept beside the newest one.
const KEPT_MAX: usize = 16;

/// A flight in a folder has taken place and has a higher number than the requested one; nothing has changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the newest flight in the journal is {newest}")]
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
        let found = peek(&folder_of(root, newest)).ok();
        let readable = found.as_ref().and_then(|it| it.readable());
        if readable.is_some_and(Checkpoints::is_flight_ongoing) {
            // A process that restarts in flight goes on with it, whatever its file says by then.
            return Ok(newest);
        }
        if newest <= requested {
            break;
        }
        if !found.is_some_and(|it| it.is_unused()) {
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
    use crate::journal::{Folder, HEADING_LEN, Journal, MAGIC, Peeked};

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
        journal.sync().unwrap();
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

    /// Cuts the journal of flight `number` after its first record. The number of the last synced record is intact.
    fn cut(root: &Path, number: u32) {
        let path = folder_of(root, number).join("journal");
        let bytes = fs::read(&path).unwrap();
        let first = bytes[MAGIC.len()..][..4].try_into().unwrap();
        let len = HEADING_LEN + u32::from_le_bytes(first) as usize;
        fs::write(path, &bytes[..MAGIC.len() + len]).unwrap();
    }

    #[test]
    fn journal_cut_between_records_is_damaged() {
        let root = tempfile::tempdir().unwrap();
        fly(root.path(), 1, State::Finished);
        fly(root.path(), 2, State::TakingOff);
        cut(root.path(), 2);
        let found = peek(&folder_of(root.path(), 2)).unwrap();
        assert!(matches!(found, Peeked::Damaged { .. }), "{found:?}");
        assert!(found.may_be_in_flight() && !found.is_unused());
        assert_eq!(choose(root.path(), 1), Err(OldFlight { newest: 2 }));
        assert_eq!(choose(root.path(), 2), Ok(2));
        fs::write(folder_of(root.path(), 2).join("journal"), b"").unwrap();
        let emptied = peek(&folder_of(root.path(), 2)).unwrap();
        assert!(emptied.may_be_in_flight(), "{emptied:?}");
        assert_eq!(choose(root.path(), 1), Err(OldFlight { newest: 2 }));
    }

    #[test]
    fn lost_or_replaced_files_of_a_journal_show_no_older_state() {
        for (journal, lasting) in [
            ("kept", "removed"),
            ("kept", "emptied"),
            ("kept", "flipped"),
            ("removed", "kept"),
            ("emptied", "kept"),
            ("folder", "kept"),
            ("kept", "folder"),
        ] {
            let root = tempfile::tempdir().unwrap();
            fly(root.path(), 1, State::TakingOff);
            let folder = folder_of(root.path(), 1);
            for (name, what) in [("journal", journal), ("lasting", lasting)] {
                let path = folder.join(name);
                match what {
                    "removed" => fs::remove_file(path).unwrap(),
                    "emptied" => fs::write(path, b"").unwrap(),
                    "flipped" => {
                        let mut bytes = fs::read(&path).unwrap();
                        bytes[0] ^= 1;
                        fs::write(path, bytes).unwrap();
                    }
                    "folder" => {
                        fs::remove_file(&path).unwrap();
                        fs::create_dir(path).unwrap();
                    }
                    _ => {}
                }
            }
            let state = match peek(&folder) {
                Ok(Peeked::Intact(found)) => Some(found.state()),
                Ok(Peeked::Damaged { .. }) | Err(_) => None,
                Ok(Peeked::Missing) => panic!("{journal} {lasting}: taken for a new drone"),
            };
            let is_known = journal == "kept" && lasting != "folder";
            let expected = is_known.then_some(State::TakingOff);
            assert_eq!(state, expected, "{journal} {lasting}");
        }
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
        let oldest = peek(&folder_of(root.path(), 4)).unwrap();
        assert_eq!(oldest.readable().unwrap().state(), State::Finished);
    }
}
