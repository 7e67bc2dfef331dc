use std::sync::{Arc, Mutex, mpsc};
use std::time::{Duration, Instant};

use muster_machines::geometry::Ned;
use muster_machines::{mission, radio};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;

fn counter(counter: u64) -> Checkpoint {
    Checkpoint::Radio(radio::Checkpoint { counter })
}

fn mission(opened: u16) -> Checkpoint {
    let mut checkpoint = mission::Checkpoint::default();
    checkpoint.progress.opened = Some(opened);
    Checkpoint::Mission(Box::new(checkpoint))
}

fn keep(journal: &mut Journal<MemoryStorage>, all: &mut Checkpoints, checkpoint: &Checkpoint) {
    all.keep(checkpoint.clone());
    journal.add(checkpoint, all).unwrap();
    journal.sync().unwrap();
}

#[test]
fn newest_checkpoint_of_each_machine_survives_a_restart() {
    let (mut journal, mut all) = Journal::open(MemoryStorage::default()).unwrap();
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
fn journal_is_compacted_above_its_limit() {
    let (mut journal, mut all) = Journal::open(MemoryStorage::default()).unwrap();
    for opened in 0..u16::MAX {
        keep(&mut journal, &mut all, &mission(opened));
    }
    assert!(journal.storage.bytes.len() < 2 * COMPACT_ABOVE);
    let (_, found) = Journal::open(journal.into_storage()).unwrap();
    let Some(Checkpoint::Mission(mission)) = found.iter().nth(1) else {
        panic!("{found:?}");
    };
    assert_eq!(mission.progress.opened, Some(u16::MAX - 1));
}

#[test]
fn journal_with_damaged_magic_is_refused() {
    let (mut journal, mut all) = Journal::open(MemoryStorage::default()).unwrap();
    keep(&mut journal, &mut all, &mission(3));
    let mut bytes = journal.into_storage().bytes;
    bytes[0] ^= 1;
    let error = Journal::open(MemoryStorage::with_bytes(bytes)).unwrap_err();
    assert_eq!(error.kind(), io::ErrorKind::InvalidData);
}

/// A journal with a mission checkpoint, a record of another version, and a radio checkpoint.
fn with_unknown_record() -> Vec<u8> {
    let (mut journal, mut all) = Journal::open(MemoryStorage::default()).unwrap();
    keep(&mut journal, &mut all, &mission(3));
    let mut bytes = journal.into_storage().bytes;
    frame_record(&[77, 1, 2, 3], &mut bytes);
    append_record(9, &Record::Checkpoint(counter(5)), &mut bytes);
    bytes
}

#[test]
fn complete_record_of_another_version_is_refused() {
    let bytes = with_unknown_record();
    let refused = Journal::open(MemoryStorage::with_bytes(bytes.clone())).unwrap_err();
    assert_eq!(refused.kind(), io::ErrorKind::InvalidData);
    let at = bytes.windows(4).position(|it| it == [77, 1, 2, 3]).unwrap() - HEADING_LEN;
    let says = format!("the record at byte {at} is of another version");
    assert!(refused.to_string().starts_with(&says), "{refused}");

    // A record with more bytes than this version's is of another version, too.
    let (journal, _) = Journal::open(MemoryStorage::default()).unwrap();
    let mut longer = journal.into_storage().bytes;
    let known = postcard::to_stdvec(&(9_u64, Record::Checkpoint(counter(5)))).unwrap();
    frame_record(&[known, vec![1]].concat(), &mut longer);
    Journal::open(MemoryStorage::with_bytes(longer)).unwrap_err();
}

#[test]
fn in_flight_unknown_records_are_skipped_and_preserved() {
    let mut bytes = with_unknown_record();
    for incarnation in 2..5 {
        let (mut journal, mut all) =
            Journal::open_in_flight(MemoryStorage::with_bytes(bytes)).unwrap();
        assert!(!journal.is_intact());
        assert_eq!(all.boot(), incarnation);
        assert!(all.holds(&counter(5)) && all.state() == mission::State::default());
        (0..u16::MAX / 4).for_each(|opened| keep(&mut journal, &mut all, &mission(opened)));
        keep(&mut journal, &mut all, &mission(3));
        bytes = journal.into_storage().bytes;
        Journal::open(MemoryStorage::with_bytes(bytes.clone())).unwrap_err();
    }
}

#[test]
fn zeros_at_the_end_are_a_torn_end() {
    let (mut journal, mut all) = Journal::open(MemoryStorage::default()).unwrap();
    keep(&mut journal, &mut all, &counter(7));
    let mut bytes = journal.into_storage().bytes;
    bytes.extend_from_slice(&[0; 512]);
    let (_, found) = Journal::open(MemoryStorage::with_bytes(bytes)).unwrap();
    assert!(found.holds(&counter(7)));
}

#[test]
fn journal_without_incarnation_number_left_is_refused() {
    let mut bytes = MAGIC.to_vec();
    append_record(1, &Record::Boot(u32::MAX), &mut bytes);
    let error = Journal::open(MemoryStorage::with_bytes(bytes)).unwrap_err();
    assert_eq!(error.kind(), io::ErrorKind::InvalidData);
}

proptest! {
    #[test]
    fn records_before_a_torn_end_are_found(
        cut in 0_usize..60,
        garbage in proptest::collection::vec(any::<u8>(), 0..40),
    ) {
        let (mut journal, mut all) = Journal::open(MemoryStorage::default()).unwrap();
        keep(&mut journal, &mut all, &counter(7));
        let synced_len = journal.storage.bytes.len();
        keep(&mut journal, &mut all, &counter(8));
        let mut bytes = journal.into_storage().bytes;
        bytes.truncate(bytes.len().saturating_sub(cut).max(synced_len));
        bytes.extend_from_slice(&garbage);
        let (_, found) = Journal::open(MemoryStorage::with_bytes(bytes)).unwrap();
        let found: Vec<_> = found.iter().collect();
        prop_assert!(found.contains(&counter(7)) || found.contains(&counter(8)), "{found:?}");
    }
}

#[test]
fn journal_has_golden_bytes() {
    let (mut journal, mut all) = Journal::open(MemoryStorage::default()).unwrap();
    keep(&mut journal, &mut all, &counter(7));
    let MemoryStorage { bytes, last_synced } = journal.into_storage();
    let records: [&[u8]; 3] = [
        // Length, checksum; number, kind, incarnation.
        &[3, 0, 0, 0, 179, 131, 132, 137, 1, 0, 1],
        // Length, checksum; number, kind, and a radio checkpoint with counter 0, then 7.
        &[4, 0, 0, 0, 160, 125, 143, 138, 2, 1, 0, 0],
        &[4, 0, 0, 0, 102, 143, 87, 172, 3, 1, 0, 7],
    ];
    assert_eq!(bytes, [&MAGIC[..], &records.concat()].concat());
    assert_eq!(last_synced, 3);
}

/// A journal in its second incarnation, all of it synced, and the newest checkpoints.
fn journal_of_a_flight() -> (MemoryStorage, Vec<Checkpoint>) {
    let (mut journal, mut all) = Journal::open(MemoryStorage::default()).unwrap();
    (1..20).for_each(|it| keep(&mut journal, &mut all, &mission(it)));
    let (mut journal, mut all) = Journal::open(journal.into_storage()).unwrap();
    for it in 20..60 {
        keep(&mut journal, &mut all, &mission(it));
        keep(&mut journal, &mut all, &counter(u64::from(it)));
    }
    (journal.into_storage(), all.iter().collect())
}

/// Offsets at which records begin, and of the last one's end.
fn record_bounds(bytes: &[u8]) -> Vec<usize> {
    let mut bounds = vec![MAGIC.len()];
    while let Some(body) = complete_record(&bytes[bounds[bounds.len() - 1]..]) {
        bounds.push(bounds[bounds.len() - 1] + HEADING_LEN + body.len());
    }
    bounds
}

/// Damages a journal in one of eight ways, by `case`; some leave it unchanged.
fn damage(mut bytes: Vec<u8>, case: u32, random: &mut ChaCha8Rng) -> Vec<u8> {
    let bounds = record_bounds(&bytes);
    let len = bytes.len();
    let at = random.random_range(0..len);
    let length = random.random_range(1..=40.min(len - at));
    match case % 8 {
        0 => bytes[at] ^= 1 << random.random_range(0..8),
        1 => bytes.truncate(at),
        2 => bytes[at..at + length].fill(0),
        3 => drop(bytes.drain(at..at + length)),
        // A record's length or checksum is changed.
        4 => {
            let heading = bounds[random.random_range(0..bounds.len() - 1)];
            bytes[heading + random.random_range(0..HEADING_LEN)] ^= random.random_range(1..=255);
        }
        // Two records are exchanged.
        5 => {
            let first = random.random_range(0..bounds.len() - 2);
            let [a, b, c] = [bounds[first], bounds[first + 1], bounds[first + 2]];
            return [&bytes[..a], &bytes[b..c], &bytes[a..b], &bytes[c..]].concat();
        }
        // A record is removed, or it and all after it.
        6 => {
            let first = random.random_range(0..bounds.len() - 1);
            let [a, b] = [bounds[first], bounds[first + 1]];
            return match random.random() {
                true => [&bytes[..a], &bytes[b..]].concat(),
                false => bytes[..a].to_vec(),
            };
        }
        _ => bytes.clear(),
    }
    bytes
}

#[test]
fn damage_to_synced_records_is_always_found() {
    let (intact, newest) = journal_of_a_flight();
    let mut random = ChaCha8Rng::seed_from_u64(22);
    let mut unchanged = 0;
    for case in 0..10_000 {
        let bytes = damage(intact.bytes.clone(), case, &mut random);
        let is_damaged = bytes != intact.bytes;
        unchanged += u32::from(!is_damaged);
        let damaged = MemoryStorage {
            bytes,
            last_synced: intact.last_synced,
        };
        let opened = Journal::open(damaged.clone());
        assert_eq!(opened.is_err(), is_damaged, "case {case}");
        let (journal, found) = Journal::open_in_flight(damaged).unwrap();
        assert_eq!(journal.is_intact(), !is_damaged, "case {case}");
        let found: Vec<_> = found.iter().collect();
        assert!(is_damaged || found == newest, "case {case}");
        // No later incarnation takes the journal for intact.
        let reopened = Journal::open(journal.into_storage());
        assert_eq!(reopened.is_err(), is_damaged, "case {case}");
    }
    assert!(unchanged < 1_000, "{unchanged}");
}

#[test]
fn damaged_number_of_the_last_synced_record_hides_no_damage_and_loses_no_record() {
    let (intact, newest) = journal_of_a_flight();
    let mut random = ChaCha8Rng::seed_from_u64(23);
    for _ in 0..1_000 {
        let bit = 1 << random.random_range(0..64);
        let number = intact.last_synced ^ bit;
        let opened = Journal::open(MemoryStorage {
            bytes: intact.bytes.clone(),
            last_synced: number,
        });
        match opened {
            Ok((_, found)) => assert_eq!(found.iter().collect::<Vec<_>>(), newest, "{number}"),
            Err(_) => assert!(number > intact.last_synced),
        }
    }
}

#[test]
fn synced_records_survive_and_unsynced_ones_may_be_lost() {
    let (mut journal, mut all) = Journal::open(MemoryStorage::default()).unwrap();
    keep(&mut journal, &mut all, &mission(3));
    let synced_len = journal.storage.bytes.len();
    all.keep(mission(4));
    journal.add(&mission(4), &all).unwrap();
    let MemoryStorage {
        bytes,
        last_synced: number,
    } = journal.into_storage();
    for end in synced_len..bytes.len() {
        let (_, found) = Journal::open(MemoryStorage {
            bytes: bytes[..end].to_vec(),
            last_synced: number,
        })
        .unwrap();
        assert!(found.holds(&mission(3)), "{end}");
    }
    // The number of the last synced record may be lost without the records.
    let (_, found) = Journal::open(MemoryStorage::with_bytes(bytes)).unwrap();
    assert!(found.holds(&mission(4)));
}

/// A disk whose syncs take a while.
#[derive(Debug, Clone, Default)]
struct Disk {
    /// The bytes, how many of them are synced, and the number of the last synced record.
    held: Arc<Mutex<(Vec<u8>, usize, u64)>>,
    sync_takes: Duration,
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

    fn last_synced(&mut self) -> io::Result<u64> {
        Ok(self.held.lock().unwrap().2)
    }

    fn set_last_synced(&mut self, number: u64) -> io::Result<()> {
        self.held.lock().unwrap().2 = number;
        Ok(())
    }
}

/// A checkpoint of 4 KB, so that a short flight compacts its journal.
fn large_mission(opened: u16) -> Checkpoint {
    let Checkpoint::Mission(mut checkpoint) = mission(opened) else {
        unreachable!("a mission's checkpoint");
    };
    checkpoint.plan.waypoints = vec![Ned::new(1.0, 2.0, -3.0); 170];
    Checkpoint::Mission(checkpoint)
}

/// A power cut may leave sound records behind lost ones: then the journal is damaged, and the drone lands.
#[test]
fn reported_checkpoints_survive_any_power_cut_or_the_journal_is_damaged() {
    let mut random = ChaCha8Rng::seed_from_u64(200);
    let (mut damaged, mut compacted) = (0, 0);
    for case in 0..200_usize {
        let disk = PowerCutStorage::default();
        let (journal, all) = Journal::open(disk.clone()).unwrap();
        let (sender, reports) = mpsc::channel();
        let mut writer = Writer::start(journal, all, move |it| drop(sender.send(it))).unwrap();
        // Each fourth flight is long enough for a compaction.
        let flight = if case.is_multiple_of(4) {
            60..200
        } else {
            1..40
        };
        let (mut queued, mut last) = (0, 0);
        for opened in 1..=random.random_range(flight) {
            writer.keep(large_mission(opened), random.random()).unwrap();
            queued += 4_096;
            last = last_durable(&reports).unwrap_or(last);
        }
        compacted += usize::from(queued > COMPACT_ABOVE);
        last = last_durable(&reports).unwrap_or(last);
        let cut = disk.after_power_cut(|below| random.random_range(0..below));
        let Ok((_, found)) = Journal::open(cut) else {
            damaged += 1;
            continue;
        };
        let opened = found.iter().find_map(|it| match it {
            Checkpoint::Mission(mission) => mission.progress.opened,
            _ => None,
        });
        assert!(
            u64::from(opened.unwrap_or(0)) >= last,
            "{opened:?} < {last}"
        );
    }
    assert!(damaged < 100 && compacted > 20, "{damaged}, {compacted}");
}

fn last_durable(reports: &mpsc::Receiver<WriteReport>) -> Option<u64> {
    let last = reports.try_iter().last()?;
    match last {
        WriteReport::DurableUpTo(number) => Some(number),
        WriteReport::Failed { .. } => panic!("{last:?}"),
    }
}

#[test]
fn slow_disk_delays_no_caller_and_is_reported_after_the_sync() {
    let disk = Disk {
        sync_takes: Duration::from_millis(500),
        ..Disk::default()
    };
    let (journal, all) = Journal::open(disk.clone()).unwrap();
    let start = Instant::now();
    let (sender, reports) = mpsc::channel();
    let synced = disk.clone();
    let report = move |it| drop(sender.send((it, synced.held.lock().unwrap().clone())));
    let mut writer = Writer::start(journal, all, report).unwrap();
    for opened in 1..=20 {
        writer.keep(mission(opened), true).unwrap();
    }
    assert!(start.elapsed() < Duration::from_millis(250));
    drop(writer);
    let reports: Vec<_> = reports.iter().collect();
    for (written, (bytes, synced, number)) in &reports {
        assert!(
            matches!(written, WriteReport::DurableUpTo(_)),
            "{written:?}"
        );
        assert_eq!(bytes.len(), *synced);
        assert!(*number > 0);
    }
    let (WriteReport::DurableUpTo(20), _) = reports[reports.len() - 1] else {
        panic!("{reports:?}");
    };
    // Queued checkpoints were synced together.
    assert!(reports.len() < 4, "{}", reports.len());
}

#[test]
fn disk_that_does_not_keep_up_bounds_what_waits() {
    let disk = Disk::default();
    let (journal, all) = Journal::open(disk.clone()).unwrap();
    let (sender, reports) = mpsc::channel();
    // The disk writes nothing until the queue is full.
    let held = disk.held.lock().unwrap();
    let mut writer = Writer::start(journal, all, move |it| drop(sender.send(it))).unwrap();
    let numbers: Vec<_> = (0..=2 * WAITING_MAX)
        .map_while(|_| writer.keep(mission(1), true).ok())
        .collect();
    drop(held);
    assert!(numbers.len() >= WAITING_MAX && numbers.len() <= 2 * WAITING_MAX);
    drop(writer);
    // What was queued is still written.
    let last = reports.iter().last();
    let Some(WriteReport::DurableUpTo(number)) = last else {
        panic!("{last:?}");
    };
    assert_eq!(number, *numbers.last().unwrap());
}

/// A disk on which the third append fails.
#[derive(Debug, Default)]
struct FullOnce(Disk, usize);

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
        self.0.sync()
    }

    fn replace(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.replace(bytes)
    }

    fn last_synced(&mut self) -> io::Result<u64> {
        self.0.last_synced()
    }

    fn set_last_synced(&mut self, number: u64) -> io::Result<()> {
        self.0.set_last_synced(number)
    }
}

#[test]
fn journal_is_rewritten_after_a_failed_write() {
    let disk = Disk::default();
    let (journal, all) = Journal::open(FullOnce(disk.clone(), 0)).unwrap();
    let (sender, reports) = mpsc::channel();
    let mut writer = Writer::start(journal, all, move |it| drop(sender.send(it))).unwrap();
    for opened in 1..=4 {
        writer.keep(mission(opened), opened != 3).unwrap();
    }
    drop(writer);
    let reports: Vec<_> = reports
        .iter()
        .map(|it| match it {
            WriteReport::DurableUpTo(number) => (number, true),
            WriteReport::Failed { number, .. } => (number, false),
        })
        .collect();
    let (failed, is_durable) = *reports.iter().find(|(_, is_durable)| !is_durable).unwrap();
    assert!((3..=4).contains(&failed) && !is_durable);
    assert!(reports.contains(&(failed, true)), "{reports:?}");
    assert_eq!(reports.last(), Some(&(4, true)), "{reports:?}");
    let bytes = disk.held.lock().unwrap().0.clone();
    let (_, found) = Journal::open(MemoryStorage::with_bytes(bytes)).unwrap();
    assert!(found.holds(&mission(4)));
}
