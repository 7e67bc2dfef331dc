use bytes::Bytes;

use super::*;
use crate::machine::{Emitted, Stimulus, step};
use crate::routing::{Dissemination, Input, LeaderEpoch, Transmit};

type Flooding = Dissemination<FloodPolicy>;

const MASTER: Ballot = Ballot {
    term: 1,
    rank: 0,
    master: NodeId(0),
};

fn config(id: u32) -> Config {
    Config {
        id: NodeId(id),
        drones: 4,
        period: Duration::from_millis(200),
        keep_alive: Duration::from_secs(1),
        hello_period: Duration::from_millis(500),
        discovery: Duration::from_secs(8),
        stable_after: 3,
        hello_gap: Duration::from_millis(750),
        time_to_live: Duration::from_secs(5),
        misses_early: false,
    }
}

fn with(config: Config, now: Timestamp, kept: Option<(Durable, Checkpoint)>) -> Flooding {
    let core = Core::new(config.id, config.drones, 1);
    Dissemination::new(core, |core| FloodPolicy::new(config, core, now, kept))
}

fn routing(id: u32) -> Flooding {
    with(config(id), Timestamp::ZERO, None)
}

fn at(seconds: f64) -> Timestamp {
    Timestamp::from_secs_f64(seconds)
}

struct Outcome {
    sent: Vec<Packet>,
    notices: Vec<Notice>,
    events: Vec<Event>,
}

fn stimulate(routing: &mut Flooding, now: Timestamp, stimulus: Stimulus<Input>) -> Outcome {
    let mut outcome = Outcome {
        sent: Vec::new(),
        notices: Vec::new(),
        events: Vec::new(),
    };
    let Ok(_) = step(routing, now, stimulus, |said| match said {
        Emitted::Transmit(Transmit::Send { payload, .. }) => {
            outcome.sent.push(wire::decode_packet(&payload).unwrap());
        }
        Emitted::Transmit(Transmit::Inform(notice)) => outcome.notices.push(notice),
        Emitted::Event(event) => outcome.events.push(event),
    });
    outcome
}

fn hears(routing: &mut Flooding, now: Timestamp, from: u32, packet: &Packet) -> Outcome {
    hears_under(routing, now, from, MASTER, packet)
}

fn hears_under(
    routing: &mut Flooding,
    now: Timestamp,
    from: u32,
    ballot: Ballot,
    packet: &Packet,
) -> Outcome {
    let input = Input::Heard {
        sender: NodeId(from),
        ballot,
        payload: wire::encode_packet(packet).into(),
    };
    stimulate(routing, now, Stimulus::Input(input))
}

fn flood(heartbeat: u32, sequence: u32) -> Flood {
    Flood {
        hops: Some(0),
        parent: None,
        heartbeat,
        sequence,
        hears: (0..8).map(NodeId).collect(),
        members: Vec::new(),
        order: (sequence > 0).then(|| Bytes::from_static(b"order")),
    }
}

/// Lets time pass up to `until`, timer by timer.
fn wait(routing: &mut Flooding, until: Timestamp) -> Outcome {
    let mut all = Outcome {
        sent: Vec::new(),
        notices: Vec::new(),
        events: Vec::new(),
    };
    while let Some(due) = routing.policy.next_send.filter(|due| *due <= until) {
        let outcome = stimulate(routing, due, Stimulus::Timeout);
        all.sent.extend(outcome.sent);
        all.notices.extend(outcome.notices);
        all.events.extend(outcome.events);
    }
    all
}

/// Slave 1, whose neighbours 0 (the master) and 2 are stable, at the start of its hop update.
fn in_hop_update() -> (Flooding, Timestamp) {
    let mut slave = routing(1);
    for hello in 0..16_u32 {
        let now = at(0.5 * f64::from(hello));
        let remaining = Duration::from_secs(8) - Duration::from_millis(500) * hello;
        for neighbour in [0, 2] {
            hears(&mut slave, now, neighbour, &Packet::Hello { remaining });
        }
    }
    let ended = wait(&mut slave, at(8.0));
    assert!(ended.notices.contains(&Notice::HopUpdateStarted));
    (slave, at(8.0))
}

