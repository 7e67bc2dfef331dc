//! Journals: whatever a disk holds is read up to where it is whole or refused, and what was read is read again.
#![no_main]

use std::io;

use libfuzzer_sys::fuzz_target;
use muster_runtime::journal::{Journal, Storage};

#[derive(Debug)]
struct Memory(Vec<u8>);

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
}

fuzz_target!(|bytes: &[u8]| {
    open(bytes.to_vec());
    // With the checksums that these records would have, which chance does not find.
    let mut journal = Vec::new();
    let mut rest = bytes;
    while let Some((len, behind)) = rest.split_first() {
        let (body, behind) = behind.split_at(usize::from(*len).min(behind.len()));
        let len = u32::try_from(body.len()).expect("less than a record's most");
        journal.extend_from_slice(&len.to_le_bytes());
        journal.extend_from_slice(&crc32fast::hash(body).to_le_bytes());
        journal.extend_from_slice(body);
        rest = behind;
    }
    open(journal);
});

fn open(bytes: Vec<u8>) {
    if let Ok((journal, found)) = Journal::open(Memory(bytes)) {
        let (_, again) = Journal::open(journal.into_storage()).expect("what was written is read");
        assert_eq!(again.boot(), found.boot().wrapping_add(1));
    }
}
