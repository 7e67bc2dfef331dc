use std::future::poll_fn;
use std::io;
use std::net::UdpSocket;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::task::{Context, Poll};

use tokio::io::Interest;

/// Waits for datagrams, while others use the transport.
#[derive(Debug)]
pub struct Readiness {
    /// Clones of the transport's sockets, which are only watched here.
    sockets: Vec<tokio::net::UdpSocket>,
    polled: Arc<SocketMask>,
}

/// The sockets that the transport reads, one bit each. All by default; only the ready ones while these are drained.
#[derive(Debug)]
pub(super) struct SocketMask(AtomicU64);

impl SocketMask {
    pub(super) const fn all() -> Self {
        Self(AtomicU64::new(u64::MAX))
    }

    pub(super) fn has(&self, socket: usize) -> bool {
        self.0.load(Ordering::Relaxed) & (1 << socket) != 0
    }

    /// Runs `read` with reading restricted to these sockets.
    fn restricted_to<T>(&self, sockets: u64, read: impl FnOnce() -> T) -> T {
        self.0.store(sockets, Ordering::Relaxed);
        let result = read();
        self.0.store(u64::MAX, Ordering::Relaxed);
        result
    }
}

impl Readiness {
    pub(super) fn new(sockets: &[Arc<UdpSocket>], polled: Arc<SocketMask>) -> io::Result<Self> {
        let watch = |socket: &Arc<UdpSocket>| tokio::net::UdpSocket::from_std(socket.try_clone()?);
        Ok(Self {
            sockets: sockets.iter().map(watch).collect::<io::Result<_>>()?,
            polled,
        })
    }

    /// Waits until datagrams may have arrived, then calls `drain`, which reads some and returns whether none is left. Returns
    /// the same. If any are left, the next call does not wait.
    ///
    /// # Errors
    /// If the runtime no longer watches the sockets.
    pub async fn datagrams(&self, mut drain: impl FnMut() -> bool) -> io::Result<bool> {
        poll_fn(|context| self.poll_ready(context)).await?;
        Ok(self.drain_ready(0, 0, &mut drain))
    }

    /// Drains the sockets of `ready`, one bit each, and all ready ones from index `next` on. Recursive, since Tokio clears the
    /// readiness of a socket only if the function within its `try_io` finds it drained. Datagrams that arrive meanwhile make a
    /// socket ready again.
    fn drain_ready(&self, ready: u64, next: usize, drain: &mut impl FnMut() -> bool) -> bool {
        let Some(socket) = self.sockets.get(next) else {
            return self.polled.restricted_to(ready, drain);
        };
        let mut is_drained = None;
        let result = socket.try_io(Interest::READABLE, || {
            match *is_drained.insert(self.drain_ready(ready | 1 << next, next + 1, drain)) {
                true => Err(io::Error::from(io::ErrorKind::WouldBlock)),
                false => Ok(()),
            }
        });
        drop(result);
        is_drained.unwrap_or_else(|| self.drain_ready(ready, next + 1, drain))
    }

    fn poll_ready(&self, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        // Poll all sockets, so that each registers the waker.
        let polled = self.sockets.iter().map(|it| it.poll_recv_ready(context));
        polled.fold(Poll::Pending, |first, polled| match first {
            Poll::Ready(_) => first,
            Poll::Pending => polled,
        })
    }
}
