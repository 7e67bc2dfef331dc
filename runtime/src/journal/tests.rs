use std::sync::{Arc, Mutex, mpsc};
use std::time::{Duration, Instant};

use muster_machines::{mission, radio};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;

#[derive(Debug, Default, Clone)]
struct Memory(Vec<u8>, u64);

impl Storage for Memory {
    fn read(&mut self) -> io::Result<Vec<u8>> {
        Ok(self.0.clone())
    }

    fn append(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.extend_from_slice(bytes);
        Ok(())
    }

    fn sync(&mut self) -> io::Result<()> {
        Ok(())
    }

    fn replace(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0 = bytes.to_vec();
        Ok(())
    }

    fn lasting(&mut self) -> io::Result<u64> {
        Ok(self.1)
    }

    fn note_lasting(&mut self, number: u64) -> io::Result<()> {
        self.1 = number;
        Ok(())
    }
}

fn counter(counter: u64) -> Checkpoint {
    Checkpoint::Radio(radio::Checkpoint { counter })
}

fn mission(opened: u16) -> Checkpoint {
    let checkpoint = mission::Checkpoint {
        opened: Some(opened),
        ..mission::Checkpoint::default()
    };
    Checkpoint::Mission(Box::new(checkpoint))
}

fn keep(journal: &mut Journal<Memory>, all: &mut Checkpoints, checkpoint: &Checkpoint) {
    all.keep(checkpoint.clone());
    journal.add(checkpoint, all).unwrap();
    journal.sync().unwrap();
}

#[test]
fn the_newest_checkpoint_of_each_machine_outlives_the_process() {
    let (mut journal, mut all) = Journal::open(Memory::default()).unwrap();
    assert_eq!(all.boot(), 1);
    for checkpoint in [counter(1), mission(2), counter(3)] {
        keep(&mut journal, &mut all, &checkpoint);
    }
    let (_, found) = Journal::open(journal.into_storage()).unwrap();
    assert_eq!(found.boot(), 2);
    let found: Vec<_> = found.iter().collect();
    assert!(found.contains(&counter(3)) && found.len() == 2, "{found:?}");
}

#[test]
fn a_journal_does_not_grow_for_ever() {
    let (mut journal, mut all) = Journal::open(Memory::default()).unwrap();
    for opened in 0..u16::MAX {
        keep(&mut journal, &mut all, &mission(opened));
    }
    assert!(journal.storage.0.len() < 2 * COMPACT_ABOVE);
    let (_, found) = Journal::open(journal.into_storage()).unwrap();
    let Some(Checkpoint::Mission(mission)) = found.iter().nth(1) else {
        panic!("{found:?}");
    };
    assert_eq!(mission.opened, Some(u16::MAX - 1));
}

#[test]
fn a_journal_whose_beginning_is_damaged_is_refused_and_left_as_it_is() {
    let (mut journal, mut all) = Journal::open(Memory::default()).unwrap();
    keep(&mut journal, &mut all, &mission(3));
    let mut bytes = journal.into_storage().0;
    bytes[0] ^= 1;
    let error = Journal::open(Memory(bytes, 0)).unwrap_err();
    assert_eq!(error.kind(), io::ErrorKind::InvalidData);
}

/// A journal with a mission's checkpoint, a record of another version's, and a radio's checkpoint behind it.
fn with_unknown_record() -> Vec<u8> {
    let (mut journal, mut all) = Journal::open(Memory::default()).unwrap();
    keep(&mut journal, &mut all, &mission(3));
    let mut bytes = journal.into_storage().0;
    frame(&[77, 1, 2, 3], &mut bytes);
    write(9, &Record::Checkpoint(counter(5)), &mut bytes);
    bytes
}

#[test]
fn a_whole_record_that_is_not_understood_is_no_torn_end() {
    let bytes = with_unknown_record();
    let refused = Journal::open(Memory(bytes.clone(), 0)).unwrap_err();
    assert_eq!(refused.kind(), io::ErrorKind::InvalidData);
    let at = bytes.windows(4).position(|it| it == [77, 1, 2, 3]).unwrap() - HEADING_LEN;
    let says = format!("the record at byte {at} is whole");
    assert!(refused.to_string().starts_with(&says), "{refused}");

    // Nor is one that goes on where this version's ends.
    let (journal, _) = Journal::open(Memory::default()).unwrap();
    let mut longer = journal.into_storage().0;
    let known = postcard::to_stdvec(&(9_u64, Record::Checkpoint(counter(5)))).unwrap();
    frame(&[known, vec![1]].concat(), &mut longer);
    Journal::open(Memory(longer, 0)).unwrap_err();
}

