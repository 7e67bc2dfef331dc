//! A campaign on several hosts: each runs shard after shard, and what a lost host has begun is run by another.

use std::collections::VecDeque;
use std::fs;
use std::io;
use std::path::{Component, Path, PathBuf};
use std::sync::{Condvar, Mutex, MutexGuard};

use muster_runtime::diagnostic::BadInput;
use muster_runtime::identity::is_plain;
use thiserror::Error;

use crate::remote::{RemoteError, line, output, temporary_folder, upload};

/// Shards a host: a lost host costs a fraction of its part.
const SHARDS_PER_HOST: usize = 4;

/// Exit codes of a campaign that ran: all well, a rule broken, a mission incomplete.
const RAN: [i32; 2] = [3, 4];

/// A campaign to run on hosts.
#[derive(Debug)]
pub struct SpreadRequest<'a> {
    /// The commands that run others on the hosts.
    pub hosts: &'a [Vec<String>],
    /// This program, which is sent to each host.
    pub program: &'a Path,
    /// Files that the campaign reads, relative to the working folder: each is put in the same place on a host.
    pub files: &'a [PathBuf],
    /// Arguments of `muster campaign`, without `--shard` and `--out`.
    pub arguments: &'a [String],
    /// Number of runs.
    pub runs: u64,
    /// Folder for the shards, with names as `part-2-of-8`. Complete ones there are not run again, also with other hosts: then
    /// the campaign keeps their number.
    pub folder: &'a Path,
}

/// Why a campaign was not run whole. Complete shards are kept.
#[derive(Debug, Error)]
pub enum SpreadError {
    /// A file or an argument can't be used on a host.
    #[error(transparent)]
    Refused(#[from] BadInput),
    /// A file could not be read or written.
    #[error("can't read or write {}", path.display())]
    Disk {
        /// The file.
        path: PathBuf,
        /// The cause.
        #[source]
        source: io::Error,
    },
    /// No host is left.
    #[error("all hosts failed, {missing} shards are missing; last error: {last}")]
    NoHost {
        /// Shards that were not run.
        missing: usize,
        /// Why the last host was given up.
        last: String,
    },
}

/// Runs all shards. Returns their folders.
///
/// # Errors
/// If a file can't be used, or all hosts are lost.
pub fn spread(
    request: &SpreadRequest<'_>,
    report: &(dyn Fn(&str) + Sync),
) -> Result<Vec<PathBuf>, SpreadError> {
    let payload = Payload::read(request)?;
    let runs = usize::try_from(request.runs).unwrap_or(usize::MAX).max(1);
    let shards = shards_in(request.folder)
        .filter(|begun| *begun <= runs)
        .unwrap_or_else(|| runs.min(request.hosts.len() * SHARDS_PER_HOST));
    let parts: Vec<_> = (1..=shards)
        .map(|nth| request.folder.join(part_name(nth, shards)))
        .collect();
    let missing = (1..=shards).filter(|nth| !parts[nth - 1].is_dir());
    let missing: VecDeque<_> = missing.collect();
    if missing.is_empty() {
        return Ok(parts);
    }
    let queue = Queue::new(missing);
    let last = Mutex::new(String::new());
    std::thread::scope(|scope| {
        for (nth, run) in request.hosts.iter().enumerate() {
            let (queue, last, payload) = (&queue, &last, &payload);
            scope.spawn(move || {
                let host = Host {
                    run,
                    request,
                    payload,
                    shards,
                };
                if let Err(error) = host.work(queue, report) {
                    report(&format!("host {} is given up: {error}", nth + 1));
                    error
                        .to_string()
                        .clone_into(&mut last.lock().expect("no thread panics with it"));
                }
            });
        }
    });
    let missing = parts.iter().filter(|part| !part.is_dir()).count();
    if missing > 0 {
        let last = last.into_inner().unwrap_or_default();
        return Err(SpreadError::NoHost { missing, last });
    }
    Ok(parts)
}

/// Name of a shard's folder.
fn part_name(shard: usize, of: usize) -> String {
    format!("part-{shard}-of-{of}")
}

/// Number of shards of the campaign whose complete shards are in a folder. `None` if there are none.
fn shards_in(folder: &Path) -> Option<usize> {
    let names = fs::read_dir(folder).ok()?.flatten();
    let shards = names.filter_map(|entry| {
        let name = entry.file_name().into_string().ok()?;
        let (shard, of) = name.strip_prefix("part-")?.split_once("-of-")?;
        let (shard, of) = (shard.parse::<usize>().ok()?, of.parse().ok()?);
        (1..=of).contains(&shard).then_some(of)
    });
    shards.max()
}

/// The shards that are not complete.
struct Queue {
    shards: Mutex<Incomplete>,
    changed: Condvar,
}

struct Incomplete {
    waiting: VecDeque<usize>,
    /// Number of shards that hosts run now.
    under_way: usize,
}

impl Queue {
    fn new(waiting: VecDeque<usize>) -> Self {
        let under_way = 0;
        Self {
            shards: Mutex::new(Incomplete { waiting, under_way }),
            changed: Condvar::new(),
        }
    }

    fn lock(&self) -> MutexGuard<'_, Incomplete> {
        self.shards.lock().expect("no thread panics with it")
    }

