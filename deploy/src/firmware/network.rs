//! The network of another process.

use std::fs::{self, File};
use std::io;
use std::os::fd::AsFd;
use std::thread;

use rustix::thread::{LinkNameSpaceType, move_into_link_name_space};

/// A network in which sockets can be opened.
#[derive(Debug)]
pub(super) struct Network(File);

impl Network {
    /// The network of a process.
    ///
    /// # Errors
    /// If the process has none of its own yet, or this one may not see it.
    pub(super) fn of(process: u32) -> io::Result<Self> {
        let path = format!("/proc/{process}/ns/net");
        if fs::read_link(&path)? == fs::read_link("/proc/self/ns/net")? {
            let message = "the process has no network of its own";
            return Err(io::Error::new(io::ErrorKind::NotFound, message));
        }
        File::open(path).map(Self)
    }

    /// Does something on a thread in this network. Sockets stay in it.
    ///
    /// # Errors
    /// If the thread may not enter it, and errors of `make`.
    pub(super) fn inside<T: Send>(
        &self,
        make: impl FnOnce() -> io::Result<T> + Send,
    ) -> io::Result<T> {
        let made = thread::scope(|scope| {
            let thread = scope.spawn(|| {
                move_into_link_name_space(self.0.as_fd(), Some(LinkNameSpaceType::Network))?;
                make()
            });
            thread.join()
        });
        made.unwrap_or_else(|_| Err(io::Error::other("a thread in the network panicked")))
    }
}
