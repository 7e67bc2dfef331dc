mod discovery;
mod monitoring;

use bytes::Bytes;

use super::*;
use crate::machine::{Emitted, Stimulus, step};
use crate::routing::{Dissemination, Input, LeaderEpoch, Transmit};

type FloodRouting = Dissemination<FloodPolicy>;

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
        monitors_before_routes: false,
    }
}

fn with(config: Config, now: Timestamp, checkpoint: Option<(Durable, Checkpoint)>) -> FloodRouting {
    let shared = SharedState::new(config.id, config.drones, 1);
    Dissemination::new(shared, |shared| {
        FloodPolicy::new(config, shared, now, checkpoint)
    })
}

fn routing(id: u32) -> FloodRouting {
    with(config(id), Timestamp::ZERO, None)
}

fn at(seconds: f64) -> Timestamp {
    Timestamp::from_secs_f64(seconds)
}

struct Outputs {
    sent: Vec<Packet>,
    notices: Vec<Notice>,
    deaf: Option<NodeSet>,
    events: Vec<Event>,
}

fn stimulate(routing: &mut FloodRouting, now: Timestamp, stimulus: Stimulus<Input>) -> Outputs {
    let mut outputs = Outputs {
        sent: Vec::new(),
        notices: Vec::new(),
        deaf: None,
        events: Vec::new(),
    };
    step(routing, now, stimulus, |emitted| match emitted {
        Emitted::Transmit(Transmit::Send { payload, .. }) => {
            outputs
                .sent
                .push(wire::decode_packet(&payload.into()).unwrap());
        }
        Emitted::Transmit(Transmit::Inform(notice)) => outputs.notices.push(notice),
        Emitted::Transmit(Transmit::Deaf(deaf)) => outputs.deaf = Some(deaf),
        Emitted::Event(event) => outputs.events.push(event),
    });
    outputs
}

fn receive(routing: &mut FloodRouting, now: Timestamp, from: u32, packet: &Packet) -> Outputs {
    receive_under(routing, now, from, MASTER, packet)
}

