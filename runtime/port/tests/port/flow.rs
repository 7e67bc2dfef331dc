use std::io::Write;
use std::net::TcpListener;
use std::sync::mpsc;
use std::time::Duration;

use muster_msp::{FlowReading, OpticalFlow, RangefinderSample, Version, order};
use muster_port::{Address, listen_flow};

const WAIT: Duration = Duration::from_secs(10);

fn range(distance_mm: i32) -> RangefinderSample {
    RangefinderSample {
        quality: 200,
        distance_mm,
    }
}

#[test]
fn a_module_is_heard_through_noise_and_after_its_port_was_closed() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let device = format!("tcp:{}", listener.local_addr().unwrap());
    let address: Address = device.parse().unwrap();
    let (readings, taken) = mpsc::channel();
    let (failures, failed) = mpsc::channel();
    let take = move |reading| readings.send(reading).is_ok();
    listen_flow(address, take, move |error| {
        failures.send(error.kind()).unwrap();
    })
    .unwrap();
    for distance_mm in [1_500, 1_600] {
        let (mut line, _) = listener.accept().unwrap();
        let rates = OpticalFlow {
            quality: 90,
            x_mradps: -30,
            y_mradps: 40,
        };
        let mut bytes = b"\xff$X<".to_vec();
        order(Version::V2, &range(distance_mm), &mut bytes).unwrap();
        order(Version::V2, &rates, &mut bytes).unwrap();
        line.write_all(&bytes).unwrap();
        let expected = FlowReading::Range(range(distance_mm));
        assert_eq!(taken.recv_timeout(WAIT), Ok(expected));
        assert_eq!(taken.recv_timeout(WAIT), Ok(FlowReading::Rates(rates)));
        drop(line);
        failed.recv_timeout(WAIT).unwrap();
    }
}
