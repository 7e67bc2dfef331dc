//! Bytes of a lidar, in pieces: no packet is made up, and a good one behind them is found.

use muster_sensors::ld19::{Decoder, PACKET_SIZE};

/// The example of the LD19's manual.
const PACKET: [u8; PACKET_SIZE] = [
    0x54, 0x2c, 0x68, 0x08, 0xab, 0x7e, 0xe0, 0x00, 0xe4, 0xdc, 0x00, 0xe2, 0xd9, 0x00, 0xe5, 0xd5,
    0x00, 0xe3, 0xd3, 0x00, 0xe4, 0xd0, 0x00, 0xe9, 0xcd, 0x00, 0xe4, 0xca, 0x00, 0xe2, 0xc7, 0x00,
    0xe9, 0xc5, 0x00, 0xe5, 0xc2, 0x00, 0xe5, 0xc0, 0x00, 0xe5, 0xbe, 0x82, 0x3a, 0x1a, 0x50,
];

pub(super) fn run(bytes: &[u8]) {
    let mut decoder = Decoder::default();
    let mut packets = 0;
    for piece in bytes.chunks(7) {
        decoder.feed(piece, |packet| {
            assert!(packet.points.iter().all(|point| point.angle_cdeg < 36_000));
            packets += 1;
        });
    }
    assert_eq!(decoder.counts().packets, packets);
    // What is held may take the first one with it.
    let mut found = 0;
    decoder.feed(&PACKET, |_| found += 1);
    decoder.feed(&PACKET, |_| found += 1);
    assert!(found >= 1);
}
