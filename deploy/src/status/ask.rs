//! Queries the status of drones' processes over HTTP, in parallel.

use std::path::{Path, PathBuf};
use std::time::Duration;

use muster_daemon::config;
use muster_daemon::status::Status;
use muster_runtime::diagnostic::BadInput;
use thiserror::Error;
use ureq::Agent;

use super::Answer;

/// Time limit of a query.
const TIMEOUT: Duration = Duration::from_secs(2);
/// Largest accepted answer, in bytes. A drone with a thousand neighbours sends about 50 KB.
const ANSWER_MAX: u64 = 1_024 * 1_024;
/// Number of parallel queries.
const PARALLEL_MAX: usize = 64;

/// A drone to query.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Target {
    /// The drone's number, if known before it answers.
    pub drone: Option<u32>,
    /// Host and port of its status page.
    pub address: String,
}

/// Why a query failed.
#[derive(Debug, Error)]
pub enum AskError {
    /// No connection, or no answer in time.
    #[error("no answer: {0}")]
    NoAnswer(#[source] Box<ureq::Error>),
    /// The answer is not the status of a drone of this version.
    #[error("the answer is not the status of a drone of this version")]
    NotADrone(#[source] serde_json::Error),
}

/// The drones that an argument names: by an address, a drone's file, or the folder of a flight (all its drones).
///
/// # Errors
/// If it is none of these, or a drone's file has no `[observe]` table.
pub fn targets(argument: &Path) -> Result<Vec<Target>, BadInput> {
    if argument.is_dir() {
        return files_in(argument)?.iter().map(|it| of_file(it)).collect();
    }
    if argument.is_file() {
        return Ok(vec![of_file(argument)?]);
    }
    let text = argument.to_string_lossy();
    let is_address = (text.rsplit_once(':')).is_some_and(|(host, port)| {
        !host.is_empty() && !host.contains('/') && port.parse::<u16>().is_ok()
    });
    if !is_address {
        let message = "is neither a file nor a folder nor an address";
        let help = "accepted are an address with a port, for example 127.0.0.1:9100, a drone's file, or the folder of a \
                    flight";
        return Err(BadInput::without_excerpt(argument, message, help));
    }
    let address = text.into_owned();
    Ok(vec![Target {
        drone: None,
        address,
    }])
}

fn of_file(path: &Path) -> Result<Target, BadInput> {
    let (drone, address) = config::observed(path)?;
    Ok(Target {
        drone: Some(drone.0),
        address: address.to_string(),
    })
}

/// The drones' files of a flight, ordered by number.
fn files_in(folder: &Path) -> Result<Vec<PathBuf>, BadInput> {
    let inner = folder.join("drones");
    let drones = if inner.is_dir() {
        inner
    } else {
        folder.to_owned()
    };
    let entries = std::fs::read_dir(&drones).into_iter().flatten();
    let paths = entries.filter_map(|entry| {
        let path = entry.ok()?.path();
        let number: u32 = (path.file_name()?.to_str()?)
            .strip_prefix("drone-")?
            .parse()
            .ok()?;
        let file = path.join("drone.toml");
        file.is_file().then_some((number, file))
    });
    let mut files: Vec<_> = paths.collect();
    files.sort();
    if files.is_empty() {
        let message = "is not the folder of a flight: it has neither drone-0/drone.toml nor drones/drone-0/drone.toml";
        let help = "`muster swarm` creates such a folder, by default runs/SCENARIO-swarm";
        return Err(BadInput::without_excerpt(folder, message, help));
    }
    Ok(files.into_iter().map(|(_, file)| file).collect())
}

/// Queries all targets in parallel. The answers are in the order of the targets.
#[must_use]
pub fn ask_all(targets: &[Target]) -> Vec<Answer> {
    let agent: Agent = Agent::config_builder()
        .timeout_global(Some(TIMEOUT))
        // Drones are near: a proxy of the environment would look elsewhere for them.
        .proxy(None)
        .build()
        .into();
    let ask = |target: &Target| Answer {
        target: target.clone(),
        status: ask(&agent, &target.address),
    };
    let chunks = targets.chunks(PARALLEL_MAX);
    let answers = chunks.flat_map(|chunk| {
        std::thread::scope(|scope| {
            let asked = chunk.iter().map(|target| scope.spawn(|| ask(target)));
            let asked: Vec<_> = asked.collect();
            let answers = asked.into_iter().map(|it| it.join());
            answers
                .map(|it| it.expect("a query does not panic"))
                .collect::<Vec<_>>()
        })
    });
    answers.collect()
}

fn ask(agent: &Agent, address: &str) -> Result<Status, AskError> {
    let no_answer = |error| AskError::NoAnswer(Box::new(error));
    let answer = agent.get(format!("http://{address}/status")).call();
    let mut answer = answer.map_err(no_answer)?;
    let body = answer.body_mut().with_config().limit(ANSWER_MAX);
    let text = body.read_to_string().map_err(no_answer)?;
    serde_json::from_str(&text).map_err(AskError::NotADrone)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arguments_are_addresses_files_or_folders() {
        for address in ["127.0.0.1:9100", "[::1]:9100", "pi-3.local:9100"] {
            let expected = Target {
                drone: None,
                address: address.to_owned(),
            };
            assert_eq!(targets(Path::new(address)).unwrap(), [expected]);
        }
        for none in [
            "",
            "drone-2",
            "9100",
            ":9100",
            "pi:http",
            "runs/none:1/x",
            "pi:70000",
        ] {
            let refused = targets(Path::new(none)).unwrap_err().rendered();
            assert!(
                refused.contains("neither a file nor a folder"),
                "{none}: {refused}"
            );
        }
        let empty = tempfile::tempdir().unwrap();
        let refused = targets(empty.path()).unwrap_err().rendered();
        assert!(refused.contains("not the folder of a flight"), "{refused}");
    }
}
