//! Packets out of a stream of bytes.
//!
//! Source: *LD19 Development Manual*, sections 3.1 to 3.4; the LD06 sends the same.

use crc::{Algorithm, Crc};

/// Bytes of a packet.
pub const PACKET_SIZE: usize = 47;
/// The lidar's clock begins again after so many milliseconds. Source: the manual, section 3.2.
pub(super) const CLOCK_MS: u16 = 30_000;
/// Ranges of a packet.
const POINTS: usize = 12;
/// First byte of a packet, and the kind with twelve ranges.
const HEADER: [u8; 2] = [0x54, 0x2c];
/// The manual's checksum, given there as a table: polynomial x⁸ + x⁶ + x³ + x² + 1.
const CHECKSUM: Algorithm<u8> = Algorithm {
    width: 8,
    poly: 0x4d,
    init: 0,
    refin: false,
    refout: false,
    xorout: 0,
    check: 0,
    residue: 0,
};
const CRC: Crc<u8> = Crc::<u8>::new(&CHECKSUM);

/// A measured range.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Point {
    /// Clockwise from the arrow on the lidar, hundredths of a degree.
    pub angle_cdeg: u16,
    /// Millimetres; 0 if nothing came back.
    pub range_mm: u16,
    /// Strength of the echo; about 200 for white at 6 m.
    pub confidence: u8,
}

/// A packet with a correct checksum.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Packet {
    /// Degrees a second.
    pub speed_dps: u16,
    /// Milliseconds of the lidar's clock, up to 30,000; then it begins again.
    pub time_ms: u16,
    /// In the order of their angles.
    pub points: [Point; POINTS],
}

/// What came in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counts {
    /// Packets.
    pub packets: u64,
    /// Bytes that look like the start of a packet, with a wrong checksum, angles beyond a turn or a time that is none.
    pub bad: u64,
    /// Bytes outside of packets.
    pub skipped: u64,
}

/// Finds packets in bytes.
///
/// A packet that is bad costs its own bytes at most: the search goes on behind its first one.
#[derive(Debug, Clone, Default)]
pub struct Decoder {
    held: Vec<u8>,
    counts: Counts,
}

impl Decoder {
    /// Takes bytes, and calls `sink` with each packet. Keeps less than a packet of them.
    pub fn feed(&mut self, bytes: &[u8], mut sink: impl FnMut(Packet)) {
        for byte in bytes {
            self.held.push(*byte);
            while !self.is_beginning() {
                self.held.remove(0);
                self.counts.skipped += 1;
            }
            if self.held.len() < PACKET_SIZE {
                continue;
            }
            match parse(&self.held) {
                Some(packet) => {
                    self.held.clear();
                    self.counts.packets += 1;
                    sink(packet);
                }
                None => {
                    self.counts.bad += 1;
                    self.resume();
                }
            }
        }
    }

    /// What came in so far.
    #[must_use]
    pub fn counts(&self) -> Counts {
        self.counts
    }

    /// Whether what is held can be a packet's beginning.
    fn is_beginning(&self) -> bool {
        let start = &self.held[..self.held.len().min(HEADER.len())];
        HEADER.starts_with(start)
    }

    /// Drops the first byte, and all up to the next beginning.
    fn resume(&mut self) {
        loop {
            self.held.remove(0);
            self.counts.skipped += 1;
            if self.is_beginning() {
                return;
            }
        }
    }
}

