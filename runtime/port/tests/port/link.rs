use std::time::{Duration, Instant};

use muster_msp::Telemetry;
use muster_msp::check::ReceiverMode;
use muster_msp::{Channel, Message, Mode, RawGps, SetRawRc, Sticks};
use muster_port::{Event, Link, State};

use crate::controller::{ATTITUDE, Controller, KIND, Manner};

/// What a test waits for at most.
const PATIENCE: Duration = Duration::from_secs(10);

/// Takes events until one is wanted.
fn wait_for(link: &Link, wanted: impl Fn(&Event) -> bool) -> Event {
    let started = Instant::now();
    while started.elapsed() < PATIENCE {
        if let Some(event) = link.next_event(PATIENCE).filter(&wanted) {
            return event;
        }
    }
    panic!("no such event: {:?}", link.status());
}

fn channels() -> SetRawRc {
    SetRawRc::new(Sticks::IDLE, &[Channel::LOW; 4]).expect("4 aux channels")
}

/// Gives sticks every 20 ms for a while.
fn fly(link: &Link, duration: Duration) {
    let started = Instant::now();
    while started.elapsed() < duration {
        link.set_channels(channels());
        std::thread::sleep(Duration::from_millis(20));
    }
}

#[test]
fn a_link_identifies_its_controller_and_brings_telemetry() {
    for controller in [Controller::on_tcp(KIND), Controller::on_a_serial_line(KIND)] {
        let link = Link::start(controller.address.clone(), None).expect("threads");
        let identified = wait_for(&link, |it| matches!(it, Event::Identified(_)));
        let Event::Identified(identity) = identified else {
            unreachable!("it was waited for");
        };
        assert_eq!(identity.boxes.modes.last(), Some(&Mode::MspOverride));
        let attitude = Event::Telemetry(Telemetry::Attitude(ATTITUDE));
        wait_for(&link, |it| *it == attitude);
        let status = link.status();
        assert_eq!((status.state, status.opened), (State::Open, 1));
        assert_eq!(
            controller.with_seen(|it| it.noise),
            0,
            "frames and nothing else"
        );
    }
}

#[test]
fn a_refused_question_is_asked_three_times() {
    let controller = Controller::on_tcp(KIND);
    let link = Link::start(controller.address.clone(), None).expect("threads");
    let attitude = Event::Telemetry(Telemetry::Attitude(ATTITUDE));
    for _ in 0..10 {
        wait_for(&link, |it| *it == attitude);
    }
    let asked = |seen: &crate::controller::Seen| {
        seen.commands
            .iter()
            .filter(|it| **it == RawGps::COMMAND)
            .count()
    };
    assert_eq!(controller.with_seen(asked), 3);
    assert!(link.status().refused >= 3);
}

#[test]
fn a_lost_port_is_opened_again_and_rc_continues() {
    let controller = Controller::on_tcp(Manner {
        frames_max: 40,
        ..KIND
    });
    let link = Link::start(controller.address.clone(), None).expect("threads");
    wait_for(&link, |it| matches!(it, Event::Identified(_)));
    fly(&link, Duration::from_millis(600));
    wait_for(&link, |it| matches!(it, Event::Closed(_)));
    wait_for(&link, |it| matches!(it, Event::Identified(_)));
    let before = controller.with_seen(|it| it.rc.len());
    fly(&link, Duration::from_millis(300));
    assert!(controller.with_seen(|it| it.rc.len()) > before);
    assert_eq!(link.status().opened, 2);
}

#[test]
fn a_controller_that_was_armed_when_the_port_opened_is_looked_at_once_it_has_landed() {
    let controller = Controller::on_tcp(Manner {
        armed_statuses: 10,
        ..KIND
    });
    let link = Link::start(controller.address.clone(), Some(ReceiverMode::Sole)).expect("threads");
    wait_for(&link, |it| matches!(it, Event::Identified(_)));
    // It refuses its settings.
    let is_unread = |it: &Event| matches!(it, Event::Unfit(unfit) if unfit[0].rule == "unread");
    wait_for(&link, is_unread);
    assert_eq!(link.status().opened, 2);
}

#[test]
fn a_port_that_closes_after_a_landing_has_reported_twice_that_the_controller_is_disarmed() {
    let controller = Controller::on_tcp(Manner {
        armed_statuses: 10,
        ..KIND
    });
    let link = Link::start(controller.address.clone(), Some(ReceiverMode::Sole)).expect("threads");
    let mut disarmed = 0;
    loop {
        match wait_for(&link, |_| true) {
            Event::Telemetry(Telemetry::Status(status)) if status.head.modes == 0 => disarmed += 1,
            Event::Closed(_) => break,
            _ => {}
        }
    }
    assert_eq!(
        disarmed, 2,
        "a link to a vehicle believes what is told twice"
    );
}

#[test]
fn a_closed_port_identifies_no_controller_until_it_is_open_again() {
    let controller = Controller::on_tcp(Manner {
        armed_statuses: 10,
        ..KIND
    });
    let link = Link::start(controller.address.clone(), Some(ReceiverMode::Sole)).expect("threads");
    wait_for(&link, |it| matches!(it, Event::Closed(_)));
    let next = wait_for(&link, |_| true);
    assert!(matches!(next, Event::Unfit(_)), "{next:?}");
}

#[test]
fn unanswered_questions_delay_no_rc_and_rc_stops_when_sticks_do() {
    let controller = Controller::on_tcp(Manner {
        // Enough to be known.
        answers_max: 30,
        ..KIND
    });
    let link = Link::start(controller.address.clone(), None).expect("threads");
    wait_for(&link, |it| matches!(it, Event::Identified(_)));
    fly(&link, Duration::from_secs(2));
    let stopped = Instant::now();
    // Twice as long as sticks are repeated.
    std::thread::sleep(2 * muster_msp::RC_HOLD);
    let status = link.status();
    controller.with_seen(|seen| {
        let times: Vec<Instant> = seen.rc.iter().map(|it| it.0).collect();
        assert!(times.len() >= 90, "{} RC frames in 2 s", times.len());
        let gaps = times.windows(2).map(|it| it[1] - it[0]);
        let longest = gaps.max().expect("frames");
        assert!(
            longest < Duration::from_millis(100),
            "{longest:?} without RC"
        );
        let last = *times.last().expect("frames");
        assert!(last < stopped + Duration::from_millis(150), "RC continues");
        assert!(
            seen.rc
                .iter()
                .all(|it| it.1.channels_us[..4] == [1500, 1500, 1000, 1500])
        );
    });
    assert_eq!(status.state, State::Open);
    assert!(status.rc_gap_max < Duration::from_millis(100));
    assert!(status.latency.asked > status.latency.answered);
}

#[test]
fn a_port_that_is_not_there_is_reported_once_and_tried_again() {
    let listener = std::net::TcpListener::bind("127.0.0.1:0").expect("a free port");
    let address = listener.local_addr().expect("it is bound");
    drop(listener);
    let link =
        Link::start(format!("tcp:{address}").parse().expect("a port"), None).expect("threads");
    wait_for(&link, |it| matches!(it, Event::Closed(_)));
    assert_eq!(link.next_event(Duration::from_millis(400)), None);
    assert_eq!(link.status().state, State::Closed);
}
