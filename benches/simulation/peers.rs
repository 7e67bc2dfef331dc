//! Other simulators: gradysim from PyPI and simulacra from crates.io. The programs that use them are outside this project,
//! in `../shared/peers` or the folder `MUSTER_PEERS`.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use super::TIMES;

/// The available peers.
pub(super) struct Peers {
    gradysim: Option<(PathBuf, PathBuf)>,
    simulacra: Option<PathBuf>,
}

/// Installs and builds the available peers; prints why one is skipped.
pub(super) fn prepare() -> Peers {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/peers");
    let folder = std::env::var_os("MUSTER_PEERS").map_or(beside, PathBuf::from);
    let into = Path::new(env!("CARGO_TARGET_TMPDIR")).join("peers");
    if !folder.is_dir() {
        println!(
            "No peers to compare with: {} is not a folder. Set MUSTER_PEERS to the folder of the peers.",
            folder.display()
        );
        return Peers {
            gradysim: None,
            simulacra: None,
        };
    }
    Peers {
        gradysim: or_skip("gradysim", gradysim(&folder, &into)),
        simulacra: or_skip("simulacra", simulacra(&folder, &into)),
    }
}

fn or_skip<T>(name: &str, ready: Result<T, String>) -> Option<T> {
    ready
        .map_err(|why| println!("{name} is skipped: {why}."))
        .ok()
}

/// Installs gradysim; returns Python and the program.
fn gradysim(folder: &Path, into: &Path) -> Result<(PathBuf, PathBuf), String> {
    let program = folder.join("gradysim_line.py");
    if !program.is_file() {
        return Err(format!("{} does not exist", program.display()));
    }
    let environment = into.join("venv");
    let python = environment.join("bin/python3");
    let is_installed = || run_command(Command::new(&python).args(["-c", "import gradysim"]));
    if is_installed().is_err() {
        eprintln!("  installing gradysim …");
        run_command(
            Command::new("python3")
                .args(["-m", "venv"])
                .arg(&environment),
        )?;
        run_command(Command::new(&python).args(["-m", "pip", "install", "--quiet", "gradysim"]))?;
        is_installed()?;
    }
    Ok((python, program))
}

/// Builds simulacra's program; returns its path.
fn simulacra(folder: &Path, into: &Path) -> Result<PathBuf, String> {
    let copy = into.join("simulacra");
    fs::create_dir_all(copy.join("src")).map_err(|error| error.to_string())?;
    for file in ["Cargo.toml", "src/main.rs"] {
        let from = folder.join("simulacra").join(file);
        fs::copy(&from, copy.join(file))
            .map_err(|error| format!("{} can't be read: {error}", from.display()))?;
    }
    // Its own workspace, because the copy lies in the folder of another one.
    let manifest =
        fs::read_to_string(copy.join("Cargo.toml")).map_err(|error| error.to_string())?;
    fs::write(
        copy.join("Cargo.toml"),
        format!("{manifest}\n[workspace]\n"),
    )
    .map_err(|error| error.to_string())?;
    eprintln!("  building simulacra …");
    let target = into.join("target");
    run_command(
        Command::new(env!("CARGO"))
            .args(["build", "--release", "--quiet", "--manifest-path"])
            .arg(copy.join("Cargo.toml"))
            .arg("--target-dir")
            .arg(&target),
    )?;
    Ok(target.join("release/simu"))
}

fn run_command(command: &mut Command) -> Result<Vec<u8>, String> {
    let program = command.get_program().to_string_lossy().into_owned();
    let output = command
        .output()
        .map_err(|error| format!("{program} can't be run: {error}"))?;
    if output.status.success() {
        return Ok(output.stdout);
    }
    let errors = String::from_utf8_lossy(&output.stderr);
    let last = errors.lines().last().unwrap_or_default().trim().to_owned();
    Err(format!("{program} failed: {last}"))
}

impl Peers {
    /// Simulated drone-seconds per second of processor time of gradysim (with steps of 0.2 s, its faster mode) and of
    /// simulacra.
    pub(super) fn paces(&self, drones: u32, shape: &str) -> [Option<f64>; 2] {
        let number = drones.to_string();
        // At least a quarter of a second of processor time; the fastest of as many repetitions as ours.
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
    let output = run_command(command).ok()?;
    let measured: Value = serde_json::from_slice(&output).ok()?;
    measured.get("drone_s_per_s")?.as_f64()
}
