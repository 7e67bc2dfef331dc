//! Drones that have left the swarm.

use super::*;

/// Longer than both policies' time to live.
const LONG: Duration = Duration::from_secs(25);

fn leave(net: &mut Net, at: impl IntoIterator<Item = usize>) {
    for id in at {
        net.input(id, Input::Leave);
    }
    net.run(LONG);
}

#[test]
fn drones_that_have_left_send_messages_over_several_hops_and_little_else() {
    for (config, seed) in [(tree_config as fn(_, _) -> _, 5), (flood_config, 6)] {
        let mut net = Net::line(4, 1, config, seed);
        leave(&mut net, 0..4);
        let frames = |net: &Net| net.nodes.iter().map(|node| node.frames).sum::<usize>();
        let before = frames(&net);
        net.run(60 * SECOND);
        // Three presence frames in a time to live, of 10 s and 5 s.
        let sent = frames(&net) - before;
        assert!((4 * 17..=4 * 37).contains(&sent), "{sent}");
        net.send(3, 1, Destination::Drone(NodeId(0)), b"far");
        net.run(3 * SECOND);
        net.send(0, 2, Destination::Drone(NodeId(3)), b"back");
        net.submit(1, 3, Destination::All, Reliability::BestEffort, b"all");
        net.run(3 * SECOND);
        assert_eq!(net.payloads(0), [&b"far"[..], b"all"]);
        let mut got = net.payloads(3);
        got.sort_unstable();
        assert_eq!(got, [&b"all"[..], b"back"]);
        assert!(is_outcome(&net, 3, &[(1, Outcome::Delivered)]));
        assert!(is_outcome(&net, 0, &[(2, Outcome::Delivered)]));
    }
}

#[test]
fn drone_that_has_left_follows_no_leader_and_hands_its_protocol_messages_only() {
    let mut net = line(7);
    leave(&mut net, [3]);
    let notices = net.nodes[3].notices;
    net.input(2, Input::Lead(leader(9, 2)));
    net.input(3, Input::Lead(leader(10, 3)));
    net.input(3, Input::TopologyChanges);
    net.input(3, Input::Resync);
    net.run(LONG);
    assert_eq!(net.nodes[3].notices, notices);
    net.submit(
        2,
        1,
        Destination::Neighbours,
        Reliability::BestEffort,
        b"near",
    );
    net.run(SECOND);
    assert_eq!(net.payloads(3), [&b"near"[..]]);
}

#[test]
fn member_reaches_a_drone_that_has_left_and_has_spoken_and_one_behind_it() {
    let mut net = line(8);
    leave(&mut net, [3, 4]);
    net.send(4, 1, Destination::Drone(NodeId(0)), b"here");
    net.run(3 * SECOND);
    net.send(0, 2, Destination::Drone(NodeId(4)), b"heard");
    net.send(FARTHEST, 3, Destination::Drone(NodeId(0)), b"past them");
    net.run(5 * SECOND);
    let mut got = net.payloads(0);
    got.sort_unstable();
    assert_eq!(got, [&b"here"[..], b"past them"]);
    assert_eq!(net.payloads(4), [&b"heard"[..]]);
    assert!(is_outcome(&net, 0, &[(2, Outcome::Delivered)]));
}

#[test]
fn drone_that_has_left_and_lands_sends_nothing_more() {
    let mut net = line(9);
    leave(&mut net, 0..=FARTHEST);
    net.input(2, Input::Land);
    net.input(2, Input::Stop);
    let frames = net.nodes[2].frames;
    net.send(2, 1, Destination::Leader, b"too late");
    net.run(LONG);
    assert_eq!(net.nodes[2].frames, frames);
    let stopped = Outcome::Dropped(DropReason::Stopped);
    assert!(is_outcome(&net, 2, &[(1, stopped)]));
}