    /// The next shard. While other hosts run the last ones, waits for one of them to fail. `None` if all are complete.
    fn take(&self) -> Option<usize> {
        let is_undecided = |it: &mut Incomplete| it.waiting.is_empty() && it.under_way > 0;
        let shards = self.changed.wait_while(self.lock(), is_undecided);
        let mut shards = shards.expect("no thread panics with it");
        let next = shards.waiting.pop_front()?;
        shards.under_way += 1;
        Some(next)
    }

    /// Ends what `take` began. `failed` is the shard if another host must run it.
    fn end(&self, failed: Option<usize>) {
        let mut shards = self.lock();
        shards.under_way -= 1;
        if let Some(shard) = failed {
            shards.waiting.push_front(shard);
        }
        self.changed.notify_all();
    }
}

/// What each host gets.
struct Payload {
    program: Vec<u8>,
    /// Contents by path.
    files: Vec<(PathBuf, Vec<u8>)>,
}

impl Payload {
    fn read(request: &SpreadRequest<'_>) -> Result<Self, SpreadError> {
        let read = |path: &Path| {
            fs::read(path).map_err(|source| SpreadError::Disk {
                path: path.to_owned(),
                source,
            })
        };
        for argument in request.arguments {
            let is_plain = |c: char| c.is_ascii_alphanumeric() || "._-+=,/".contains(c);
            if !argument.chars().all(is_plain) {
                let message = "a shell on a host would read more than this text";
                let help = "arguments have letters, digits and `._-+=,/`";
                return Err(BadInput::without_excerpt(Path::new(argument), message, help).into());
            }
        }
        let mut files = Vec::new();
        for path in request.files {
            let is_inside = path
                .components()
                .all(|it| matches!(it, Component::Normal(_)));
            if !is_inside || !path.to_str().is_some_and(is_plain) {
                let message = "is not in the working folder, or needs quoting in a shell";
                let help = "run the command in a folder above the scenario, and name it from there";
                return Err(BadInput::without_excerpt(path, message, help).into());
            }
            files.push((path.clone(), read(path)?));
        }
        Ok(Self {
            program: read(request.program)?,
            files,
        })
    }
}

/// A host at work.
struct Host<'a> {
    run: &'a [String],
    request: &'a SpreadRequest<'a>,
    payload: &'a Payload,
    shards: usize,
}

impl Host<'_> {
    /// Runs shards until all are complete.
    fn work(&self, queue: &Queue, report: &dyn Fn(&str)) -> Result<(), HostError> {
        let folder = temporary_folder(self.run)?;
        let worked = self.work_in(&folder, queue, report);
        // A lost host keeps it.
        let _ = line(self.run, &["rm", "-r", &folder]);
        worked
    }

    fn work_in(&self, folder: &str, queue: &Queue, report: &dyn Fn(&str)) -> Result<(), HostError> {
        self.put(folder, "muster", &self.payload.program)?;
        line(self.run, &["chmod", "700", &format!("{folder}/muster")])?;
        for (path, content) in &self.payload.files {
            self.put(folder, &path.to_string_lossy(), content)?;
        }
        while let Some(shard) = queue.take() {
            let ran = self.run_shard(folder, shard);
            queue.end(ran.is_err().then_some(shard));
            ran?;
            report(&format!("shard {shard} of {} is complete", self.shards));
        }
        Ok(())
    }

    fn put(&self, folder: &str, path: &str, content: &[u8]) -> Result<(), HostError> {
        let path = format!("{folder}/{path}");
        if let Some((parent, _)) = path.rsplit_once('/') {
            line(self.run, &["mkdir", "-p", parent])?;
        }
        Ok(upload(self.run, &path, content)?)
    }

    /// Runs a shard and brings its folder here, whole or not at all.
    fn run_shard(&self, folder: &str, shard: usize) -> Result<(), HostError> {
        let (chdir, of) = (
            format!("--chdir={folder}"),
            format!("{shard}/{}", self.shards),
        );
        let mut words = vec!["env", &chdir, "./muster", "campaign"];
        words.extend(self.request.arguments.iter().map(String::as_str));
        words.extend(["--shard", &of, "--out", "part"]);
        match output(self.run, &words, &[]) {
            Err(RemoteError::Failed {
                code: Some(code), ..
            }) if RAN.contains(&code) => {}
            ran => drop(ran?),
        }
        let archive = output(
            self.run,
            &["tar", "-C", &format!("{folder}/part"), "-cf", "-", "."],
            &[],
        )?;
        line(self.run, &["rm", "-r", &format!("{folder}/part")])?;
        let target = self.request.folder.join(part_name(shard, self.shards));
        let incoming = target.with_extension("incoming");
        if incoming.exists() {
            fs::remove_dir_all(&incoming)?;
        }
        fs::create_dir_all(&incoming)?;
        tar::Archive::new(&archive[..]).unpack(&incoming)?;
        fs::rename(incoming, target)?;
        Ok(())
    }
}

/// Why a host was given up.
#[derive(Debug, Error)]
enum HostError {
    #[error(transparent)]
    Remote(#[from] RemoteError),
    #[error("can't store its shard: {0}")]
    Store(#[from] io::Error),
}

#[cfg(test)]
mod tests;
