use super::*;

#[test]
fn message_expires_in_a_partition() {
    let mut net = line(5);
    net.connect(3, 4, false);
    net.send(FARTHEST, 1, Destination::Leader, b"cut off");
    net.submit(
        6,
        2,
        Destination::Leader,
        Reliability::BestEffort,
        b"cut off",
    );
    net.run(31 * SECOND);
    assert!(net.nodes[0].got.is_empty());
    assert!(is_outcome(&net, FARTHEST, &[(1, Outcome::Expired)]));
}

#[test]
fn message_survives_a_short_partition() {
    let mut net = line(6);
    net.connect(3, 4, false);
    net.send(FARTHEST, 1, Destination::Leader, b"late");
    net.run(8 * SECOND);
    net.connect(3, 4, true);
    net.run(20 * SECOND);
    assert_eq!(net.payloads(0), [&b"late"[..]]);
    assert!(is_outcome(&net, FARTHEST, &[(1, Outcome::Delivered)]));
}

#[test]
fn message_goes_around_a_relay_that_fails() {
    for reports in [false, true] {
        let mut net = Net::line(8, 2, tree_config, 7);
        net.faults.reports = reports;
        for id in 0..20 {
            if id == 3 {
                net.kill(4);
            }
            net.send(FARTHEST, id, Destination::Leader, &[id as u8]);
            net.run(SECOND / 4);
        }
        net.run(20 * SECOND);
        assert_eq!(net.payloads(0).len(), 20);
        assert!(
            net.nodes[FARTHEST]
                .outcomes
                .iter()
                .all(|(_, it)| *it == Outcome::Delivered)
        );
    }
}

#[test]
fn messages_to_the_leader_go_to_the_new_one() {
    let mut net = Net::line(8, 2, tree_config, 8);
    net.kill(0);
    net.send(FARTHEST, 1, Destination::Leader, b"to whom?");
    net.run(SECOND);
    net.input(1, Input::Lead(leader(2, 1)));
    net.run(10 * SECOND);
    assert_eq!(net.payloads(1), [&b"to whom?"[..]]);
    assert!(is_outcome(&net, FARTHEST, &[(1, Outcome::Delivered)]));
}

#[test]
fn restarted_relay_loses_no_acknowledged_message() {
    let mut net = line(9);
    for id in 0..12 {
        net.send(FARTHEST, id, Destination::Leader, &[id as u8]);
        if id % 4 == 0 {
            net.restart(3);
        }
        net.run(SECOND / 100);
    }
    net.run(29 * SECOND);
    let mut got = net.payloads(0);
    got.sort_unstable();
    assert_eq!(got.len(), 12);
    assert_eq!(net.nodes[FARTHEST].outcomes.len(), 12);
}

#[test]
fn large_message_arrives_whole_in_spite_of_losses() {
    let mut net = Net::line(4, 1, tree_config, 10);
    net.faults = Faults::loss(0.2);
    let large: Vec<u8> = (0..100_000_u32).map(|it| (it % 251) as u8).collect();
    net.send(3, 1, Destination::Leader, &large);
    net.send(3, 2, Destination::Leader, b"small");
    net.run(30 * SECOND);
    let got = net.payloads(0);
    assert_eq!(got.len(), 2);
    assert_eq!(
        got[0],
        &b"small"[..],
        "a small message overtakes the pieces"
    );
    assert!(got[1] == large);
    assert!(is_outcome(
        &net,
        3,
        &[(2, Outcome::Delivered), (1, Outcome::Delivered)]
    ));
}

#[test]
fn large_message_starts_over_at_a_new_leader_and_a_restarted_receiver() {
    let mut net = Net::line(5, 2, tree_config, 11);
    let large = vec![3; 60_000];
    net.send(4, 1, Destination::Leader, &large);
    net.run(SECOND / 2);
    net.kill(0);
    net.input(1, Input::Lead(leader(2, 1)));
    net.run(10 * SECOND);
    assert!(net.payloads(1) == [large.clone()]);
    net.send(1, 2, Destination::Drone(NodeId(4)), &large);
    net.run(SECOND / 2);
    net.restart(4);
    net.run(15 * SECOND);
    assert!(net.payloads(4).ends_with(&[large.into()]));
    assert!(is_outcome(&net, 1, &[(2, Outcome::Delivered)]));
}