#[test]
fn a_drone_that_was_told_nothing_says_nothing() {
    let mut slave = routing(1);
    assert_eq!(slave.policy.next_send, None);
    assert!(
        stimulate(&mut slave, at(9.0), Stimulus::Timeout)
            .sent
            .is_empty()
    );
}

#[test]
fn three_hellos_in_a_row_make_a_neighbour_stable_and_a_gap_starts_anew() {
    let mut slave = routing(1);
    let remaining = Duration::from_secs(8);
    let mut stable_at = None;
    for now in [0.0, 0.5, 1.3, 1.8, 2.3] {
        let outcome = hears(&mut slave, at(now), 2, &Packet::Hello { remaining });
        if outcome.events.contains(&Event::NeighbourStable(NodeId(2))) {
            stable_at = Some(now);
        }
    }
    assert_eq!(
        stable_at,
        Some(2.3),
        "the gap of 0.8 s at 1.3 s starts the count anew"
    );
}

#[test]
fn whoever_hears_of_discovery_late_ends_with_the_others() {
    let mut slave = routing(1);
    let remaining = Duration::from_secs(3);
    let outcome = hears(&mut slave, at(5.0), 2, &Packet::Hello { remaining });
    assert!(outcome.notices.contains(&Notice::DiscoveryStarted));
    let phase = slave.policy.durable.phase;
    assert_eq!(phase, Phase::Discovery { until: at(8.0) });
}

#[test]
fn the_first_stable_neighbour_heard_becomes_the_parent() {
    let (mut slave, now) = in_hop_update();
    let hop_update = |hops| Packet::HopUpdate {
        hops,
        routing_list: vec![NodeId(1)],
    };
    hears(&mut slave, now, 3, &hop_update(0));
    assert_eq!(slave.policy.durable.routes.parent, None, "3 is not stable");
    hears(&mut slave, now, 0, &hop_update(0));
    hears(&mut slave, now, 2, &hop_update(4));
    let routes = &slave.policy.durable.routes;
    assert_eq!((routes.hops, routes.parent), (Some(1), Some(NodeId(0))));
    assert_eq!(routes.routing_list, [NodeId(1), NodeId(2)]);
    assert!(routes.relay, "it is listed, and reaches 2, which is not");
    assert!(!routes.out_of_range);
}

#[test]
fn a_hop_update_ends_once_all_stable_neighbours_are_heard_again_or_the_time_is_up() {
    let (mut slave, now) = in_hop_update();
    let hop_update = Packet::HopUpdate {
        hops: 0,
        routing_list: vec![NodeId(1)],
    };
    let outcome = hears(&mut slave, now, 0, &hop_update);
    assert!(
        !outcome.notices.contains(&Notice::RoutesReady),
        "2 is missing"
    );
    let mut patient = slave.policy.durable.clone();
    let follows = Packet::Flood(flood(1, 0));
    let outcome = hears(&mut slave, now, 2, &follows);
    assert!(
        outcome.notices.contains(&Notice::RoutesReady),
        "a follower counts as heard"
    );
    patient.phase = Phase::HopUpdate { since: now };
    let mut waiting = with(config(1), now, Some((slave.core.durable.clone(), patient)));
    let outcome = wait(&mut waiting, now + Duration::from_millis(5_400));
    assert!(outcome.notices.contains(&Notice::RoutesReady));
}

