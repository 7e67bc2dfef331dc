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
