//! Many runs, on all processors.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread;
use std::time::Instant;

use muster::{Error, Sim, Stop};

use crate::interrupt::{Interrupt, LOOK_EVERY};

/// What became of the run of a place in the list.
type Flown = (usize, Result<String, Error>);

/// Flies the scenario with each seed. Returns the reports as JSON, in the order of the seeds; `None` if it was interrupted.
///
/// # Errors
/// That of the first run that could not be flown. Runs that are under way are stopped then.
pub(crate) fn fly(
    sim: &Sim,
    seeds: &[u64],
    brief: bool,
    interrupt: &Arc<Interrupt>,
) -> Result<Option<Vec<String>>, Error> {
    let workers = thread::available_parallelism().map_or(1, usize::from);
    let is_over = Arc::new(AtomicBool::new(false));
    let (next, stop) = (AtomicUsize::new(0), stop(interrupt, &is_over));
    let (sender, receiver) = sync_channel(workers);
    let collected = thread::scope(|scope| {
        for _ in 0..workers.min(seeds.len()) {
            let (sender, next, stop) = (sender.clone(), &next, &stop);
            scope.spawn(move || work((sim, seeds, brief), next, stop, &sender));
        }
        drop(sender);
        let collected = collect(&receiver, interrupt);
        is_over.store(true, Ordering::Relaxed);
        // Workers that wait to send give up.
        drop(receiver);
        collected
    });
    let mut reports = collected?;
    if interrupt.is_raised() {
        return Ok(None);
    }
    reports.sort_by_key(|(at, _)| *at);
    Ok(Some(
        reports.into_iter().map(|(_, report)| report).collect(),
    ))
}

/// Stops workers once the campaign is interrupted or over.
fn stop(interrupt: &Arc<Interrupt>, is_over: &Arc<AtomicBool>) -> Stop {
    let (interrupt, is_over) = (Arc::clone(interrupt), Arc::clone(is_over));
    Stop::when(move || interrupt.is_raised() || is_over.load(Ordering::Relaxed))
}

/// Flies seeds until there are no more, a run can't be flown or a stop is wanted.
fn work(
    (sim, seeds, brief): (&Sim, &[u64], bool),
    next: &AtomicUsize,
    stop: &Stop,
    flown: &SyncSender<Flown>,
) {
    loop {
        let at = next.fetch_add(1, Ordering::Relaxed);
        let Some(seed) = seeds.get(at) else { return };
        let run = match sim.clone().seed(*seed).run_until(stop) {
            Ok(Some(run)) => Ok(report(&run, brief)),
            Ok(None) => return,
            Err(error) => Err(error),
        };
        if flown.send((at, run)).is_err() {
            return;
        }
    }
}

/// Takes reports until the last, the first error or an interrupt. Looks at signals meanwhile.
fn collect(flown: &Receiver<Flown>, interrupt: &Interrupt) -> Result<Vec<(usize, String)>, Error> {
    let (mut reports, mut looked) = (Vec::new(), Instant::now());
    while !interrupt.is_raised() {
        match flown.recv_timeout(LOOK_EVERY) {
            Ok((at, report)) => reports.push((at, report?)),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => break,
        }
        if looked.elapsed() >= LOOK_EVERY {
            looked = Instant::now();
            interrupt.check_signals();
        }
    }
    Ok(reports)
}

fn report(run: &muster::Run, brief: bool) -> String {
    let mut report = serde_json::to_value(&run.report).expect("a report always serialises");
    if brief && let Some(report) = report.as_object_mut() {
        for large in [
            "drones", "relays", "barriers", "bridges", "observed", "others",
        ] {
            report.remove(large);
        }
    }
    report.to_string()
}
