//! Disks of simulated drones.

use std::io;

use muster_runtime::journal::Storage;
use rand::{Rng, RngExt};

/// The disk of a simulated drone's journal. Bytes that are not synchronised are lost with the process, but for a part that
/// may have reached the disk.
///
/// Invariant: the first `synced` bytes are never lost.
#[derive(Debug, Default)]
pub(super) struct Disk {
    bytes: Vec<u8>,
    /// How many of them are synchronised.
    synced: usize,
    /// The last record that was reported as synchronised.
    last_synced: u64,
}

impl Disk {
    /// Power fails: a random part of the bytes not synchronised is left, which may end within a record.
    pub(super) fn lose_power(&mut self, rng: &mut impl Rng) {
        let left = rng.random_range(self.synced..=self.bytes.len());
        self.bytes.truncate(left);
        self.synced = left;
    }
}

impl Storage for Disk {
    fn read(&mut self) -> io::Result<Vec<u8>> {
        Ok(self.bytes.clone())
    }

    fn append(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.bytes.extend_from_slice(bytes);
        Ok(())
    }

    fn sync(&mut self) -> io::Result<()> {
        self.synced = self.bytes.len();
        Ok(())
    }

    fn replace(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.bytes = bytes.to_vec();
        self.sync()
    }

    fn last_synced(&mut self) -> io::Result<u64> {
        Ok(self.last_synced)
    }

    fn set_last_synced(&mut self, number: u64) -> io::Result<()> {
        self.last_synced = number;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;

    #[test]
    fn synchronised_bytes_outlive_a_loss_of_power() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut lengths = Vec::new();
        for _ in 0..100 {
            let mut disk = Disk::default();
            disk.append(b"kept").unwrap();
            disk.sync().unwrap();
            disk.append(b"lost").unwrap();
            disk.lose_power(&mut rng);
            assert!(b"keptlost".starts_with(&disk.bytes) && disk.bytes.len() >= 4);
            lengths.push(disk.bytes.len());
        }
        lengths.sort_unstable();
        lengths.dedup();
        assert_eq!(lengths, [4, 5, 6, 7, 8]);
    }
}
