use std::io;

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
