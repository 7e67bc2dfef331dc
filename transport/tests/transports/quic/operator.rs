//! An operator, who has the fleet's own key, and a drone.

use std::sync::Arc;

use muster_machines::identity::NodeId;
use muster_transport::quic::{Operator, OperatorError, Refusal};
use tokio::time::timeout;

use super::fleet::Fleet;
use super::{End, PATIENCE, Places};

/// More than waits on its way at once.
const LARGE: usize = 1_000_000;

fn drone(fleet: &Fleet, places: &Places) -> End {
    places.open(fleet, 2, &[])
}

#[test]
fn an_operator_and_a_drone_have_streams_for_what_is_large() {
    let (fleet, places) = (Fleet::new(), Places::free());
    let mut drone = drone(&fleet, &places);
    let mut streams = drone.transport.streams().unwrap();
    assert!(drone.transport.streams().is_none(), "they are for one");
    drone.runtime.spawn(async move {
        while let Some(mut stream) = streams.recv().await {
            let asked = stream.read_to_end(LARGE).await.unwrap();
            stream.write(&asked).await.unwrap();
            stream.finish();
        }
    });
    let spoken = async {
        let operator = Operator::connect(places.of(2), fleet.operator())
            .await
            .unwrap();
        assert_eq!(operator.drone(), NodeId(2));
        for len in [0, 1, LARGE] {
            let said: Vec<u8> = (0..=255).cycle().take(len).collect();
            let mut stream = operator.open().await.unwrap();
            stream.write(&said).await.unwrap();
            stream.finish();
            assert_eq!(stream.read_to_end(LARGE).await.unwrap(), said);
        }
        operator.end().await;
    };
    let spoken = async { timeout(PATIENCE, spoken).await };
    drone.runtime.block_on(spoken).unwrap();
    assert_eq!(drone.connections().open, 0, "an operator is no drone");
    assert!(drone.connections().refused.is_empty());
}

#[test]
fn who_has_not_the_fleets_own_key_is_no_operator() {
    let (fleet, places) = (Fleet::new(), Places::free());
    let drone = drone(&fleet, &places);
    let theirs = Fleet::of(2);
    // Another fleet's operator who believes this one's drones, and a drone of this fleet.
    for identities in [fleet.with_key_of(&theirs, 0), fleet.identities(1)] {
        let refused = drone.runtime.block_on(async {
            let operator = Operator::connect(places.of(2), identities).await.unwrap();
            // A drone proves its key first, and is convinced last.
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
fn an_operator_speaks_with_no_stranger_nor_with_nobody() {
    let (fleet, places) = (Fleet::new(), Places::free());
    let drone = drone(&fleet, &places);
    let connect = |place, operator| {
        let connected = Operator::connect(places.of(place), operator);
        drone.runtime.block_on(connected).map(drop).unwrap_err()
    };
    let theirs = Fleet::of(2).operator();
    let refused = connect(2, Arc::clone(&theirs));
    let OperatorError::NotBelieved { refusal, .. } = refused else {
        panic!("{refused}");
    };
    assert_eq!(refusal, Refusal::Stranger);
    let refused = connect(3, theirs);
    assert!(matches!(refused, OperatorError::Silent(_)), "{refused}");
}
