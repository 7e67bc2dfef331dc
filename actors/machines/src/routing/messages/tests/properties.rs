use proptest::prelude::*;

use super::*;

fn any_destination() -> impl Strategy<Value = Destination> {
    prop_oneof![
        Just(Destination::Leader),
        Just(Destination::All),
        Just(Destination::Neighbours),
        (0_u32..6).prop_map(|id| Destination::Drone(NodeId(id))),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn each_message_arrives_at_most_once_and_if_acknowledged_once_or_is_reported(
        seed: u64,
        loss in 0.0..0.5_f64,
        duplicate in 0.0..0.3_f64,
        delay_ms in 1_u64..60,
        (reach, is_flood, reports) in (1_usize..4, any::<bool>(), any::<bool>()),
        messages in prop::collection::vec((0_usize..6, any_destination(), any::<bool>(), 0_u64..400, 0_usize..3_000), 1..30),
    ) {
        let config = if is_flood { flood_config } else { tree_config };
        let mut net = Net::line(6, reach, config, seed);
        net.faults = Faults { loss, duplicate, delay: Duration::from_millis(delay_ms), reports };
        let mut sent = Vec::new();
        for (id, (at, to, is_acknowledged, pause_ms, length)) in (0_u32..).zip(messages) {
            let is_for_many = matches!(to, Destination::All | Destination::Neighbours);
            let length = if is_for_many { length % 1_000 } else { length };
            let mut payload = id.to_le_bytes().to_vec();
            payload.resize(4 + length, 0);
            let is_acknowledged = is_acknowledged && to != Destination::All;
            let reliability = if is_acknowledged { Reliability::Acknowledged } else { Reliability::BestEffort };
            net.submit(at, id, to, reliability, &payload);
            sent.push((id, at, to, is_acknowledged, Bytes::from(payload)));
            net.run(Duration::from_millis(pause_ms));
        }
        net.run(40 * SECOND);
        for (id, at, to, is_acknowledged, payload) in sent {
            let copies: Vec<_> = (0..6).map(|at| net.payloads(at).iter().filter(|it| **it == payload).count()).collect();
            prop_assert!(copies.iter().all(|copies| *copies <= 1), "message {} to {:?}: {:?}", id, to, copies);
            let outcomes: Vec<_> = net.nodes[at].outcomes.iter().filter(|it| it.0 == id).collect();
            prop_assert!(outcomes.len() <= 1);
            if is_acknowledged {
                prop_assert_eq!(outcomes.len(), 1, "message {} has an outcome", id);
                let receiver = match to {
                    Destination::Leader => Some(0),
                    Destination::Drone(id) => Some(id.0 as usize),
                    _ => None,
                };
                if let (Some(receiver), Outcome::Delivered) = (receiver, outcomes[0].1) {
                    prop_assert_eq!(copies[receiver], 1, "message {} was acknowledged", id);
                }
            }
        }
    }
}
