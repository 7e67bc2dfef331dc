use super::*;
use muster_daemon::status::{
    ActorStatus, ComputerStatus, Datagrams, Doing, Frames, Heard, LeaderEpoch, PortState,
    PortStatus, VehicleStatus,
};

fn status(drone: u32) -> Status {
    let actor = ActorStatus {
        up: true,
        waiting: 0,
        waiting_max: 64,
        failures: 1,
        restarts: 1,
        overdue: 0,
    };
    let heard = |silent_s| Heard {
        frames: 7,
        silent_s,
    };
    Status {
        drone,
        swarm: 1,
        version: "0.1.0".to_owned(),
        incarnation: 1,
        up_s: 12.7,
        faults: Vec::new(),
        state: Doing {
            name: "moving_to_waypoint".to_owned(),
            words: "moving to waypoint 2".to_owned(),
            waypoint: Some(2),
        },
        in_flight: true,
        role: Role::Member,
        ballot: Some(LeaderEpoch {
            term: 1,
            rank: 0,
            master: 2,
        }),
        hops: Some(1),
        parent: Some(2),
        proven: [0, 2, 3].into(),
        heard: [(0, heard(0.4)), (2, heard(2.9)), (3, heard(3.1))].into(),
        vehicle: VehicleStatus {
            north_m: 20.04,
            east_m: -0.01,
            altitude_m: 19.96,
            position_lost_s: None,
            charge: 0.994,
            armed: true,
        },
        port: None,
        agent: None,
        actors: [("radio".to_owned(), actor)].into(),
        frames: Frames {
            dropped: [("forged".to_owned(), 40), ("replayed".to_owned(), 2)].into(),
            ..Frames::default()
        },
        datagrams: Datagrams {
            too_long: 3,
            overflowed: Some(5),
            ..Datagrams::default()
        },
        messages_refused: 0,
        journal_unwritten: 0,
        log_lines_lost: 0,
        computer: ComputerStatus::default(),
    }
}

fn answer(drone: Option<u32>, status: Result<Status, AskError>) -> Answer {
    Answer {
        target: Target {
            drone,
            address: format!("127.0.0.1:910{}", drone.unwrap_or(9)),
        },
        status,
    }
}

#[test]
fn rows_are_ordered_by_number_and_show_missing_answers() {
    let master = Status {
        role: Role::Master,
        hops: Some(0),
        up_s: 12_000.0,
        ..status(2)
    };
    let idle = Status {
        ballot: None,
        hops: None,
        role: Role::None,
        faults: vec!["the mission actor does not run".to_owned()],
        up_s: 300.0,
        ..status(1)
    };
    let no_answer = || Err(AskError::NoAnswer(Box::new(ureq::Error::ConnectionFailed)));
    let answers = [
        answer(None, no_answer()),
        answer(Some(2), Ok(master)),
        answer(None, Ok(idle)),
        answer(Some(0), Ok(status(0))),
        answer(Some(3), no_answer()),
    ];
    insta::assert_snapshot!(table(&answers, Colour::Never));
}

#[test]
fn slow_agent_is_remarked_and_one_that_is_not_slow_is_not() {
    let with_agent = |drone, slow_calls| Status {
        agent: Some(AgentStatus {
            slow_calls,
            longest_call_s: 0.2041,
        }),
        ..status(drone)
    };
    let answers = [
        answer(Some(1), Ok(with_agent(1, 7))),
        answer(Some(2), Ok(with_agent(2, 0))),
    ];
    let text = table(&answers, Colour::Never);
    let remarks: Vec<_> = text.lines().filter(|line| line.contains("agent")).collect();
    assert_eq!(
        remarks,
        [" drone 1      its agent is slow: 7 calls over 50 ms, the longest 204 ms"]
    );
}

#[test]
fn remarks_name_the_port_of_a_flight_controller_and_whether_it_is_closed_or_unfit() {
    let port = |state, closed_by: Option<&str>| PortStatus {
        state,
        unfit: Vec::new(),
        closed_by: closed_by.map(str::to_owned),
        opened: 1,
        latency_s: 0.0104,
        latency_max_s: 0.05,
        loss: 0.02,
        bad_frames: 0,
        rc_sent: 500,
        rc_acknowledged: 500,
        rc_per_s: 50,
        rc_gap_max_s: 0.0214,
        is_realtime: false,
    };
    let with_port = |drone, port| Status {
        port: Some(port),
        ..status(drone)
    };
    let unfit = PortStatus {
        unfit: vec!["failsafe-procedure: it falls when RC is lost".to_owned()],
        ..port(PortState::Open, None)
    };
    let answers = [
        answer(Some(0), Ok(with_port(0, unfit))),
        answer(Some(1), Ok(with_port(1, port(PortState::Open, None)))),
        answer(
            Some(2),
            Ok(with_port(
                2,
                port(PortState::Closed, Some("no such device")),
            )),
        ),
    ];
    let text = table(&answers, Colour::Never);
    let remarks: Vec<_> = text.lines().filter(|line| line.contains("port")).collect();
    assert_eq!(
        remarks,
        [
            " drone 0      port open, not fit to fly, 10.4 ms, 2 % lost, RC 50/s, longest gap 21 ms",
            " drone 1      port open, 10.4 ms, 2 % lost, RC 50/s, longest gap 21 ms",
            " drone 2      port closed: no such device",
        ]
    );
}

#[test]
fn a_weak_computer_is_remarked_on_and_a_healthy_one_is_not() {
    let remark = |computer| {
        let mut status = status(1);
        status.computer = computer;
        super::computer(&status)
    };
    let well = ComputerStatus {
        temperature_c: Some(79.9),
        under_voltage: Some(false),
        free_bytes: Some(SPACE_MIN),
        card_wear: Some(0.8),
        ..ComputerStatus::default()
    };
    assert_eq!(remark(ComputerStatus::default()), None);
    assert_eq!(remark(well), None);
    let weak = ComputerStatus {
        temperature_c: Some(80.0),
        under_voltage: Some(true),
        throttled: Some(true),
        free_bytes: Some(SPACE_MIN - 1),
        card_wear: Some(0.9),
        ..well
    };
    let words =
        "its computer: 80 °C, voltage too low, slowed down, wear of the card 90 %, 99 MB free";
    assert_eq!(remark(weak).as_deref(), Some(words));
    let before = ComputerStatus {
        had_under_voltage: Some(true),
        was_throttled: Some(true),
        ..well
    };
    let words = "its computer: voltage was too low, was slowed down";
    assert_eq!(remark(before).as_deref(), Some(words));
}
