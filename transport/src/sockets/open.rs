//! Opens a drone's sockets.

use std::io;
use std::net::{Ipv4Addr, SocketAddr, SocketAddrV4, UdpSocket};

use rustix::net::netdevice::name_to_index;
use socket2::{Domain, InterfaceIndexOrAddress, Protocol, SockRef, Socket, Type};
use thiserror::Error;

use super::{Config, Reach};

/// Requested receive buffer in bytes, for about a hundred frames of the largest size. The kernel may grant less; drops show
/// in [`super::kernel_drops`].
const RECEIVE_BUFFER: usize = 256 * 1_024;

/// Why the sockets could not be opened: their configuration does not fit this machine.
#[derive(Debug, Error)]
pub enum OpenError {
    /// The interface does not exist, or the user may not bind to it.
    #[error("can't use the interface {name}")]
    Interface {
        /// The configured interface.
        name: String,
        /// The cause.
        #[source]
        source: io::Error,
    },
    /// The address does not belong to this machine, or is in use.
    #[error("can't listen at {address}")]
    Bind {
        /// The configured address.
        address: SocketAddr,
        /// The cause.
        #[source]
        source: io::Error,
    },
    /// The own port is the port of broadcasts, which would arrive twice.
    #[error("a drone's own port must differ from the port of broadcasts, {port}")]
    SamePort {
        /// The port.
        port: u16,
    },
    /// The multicast group can't be joined.
    #[error("can't join the group {address}")]
    Join {
        /// The configured group.
        address: SocketAddrV4,
        /// The cause.
        #[source]
        source: io::Error,
    },
    /// The kernel refused a socket.
    #[error("can't open a socket")]
    Socket(#[from] io::Error),
}

/// Most peers with their own socket; with the drone's own socket they fit into the bits of a `u64`. Datagrams of further
/// peers arrive at the drone's own socket.
const PEER_SOCKETS_MAX: usize = 63;

/// Opens the drone's own socket, and the one for broadcasts unless [`Reach::Peers`] is used.
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

/// Opens a connected socket per peer at the drone's own address. Each has its own receive buffer, so that a flood from
/// another address can't displace the peer's datagrams. A peer without such a socket shares the drone's own.
pub(crate) fn peer_sockets(
    config: &Config,
    own: &UdpSocket,
    peers: &[SocketAddr],
) -> Result<Vec<UdpSocket>, OpenError> {
    let address = own.local_addr()?;
    let own = SockRef::from(own);
    // Only while these sockets are opened; nobody else can share the address later.
    own.set_reuse_address(true)?;
    let peers = peers.iter().take(PEER_SOCKETS_MAX);
    let sockets = peers.filter_map(|peer| {
        let socket = socket(config, address, true).ok()?;
        socket.connect(&(*peer).into()).ok()?;
        Some(socket.into())
    });
    let sockets = sockets.collect();
    own.set_reuse_address(false)?;
    Ok(sockets)
}

/// Opens a socket for broadcasts. Other drones on this host may share its address.
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
        Some(name) => {
            // Not from /sys, which may be another network namespace's.
            InterfaceIndexOrAddress::Index(name_to_index(socket, name)?)
        }
        None => InterfaceIndexOrAddress::Address(Ipv4Addr::UNSPECIFIED),
    };
    socket.join_multicast_v4_n(&group, &interface)
}
