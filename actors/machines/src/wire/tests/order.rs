//! Orders on the wire.

use super::*;

#[test]
fn orders_match_golden_bytes() {
    let plan = Order::Plan {
        index: 0,
        count: 1,
        waypoints: vec![Ned::new(1.0, -1.0, -25.0)],
        holds: Vec::new(),
    };
    assert_eq!(hex(&encode_order(&plan)), "00000101d00fcf0fcf8603");
    assert_eq!(decode_order(&encode_order(&plan)), Ok(plan));
    let plan = Order::Plan {
        index: 0,
        count: 1,
        waypoints: vec![Ned::new(1.0, -1.0, -25.0), Ned::HOME],
        holds: vec![Duration::from_millis(300), Duration::ZERO],
    };
    assert_eq!(
        hex(&encode_order(&plan)),
        "0a000102d00fcf0fcf8603ac0200000000"
    );
    assert_eq!(decode_order(&encode_order(&plan)), Ok(plan));
    assert_eq!(hex(&encode_order(&Order::TakeOff { wave: 0 })), "01");
    assert_eq!(
        hex(&encode_order(&Order::Move {
            waypoint: 300,
            apart: true
        })),
        "02ac0201"
    );
    let land = Order::Land {
        at: Ned::new(0.001, 0.0, 0.0),
        changes: 2,
        apart: false,
        wave: 0,
    };
    assert_eq!(hex(&encode_order(&land)), "030200000200");
    for (step, bytes) in [
        (Step::Climb, "04010000"),
        (Step::Cross, "04010100"),
        (Step::Descend, "04010200"),
    ] {
        let reform = Order::Reform {
            change: 1,
            step,
            apart: false,
            wave: 0,
        };
        assert_eq!(hex(&encode_order(&reform)), bytes);
        assert_eq!(decode_order(&encode_order(&reform)), Ok(reform));
    }
    let (at, apart, wave) = (Ned::new(0.001, 0.0, 0.0), true, 2);
    let changes = 1;
    for (order, bytes) in [
        (Order::TakeOff { wave }, "0702"),
        (
            Order::Land {
                at,
                changes,
                wave,
                apart,
            },
            "08020000010102",
        ),
        (
            Order::Reform {
                change: 1,
                step: Step::Cross,
                wave,
                apart,
            },
            "09010102",
        ),
    ] {
        assert_eq!(hex(&encode_order(&order)), bytes);
        assert_eq!(decode_order(&encode_order(&order)), Ok(order));
    }
    let at = Ned::new(1.0, -1.0, -25.0);
    let follow = Order::Follow {
        at,
        velocity: Velocity::new(10.0, 0.0, -0.001),
    };
    assert_eq!(hex(&encode_order(&follow)), "05d00fcf0fcf8603a09c010001");
    assert_eq!(decode_order(&encode_order(&follow)), Ok(follow));
    let assemble = Order::Assemble { at };
    assert_eq!(hex(&encode_order(&assemble)), "06d00fcf0fcf8603");
    assert_eq!(decode_order(&encode_order(&assemble)), Ok(assemble));
}
