use muster_msp::{Attitude, Identity, Mode, RawGps, ask};
use muster_port::{AskError, Session};

use crate::controller::{ATTITUDE, Controller, KIND, Manner};

#[test]
fn a_controller_says_who_it_is_over_tcp_and_over_a_serial_line() {
    for controller in [Controller::on_tcp(KIND), Controller::on_a_serial_line(KIND)] {
        let mut session = Session::open(&controller.address).expect("it is there");
        let identity = Identity::read(&mut session).expect("it answers");
        assert_eq!(identity.variant.variant.to_string(), "BTFL");
        assert_eq!(identity.boxes.modes.len(), 33);
        assert_eq!(identity.boxes.modes[32], Mode::MspOverride);
        assert_eq!(session.latency().answered, 6);
        assert_eq!(controller.with_seen(|it| it.noise), 0);
    }
}

#[test]
fn noise_before_an_answer_costs_no_answer() {
    let controller = Controller::on_a_serial_line(Manner {
        noise: b"\xff$M>\x09\x6c$X",
        ..KIND
    });
    let mut session = Session::open(&controller.address).expect("it is there");
    for _ in 0..5 {
        let attitude: Attitude = ask(&mut session).expect("it answers");
        assert_eq!(attitude, ATTITUDE);
    }
    assert!(session.counts().bad() > 0);
}

#[test]
fn a_refused_question_and_a_silent_controller_are_different_errors() {
    let controller = Controller::on_tcp(KIND);
    let mut session = Session::open(&controller.address).expect("it is there");
    let refused = ask::<RawGps, _>(&mut session).expect_err("it has no GPS");
    assert!(
        matches!(
            refused,
            AskError::Refused {
                message: "MSP_RAW_GPS"
            }
        ),
        "{refused:?}"
    );

    let controller = Controller::on_tcp(Manner {
        answers_max: 0,
        ..KIND
    });
    let mut session = Session::open(&controller.address).expect("it is there");
    let silent = ask::<Attitude, _>(&mut session).expect_err("it is silent");
    assert!(
        matches!(
            silent,
            AskError::Silent {
                message: "MSP_ATTITUDE"
            }
        ),
        "{silent:?}"
    );
    assert!(session.latency().loss() > 0.99);
}