fn parse(bytes: &[u8]) -> Option<Packet> {
    let (content, checksum) = bytes.split_at(PACKET_SIZE - 1);
    if checksum != [CRC.checksum(content)] {
        return None;
    }
    let word = |at: usize| u16::from_le_bytes([content[at], content[at + 1]]);
    let (first, last) = (u32::from(word(4)), u32::from(word(42)));
    let time_ms = word(44);
    if first > 36_000 || last > 36_000 || time_ms > CLOCK_MS {
        return None;
    }
    // Past a full turn, angles begin again.
    let turned = (last + 36_000 - first) % 36_000;
    let point = |number: usize| {
        let at = 6 + 3 * number;
        let angle = first + turned * number as u32 / (POINTS as u32 - 1);
        Point {
            angle_cdeg: (angle % 36_000) as u16,
            range_mm: word(at),
            confidence: content[at + 2],
        }
    };
    Some(Packet {
        speed_dps: word(2),
        time_ms,
        points: std::array::from_fn(point),
    })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// The example of the manual, section 3.4.
    const MANUAL: [u8; PACKET_SIZE] = [
        0x54, 0x2c, 0x68, 0x08, 0xab, 0x7e, 0xe0, 0x00, 0xe4, 0xdc, 0x00, 0xe2, 0xd9, 0x00, 0xe5,
        0xd5, 0x00, 0xe3, 0xd3, 0x00, 0xe4, 0xd0, 0x00, 0xe9, 0xcd, 0x00, 0xe4, 0xca, 0x00, 0xe2,
        0xc7, 0x00, 0xe9, 0xc5, 0x00, 0xe5, 0xc2, 0x00, 0xe5, 0xc0, 0x00, 0xe5, 0xbe, 0x82, 0x3a,
        0x1a, 0x50,
    ];
    /// A packet of an LD19 without any return, as published by a user.
    const SILENT: [u8; PACKET_SIZE] = [
        0x54, 0x2c, 0x74, 0x08, 0xb0, 0x86, 0x00, 0x00, 0xd4, 0x00, 0x00, 0xd4, 0x00, 0x00, 0xd4,
        0x00, 0x00, 0xd4, 0x00, 0x00, 0xd4, 0x00, 0x00, 0xd5, 0x00, 0x00, 0xd5, 0x00, 0x00, 0x49,
        0x00, 0x00, 0x5f, 0x00, 0x00, 0xb0, 0x00, 0x00, 0xd2, 0x00, 0x00, 0xd4, 0x02, 0x89, 0x1e,
        0x09, 0x1f,
    ];

    fn packets(decoder: &mut Decoder, bytes: &[u8]) -> Vec<Packet> {
        let mut packets = Vec::new();
        decoder.feed(bytes, |packet| packets.push(packet));
        packets
    }

    #[test]
    fn the_manuals_packet_has_the_manuals_values() {
        let packets = packets(&mut Decoder::default(), &MANUAL);
        let [packet] = packets[..] else {
            panic!("{packets:?}")
        };
        assert_eq!((packet.speed_dps, packet.time_ms), (2_152, 6_714));
        let [first, second, .., last] = packet.points;
        assert_eq!(
            (first.angle_cdeg, first.range_mm, first.confidence),
            (32_427, 224, 228)
        );
        assert_eq!((second.range_mm, second.confidence), (220, 226));
        assert_eq!(
            (last.angle_cdeg, last.range_mm, last.confidence),
            (33_470, 192, 229)
        );
    }

    #[test]
    fn a_recorded_packet_without_echoes_has_ranges_of_zero() {
        let packets = packets(&mut Decoder::default(), &SILENT);
        assert!(packets[0].points.iter().all(|point| point.range_mm == 0));
    }

    #[test]
    fn a_bad_checksum_costs_no_later_packet() {
        let mut bytes = MANUAL;
        bytes[20] ^= 1;
        let mut decoder = Decoder::default();
        let stream = [&bytes[..], &MANUAL, &SILENT].concat();
        assert_eq!(packets(&mut decoder, &stream).len(), 2);
        assert_eq!(decoder.counts().bad, 1);
    }

    #[test]
    fn a_lost_byte_costs_its_own_packet_only() {
        let stream = [&MANUAL[..30], &MANUAL[31..], &MANUAL, &SILENT].concat();
        assert_eq!(packets(&mut Decoder::default(), &stream).len(), 2);
    }

    proptest! {
        #[test]
        fn packets_are_found_behind_any_bytes_in_any_pieces(
            noise in prop::collection::vec(any::<u8>(), 0..200),
            piece in 1_usize..60,
        ) {
            let mut decoder = Decoder::default();
            let stream = [&noise[..], &MANUAL, &MANUAL].concat();
            let mut found = 0;
            for bytes in stream.chunks(piece) {
                decoder.feed(bytes, |_| found += 1);
            }
            // The end of the noise may be the start of a packet, which takes the first one with it at most.
            prop_assert!(found >= 1);
            prop_assert!(decoder.held.len() < PACKET_SIZE);
        }
    }
}