#[test]
fn only_a_master_is_told_whom_it_hears_itself_and_once_more_when_it_asks() {
    for (id, is_told) in [(0, true), (1, false)] {
        let checkpoint = Checkpoint {
            phase: Phase::Following,
            stable: vec![NodeId(2), NodeId(3)],
            ..Checkpoint::default()
        };
        let common = Durable {
            epoch: LeaderEpoch::of(MASTER),
            ..Durable::default()
        };
        let mut routing = with(config(id), Timestamp::ZERO, Some((common, checkpoint)));
        let outcome = stimulate(&mut routing, at(1.0), Stimulus::Input(Input::Resync));
        let heard = Notice::Hears([NodeId(2), NodeId(3)].into_iter().collect());
        let ready = |notice: &Notice| *notice == Notice::RoutesReady;
        let before = outcome.notices.iter().take_while(|notice| !ready(notice));
        assert_eq!(
            before.filter(|notice| **notice == heard).count() == 1,
            is_told
        );
        assert!(outcome.notices.iter().any(ready));
    }
}

#[test]
fn before_there_are_routes_everyone_repeats_everything() {
    let mut slave = routing(2);
    let member = Member {
        id: NodeId(3),
        number: 1,
        acknowledged: 1,
        out_of_range: false,
        landing: false,
    };
    let mut heard = flood(1, 1);
    heard.members.push(member);
    let outcome = hears(&mut slave, at(0.0), 1, &Packet::Flood(heard));
    assert!(matches!(
        outcome.notices[..],
        [Notice::Leader(_), Notice::Order { sequence: 1, .. }]
    ));
    let said = wait(&mut slave, at(0.2)).sent;
    let [Packet::Flood(said)] = said.as_slice() else {
        panic!("one packet a period, not {said:?}");
    };
    assert_eq!((said.heartbeat, said.sequence), (1, 1));
    assert!(said.order.is_some());
    assert_eq!(
        said.members.iter().map(|it| it.id.0).collect::<Vec<_>>(),
        [2, 3]
    );
}

#[test]
fn with_routes_only_children_are_spoken_for_and_only_a_relay_repeats_orders() {
    let (mut slave, now) = in_hop_update();
    let hop_update = Packet::HopUpdate {
        hops: 0,
        routing_list: vec![NodeId(1), NodeId(2)],
    };
    hears(&mut slave, now, 0, &hop_update);
    let member = |id, parent| {
        let mut heard = flood(0, 0);
        heard.parent = parent;
        heard.members.push(Member {
            id: NodeId(id),
            number: 9,
            acknowledged: 1,
            out_of_range: false,
            landing: false,
        });
        Packet::Flood(heard)
    };
    hears(&mut slave, now, 2, &member(2, Some(NodeId(0))));
    hears(&mut slave, now, 0, &Packet::Flood(flood(1, 1)));
    assert_eq!(slave.policy.durable.phase, Phase::Following);
    let says = |slave: &mut Flooding, until| {
        let sent = wait(slave, until).sent;
        match sent.into_iter().next_back() {
            Some(Packet::Flood(flood)) => (flood.members.len(), flood.order.is_some()),
            other => panic!("a flood should have been sent, not {other:?}"),
        }
    };
    assert_eq!(
        says(&mut slave, at(8.3)),
        (1, false),
        "a leaf speaks for itself"
    );
    hears(&mut slave, at(8.3), 3, &member(3, Some(NodeId(1))));
    assert_eq!(says(&mut slave, at(8.6)), (2, true), "a parent relays");
}

#[test]
fn a_master_is_alive_only_if_its_own_number_rises() {
    let mut slave = routing(1);
    hears(&mut slave, at(0.0), 0, &Packet::Flood(flood(7, 1)));
    let mut silent_at = None;
    for tenth in 1..80_u32 {
        let now = at(f64::from(tenth) / 10.0);
        // Another drone goes on repeating the last number that it heard.
        hears(&mut slave, now, 2, &Packet::Flood(flood(7, 1)));
        if wait(&mut slave, now)
            .notices
            .contains(&Notice::MasterSilent)
        {
            silent_at = Some(tenth);
        }
    }
    assert!((50..=53).contains(&silent_at.unwrap()), "{silent_at:?}");
    let outcome = hears(&mut slave, at(8.0), 2, &Packet::Flood(flood(8, 1)));
    assert!(outcome.notices.contains(&Notice::MasterReturned));
}

