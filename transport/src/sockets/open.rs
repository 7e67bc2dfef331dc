//! How a drone's sockets are opened.

use std::io;
use std::net::{Ipv4Addr, SocketAddr, SocketAddrV4, UdpSocket};

use socket2::{Domain, InterfaceIndexOrAddress, Protocol, SockRef, Socket, Type};
use thiserror::Error;

use super::{Config, Reach};

/// How much the system is asked to keep of what comes in, in bytes: a hundred frames of the largest size. It may grant
/// less, which [`super::drops`] shows.
const RECEIVE_BUFFER: usize = 256 * 1_024;

/// Why a drone's end of the network could not be opened: its configuration does not fit this machine.
#[derive(Debug, Error)]
pub enum OpenError {
    /// There is no such interface, or this user may not choose it.
    #[error("can't use the interface {name}")]
    Interface {
        /// As configured.
        name: String,
        /// What the system says.
        #[source]
        source: io::Error,
    },
    /// The address is none of this machine's, or taken.
    #[error("can't listen at {address}")]
    Bind {
        /// As configured.
        address: SocketAddr,
        /// What the system says.
        #[source]
        source: io::Error,
    },
    /// What is sent to all would come in twice.
    #[error("a drone's own port must be another than {port}, to which goes what is for all")]
    SamePort {
        /// The port of both.
        port: u16,
    },
    /// The multicast group can't be joined.
    #[error("can't join the group {address}")]
    Join {
        /// As configured.
        address: SocketAddrV4,
        /// What the system says.
        #[source]
        source: io::Error,
    },
    /// The system has no socket for it.
    #[error("can't open a socket")]
    Socket(#[from] io::Error),
}

/// For how many peers there is a socket apart, so that all sockets together are no more than a word has bits; what comes
/// from others comes in at the drone's own.
const APART_MAX: usize = 63;

/// The drone's own socket, and the one at which it hears what is for all, if that is another.
pub(crate) fn open(config: &Config) -> Result<(UdpSocket, Option<UdpSocket>), OpenError> {
    let own = socket(config, config.bind, false)?;
    let shared = match config.reach {
        Reach::Peers(_) => None,
        Reach::Group(address) => {
            own.set_multicast_loop_v4(true)?;
            let shared = shared_socket(config, address)?;
            let joined = join(config, &shared, *address.ip());
            joined.map_err(|source| OpenError::Join { address, source })?;
            Some(shared)
        }
        Reach::Broadcast(address) => {
            own.set_broadcast(true)?;
            Some(shared_socket(config, address)?)
        }
    };
    Ok((own.into(), shared.map(UdpSocket::from)))
}

/// A socket for each peer, at the drone's own address, that gets what comes from that peer's: so a flood from elsewhere
/// leaves room for it. Where the system gives none, what that peer sends comes in with all else.
pub(crate) fn apart(
    config: &Config,
    own: &UdpSocket,
    peers: &[SocketAddr],
) -> Result<Vec<UdpSocket>, OpenError> {
    let address = own.local_addr()?;
    let own = SockRef::from(own);
    // Others share the address for as long as it takes to open these, and nobody after that.
    own.set_reuse_address(true)?;
    let peers = peers.iter().take(APART_MAX);
    let sockets = peers.filter_map(|peer| {
        let socket = socket(config, address, true).ok()?;
        socket.connect(&(*peer).into()).ok()?;
        Some(socket.into())
    });
    let sockets = sockets.collect();
    own.set_reuse_address(false)?;
    Ok(sockets)
}

/// A socket for what is sent to all, which other drones of this host may have, too.
fn shared_socket(config: &Config, address: SocketAddrV4) -> Result<Socket, OpenError> {
    if config.bind.port() == address.port() {
        let port = address.port();
        return Err(OpenError::SamePort { port });
    }
    socket(config, address.into(), true)
}

fn socket(config: &Config, address: SocketAddr, is_shared: bool) -> Result<Socket, OpenError> {
    let socket = Socket::new(
        Domain::for_address(address),
        Type::DGRAM,
        Some(Protocol::UDP),
    )?;
    socket.set_nonblocking(true)?;
    socket.set_recv_buffer_size(RECEIVE_BUFFER)?;
    if let Some(name) = &config.interface {
        let chosen = socket.bind_device(Some(name.as_bytes()));
        chosen.map_err(|source| OpenError::Interface {
            name: name.clone(),
            source,
        })?;
    }
    if is_shared {
        socket.set_reuse_address(true)?;
    }
    let bound = socket.bind(&address.into());
    bound.map_err(|source| OpenError::Bind { address, source })?;
    Ok(socket)
}

fn join(config: &Config, socket: &Socket, group: Ipv4Addr) -> io::Result<()> {
    let interface = match &config.interface {
        Some(name) => InterfaceIndexOrAddress::Index(index_of(name)?),
        None => InterfaceIndexOrAddress::Address(Ipv4Addr::UNSPECIFIED),
    };
    socket.join_multicast_v4_n(&group, &interface)
}

/// The system's number of an interface.
fn index_of(name: &str) -> io::Result<u32> {
    let text = std::fs::read_to_string(format!("/sys/class/net/{name}/ifindex"))?;
    let index = text.trim().parse();
    index.map_err(|_| io::Error::from(io::ErrorKind::InvalidData))
}
