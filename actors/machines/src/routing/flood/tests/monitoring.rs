//! How a master notices members that fall silent.

use super::*;

/// A master that starts discovery after 1 s.
fn discovering_master() -> FloodRouting {
    let mut master = routing(0);
    let input = Input::Lead(MASTER);
    stimulate(&mut master, Timestamp::ZERO, Stimulus::Input(input));
    stimulate(&mut master, at(1.0), Stimulus::Input(Input::Discover));
    master
}

/// The second after `from` at which a master first reports silent members.
fn first_silence_s(master: &mut FloodRouting, from: u32) -> Option<u32> {
    (from..40).find(|second| {
        let sent = wait(master, at(f64::from(*second))).notices;
        sent.iter().any(|it| matches!(it, Notice::Silent(_)))
    })
}

#[test]
fn members_get_one_more_time_to_live_after_hop_update() {
    // The master's routes are up at once, because it has heard no neighbour.
    assert_eq!(
        first_silence_s(&mut discovering_master(), 9),
        Some(9 + 5 + 5 + 1)
    );
}

#[test]
fn dropped_routes_leave_members_the_time_for_their_hop_update() {
    let mut master = discovering_master();
    let sent = wait(&mut master, at(9.5)).notices;
    assert!(sent.contains(&Notice::RoutesReady), "{sent:?}");
    stimulate(
        &mut master,
        at(9.5),
        Stimulus::Input(Input::TopologyChanges),
    );
    assert_eq!(first_silence_s(&mut master, 10), Some(9 + 5 + 5 + 1));
}

#[test]
fn members_silent_before_discovery_are_expected_after_it() {
    let config = Config {
        monitors_before_routes: true,
        ..config(0)
    };
    let mut master = with(config, Timestamp::ZERO, None);
    let input = Input::Lead(MASTER);
    stimulate(&mut master, Timestamp::ZERO, Stimulus::Input(input));
    let member = Member {
        id: NodeId(2),
        number: 1,
        acknowledged: 0,
        out_of_range: false,
        landing: false,
    };
    let sent = Flood {
        members: vec![member],
        ..flood(0, 0)
    };
    receive(&mut master, at(0.5), 2, &Packet::Flood(sent));
    let is_silent = |sent: &[Notice]| sent.iter().any(|it| matches!(it, Notice::Silent(_)));
    assert!(is_silent(&wait(&mut master, at(6.0)).notices));
    stimulate(&mut master, at(6.5), Stimulus::Input(Input::Discover));
    // Hop update ends at once, because the master has heard no neighbour meanwhile.
    let sent = wait(&mut master, at(14.5)).notices;
    assert!(sent.contains(&Notice::RoutesReady), "{sent:?}");
    let returned = |it: &Notice| matches!(it, Notice::Returned(who) if who.contains(NodeId(2)));
    assert!(sent.iter().any(returned), "{sent:?}");
    assert!(!is_silent(&wait(&mut master, at(24.0)).notices));
    assert!(is_silent(&wait(&mut master, at(25.0)).notices));
}

#[test]
fn master_hears_a_member_itself_if_its_parent_forwards_nothing() {
    let mut master = discovering_master();
    let mut heard_at = None;
    for second in 9..40_u32 {
        let now = at(f64::from(second));
        let is_missed = |it: &Notice| matches!(it, Notice::Silent(who) if who.contains(NodeId(2)));
        assert!(
            !wait(&mut master, now).notices.iter().any(is_missed),
            "after {second} s"
        );
        let member = Member {
            id: NodeId(2),
            number: second,
            acknowledged: 0,
            out_of_range: true,
            landing: false,
        };
        let sent = Flood {
            parent: Some(NodeId(1)),
            members: vec![member],
            ..flood(0, 0)
        };
        let is_reached = |it: &Event| {
            matches!(
                it,
                Event::Reached {
                    member: NodeId(2),
                    ..
                }
            )
        };
        let events = receive(&mut master, now, 2, &Packet::Flood(sent)).events;
        heard_at = heard_at.or(events.iter().any(is_reached).then_some(second));
    }
    // Routes are up after 9 s, and members are expected within two times to live: half of one after the first.
    assert_eq!(heard_at, Some(17));
}
