//! The contract of all transports. A transport is tested by implementing [`Network`] and passing it to [`contract_tests`].

use bytes::Bytes;
use muster_machines::identity::NodeId;
use muster_transport::{Arrival, Destination, Outcome, SendError};

/// Largest datagram of the tested networks, in bytes.
pub(crate) const DATAGRAM_MAX: usize = 1_472;

/// Four drones in reach of each other without losses, on one transport.
pub(crate) trait Network {
    /// Sends a datagram.
    fn send(&mut self, from: NodeId, to: Destination, datagram: &Bytes) -> Result<(), SendError>;

    /// All arrivals of the datagrams sent so far, in the order of arrival at each drone.
    fn arrivals(&mut self) -> Vec<Arrival>;

    /// The outcomes reported up to the last call of [`Self::arrivals`].
    fn outcomes(&mut self) -> Vec<Outcome>;

    /// A drone learns the address of the sender.
    fn learn(&mut self, drone: NodeId, arrival: &Arrival, sender: NodeId);
}

const ALL: [NodeId; 4] = [NodeId(0), NodeId(1), NodeId(2), NodeId(3)];

/// Generates the tests of the contract for a network.
macro_rules! contract_tests {
    ($network:expr) => {
        #[test]
        fn broadcast_reaches_each_other_drone_once_and_unaltered() {
            crate::suite::broadcast_reaches_all($network);
        }

        #[test]
        fn unicast_reaches_its_drone() {
            crate::suite::unicast_arrives($network);
        }

        #[test]
        fn unicast_to_a_learned_address_reaches_its_drone() {
            crate::suite::unicast_to_learned_address_arrives($network);
        }

        #[test]
        fn datagrams_of_any_accepted_size_arrive_whole() {
            crate::suite::arrives_whole($network);
        }

        #[test]
        fn too_long_datagram_is_refused_and_not_sent() {
            crate::suite::refuses_too_long_datagrams($network);
        }

        #[test]
        fn unknown_sender_is_refused() {
            crate::suite::refuses_unknown_senders($network);
        }
    };
}
pub(crate) use contract_tests;

fn receivers(arrivals: &[Arrival]) -> Vec<u32> {
    let mut receivers: Vec<_> = arrivals.iter().map(|arrival| arrival.to.0).collect();
    receivers.sort_unstable();
    receivers
}

pub(crate) fn broadcast_reaches_all(mut network: impl Network) {
    let datagram = Bytes::from_static(b"broadcast");
    for from in ALL {
        let sent = network.send(from, Destination::Broadcast, &datagram);
        assert_eq!(sent, Ok(()));
        let arrivals = network.arrivals();
        let others: Vec<u32> = (0..4).filter(|id| *id != from.0).collect();
        assert_eq!(receivers(&arrivals), others);
        assert!(arrivals.iter().all(|it| it.datagram == datagram));
    }
    assert_eq!(network.outcomes(), []);
}

pub(crate) fn unicast_arrives(mut network: impl Network) {
    let datagram = Bytes::from_static(b"unicast");
    let to = Destination::To(NodeId(2));
    assert_eq!(network.send(NodeId(0), to, &datagram), Ok(()));
    let arrivals = network.arrivals();
    let own: Vec<_> = arrivals.iter().filter(|it| it.to == NodeId(2)).collect();
    assert_eq!(own.len(), 1, "others may overhear it: {arrivals:?}");
    assert_eq!(own[0].datagram, datagram);
}

pub(crate) fn unicast_to_learned_address_arrives(mut network: impl Network) {
    let datagram = Bytes::from_static(b"hello");
    let sent = network.send(NodeId(2), Destination::Broadcast, &datagram);
    assert_eq!(sent, Ok(()));
    for arrival in network.arrivals() {
        network.learn(arrival.to, &arrival, NodeId(2));
    }
    unicast_arrives(network);
}

pub(crate) fn arrives_whole(mut network: impl Network) {
    for len in [1, 64, 1_000, DATAGRAM_MAX] {
        let bytes = (0_u8..=255).cycle().take(len);
        let datagram: Bytes = bytes.collect::<Vec<_>>().into();
        let sent = network.send(NodeId(1), Destination::Broadcast, &datagram);
        assert_eq!(sent, Ok(()));
        let arrivals = network.arrivals();
        assert_eq!(receivers(&arrivals), [0, 2, 3]);
        assert!(arrivals.iter().all(|it| it.datagram == datagram));
    }
}

pub(crate) fn refuses_too_long_datagrams(mut network: impl Network) {
    let (len, max) = (DATAGRAM_MAX + 1, DATAGRAM_MAX);
    let datagram = Bytes::from(vec![7; len]);
    let sent = network.send(NodeId(0), Destination::Broadcast, &datagram);
    assert_eq!(sent, Err(SendError::TooLong { len, max }));
    assert_eq!(network.arrivals(), []);
}

pub(crate) fn refuses_unknown_senders(mut network: impl Network) {
    let stranger = NodeId(4);
    let datagram = Bytes::from_static(b"unknown sender");
    let sent = network.send(stranger, Destination::Broadcast, &datagram);
    assert_eq!(sent, Err(SendError::UnknownSender(stranger)));
    assert_eq!(network.arrivals(), []);
}