#[test]
fn an_older_ballot_and_a_stranger_are_ignored_and_a_better_ballot_is_obeyed() {
    let mut slave = routing(1);
    let newer = Ballot { term: 2, ..MASTER };
    let order = Packet::Flood(flood(1, 1));
    assert!(
        !hears_under(&mut slave, at(0.0), 0, newer, &order)
            .notices
            .is_empty()
    );
    let older = hears_under(&mut slave, at(0.1), 0, MASTER, &Packet::Flood(flood(2, 2)));
    assert_eq!(older.events, [Event::Ignored(NodeId(0))]);
    let stranger = hears_under(&mut slave, at(0.1), 4, newer, &Packet::Flood(flood(2, 2)));
    assert_eq!(stranger.events, [Event::Ignored(NodeId(4))]);
    assert_eq!(slave.core.durable.epoch.sequence(), 1);
}

#[test]
fn a_restarted_routing_never_falls_back_to_a_beat_it_used() {
    let mut slave = routing(1);
    hears(&mut slave, at(0.0), 0, &Packet::Flood(flood(1, 1)));
    let mut kept = None;
    for outcome in [wait(&mut slave, at(2.0)), wait(&mut slave, at(60.0))] {
        for event in outcome.events {
            if let Event::Checkpoint(checkpoint) = event
                && let PolicyCheckpoint::Flood(own) = checkpoint.policy
            {
                kept = Some((checkpoint.common, own));
            }
        }
    }
    let number = slave.core.durable.heartbeats.own;
    let restarted = with(config(1), at(60.0), kept);
    assert!(
        restarted.core.durable.heartbeats.own >= number,
        "{number} was used already"
    );
}

#[test]
fn a_drone_that_is_done_says_so_once_and_falls_silent() {
    let mut slave = routing(1);
    hears(&mut slave, at(0.0), 0, &Packet::Flood(flood(1, 4)));
    stimulate(
        &mut slave,
        at(0.1),
        Stimulus::Input(Input::Acknowledge {
            ballot: MASTER,
            sequence: 4,
        }),
    );
    let last = stimulate(&mut slave, at(0.1), Stimulus::Input(Input::Stop)).sent;
    let [Packet::Flood(last)] = last.as_slice() else {
        panic!("one last packet, not {last:?}");
    };
    assert_eq!(last.members[0].acknowledged, 4);
    assert_eq!(slave.policy.next_send, None);
}

#[test]
fn a_drone_whose_host_stalled_waits_a_time_to_live_more_for_its_master() {
    let mut slave = routing(1);
    hears(&mut slave, at(0.0), 0, &Packet::Flood(flood(7, 1)));
    wait(&mut slave, at(1.0));
    let woken = stimulate(&mut slave, at(30.0), Stimulus::Timeout);
    assert_eq!(woken.notices, []);
    assert_eq!(woken.sent.len(), 1, "it does not catch up");
    assert_eq!(wait(&mut slave, at(34.9)).notices, []);
    assert_eq!(wait(&mut slave, at(36.0)).notices, [Notice::MasterSilent]);
}

#[test]
fn a_master_says_that_it_lands_and_whoever_knows_its_last_order_takes_it_in() {
    let mut master = routing(0);
    stimulate(&mut master, at(0.0), Stimulus::Input(Input::Lead(MASTER)));
    stimulate(&mut master, at(0.0), Stimulus::Input(Input::Land));
    let said = wait(&mut master, at(1.0)).sent.pop().unwrap();
    let mut slave = routing(1);
    hears(&mut slave, at(1.0), 0, &Packet::Flood(flood(1, 1)));
    let told = hears(&mut slave, at(1.1), 0, &said);
    assert_eq!(told.notices, [Notice::MasterLands]);
    assert_eq!(hears(&mut slave, at(1.2), 0, &said).notices, []);
}

