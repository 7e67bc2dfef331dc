//! What a drone's journal says of its flight, for when its process says nothing.

use std::fs;
use std::path::{Path, PathBuf};

use muster_machines::mission::State;
use muster_runtime::journal::{flights, peek};
use serde::Deserialize;

/// The flight that a drone's file asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Flight {
    /// The drone has heard of no master.
    NotBegun,
    /// It takes part in the flight, as far as is known.
    Ongoing,
    /// It has landed for good.
    Over,
}

/// The part of a drone's file that is needed here. Another version may read the rest.
#[derive(Deserialize)]
struct DroneFile {
    journal: PathBuf,
    flight: Option<u32>,
}

impl Flight {
    /// The flight of a drone with this file. Ongoing if the file or the journal can't be read.
    pub(super) fn of(file: &Path) -> Self {
        Self::read(file).unwrap_or(Self::Ongoing)
    }

    fn read(file: &Path) -> Option<Self> {
        let text = fs::read_to_string(file).ok()?;
        let file: DroneFile = toml::from_str(&text).ok()?;
        let Ok(number) = flights::choose(&file.journal, file.flight.unwrap_or(1)) else {
            // The newest flight is over and another one.
            return Some(Self::NotBegun);
        };
        let found = peek(&flights::folder_of(&file.journal, number)).ok()?;
        Some(match found.readable() {
            _ if found.may_be_in_flight() => Self::Ongoing,
            Some(it) if it.state() == State::Finished => Self::Over,
            _ => Self::NotBegun,
        })
    }
}

#[cfg(test)]
pub(super) mod tests {
    use muster_machines::mission;
    use muster_machines::node::Checkpoint;
    use muster_runtime::journal::{Folder, Journal};

    use super::*;

    /// Writes a drone's file, and the journal of its flight 1 with a mission in this state.
    pub(in crate::slots) fn fly(folder: &Path, drone: u32, state: State) -> PathBuf {
        let journal = folder.join(format!("journal-{drone}"));
        let opened = Folder::open(&flights::folder_of(&journal, 1)).unwrap();
        let (mut written, mut all) = Journal::open(opened).unwrap();
        let mission = mission::Checkpoint {
            state,
            ..mission::Checkpoint::default()
        };
        let checkpoint = Checkpoint::Mission(Box::new(mission));
        all.keep(checkpoint.clone());
        written.add(&checkpoint, &all).unwrap();
        let file = folder.join(format!("drone-{drone}.toml"));
        fs::write(&file, format!("journal = {journal:?}\nid = {drone}\n")).unwrap();
        file
    }

    #[test]
    fn journal_shows_whether_the_flight_is_over() {
        let folder = tempfile::tempdir().unwrap();
        let file = fly(folder.path(), 0, State::TakingOff);
        assert_eq!(Flight::of(&file), Flight::Ongoing);
        fly(folder.path(), 0, State::Finished);
        assert_eq!(Flight::of(&file), Flight::Over);
        let mut text = fs::read_to_string(&file).unwrap();
        text.push_str("flight = 2\n");
        fs::write(&file, text).unwrap();
        assert_eq!(Flight::of(&file), Flight::NotBegun);
    }

    #[test]
    fn file_that_can_not_be_read_may_be_of_a_drone_in_flight() {
        assert_eq!(Flight::of(Path::new("/nowhere")), Flight::Ongoing);
    }
}