fn receive_under(
    routing: &mut FloodRouting,
    now: Timestamp,
    from: u32,
    ballot: Ballot,
    packet: &Packet,
) -> Outputs {
    let input = Input::Received {
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

/// Runs all timers up to `until`.
fn wait(routing: &mut FloodRouting, until: Timestamp) -> Outputs {
    let mut all = Outputs {
        sent: Vec::new(),
        notices: Vec::new(),
        deaf: None,
        events: Vec::new(),
    };
    while let Some(due) = routing.policy.next_send.filter(|due| *due <= until) {
        let outputs = stimulate(routing, due, Stimulus::Timeout);
        all.sent.extend(outputs.sent);
        all.notices.extend(outputs.notices);
        all.deaf = outputs.deaf.or(all.deaf);
        all.events.extend(outputs.events);
    }
    all
}

/// Drone 1 at the start of its hop update. Its stable neighbours are 0, the master, and 2.
fn in_hop_update() -> (FloodRouting, Timestamp) {
    let mut drone = routing(1);
    for hello in 0..16_u32 {
        let now = at(0.5 * f64::from(hello));
        let remaining = Duration::from_secs(8) - Duration::from_millis(500) * hello;
        for neighbour in [0, 2] {
            receive(&mut drone, now, neighbour, &Packet::Hello { remaining });
        }
    }
    let ended = wait(&mut drone, at(8.0));
    assert!(ended.notices.contains(&Notice::HopUpdateStarted));
    (drone, at(8.0))
}

#[test]
fn neighbour_that_does_not_list_this_drone_is_deaf_until_it_does() {
    let mut drone = routing(1);
    let deaf = Packet::Flood(Flood {
        hears: NodeSet::from(NodeId(0)),
        ..flood(1, 0)
    });
    assert_eq!(
        receive(&mut drone, at(0.0), 0, &Packet::Flood(flood(1, 0))).deaf,
        None
    );
    assert_eq!(
        receive(&mut drone, at(0.1), 2, &deaf).deaf,
        Some(NodeId(2).into())
    );
    assert_eq!(
        wait(&mut drone, at(1.0)).deaf,
        Some(NodeId(2).into()),
        "repeated"
    );
    let hears = Packet::Flood(flood(2, 0));
    assert_eq!(
        receive(&mut drone, at(1.0), 2, &hears).deaf,
        Some(NodeSet::new())
    );
    assert_eq!(wait(&mut drone, at(2.0)).deaf, None);
}

#[test]
fn drone_without_leader_sends_nothing() {
    let mut drone = routing(1);
    assert_eq!(drone.policy.next_send, None);
    assert!(
        stimulate(&mut drone, at(9.0), Stimulus::Timeout)
            .sent
            .is_empty()
    );
}

#[test]
fn without_routes_every_drone_repeats_everything() {
    let mut drone = routing(2);
    let member = Member {
        id: NodeId(3),
        number: 1,
        acknowledged: 1,
        out_of_range: false,
        landing: false,
    };
    let mut received = flood(1, 1);
    received.members.push(member);
    let outputs = receive(&mut drone, at(0.0), 1, &Packet::Flood(received));
    assert!(matches!(
        outputs.notices[..],
        [Notice::Leader(_), Notice::Order { sequence: 1, .. }]
    ));
    let sent = wait(&mut drone, at(0.2)).sent;
    let [Packet::Flood(sent)] = sent.as_slice() else {
        panic!("expected one packet per period, found {sent:?}");
    };
    assert_eq!((sent.heartbeat, sent.sequence), (1, 1));
    assert!(sent.order.is_some());
    assert_eq!(
        sent.members.iter().map(|it| it.id.0).collect::<Vec<_>>(),
        [2, 3]
    );
}

#[test]
fn with_routes_parents_report_children_and_relay_orders() {
    let (mut drone, now) = in_hop_update();
    let hop_update = Packet::HopUpdate {
        hops: 0,
        routing_list: vec![NodeId(1), NodeId(2)],
    };
    receive(&mut drone, now, 0, &hop_update);
    let member = |id, parent| {
        let mut received = flood(0, 0);
        received.parent = parent;
        received.members.push(Member {
            id: NodeId(id),
            number: 9,
            acknowledged: 1,
            out_of_range: false,
            landing: false,
        });
        Packet::Flood(received)
    };
    receive(&mut drone, now, 2, &member(2, Some(NodeId(0))));
    receive(&mut drone, now, 0, &Packet::Flood(flood(1, 1)));
    assert_eq!(drone.policy.durable.phase, Phase::Following);
    let next_flood = |drone: &mut FloodRouting, until| {
        let sent = wait(drone, until).sent;
        match sent.into_iter().next_back() {
            Some(Packet::Flood(flood)) => (flood.members.len(), flood.order.is_some()),
            other => panic!("expected a flood, found {other:?}"),
        }
    };
    assert_eq!(
        next_flood(&mut drone, at(8.3)),
        (1, false),
        "a leaf reports only itself"
    );
    receive(&mut drone, at(8.3), 3, &member(3, Some(NodeId(1))));
    assert_eq!(
        next_flood(&mut drone, at(8.6)),
        (2, true),
        "a parent relays orders"
    );
}

#[test]
fn master_is_alive_only_if_its_heartbeat_rises() {
    let mut drone = routing(1);
    receive(&mut drone, at(0.0), 0, &Packet::Flood(flood(7, 1)));
    let mut silent_at = None;
    for tenth in 1..80_u32 {
        let now = at(f64::from(tenth) / 10.0);
        // Another drone repeats the last heartbeat sequence that it knows.
        receive(&mut drone, now, 2, &Packet::Flood(flood(7, 1)));
        if wait(&mut drone, now)
            .notices
            .contains(&Notice::MasterSilent)
        {
            silent_at = Some(tenth);
        }
    }
    assert!((50..=53).contains(&silent_at.unwrap()), "{silent_at:?}");
    let outputs = receive(&mut drone, at(8.0), 2, &Packet::Flood(flood(8, 1)));
    assert!(outputs.notices.contains(&Notice::MasterReturned));
}

#[test]
fn older_ballots_and_unknown_senders_are_ignored() {
    let mut drone = routing(1);
    let newer = Ballot { term: 2, ..MASTER };
    let order = Packet::Flood(flood(1, 1));
    assert!(
        !receive_under(&mut drone, at(0.0), 0, newer, &order)
            .notices
            .is_empty()
    );
    let older = receive_under(&mut drone, at(0.1), 0, MASTER, &Packet::Flood(flood(2, 2)));
    assert_eq!(older.events, [Event::Ignored(NodeId(0))]);
    let stranger = receive_under(&mut drone, at(0.1), 4, newer, &Packet::Flood(flood(2, 2)));
    assert_eq!(stranger.events, [Event::Ignored(NodeId(4))]);
    assert_eq!(drone.shared.durable.epoch.sequence(), 1);
}

#[test]
fn restarted_routing_never_reuses_a_sequence() {
    let mut drone = routing(1);
    receive(&mut drone, at(0.0), 0, &Packet::Flood(flood(1, 1)));
    let mut checkpoint = None;
    for outputs in [wait(&mut drone, at(2.0)), wait(&mut drone, at(60.0))] {
        for event in outputs.events {
            if let Event::Checkpoint(it) = event
                && let PolicyCheckpoint::Flood(own) = it.policy
            {
                checkpoint = Some((it.common, own));
            }
        }
    }
    let number = drone.shared.durable.heartbeats.own;
    let restarted = with(config(1), at(60.0), checkpoint);
    assert!(
        restarted.shared.durable.heartbeats.own >= number,
        "{number} was used before the restart"
    );
}

#[test]
fn stopped_drone_sends_one_last_frame() {
    let mut drone = routing(1);
    receive(&mut drone, at(0.0), 0, &Packet::Flood(flood(1, 4)));
    stimulate(
        &mut drone,
        at(0.1),
        Stimulus::Input(Input::Acknowledge {
            ballot: MASTER,
            sequence: 4,
        }),
    );
    let last = stimulate(&mut drone, at(0.1), Stimulus::Input(Input::Stop)).sent;
    let [Packet::Flood(last)] = last.as_slice() else {
        panic!("expected one last packet, found {last:?}");
    };
    assert_eq!(last.members[0].acknowledged, 4);
    assert_eq!(drone.policy.next_send, None);
}

#[test]
fn stalled_host_restarts_the_master_timeout() {
    let mut drone = routing(1);
    receive(&mut drone, at(0.0), 0, &Packet::Flood(flood(7, 1)));
    wait(&mut drone, at(1.0));
    let woken = stimulate(&mut drone, at(30.0), Stimulus::Timeout);
    assert_eq!(woken.notices, []);
    assert_eq!(woken.sent.len(), 1, "overdue frames are dropped");
    assert_eq!(wait(&mut drone, at(34.9)).notices, []);
    assert_eq!(wait(&mut drone, at(36.0)).notices, [Notice::MasterSilent]);
}

#[test]
fn master_announces_its_landing() {
    let mut master = routing(0);
    stimulate(&mut master, at(0.0), Stimulus::Input(Input::Lead(MASTER)));
    stimulate(&mut master, at(0.0), Stimulus::Input(Input::Land));
    let sent = wait(&mut master, at(1.0)).sent.pop().unwrap();
    let mut drone = routing(1);
    receive(&mut drone, at(1.0), 0, &Packet::Flood(flood(1, 1)));
    let outputs = receive(&mut drone, at(1.1), 0, &sent);
    assert_eq!(outputs.notices, [Notice::MasterLands]);
    assert_eq!(receive(&mut drone, at(1.2), 0, &sent).notices, []);
}

#[test]
fn a_drone_that_lands_keeps_its_period_until_its_master_lands_too() {
    let mut drone = routing(1);
    receive(&mut drone, at(0.0), 0, &Packet::Flood(flood(1, 1)));
    stimulate(&mut drone, at(0.0), Stimulus::Input(Input::Land));
    let mut sent_in_5_s = |from_s: u32, master_lands: bool| {
        let mut sent = 0;
        for tenth in 0..50_u32 {
            let now = at(f64::from(from_s) + f64::from(tenth) / 10.0);
            let mut heard = flood(10 * from_s + tenth + 2, 1);
            heard.members.extend(master_lands.then_some(Member {
                id: NodeId(0),
                number: 3,
                acknowledged: 1,
                out_of_range: false,
                landing: true,
            }));
            sent += receive(&mut drone, now, 0, &Packet::Flood(heard))
                .sent
                .len();
            sent += wait(&mut drone, now).sent.len();
        }
        sent
    };
    sent_in_5_s(0, false);
    sent_in_5_s(5, false);
    assert_eq!(
        sent_in_5_s(10, false),
        25,
        "it relays the master's heartbeats"
    );
    sent_in_5_s(15, true);
    assert_eq!(sent_in_5_s(20, true), 5);
}

#[test]
fn drone_relays_orders_to_a_neighbour_without_route() {
    let (mut drone, now) = in_hop_update();
    let hop_update = Packet::HopUpdate {
        hops: 0,
        routing_list: Vec::new(),
    };
    receive(&mut drone, now, 0, &hop_update);
    receive(&mut drone, now, 2, &Packet::Flood(flood(0, 0)));
    receive(&mut drone, now, 0, &Packet::Flood(flood(1, 1)));
    assert_eq!(drone.policy.durable.phase, Phase::Following);
    assert!(!drone.policy.durable.routes.relay);
    let lost = Flood {
        hops: None,
        ..flood(0, 0)
    };
    receive(&mut drone, at(8.1), 3, &Packet::Flood(lost));
    let sent = wait(&mut drone, at(8.4)).sent;
    let repeats = |packet: &Packet| matches!(packet, Packet::Flood(it) if it.order.is_some());
    assert!(sent.last().is_some_and(repeats), "{sent:?}");
}

#[test]
fn master_landing_is_forwarded() {
    let landing = Member {
        id: NodeId(0),
        number: 3,
        acknowledged: 1,
        out_of_range: false,
        landing: true,
    };
    let mut drone = routing(2);
    receive(&mut drone, at(0.0), 1, &Packet::Flood(flood(1, 1)));
    let mut received = flood(2, 1);
    received.members = vec![landing];
    let outputs = receive(&mut drone, at(0.1), 0, &Packet::Flood(received));
    assert!(outputs.notices.contains(&Notice::MasterLands));
    let sent = wait(&mut drone, at(0.4)).sent;
    let Some(sent @ Packet::Flood(_)) = sent.last() else {
        panic!("expected a flood, found {sent:?}");
    };
    let mut other = routing(3);
    receive(&mut other, at(0.0), 1, &Packet::Flood(flood(1, 1)));
    let outputs = receive(&mut other, at(0.5), 2, sent);
    assert!(outputs.notices.contains(&Notice::MasterLands));
}