#[test]
fn in_flight_what_is_understood_counts_and_the_rest_is_still_there_for_the_next_life() {
    let mut bytes = with_unknown_record();
    for incarnation in 2..5 {
        let (mut journal, mut all) = Journal::open_in_flight(Memory(bytes, 0)).unwrap();
        assert!(!journal.is_understood());
        assert_eq!(all.boot(), incarnation);
        assert!(all.holds(&counter(5)) && all.state() == mission::State::default());
        (0..u16::MAX / 4).for_each(|opened| keep(&mut journal, &mut all, &mission(opened)));
        keep(&mut journal, &mut all, &mission(3));
        bytes = journal.into_storage().0;
        Journal::open(Memory(bytes.clone(), 0)).unwrap_err();
    }
}

#[test]
fn zeros_at_the_end_are_what_a_disk_had_not_written_yet() {
    let (mut journal, mut all) = Journal::open(Memory::default()).unwrap();
    keep(&mut journal, &mut all, &counter(7));
    let mut bytes = journal.into_storage().0;
    bytes.extend_from_slice(&[0; 512]);
    let (_, found) = Journal::open(Memory(bytes, 0)).unwrap();
    assert!(found.holds(&counter(7)));
}

#[test]
fn a_journal_of_the_last_life_that_has_a_number_is_refused() {
    let mut bytes = MAGIC.to_vec();
    write(1, &Record::Boot(u32::MAX), &mut bytes);
    let error = Journal::open(Memory(bytes, 0)).unwrap_err();
    assert_eq!(error.kind(), io::ErrorKind::InvalidData);
}

proptest! {
    #[test]
    fn whatever_is_torn_off_or_altered_at_the_end_what_stood_before_is_found(
        cut in 0_usize..60,
        garbage in proptest::collection::vec(any::<u8>(), 0..40),
    ) {
        let (mut journal, mut all) = Journal::open(Memory::default()).unwrap();
        keep(&mut journal, &mut all, &counter(7));
        let whole = journal.storage.0.len();
        keep(&mut journal, &mut all, &counter(8));
        let mut bytes = journal.into_storage().0;
        bytes.truncate(bytes.len().saturating_sub(cut).max(whole));
        bytes.extend_from_slice(&garbage);
        let (_, found) = Journal::open(Memory(bytes, 0)).unwrap();
        let found: Vec<_> = found.iter().collect();
        prop_assert!(found.contains(&counter(7)) || found.contains(&counter(8)), "{found:?}");
    }
}

#[test]
fn a_journal_has_these_bytes() {
    let (mut journal, mut all) = Journal::open(Memory::default()).unwrap();
    keep(&mut journal, &mut all, &counter(7));
    let Memory(bytes, lasting) = journal.into_storage();
    let records: [&[u8]; 3] = [
        // The length, the checksum; the number, which kind, which life.
        &[3, 0, 0, 0, 179, 131, 132, 137, 1, 0, 1],
        // Likewise, a checkpoint of the radio's, in which it has counted to 0 and to 7.
        &[4, 0, 0, 0, 160, 125, 143, 138, 2, 1, 0, 0],
        &[4, 0, 0, 0, 102, 143, 87, 172, 3, 1, 0, 7],
    ];
    assert_eq!(bytes, [&MAGIC[..], &records.concat()].concat());
    assert_eq!(lasting, 3);
}

/// A journal in its second life, in which all was made to last, and the newest checkpoints.
fn of_a_flight() -> (Memory, Vec<Checkpoint>) {
    let (mut journal, mut all) = Journal::open(Memory::default()).unwrap();
    (1..20).for_each(|it| keep(&mut journal, &mut all, &mission(it)));
    let (mut journal, mut all) = Journal::open(journal.into_storage()).unwrap();
    for it in 20..60 {
        keep(&mut journal, &mut all, &mission(it));
        keep(&mut journal, &mut all, &counter(u64::from(it)));
    }
    (journal.into_storage(), all.iter().collect())
}

/// Where each record begins, and where the last ends.
fn bounds(bytes: &[u8]) -> Vec<usize> {
    let mut bounds = vec![MAGIC.len()];
    while let Some(body) = whole(&bytes[bounds[bounds.len() - 1]..]) {
        bounds.push(bounds[bounds.len() - 1] + HEADING_LEN + body.len());
    }
    bounds
}

