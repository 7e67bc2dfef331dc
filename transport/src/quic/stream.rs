use std::io;

/// A stream between an operator and a drone, for what is large. It ends with this value.
#[derive(Debug)]
pub struct Stream {
    pub(super) writer: quinn::SendStream,
    pub(super) reader: quinn::RecvStream,
}

impl Stream {
    /// Writes all of these bytes, as fast as the other end reads them.
    ///
    /// # Errors
    /// When the connection is gone or the other end reads no more.
    pub async fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        Ok(self.writer.write_all(bytes).await?)
    }

    /// Says that nothing more is written.
    pub fn finish(&mut self) {
        // It fails only where that was said before, by either end.
        let _ = self.writer.finish();
    }

    /// Returns once the other end reads no more, or is gone.
    pub async fn given_up(&self) {
        let _ = self.writer.stopped().await;
    }

    /// Reads some of what there is, into all or a part of `bytes`: how much; nothing once nothing more is written.
    ///
    /// # Errors
    /// When the connection is gone, or the other end gave up.
    pub async fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        Ok(self.reader.read(bytes).await?.unwrap_or_default())
    }

    /// Reads all that is written until the other end says that nothing more is.
    ///
    /// # Errors
    /// When it is more than `max` bytes, the connection is gone, or the other end gave up.
    pub async fn read_to_end(&mut self, max: usize) -> io::Result<Vec<u8>> {
        let read = self.reader.read_to_end(max).await;
        read.map_err(io::Error::other)
    }
}
