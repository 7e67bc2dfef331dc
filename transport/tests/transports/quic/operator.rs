//! Connections of an operator with a drone.

use std::sync::Arc;

use muster_machines::identity::NodeId;
use muster_transport::quic::{Operator, OperatorError, Refusal};
use tokio::time::timeout;

use super::fleet::Fleet;
use super::{Addresses, End, TIMEOUT};

/// Exceeds the windows of a connection.
const LARGE: usize = 1_000_000;

fn drone(fleet: &Fleet, addresses: &Addresses) -> End {
    addresses.open(fleet, 2, &[])
}

#[test]
fn operator_and_drone_exchange_large_data_over_streams() {
    let (fleet, addresses) = (Fleet::new(), Addresses::free());
    let mut drone = drone(&fleet, &addresses);
    let mut streams = drone.transport.streams().unwrap();
    assert!(drone.transport.streams().is_none(), "taken once");
    drone.runtime.spawn(async move {
        while let Some(mut stream) = streams.recv().await {
            let received = stream.read_to_end(LARGE).await.unwrap();
            stream.write(&received).await.unwrap();
            stream.finish();
        }
    });
    let exchange = async {
        let operator = Operator::connect(addresses.of(2), fleet.operator())
            .await
            .unwrap();
        assert_eq!(operator.drone(), NodeId(2));
        for len in [0, 1, LARGE] {
            let sent: Vec<u8> = (0..=255).cycle().take(len).collect();
            let mut stream = operator.open().await.unwrap();
            stream.write(&sent).await.unwrap();
            stream.finish();
            assert_eq!(stream.read_to_end(LARGE).await.unwrap(), sent);
        }
        operator.end().await;
    };
    let exchange = async { timeout(TIMEOUT, exchange).await };
    drone.runtime.block_on(exchange).unwrap();
    assert_eq!(drone.connections().open, 0, "an operator is not counted");
    assert!(drone.connections().refused.is_empty());
}

#[test]
fn operator_without_the_fleets_key_is_refused() {
    let (fleet, addresses) = (Fleet::new(), Addresses::free());
    let drone = drone(&fleet, &addresses);
    let other_fleet = Fleet::of(2);
    // Another fleet's operator that trusts this fleet's drones, and a drone of this fleet.
    for identities in [fleet.with_key_of(&other_fleet, 0), fleet.identities(1)] {
        let refused = drone.runtime.block_on(async {
            let operator = Operator::connect(addresses.of(2), identities)
                .await
                .unwrap();
            // The drone authenticates first and checks the operator last.
            let mut stream = operator.open().await.unwrap();
            stream.read_to_end(LARGE).await
        });
        assert!(refused.is_err());
    }
    let refused = drone.connections().refused;
    assert_eq!(refused.get(&Refusal::Stranger), Some(&1), "{refused:?}");
    assert_eq!(refused.get(&Refusal::Unfinished), Some(&1), "{refused:?}");
}

#[test]
fn operator_refuses_strangers_and_reports_missing_answers() {
    let (fleet, addresses) = (Fleet::new(), Addresses::free());
    let drone = drone(&fleet, &addresses);
    let connect = |id, operator| {
        let connected = Operator::connect(addresses.of(id), operator);
        drone.runtime.block_on(connected).map(drop).unwrap_err()
    };
    let other_fleet = Fleet::of(2).operator();
    let refused = connect(2, Arc::clone(&other_fleet));
    let OperatorError::Untrusted { refusal, .. } = refused else {
        panic!("{refused}");
    };
    assert_eq!(refusal, Refusal::Stranger);
    let refused = connect(3, other_fleet);
    assert!(matches!(refused, OperatorError::NoAnswer(_)), "{refused}");
}