#[test]
fn of_a_damaged_journal_all_counts_that_was_made_to_last_or_nothing() {
    let (sound, newest) = of_a_flight();
    let bounds = bounds(&sound.0);
    let mut random = ChaCha8Rng::seed_from_u64(22);
    let mut unharmed = 0;
    for case in 0..10_000 {
        let Memory(mut bytes, lasting) = sound.clone();
        let len = bytes.len();
        let at = random.random_range(0..len);
        let length = random.random_range(1..=40.min(len - at));
        match case % 8 {
            0 => bytes[at] ^= 1 << random.random_range(0..8),
            1 => bytes.truncate(at),
            2 => bytes[at..at + length].fill(0),
            3 => drop(bytes.drain(at..at + length)),
            // What a record's heading says: its length or its checksum.
            4 => {
                let heading = bounds[random.random_range(0..bounds.len() - 1)];
                bytes[heading + random.random_range(0..HEADING_LEN)] ^=
                    random.random_range(1..=255);
            }
            // Two records change places.
            5 => {
                let first = random.random_range(0..bounds.len() - 2);
                let [a, b, c] = [bounds[first], bounds[first + 1], bounds[first + 2]];
                bytes = [&bytes[..a], &bytes[b..c], &bytes[a..b], &bytes[c..]].concat();
            }
            // A record is gone, or there are none behind it.
            6 => {
                let first = random.random_range(0..bounds.len() - 1);
                let [a, b] = [bounds[first], bounds[first + 1]];
                bytes = match random.random() {
                    true => [&bytes[..a], &bytes[b..]].concat(),
                    false => bytes[..a].to_vec(),
                };
            }
            _ => bytes.clear(),
        }
        let is_harmed = bytes != sound.0;
        unharmed += u32::from(!is_harmed);
        let damaged = Memory(bytes, lasting);
        let opened = Journal::open(damaged.clone());
        assert_eq!(opened.is_err(), is_harmed, "case {case}");
        let (journal, found) = Journal::open_in_flight(damaged).unwrap();
        assert_eq!(journal.is_understood(), !is_harmed, "case {case}");
        let found: Vec<_> = found.iter().collect();
        assert!(is_harmed || found == newest, "case {case}");
        // No later life takes it for whole.
        let again = Journal::open(journal.into_storage());
        assert_eq!(again.is_err(), is_harmed, "case {case}");
    }
    assert!(unharmed < 1_000, "{unharmed}");
}

#[test]
fn what_was_not_made_to_last_may_be_lost_and_what_was_is_there() {
    let (mut journal, mut all) = Journal::open(Memory::default()).unwrap();
    keep(&mut journal, &mut all, &mission(3));
    let lasting = journal.storage.0.len();
    all.keep(mission(4));
    journal.add(&mission(4), &all).unwrap();
    let Memory(bytes, number) = journal.into_storage();
    for end in lasting..bytes.len() {
        let (_, found) = Journal::open(Memory(bytes[..end].to_vec(), number)).unwrap();
        assert!(found.holds(&mission(3)), "{end}");
    }
    // The note is written after the records, and lost before they are.
    let (_, found) = Journal::open(Memory(bytes, 0)).unwrap();
    assert!(found.holds(&mission(4)));
}

/// A disk that loses, when its power is cut, what was not synced: all of it or a part, and what it had not written yet is
/// zeros.
#[derive(Debug, Clone, Default)]
struct Disk {
    /// What is there, how much of it is synced, and the note.
    held: Arc<Mutex<(Vec<u8>, usize, u64)>>,
    sync_takes: Duration,
}

impl Disk {
    fn cut_power(&self, random: &mut ChaCha8Rng) -> Memory {
        let (mut bytes, synced, number) = self.held.lock().unwrap().clone();
        let kept = random.random_range(synced..=bytes.len());
        match random.random() {
            true => bytes.truncate(kept),
            false => bytes[kept..].fill(0),
        }
        // The note may be lost with them.
        Memory(bytes, if random.random() { number } else { 0 })
    }
}

impl Storage for Disk {
    fn read(&mut self) -> io::Result<Vec<u8>> {
        Ok(self.held.lock().unwrap().0.clone())
    }

    fn append(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.held.lock().unwrap().0.extend_from_slice(bytes);
        Ok(())
    }

    fn sync(&mut self) -> io::Result<()> {
        std::thread::sleep(self.sync_takes);
        let mut held = self.held.lock().unwrap();
        held.1 = held.0.len();
        Ok(())
    }