#[test]
fn whoever_hears_a_neighbour_without_a_way_repeats_orders_to_it() {
    let (mut slave, now) = in_hop_update();
    let hop_update = Packet::HopUpdate {
        hops: 0,
        routing_list: Vec::new(),
    };
    hears(&mut slave, now, 0, &hop_update);
    hears(&mut slave, now, 2, &Packet::Flood(flood(0, 0)));
    hears(&mut slave, now, 0, &Packet::Flood(flood(1, 1)));
    assert_eq!(slave.policy.durable.phase, Phase::Following);
    assert!(!slave.policy.durable.routes.relay);
    let lost = Flood {
        hops: None,
        ..flood(0, 0)
    };
    hears(&mut slave, at(8.1), 3, &Packet::Flood(lost));
    let sent = wait(&mut slave, at(8.4)).sent;
    let repeats = |packet: &Packet| matches!(packet, Packet::Flood(it) if it.order.is_some());
    assert!(sent.last().is_some_and(repeats), "{sent:?}");
}

#[test]
fn members_may_take_a_time_to_live_longer_than_the_master_until_their_routes_are_up() {
    let mut master = routing(0);
    let input = Input::Lead(MASTER);
    stimulate(&mut master, Timestamp::ZERO, Stimulus::Input(input));
    stimulate(&mut master, at(1.0), Stimulus::Input(Input::Discover));
    let mut silent_at = None;
    for second in 9..40_u32 {
        let now = at(f64::from(second));
        let said = wait(&mut master, now).notices;
        if said
            .iter()
            .any(|notice| matches!(notice, Notice::Silent(_)))
        {
            silent_at = Some(second);
            break;
        }
    }
    // Its own are up at once, as it has heard nobody.
    assert_eq!(silent_at, Some(9 + 5 + 5 + 1));
}

#[test]
fn who_fell_silent_before_the_ways_were_looked_for_is_waited_for_once_they_are_up() {
    let config = Config {
        misses_early: true,
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
    let said = Flood {
        members: vec![member],
        ..flood(0, 0)
    };
    hears(&mut master, at(0.5), 2, &Packet::Flood(said));
    let is_silent = |said: &[Notice]| said.iter().any(|it| matches!(it, Notice::Silent(_)));
    assert!(is_silent(&wait(&mut master, at(6.0)).notices));
    stimulate(&mut master, at(6.5), Stimulus::Input(Input::Discover));
    // The hop update ends at once, as it has heard nobody meanwhile.
    let said = wait(&mut master, at(14.5)).notices;
    assert!(said.contains(&Notice::RoutesReady), "{said:?}");
    let returned = |it: &Notice| matches!(it, Notice::Returned(who) if who.contains(NodeId(2)));
    assert!(said.iter().any(returned), "{said:?}");
    assert!(!is_silent(&wait(&mut master, at(24.0)).notices));
    assert!(is_silent(&wait(&mut master, at(25.0)).notices));
}

#[test]
fn that_the_master_lands_is_passed_on_by_whoever_knows_it() {
    let landing = Member {
        id: NodeId(0),
        number: 3,
        acknowledged: 1,
        out_of_range: false,
        landing: true,
    };
    let mut slave = routing(2);
    hears(&mut slave, at(0.0), 1, &Packet::Flood(flood(1, 1)));
    let mut heard = flood(2, 1);
    heard.members = vec![landing];
    let told = hears(&mut slave, at(0.1), 0, &Packet::Flood(heard));
    assert!(told.notices.contains(&Notice::MasterLands));
    let said = wait(&mut slave, at(0.4)).sent;
    let Some(said @ Packet::Flood(_)) = said.last() else {
        panic!("a flood should have been sent, not {said:?}");
    };
    let mut other = routing(3);
    hears(&mut other, at(0.0), 1, &Packet::Flood(flood(1, 1)));
    let told = hears(&mut other, at(0.5), 2, said);
    assert!(told.notices.contains(&Notice::MasterLands));
}
