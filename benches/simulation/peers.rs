//! What others do that simulate swarms: gradysim, from PyPI, and simulacra, from crates.io. Their programs for the same
//! scene are no part of this project; they are looked for beside it, or where `MUSTER_PEERS` says.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use super::TIMES;

/// The peers that are there.
pub(super) struct Peers {
    gradysim: Option<(PathBuf, PathBuf)>,
    simulacra: Option<PathBuf>,
}

/// Gets the peers ready, as far as they are to be had; says in a sentence what is not.
pub(super) fn ready() -> Peers {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/peers");
    let folder = std::env::var_os("MUSTER_PEERS").map_or(beside, PathBuf::from);
    let into = Path::new(env!("CARGO_TARGET_TMPDIR")).join("peers");
    if !folder.is_dir() {
        println!(
            "There are no peers to compare with: {} is no folder. MUSTER_PEERS may name one.",
            folder.display()
        );
        return Peers {
            gradysim: None,
            simulacra: None,
        };
    }
    Peers {
        gradysim: told("gradysim", gradysim(&folder, &into)),
        simulacra: told("simulacra", simulacra(&folder, &into)),
    }
}

fn told<T>(name: &str, ready: Result<T, String>) -> Option<T> {
    ready
        .map_err(|why| println!("{name} is left out: {why}."))
        .ok()
}

/// Python with gradysim, and the program.
fn gradysim(folder: &Path, into: &Path) -> Result<(PathBuf, PathBuf), String> {
    let program = folder.join("gradysim_line.py");
    if !program.is_file() {
        return Err(format!("{} is not there", program.display()));
    }
    let environment = into.join("venv");
    let python = environment.join("bin/python3");
    let is_there = || succeeds(Command::new(&python).args(["-c", "import gradysim"]));
    if is_there().is_err() {
        eprintln!("  installing gradysim …");
        succeeds(
            Command::new("python3")
                .args(["-m", "venv"])
                .arg(&environment),
        )?;
        succeeds(Command::new(&python).args(["-m", "pip", "install", "--quiet", "gradysim"]))?;
        is_there()?;
    }
    Ok((python, program))
}

/// The built program.
fn simulacra(folder: &Path, into: &Path) -> Result<PathBuf, String> {
    let copy = into.join("simulacra");
    fs::create_dir_all(copy.join("src")).map_err(|error| error.to_string())?;
    for file in ["Cargo.toml", "src/main.rs"] {
        let from = folder.join("simulacra").join(file);
        fs::copy(&from, copy.join(file))
            .map_err(|error| format!("{} can't be read: {error}", from.display()))?;
    }
    // It is no member of the workspace that its copy lies in.
    let manifest =
        fs::read_to_string(copy.join("Cargo.toml")).map_err(|error| error.to_string())?;
    fs::write(
        copy.join("Cargo.toml"),
        format!("{manifest}\n[workspace]\n"),
    )
    .map_err(|error| error.to_string())?;
    eprintln!("  building simulacra …");
    let target = into.join("target");
    succeeds(
        Command::new(env!("CARGO"))
            .args(["build", "--release", "--quiet", "--manifest-path"])
            .arg(copy.join("Cargo.toml"))
            .arg("--target-dir")
            .arg(&target),
    )?;
    Ok(target.join("release/simu"))
}

fn succeeds(command: &mut Command) -> Result<Vec<u8>, String> {
    let program = command.get_program().to_string_lossy().into_owned();
    let output = command
        .output()
        .map_err(|error| format!("{program} can't be run: {error}"))?;
    if output.status.success() {
        return Ok(output.stdout);
    }
    let complaint = String::from_utf8_lossy(&output.stderr);
    let last = complaint
        .lines()
        .last()
        .unwrap_or_default()
        .trim()
        .to_owned();
    Err(format!("{program} failed: {last}"))
}

impl Peers {
    /// Simulated seconds of a drone in a second of processor time, of gradysim (with steps of 0.2 s, its faster way) and
    /// of simulacra.
    pub(super) fn paces(&self, drones: u32, shape: &str) -> [Option<f64>; 2] {
        let number = drones.to_string();
        // A quarter of a second of processor time at the least, the fastest of as many runs as of ours.
        let seconds = |drone_seconds: u32| (drone_seconds / drones).max(3).to_string();
        let gradysim = self.gradysim.as_ref().and_then(|(python, program)| {
            let mut command = Command::new(python);
            command
                .arg(program)
                .args(["--n", &number, "--geom", shape, "--mob", "0.2"]);
            pace(command.args(["--sim", &seconds(3_000)]))
        });
        let simulacra = self.simulacra.as_ref().and_then(|program| {
            let mut command = Command::new(program);
            command.args([&number, shape, &seconds(100_000), "task"]);
            let paces = (0..TIMES).filter_map(|_| pace(&mut command));
            paces.max_by(f64::total_cmp)
        });
        [gradysim, simulacra]
    }
}

fn pace(command: &mut Command) -> Option<f64> {
    let output = succeeds(command).ok()?;
    let measured: Value = serde_json::from_slice(&output).ok()?;
    measured.get("drone_s_per_s")?.as_f64()
}
