use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::sync::mpsc::channel;

use muster_daemon::slots::protocol::PROTOCOL;
use tempfile::TempDir;

use super::super::desired::tests::{bench, desired_of, release};
use super::*;

/// A host that has the release, and has had another before it.
struct Bench {
    folder: TempDir,
    desired: Desired,
}

impl Bench {
    fn new() -> Self {
        let folder = bench();
        let desired = desired_of(&folder, "swarm-short").unwrap().remove(0);
        let facts = |good: &str, before: Option<&str>| {
            SlotReply::Host(Box::new(HostFacts {
                current: None,
                good: Some(good.to_owned()),
                rollback_slot: before.map(str::to_owned),
                is_on_trial: false,
                good_for_s: None,
                failure: None,
                drones: BTreeMap::new(),
                free_bytes: 0,
            }))
        };
        let hello = SlotReply::Hello {
            protocol: PROTOCOL,
            version: String::new(),
            processor: String::new(),
            is_root: true,
        };
        let bench = Self { folder, desired };
        bench.write_reply("hello", &hello);
        bench.write_reply("facts", &facts(&bench.desired.id(), Some("before")));
        bench.write_reply("facts-back", &facts("before", None));
        bench.write("away", "0");
        bench.write("lost", "never");
        bench
    }

    fn write(&self, name: &str, text: &str) {
        fs::write(self.folder.path().join(name), format!("{text}\n")).unwrap();
    }

    fn write_reply(&self, name: &str, reply: &SlotReply) {
        self.write(name, &serde_json::to_string(reply).unwrap());
    }

    /// Lets a worker do something. Returns what comes of it, and what it reported.
    fn work<T>(
        &self,
        release: &Release,
        job: impl FnOnce(&mut Worker<'_>) -> T,
    ) -> (T, Vec<Report>) {
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/rollout/worker/host");
        let words = [Path::new("sh"), &script, self.folder.path()];
        let (reports, reported) = channel();
        let mut worker = Worker {
            run: &words.map(|word| word.display().to_string()),
            release,
            desired: &self.desired,
            operator: "test",
            session: None,
            reports,
            host: 0,
        };
        let done = job(&mut worker);
        drop(worker);
        (done, reported.iter().map(|(_, report)| report).collect())
    }

    /// Takes the host back. Returns how that ended, and how often the host was reported as away.
    fn take_back(&self) -> (Result<(), String>, usize) {
        let (taken, reports) = self.work(&release(), |worker| worker.take_back());
        let away = reports.iter().filter(|it| matches!(it, Report::Away(_)));
        (taken, away.count())
    }

    fn rollbacks(&self) -> usize {
        let orders = fs::read_to_string(self.folder.path().join("orders")).unwrap();
        orders.lines().filter(|it| *it == "\"RollBack\"").count()
    }
}

#[test]
fn host_that_is_away_when_its_wave_is_taken_back_is_waited_for() {
    let bench = Bench::new();
    bench.write("away", "2");
    assert_eq!(bench.take_back(), (Ok(()), 2));
    assert_eq!(bench.rollbacks(), 1);
}

#[test]
fn host_that_is_lost_before_it_goes_back_is_asked_again() {
    let bench = Bench::new();
    bench.write("lost", "before");
    assert_eq!(bench.take_back(), (Ok(()), 1));
    assert_eq!(bench.rollbacks(), 2);
}

#[test]
fn host_that_went_back_without_a_reply_is_not_asked_again() {
    let bench = Bench::new();
    bench.write("lost", "after");
    assert_eq!(bench.take_back(), (Ok(()), 1));
    assert_eq!(bench.rollbacks(), 1);
}

#[test]
fn host_that_refuses_the_trial_is_left_out_and_says_why() {
    let bench = Bench::new();
    bench.write_reply("tried", &SlotReply::Refused("drone 0 flies".to_owned()));
    let mut release = release();
    for name in [
        "/musterd",
        "units/musterd@.service",
        "units/muster-slots.service",
    ] {
        release.files.insert(name.to_owned(), b"content\n".to_vec());
    }
    let (report, _) = bench.work(&release, |worker| worker.change(&BTreeSet::new()));
    assert!(
        matches!(&report, Report::Blocked(why) if why == "drone 0 flies"),
        "{report:?}"
    );
}
