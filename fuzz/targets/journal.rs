//! Journals: whatever a disk holds is read up to where it is whole or refused, and what was read is read again.

use std::io;

use muster_runtime::journal::{Journal, MAGIC, Storage, frame};

#[derive(Debug)]
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

pub(crate) fn run(bytes: &[u8]) {
    open(bytes.to_vec());
    // With the checksums that these records would have, which chance does not find.
    let mut journal = MAGIC.to_vec();
    let mut rest = bytes;
    while let Some((len, behind)) = rest.split_first() {
        let (body, behind) = behind.split_at(usize::from(*len).min(behind.len()));
        frame(body, &mut journal);
        rest = behind;
    }
    open(journal);
}

fn open(bytes: Vec<u8>) {
    let whole = Journal::open(Memory(bytes.clone(), 0)).is_ok();
    if let Ok((journal, found)) = Journal::open_in_flight(Memory(bytes, 0)) {
        assert_eq!(journal.is_understood(), whole);
        let again = Journal::open_in_flight(journal.into_storage());
        let (journal, again) = again.expect("what was written is read");
        assert_eq!(again.boot(), found.boot().wrapping_add(1));
        assert_eq!(journal.is_understood(), whole);
    }
}
