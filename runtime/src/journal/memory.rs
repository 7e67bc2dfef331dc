use std::io;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::Storage;

/// Storage in memory, for tests and fuzz targets. Appended bytes are synced at once, and no call fails.
#[derive(Debug, Clone, Default)]
pub struct MemoryStorage {
    /// The journal's bytes.
    pub bytes: Vec<u8>,
    /// Number of the last synced record; 0 if unknown.
    pub last_synced: u64,
}

impl MemoryStorage {
    /// Storage with a journal's bytes, of which no record is known to be synced.
    #[must_use]
    pub const fn with_bytes(bytes: Vec<u8>) -> Self {
        Self {
            bytes,
            last_synced: 0,
        }
    }
}

impl Storage for MemoryStorage {
    fn read(&mut self) -> io::Result<Vec<u8>> {
        Ok(self.bytes.clone())
    }

    fn append(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.bytes.extend_from_slice(bytes);
        Ok(())
    }

    fn sync(&mut self) -> io::Result<()> {
        Ok(())
    }

    fn replace(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.bytes = bytes.to_vec();
        Ok(())
    }

    fn last_synced(&mut self) -> io::Result<u64> {
        Ok(self.last_synced)
    }

    fn set_last_synced(&mut self, number: u64) -> io::Result<()> {
        self.last_synced = number;
        Ok(())
    }
}

/// Bytes that a disk writes at once.
const SECTOR: usize = 512;

/// A disk in memory that may lose unsynced bytes in a power cut, for tests. Clones share their bytes.
#[derive(Debug, Clone, Default)]
pub struct PowerCutStorage(Arc<Mutex<Disk>>);

#[derive(Debug, Default)]
struct Disk {
    bytes: Vec<u8>,
    /// Bytes that survive a power cut.
    synced: usize,
    /// Number of the last synced record, and the one that was stored before.
    last_synced: [u64; 2],
}

impl PowerCutStorage {
    fn disk(&self) -> MutexGuard<'_, Disk> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What is on the disk after a power cut now. `draw` returns an even random number below its argument: each sector that
    /// was not synced is kept or is zeros, in any combination, the file may end before the last, and the number of the last
    /// synced record may be an earlier one.
    pub fn after_power_cut(&self, mut draw: impl FnMut(usize) -> usize) -> MemoryStorage {
        let disk = self.disk();
        let mut bytes = disk.bytes.clone();
        let mut at = disk.synced;
        while at < bytes.len() {
            let end = (at / SECTOR * SECTOR + SECTOR).min(bytes.len());
            if draw(2) == 0 {
                bytes[at..end].fill(0);
            }
            at = end;
        }
        if draw(2) == 0 {
            let lost = draw(bytes.len() - disk.synced + 1);
            bytes.truncate(bytes.len() - lost);
        }
        let [last, before] = disk.last_synced;
        let last_synced = [last, before, 0][draw(3)];
        MemoryStorage { bytes, last_synced }
    }
}

impl Storage for PowerCutStorage {
    fn read(&mut self) -> io::Result<Vec<u8>> {
        Ok(self.disk().bytes.clone())
    }

    fn append(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.disk().bytes.extend_from_slice(bytes);
        Ok(())
    }

    fn sync(&mut self) -> io::Result<()> {
        let mut disk = self.disk();
        disk.synced = disk.bytes.len();
        Ok(())
    }

    fn replace(&mut self, bytes: &[u8]) -> io::Result<()> {
        let mut disk = self.disk();
        disk.bytes = bytes.to_vec();
        disk.synced = bytes.len();
        Ok(())
    }

    fn last_synced(&mut self) -> io::Result<u64> {
        Ok(self.disk().last_synced[0])
    }

    fn set_last_synced(&mut self, number: u64) -> io::Result<()> {
        let mut disk = self.disk();
        disk.last_synced = [number, disk.last_synced[0]];
        Ok(())
    }
}
