//! Names for the addresses that datagrams come from.

use std::collections::{BTreeMap, VecDeque};
use std::net::SocketAddr;
use std::num::NonZeroU16;

use muster_machines::radio::Source;

/// Number of latest hosts without a learned drone that are remembered. It exceeds the number of datagrams that wait to be
/// authenticated.
const HOSTS_MAX: usize = 1_024;

/// Numbers hosts, so that a [`Source`] stands for an address. It remembers the hosts of learned drones and the latest other
/// hosts. A host keeps its number while it is remembered.
#[derive(Debug, Default)]
pub(super) struct Sources {
    hosts: BTreeMap<SocketAddr, Host>,
    /// Addresses of the hosts, by number.
    addresses: BTreeMap<NonZeroU16, SocketAddr>,
    /// The latest numbered hosts, oldest first.
    latest: VecDeque<SocketAddr>,
    /// The number assigned last.
    last_number: u16,
}

#[derive(Debug)]
struct Host {
    number: NonZeroU16,
    /// Number of learned drones on it.
    drones: u32,
}

/// The address with port 0, which identifies the host.
fn host(mut address: SocketAddr) -> SocketAddr {
    address.set_port(0);
    address
}

impl Sources {
    /// The source that stands for an address.
    pub(super) fn source(&mut self, address: SocketAddr) -> Source {
        let known = self.hosts.get(&host(address)).map(|it| it.number);
        Source {
            host: known.unwrap_or_else(|| self.add_host(host(address))),
            port: address.port(),
        }
    }

    fn add_host(&mut self, host: SocketAddr) -> NonZeroU16 {
        if self.latest.len() == HOSTS_MAX
            && let Some(oldest) = self.latest.pop_front()
        {
            self.forget_if_unused(oldest);
        }
        let number = self.next_number();
        self.latest.push_back(host);
        self.addresses.insert(number, host);
        self.hosts.insert(host, Host { number, drones: 0 });
        number
    }

    /// The next free number. If all are in use, hosts share the last one.
    fn next_number(&mut self) -> NonZeroU16 {
        for _ in 0..=u16::MAX {
            self.last_number = self.last_number.wrapping_add(1);
            let free = NonZeroU16::new(self.last_number);
            if let Some(free) = free.filter(|it| !self.addresses.contains_key(it)) {
                return free;
            }
        }
        NonZeroU16::MAX
    }

    /// The address that a source stands for; `None` if its host is forgotten.
    pub(super) fn address(&self, source: Source) -> Option<SocketAddr> {
        let mut address = *self.addresses.get(&source.host)?;
        address.set_port(source.port);
        Some(address)
    }

    /// Adds a learned drone to the host of an address, which then keeps its number.
    pub(super) fn add_drone(&mut self, address: SocketAddr) {
        if let Some(host) = self.hosts.get_mut(&host(address)) {
            host.drones += 1;
        }
    }

    /// Removes a learned drone from the host of an address.
    pub(super) fn remove_drone(&mut self, address: SocketAddr) {
        let key = host(address);
        if let Some(host) = self.hosts.get_mut(&key) {
            host.drones = host.drones.saturating_sub(1);
        }
        if !self.latest.contains(&key) {
            self.forget_if_unused(key);
        }
    }

    fn forget_if_unused(&mut self, host: SocketAddr) {
        if let Some(unused) = self.hosts.get(&host).filter(|it| it.drones == 0) {
            self.addresses.remove(&unused.number);
            self.hosts.remove(&host);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An address on a numbered host.
    fn address(host: u16) -> SocketAddr {
        let [high, low] = host.to_be_bytes();
        SocketAddr::from(([10, 0, high, low], 4_700))
    }

    #[test]
    fn oldest_host_is_forgotten_when_too_many_are_remembered() {
        let mut table = Sources::default();
        let first = table.source(address(1));
        let sources: Vec<_> = (2..=1_024)
            .map(|host| table.source(address(host)))
            .collect();
        assert_eq!(table.address(first), Some(address(1)));
        assert_eq!(table.address(sources[0]), Some(address(2)));
        assert_eq!(table.source(address(1)), first);
        let newest = table.source(address(2_000));
        assert_eq!(table.address(first), None);
        assert_eq!(table.address(sources[0]), Some(address(2)));
        assert_eq!(table.address(newest), Some(address(2_000)));
    }

    #[test]
    fn many_ports_of_one_address_are_one_host() {
        let mut table = Sources::default();
        let other = table.source(address(1));
        let mut sources = (1..=u16::MAX).map(|port| {
            let mut address = address(2);
            address.set_port(port);
            let source = table.source(address);
            assert_eq!(table.address(source), Some(address));
            source
        });
        let first = sources.next().unwrap();
        assert!(sources.all(|source| source.host == first.host && source != first));
        assert_eq!(table.address(other), Some(address(1)));
    }

    #[test]
    fn host_keeps_its_number_while_it_has_a_drone() {
        let mut table = Sources::default();
        let home = table.source(address(1));
        table.add_drone(address(1));
        let add_others = |table: &mut Sources| {
            for host in 2..3_000 {
                table.source(address(host));
            }
        };
        add_others(&mut table);
        assert_eq!(table.source(address(1)), home);
        assert_eq!(table.address(home), Some(address(1)));
        assert_eq!(table.hosts.len(), HOSTS_MAX + 1);
        table.remove_drone(address(1));
        assert_ne!(table.source(address(1)), home);
        add_others(&mut table);
        assert_eq!(table.hosts.len(), HOSTS_MAX);
        assert_eq!(table.addresses.len(), HOSTS_MAX);
    }

    #[test]
    fn host_numbers_wrap_around_without_collision() {
        let mut table = Sources {
            last_number: u16::MAX - 2,
            ..Sources::default()
        };
        let sources: Vec<_> = (1..=5)
            .map(|host| (table.source(address(host)), host))
            .collect();
        for (source, host) in sources {
            assert_eq!(table.address(source), Some(address(host)));
        }
    }
}
