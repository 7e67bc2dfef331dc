//! An open port.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::Duration;

use serial2::SerialPort;

use crate::address::Address;

/// How long a TCP connection may take.
const CONNECT_MAX: Duration = Duration::from_secs(1);
/// How long a frame may take to be written. A full buffer means that the controller doesn't read.
const WRITE_MAX: Duration = Duration::from_millis(20);

/// Bytes to and from a controller. Two threads may read and write at a time.
#[derive(Debug)]
pub(crate) enum Wire {
    Serial(SerialPort),
    Tcp(TcpStream),
}

impl Wire {
    /// Opens a port, for this process alone. Reads wait for `wait` at most.
    pub(crate) fn open(address: &Address, wait: Duration) -> io::Result<Self> {
        match address {
            Address::Serial { path, baud } => {
                let mut port = SerialPort::open(path, *baud)?;
                rustix::termios::ioctl_tiocexcl(&port)?;
                port.set_read_timeout(wait)?;
                port.set_write_timeout(WRITE_MAX)?;
                // What a controller said before isn't meant for this process.
                port.discard_buffers()?;
                Ok(Self::Serial(port))
            }
            Address::Tcp { host } => {
                let stream = connect(host)?;
                stream.set_nodelay(true)?;
                stream.set_read_timeout(Some(wait))?;
                stream.set_write_timeout(Some(WRITE_MAX))?;
                Ok(Self::Tcp(stream))
            }
        }
    }

    /// Reads wait for `wait` at most from now on.
    pub(crate) fn set_wait(&mut self, wait: Duration) -> io::Result<()> {
        match self {
            Self::Serial(port) => port.set_read_timeout(wait),
            Self::Tcp(stream) => stream.set_read_timeout(Some(wait)),
        }
    }

    /// Reads what is there; waits for a while if nothing is, and returns 0 then.
    pub(crate) fn read(&self, buffer: &mut [u8]) -> io::Result<usize> {
        let read = match self {
            Self::Serial(port) => port.read(buffer),
            Self::Tcp(stream) => (&mut &*stream).read(buffer),
        };
        match read {
            Ok(0) => Err(ErrorKind::UnexpectedEof.into()),
            Ok(length) => Ok(length),
            Err(error) if is_waiting(&error) => Ok(0),
            Err(error) => Err(error),
        }
    }

    /// Writes all of it. After an error a part of a frame may be out: the port must be closed.
    pub(crate) fn write(&self, bytes: &[u8]) -> io::Result<()> {
        match self {
            Self::Serial(port) => port.write_all(bytes),
            Self::Tcp(stream) => (&mut &*stream).write_all(bytes),
        }
    }
}

fn is_waiting(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted
    )
}

fn connect(host: &str) -> io::Result<TcpStream> {
    let mut failed = ErrorKind::AddrNotAvailable.into();
    for address in host.to_socket_addrs()? {
        match TcpStream::connect_timeout(&address, CONNECT_MAX) {
            Ok(stream) => return Ok(stream),
            Err(error) => failed = error,
        }
    }
    Err(failed)
}
