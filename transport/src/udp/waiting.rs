use std::future::poll_fn;
use std::io;
use std::net::UdpSocket;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::task::{Context, Poll};

use tokio::io::Interest;

/// Waits until datagrams are there, beside whoever else uses the transport.
#[derive(Debug)]
pub struct Waiting {
    /// The transport's sockets once more; nothing is read here.
    sockets: Vec<tokio::net::UdpSocket>,
    looked_at: Arc<LookedAt>,
}

/// Which of a transport's sockets it looks at, a bit each: all, unless it is known where datagrams are.
#[derive(Debug)]
pub(super) struct LookedAt(AtomicU64);

impl LookedAt {
    pub(super) const fn all() -> Self {
        Self(AtomicU64::new(u64::MAX))
    }

    pub(super) fn has(&self, socket: usize) -> bool {
        self.0.load(Ordering::Relaxed) & (1 << socket) != 0
    }

    /// Does something that looks at these only.
    fn only<T>(&self, sockets: u64, look: impl FnOnce() -> T) -> T {
        self.0.store(sockets, Ordering::Relaxed);
        let seen = look();
        self.0.store(u64::MAX, Ordering::Relaxed);
        seen
    }
}

impl Waiting {
    pub(super) fn new(sockets: &[Arc<UdpSocket>], looked_at: Arc<LookedAt>) -> io::Result<Self> {
        let watch = |socket: &Arc<UdpSocket>| tokio::net::UdpSocket::from_std(socket.try_clone()?);
        Ok(Self {
            sockets: sockets.iter().map(watch).collect::<io::Result<_>>()?,
            looked_at,
        })
    }

    /// Returns once datagrams may be there, having called `drain`, which takes some and says whether it has taken all.
    /// Tells the same; unless all was taken, the next call returns at once.
    ///
    /// # Errors
    /// When the runtime does not watch the sockets any more.
    pub async fn datagrams(&self, mut drain: impl FnMut() -> bool) -> io::Result<bool> {
        poll_fn(|context| self.poll_ready(context)).await?;
        Ok(self.drain_ready(0, 0, &mut drain))
    }

    /// Drains those of `ready`, a bit each, and those that are ready from the `next` one on. Once drained, they are waited for
    /// again; what came since this began makes them ready at once.
    fn drain_ready(&self, ready: u64, next: usize, drain: &mut impl FnMut() -> bool) -> bool {
        let Some(socket) = self.sockets.get(next) else {
            return self.looked_at.only(ready, drain);
        };
        let mut is_drained = None;
        let taken = socket.try_io(Interest::READABLE, || {
            match *is_drained.insert(self.drain_ready(ready | 1 << next, next + 1, drain)) {
                true => Err(io::Error::from(io::ErrorKind::WouldBlock)),
                false => Ok(()),
            }
        });
        drop(taken);
        is_drained.unwrap_or_else(|| self.drain_ready(ready, next + 1, drain))
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
