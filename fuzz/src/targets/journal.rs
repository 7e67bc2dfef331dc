//! Journals: any bytes are read up to the first damage or refused, and a journal that was opened can be reopened.

use muster_runtime::journal::{Journal, MAGIC, MemoryStorage, frame_record};

pub(super) fn run(bytes: &[u8]) {
    open(bytes.to_vec());
    // The same bytes as records with valid checksums, which random bytes never have.
    let mut journal = MAGIC.to_vec();
    let mut rest = bytes;
    while let Some((len, tail)) = rest.split_first() {
        let (body, tail) = tail.split_at(usize::from(*len).min(tail.len()));
        frame_record(body, &mut journal);
        rest = tail;
    }
    open(journal);
}

fn open(bytes: Vec<u8>) {
    let is_intact = Journal::open(MemoryStorage::with_bytes(bytes.clone())).is_ok();
    if let Ok((journal, found)) = Journal::open_in_flight(MemoryStorage::with_bytes(bytes)) {
        assert_eq!(journal.is_intact(), is_intact);
        let reopened = Journal::open_in_flight(journal.into_storage());
        let (journal, checkpoints) = reopened.expect("a journal that was written can be read");
        assert_eq!(checkpoints.boot(), found.boot().wrapping_add(1));
        assert_eq!(journal.is_intact(), is_intact);
    }
}