    fn replace(&mut self, bytes: &[u8]) -> io::Result<()> {
        let mut held = self.held.lock().unwrap();
        held.0 = bytes.to_vec();
        held.1 = bytes.len();
        Ok(())
    }

    fn lasting(&mut self) -> io::Result<u64> {
        Ok(self.held.lock().unwrap().2)
    }

    fn note_lasting(&mut self, number: u64) -> io::Result<()> {
        self.held.lock().unwrap().2 = number;
        Ok(())
    }
}

#[test]
fn whenever_power_is_cut_nothing_falls_back_behind_what_was_told_to_last() {
    let mut random = ChaCha8Rng::seed_from_u64(200);
    for _ in 0..200 {
        let disk = Disk::default();
        let (journal, all) = Journal::open(disk.clone()).unwrap();
        let (tell, told) = mpsc::channel();
        let mut writer = Writer::start(journal, all, move |it| drop(tell.send(it))).unwrap();
        for opened in 1..=random.random_range(1..40) {
            writer.keep(mission(opened), random.random());
        }
        let last = told.try_iter().last();
        let cut = disk.cut_power(&mut random);
        let (_, found) = Journal::open(cut).unwrap();
        let opened = found.iter().find_map(|it| match it {
            Checkpoint::Mission(mission) => mission.opened,
            _ => None,
        });
        if let Some(Written::UpTo(number)) = last {
            assert!(
                u64::from(opened.unwrap_or(0)) >= number,
                "{opened:?} < {number}"
            );
        }
    }
}

#[test]
fn a_disk_that_is_slow_holds_up_nobody_and_is_not_believed_too_soon() {
    let disk = Disk {
        sync_takes: Duration::from_millis(500),
        ..Disk::default()
    };
    let (journal, all) = Journal::open(disk.clone()).unwrap();
    let begun = Instant::now();
    let (tell, told) = mpsc::channel();
    let synced = disk.clone();
    let tell = move |it| drop(tell.send((it, synced.held.lock().unwrap().clone())));
    let mut writer = Writer::start(journal, all, tell).unwrap();
    for opened in 1..=20 {
        writer.keep(mission(opened), true);
    }
    assert!(begun.elapsed() < Duration::from_millis(250));
    drop(writer);
    let told: Vec<_> = told.iter().collect();
    for (written, (bytes, synced, number)) in &told {
        assert!(matches!(written, Written::UpTo(_)), "{written:?}");
        assert_eq!(bytes.len(), *synced);
        assert!(*number > 0);
    }
    let (Written::UpTo(20), _) = told[told.len() - 1] else {
        panic!("{told:?}");
    };
    // What waited was written together.
    assert!(told.len() < 4, "{}", told.len());
}

/// A disk that takes no bytes once, when it is full for a moment.
#[derive(Debug, Default)]
struct FullOnce(Memory, usize);

impl Storage for FullOnce {
    fn read(&mut self) -> io::Result<Vec<u8>> {
        self.0.read()
    }

    fn append(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.1 += 1;
        match self.1 {
            3 => Err(io::Error::other("the disk is full")),
            _ => self.0.append(bytes),
        }
    }

    fn sync(&mut self) -> io::Result<()> {
        std::thread::sleep(Duration::from_millis(50));
        self.0.sync()
    }

    fn replace(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.replace(bytes)
    }

    fn lasting(&mut self) -> io::Result<u64> {
        self.0.lasting()
    }

    fn note_lasting(&mut self, number: u64) -> io::Result<()> {
        self.0.note_lasting(number)
    }
}

#[test]
fn what_becomes_of_checkpoints_is_told_in_their_order_whichever_fails() {
    let (journal, all) = Journal::open(FullOnce::default()).unwrap();
    let (tell, told) = mpsc::channel();
    let mut writer = Writer::start(journal, all, move |it| drop(tell.send(it))).unwrap();
    for opened in 1..=4 {
        writer.keep(mission(opened), opened != 3);
    }
    drop(writer);
    let told: Vec<_> = told
        .iter()
        .map(|it| match it {
            Written::UpTo(number) => (number, true),
            Written::Failed { number, .. } => (number, false),
        })
        .collect();
    let failure = told.iter().position(|it| *it == (3, false)).unwrap();
    let (before, after) = told.split_at(failure);
    assert_eq!(before.last(), Some(&(2, true)), "{told:?}");
    assert_eq!(after, [(3, false), (4, true)]);
}
