use std::future::poll_fn;
use std::io;
use std::net::UdpSocket;
use std::sync::Arc;
use std::task::{Context, Poll};

use tokio::io::Interest;

/// Waits until datagrams are there, beside whoever else uses the transport.
#[derive(Debug)]
pub struct Waiting {
    /// The transport's sockets once more; nothing is read here.
    sockets: Vec<tokio::net::UdpSocket>,
}

impl Waiting {
    pub(super) fn new(sockets: &[Arc<UdpSocket>]) -> io::Result<Self> {
        let watch = |socket: &Arc<UdpSocket>| tokio::net::UdpSocket::from_std(socket.try_clone()?);
        Ok(Self {
            sockets: sockets.iter().map(watch).collect::<io::Result<_>>()?,
        })
    }

    /// Returns once datagrams may be there, having called `drain`, which takes some and says whether it has taken all.
    /// Tells the same; unless all was taken, the next call returns at once.
    ///
    /// # Errors
    /// When the runtime does not watch the sockets any more.
    pub async fn datagrams(&self, mut drain: impl FnMut() -> bool) -> io::Result<bool> {
        poll_fn(|context| self.poll_ready(context)).await?;
        let mut is_drained = false;
        for socket in &self.sockets {
            let taken = socket.try_io(Interest::READABLE, || {
                is_drained = drain();
                match is_drained {
                    true => Err(io::Error::from(io::ErrorKind::WouldBlock)),
                    false => Ok(()),
                }
            });
            // It is waited for again; what came meanwhile makes it ready at once.
            drop(taken);
        }
        Ok(is_drained)
    }

    fn poll_ready(&self, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        // All are asked, so that each wakes whoever waits.
        let asked = self.sockets.iter().map(|it| it.poll_recv_ready(context));
        asked.fold(Poll::Pending, |first, polled| match first {
            Poll::Ready(_) => first,
            Poll::Pending => polled,
        })
    }
}
