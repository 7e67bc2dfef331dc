use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use muster_machines::identity::NodeId;
use muster_runtime::identity::Fleet;

/// Folder of the shipped scenarios.
pub const SCENARIOS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenarios");

/// This process's temporary folder, with the files that a fuzzed file may name: missions, a scenario and a fleet's keys.
pub fn scratch() -> &'static Path {
    static SCRATCH: OnceLock<PathBuf> = OnceLock::new();
    SCRATCH.get_or_init(|| {
        let folder = std::env::temp_dir().join(format!("muster-fuzz-{}", std::process::id()));
        let missions = folder.join("missions");
        fs::create_dir_all(&missions).expect("a folder for temporary files");
        let shipped = Path::new(SCENARIOS).join("missions");
        for entry in fs::read_dir(shipped).expect("the shipped missions") {
            let path = entry.expect("a shipped mission").path();
            let name = path.file_name().expect("a file has a name");
            fs::copy(&path, missions.join(name)).expect("a copy");
        }
        let short = fs::read_to_string(Path::new(SCENARIOS).join("hardware/swarm-short.toml"));
        let short = short
            .expect("a shipped scenario")
            .replace("../missions", "missions");
        fs::write(folder.join("swarm-short.toml"), short).expect("a copy");
        let fleet = Fleet::create(&folder.join("fleet")).expect("a fleet's keys");
        fleet.add_drone(NodeId(2)).expect("a drone's key");
        folder
    })
}

/// Writes a file with these bytes and passes its path to `read`.
pub fn with_file<T>(name: &str, bytes: &[u8], read: impl FnOnce(&Path) -> T) -> T {
    let path = scratch().join(name);
    fs::write(&path, bytes).expect("a temporary file");
    read(&path)
}

#[cfg(test)]
mod tests {
    use muster_daemon::config::DroneConfig;
    use muster_machines::wire::{decode_frame, decode_message};
    use muster_runtime::identity::{FleetKey, RevocationList, Roster};

    use super::*;

    /// The corpus of a target: each seed's path and bytes.
    fn corpus(target: &str) -> Vec<(PathBuf, Vec<u8>)> {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus");
        let entries = fs::read_dir(folder.join(target)).unwrap();
        let seeds = entries.map(|entry| {
            let path = entry.unwrap().path();
            let bytes = fs::read(&path).unwrap();
            (path, bytes)
        });
        let seeds: Vec<_> = seeds.collect();
        assert!(!seeds.is_empty());
        seeds
    }

    #[test]
    fn drone_files_of_the_corpus_are_accepted() {
        for (path, bytes) in corpus("drone-file") {
            let config = with_file("seed.toml", &bytes, DroneConfig::load);
            if let Err(error) = config {
                panic!("{}: {}", path.display(), error.rendered());
            }
        }
    }

    /// Their signatures are of another fleet.
    #[test]
    fn lists_of_the_corpus_are_refused_for_their_signature_only() {
        let fleet = FleetKey::load(&scratch().join("fleet/fleet.pub")).unwrap();
        for (path, _) in corpus("lists") {
            let error = match path.ends_with("roster.toml") {
                true => Roster::load(&path, &fleet).unwrap_err(),
                false => RevocationList::load(&path, &fleet).unwrap_err(),
            };
            assert!(
                error.rendered().contains("the signature does not match"),
                "{}",
                error.rendered()
            );
        }
    }

    #[test]
    fn frames_of_the_corpus_are_decoded() {
        for (path, bytes) in corpus("frames") {
            let is_message = path.to_string_lossy().contains("message");
            let is_decoded = match is_message {
                true => decode_message(&bytes).is_ok(),
                false => decode_frame(&bytes).is_ok(),
            };
            assert!(is_decoded, "{}", path.display());
        }
    }
}
