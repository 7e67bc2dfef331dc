//! Campaigns: many runs, on all processors.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread;
use std::time::Instant;

use muster::{COMBINATIONS_MAX, Error, Row, Sim, Stop, Variation};

use crate::interrupt::{Interrupt, LOOK_EVERY};

/// The combinations of varied fields, each flown with all seeds.
pub(crate) struct Campaign {
    /// The scenario of each combination; the first field changes slowest.
    combinations: Vec<Sim>,
    seeds: Vec<u64>,
}

type Flown = Result<Row, Error>;

impl Campaign {
    /// Sets each combination of the fields' values.
    ///
    /// # Errors
    /// A field or a value is refused, a field is varied that is set, there are no seeds or a seed is there twice, or there are
    /// too many combinations.
    pub(crate) fn new(
        sim: &Sim,
        seeds: Vec<u64>,
        vary: &[(String, Vec<String>)],
    ) -> Result<Self, Error> {
        check_seeds(&seeds)?;
        let product = vary.iter().map(|(_, values)| values.len() as u64);
        if product.fold(1, u64::saturating_mul) > COMBINATIONS_MAX {
            let message =
                format!("the varied values make more than {COMBINATIONS_MAX} combinations");
            return Err(Error::BadInput(message));
        }
        let mut combinations = vec![sim.clone()];
        for (field, values) in vary {
            let variation = Variation::new(field, values).map_err(Error::Field)?;
            let mut set = sim.scenario().overrides.iter();
            if set.any(|change| change.key() == variation.key()) {
                return Err(Error::Field(format!("`{field}` is both set and varied")));
            }
            let values = |sim: Sim| {
                let values = variation.values().iter();
                values.map(move |value| sim.clone().set(value.key(), value.value()))
            };
            let flat = combinations.into_iter().flat_map(values);
            combinations = flat.collect::<Result<_, _>>()?;
        }
        Ok(Self {
            combinations,
            seeds,
        })
    }

    /// Number of runs.
    fn runs(&self) -> usize {
        self.combinations.len() * self.seeds.len()
    }

    /// Flies all. Returns the rows in the order of the list; `None` if it was interrupted.
    ///
    /// # Errors
    /// That of the first run that could not be flown. Runs that are under way are stopped then.
    pub(crate) fn fly(&self, interrupt: &Arc<Interrupt>) -> Result<Option<Vec<Row>>, Error> {
        let workers = thread::available_parallelism().map_or(1, usize::from);
        let is_over = Arc::new(AtomicBool::new(false));
        let (next, stop) = (AtomicUsize::new(0), stop(interrupt, &is_over));
        let (sender, receiver) = sync_channel(workers);
        let collected = thread::scope(|scope| {
            for _ in 0..workers.min(self.runs()) {
                let (sender, next, stop) = (sender.clone(), &next, &stop);
                scope.spawn(move || self.work(next, stop, &sender));
            }
            drop(sender);
            let collected = collect(&receiver, interrupt);
            is_over.store(true, Ordering::Relaxed);
            // Workers that wait to send give up.
            drop(receiver);
            collected
        });
        let mut rows = collected?;
        if interrupt.is_raised() {
            return Ok(None);
        }
        rows.sort_by_key(|row| row.run);
        Ok(Some(rows))
    }

    /// Flies runs until there are no more, one can't be flown or a stop is wanted.
    fn work(&self, next: &AtomicUsize, stop: &Stop, flown: &SyncSender<Flown>) {
        loop {
            let at = next.fetch_add(1, Ordering::Relaxed);
            if at >= self.runs() {
                return;
            }
            let Some(row) = self.run(at, stop).transpose() else {
                return;
            };
            if flown.send(row).is_err() {
                return;
            }
        }
    }

    /// Flies the run of this place in the list.
    fn run(&self, at: usize, stop: &Stop) -> Result<Option<Row>, Error> {
        let (combination, seed) = (at / self.seeds.len(), self.seeds[at % self.seeds.len()]);
        let sim = self.combinations[combination].clone();
        let run = sim.seed(seed).run_until(stop)?;
        Ok(run.map(|run| Row {
            run: at as u64,
            combination: combination as u64,
            ..Row::of(&run.report)
        }))
    }
}

/// Stops workers once the campaign is interrupted or over.
fn stop(interrupt: &Arc<Interrupt>, is_over: &Arc<AtomicBool>) -> Stop {
    let (interrupt, is_over) = (Arc::clone(interrupt), Arc::clone(is_over));
    Stop::when(move || interrupt.is_raised() || is_over.load(Ordering::Relaxed))
}

fn check_seeds(seeds: &[u64]) -> Result<(), Error> {
    let mut sorted = seeds.to_vec();
    sorted.sort_unstable();
    if let Some(twice) = sorted.windows(2).find(|pair| pair[0] == pair[1]) {
        return Err(Error::BadInput(format!(
            "the seed {} is there twice",
            twice[0]
        )));
    }
    match seeds {
        [] => Err(Error::BadInput("there are no seeds".to_owned())),
        _ => Ok(()),
    }
}

/// Takes rows until the last, the first error or an interrupt. Looks at signals meanwhile.
fn collect(flown: &Receiver<Flown>, interrupt: &Interrupt) -> Result<Vec<Row>, Error> {
    let (mut rows, mut looked) = (Vec::new(), Instant::now());
    while !interrupt.is_raised() {
        match flown.recv_timeout(LOOK_EVERY) {
            Ok(row) => rows.push(row?),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => break,
        }
        if looked.elapsed() >= LOOK_EVERY {
            looked = Instant::now();
            interrupt.check_signals();
        }
    }
    Ok(rows)
}
