use std::io;

/// A bidirectional stream between an operator and a drone. Dropping it ends it.
#[derive(Debug)]
pub struct Stream {
    pub(super) writer: quinn::SendStream,
    pub(super) reader: quinn::RecvStream,
}

impl Stream {
    /// Writes all bytes, with flow control by the peer.
    ///
    /// # Errors
    /// If the connection is lost or the peer stopped reading.
    pub async fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        Ok(self.writer.write_all(bytes).await?)
    }

    /// Ends the write direction.
    pub fn finish(&mut self) {
        // It fails only on a finished or stopped stream.
        let _ = self.writer.finish();
    }

    /// Waits until the peer stops reading or the connection is lost.
    pub async fn stopped(&self) {
        let _ = self.writer.stopped().await;
    }

    /// Reads into `bytes` and returns the number of bytes read; 0 at the end of the stream.
    ///
    /// # Errors
    /// If the connection is lost or the peer reset the stream.
    pub async fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        Ok(self.reader.read(bytes).await?.unwrap_or_default())
    }

    /// Reads to the end of the stream.
    ///
    /// # Errors
    /// If there are more than `max` bytes, the connection is lost, or the peer reset the stream.
    pub async fn read_to_end(&mut self, max: usize) -> io::Result<Vec<u8>> {
        let read = self.reader.read_to_end(max).await;
        read.map_err(io::Error::other)
    }
}
