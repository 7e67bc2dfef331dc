//! What every transport promises. A transport is tried by implementing [`Network`] and naming it in [`promises`].

use bytes::Bytes;
use muster_machines::identity::NodeId;
use muster_transport::{Arrival, Destination, Outcome, SendError};

/// The largest datagram of the networks that are tried, in bytes.
pub(crate) const DATAGRAM_MAX: usize = 1_472;

/// Four drones that all hear each other and lose nothing, on one transport.
pub(crate) trait Network {
    /// One drone sends.
    fn send(&mut self, from: NodeId, to: Destination, datagram: &Bytes) -> Result<(), SendError>;

    /// All that comes of what was sent so far, in the order in which each drone gets it.
    fn arrivals(&mut self) -> Vec<Arrival>;

    /// What senders were told of their datagrams for one drone, up to the last [`Self::arrivals`].
    fn outcomes(&mut self) -> Vec<Outcome>;

    /// A drone takes in where another is to be found.
    fn learn(&mut self, drone: NodeId, arrival: &Arrival, sender: NodeId);
}

const ALL: [NodeId; 4] = [NodeId(0), NodeId(1), NodeId(2), NodeId(3)];

/// Makes a test of each promise for a network.
macro_rules! promises {
    ($network:expr) => {
        #[test]
        fn what_is_for_all_comes_to_each_other_drone_once_and_unaltered() {
            crate::suite::comes_to_all($network);
        }

        #[test]
        fn what_is_for_one_drone_comes_to_it() {
            crate::suite::comes_to_one($network);
        }

        #[test]
        fn what_is_for_a_drone_that_was_found_comes_to_it() {
            crate::suite::comes_to_one_that_was_found($network);
        }

        #[test]
        fn datagrams_of_any_size_up_to_the_largest_arrive_whole() {
            crate::suite::arrives_whole($network);
        }

        #[test]
        fn what_is_too_long_is_refused_and_nothing_sent() {
            crate::suite::refuses_what_is_too_long($network);
        }

        #[test]
        fn nobody_else_sends_for_a_drone() {
            crate::suite::refuses_strangers($network);
        }
    };
}
pub(crate) use promises;

fn receivers(arrivals: &[Arrival]) -> Vec<u32> {
    let mut receivers: Vec<_> = arrivals.iter().map(|arrival| arrival.to.0).collect();
    receivers.sort_unstable();
    receivers
}

pub(crate) fn comes_to_all(mut network: impl Network) {
    let datagram = Bytes::from_static(b"for all of you");
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

pub(crate) fn comes_to_one(mut network: impl Network) {
    let datagram = Bytes::from_static(b"for you");
    let to = Destination::To(NodeId(2));
    assert_eq!(network.send(NodeId(0), to, &datagram), Ok(()));
    let arrivals = network.arrivals();
    let own: Vec<_> = arrivals.iter().filter(|it| it.to == NodeId(2)).collect();
    assert_eq!(own.len(), 1, "others may overhear it: {arrivals:?}");
    assert_eq!(own[0].datagram, datagram);
}

pub(crate) fn comes_to_one_that_was_found(mut network: impl Network) {
    let datagram = Bytes::from_static(b"here I am");
    let sent = network.send(NodeId(2), Destination::Broadcast, &datagram);
    assert_eq!(sent, Ok(()));
    for arrival in network.arrivals() {
        network.learn(arrival.to, &arrival, NodeId(2));
    }
    comes_to_one(network);
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

pub(crate) fn refuses_what_is_too_long(mut network: impl Network) {
    let (len, max) = (DATAGRAM_MAX + 1, DATAGRAM_MAX);
    let datagram = Bytes::from(vec![7; len]);
    let sent = network.send(NodeId(0), Destination::Broadcast, &datagram);
    assert_eq!(sent, Err(SendError::TooLong { len, max }));
    assert_eq!(network.arrivals(), []);
}

pub(crate) fn refuses_strangers(mut network: impl Network) {
    let stranger = NodeId(4);
    let datagram = Bytes::from_static(b"let me in");
    let sent = network.send(stranger, Destination::Broadcast, &datagram);
    assert_eq!(sent, Err(SendError::UnknownSender(stranger)));
    assert_eq!(network.arrivals(), []);
}
