//! Properties of the decoder on any stream of bytes.

use std::time::Duration;

use muster_msp::{
    Decoder, Direction, FRAME_MAX, FRAME_TIME_MAX, Frame, PAYLOAD_MAX, REQUEST_MAX, Version, encode,
};
use proptest::prelude::*;

/// A frame that owns its payload.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Owned {
    version: Version,
    direction: Direction,
    command: u16,
    flag: u8,
    payload: Vec<u8>,
}

impl Owned {
    fn from(frame: Frame<'_>) -> Self {
        Self {
            version: frame.version,
            direction: frame.direction,
            command: frame.command,
            flag: frame.flag,
            payload: frame.payload.to_vec(),
        }
    }

    /// Bytes of the frame, without a jumbo's second size.
    fn least_length(&self) -> u64 {
        let around = match self.version {
            Version::V1 => 6,
            Version::V2 => 9,
            Version::V2OverV1 => 12,
        };
        around + self.payload.len() as u64
    }

    fn bytes(&self) -> Vec<u8> {
        let frame = Frame {
            version: self.version,
            direction: self.direction,
            command: self.command,
            flag: self.flag,
            payload: &self.payload,
        };
        let mut out = Vec::new();
        encode(&frame, &mut out).expect("it can be written");
        out
    }
}

/// Frames of one decoder, which must never hold more than a frame.
fn read(decoder: &mut Decoder, bytes: &[u8]) -> Vec<Owned> {
    let mut frames = Vec::new();
    for piece in bytes.chunks(64) {
        decoder.read(piece, |frame| frames.push(Owned::from(frame)));
        assert!(decoder.held() <= FRAME_MAX);
    }
    frames
}

/// Further frames of a line that stays silent.
fn wait(decoder: &mut Decoder) -> Vec<Owned> {
    let (mut frames, mut now) = (Vec::new(), Duration::ZERO);
    while decoder.held() > 0 {
        decoder.expire(now, |frame| frames.push(Owned::from(frame)));
        now += FRAME_TIME_MAX;
    }
    frames
}

fn any_frame() -> impl Strategy<Value = Owned> {
    let version = prop_oneof![
        Just(Version::V1),
        Just(Version::V2),
        Just(Version::V2OverV1)
    ];
    let direction = prop_oneof![
        Just(Direction::Request),
        Just(Direction::Reply),
        Just(Direction::Error)
    ];
    let payload = prop_oneof![
        8 => prop::collection::vec(any::<u8>(), 0..40),
        1 => prop::collection::vec(any::<u8>(), 240..=PAYLOAD_MAX),
    ];
    (version, direction, any::<u16>(), any::<u8>(), payload).prop_map(
        |(version, direction, command, flag, payload)| {
            let is_v1 = version == Version::V1;
            let mut payload: Vec<u8> = payload;
            if direction == Direction::Request {
                payload.truncate(REQUEST_MAX);
            }
            Owned {
                version,
                direction,
                command: if is_v1 { command % 255 } else { command },
                flag: if is_v1 { 0 } else { flag },
                payload,
            }
        },
    )
}

/// Noise made to mislead: much of it looks like a header.
fn any_noise() -> impl Strategy<Value = Vec<u8>> {
    let piece = prop_oneof![
        4 => any::<u8>().prop_map(|it| vec![it]),
        1 => Just(b"$".to_vec()),
        1 => Just(b"$M<".to_vec()),
        1 => Just(b"$M>".to_vec()),
        1 => Just(b"$X<".to_vec()),
        1 => Just(b"$M<\xff".to_vec()),
        1 => any::<u8>().prop_map(|size| vec![b'$', b'M', b'>', size]),
    ];
    prop::collection::vec(piece, 0..12).prop_map(|pieces| pieces.concat())
}

/// Whether `part` is in `whole`, in order.
fn is_subsequence(part: &[Owned], whole: &[Owned]) -> bool {
    let mut rest = whole.iter();
    part.iter().all(|frame| rest.any(|it| it == frame))
}

proptest! {
    #[test]
    fn any_frame_round_trips_in_every_version(frame in any_frame()) {
        let mut decoder = Decoder::default();
        let bytes = frame.bytes();
        prop_assert!(bytes.len() <= FRAME_MAX);
        prop_assert_eq!(read(&mut decoder, &bytes), vec![frame]);
        prop_assert_eq!(decoder.held(), 0);
        prop_assert_eq!(decoder.counts().noise_bytes, 0);
    }

    #[test]
    fn every_byte_is_in_a_frame_or_counted_as_noise(bytes in prop::collection::vec(any_noise(), 0..60)) {
        let bytes = bytes.concat();
        let mut decoder = Decoder::default();
        let mut frames = read(&mut decoder, &bytes);
        frames.extend(wait(&mut decoder));
        prop_assert_eq!(decoder.held(), 0);
        let counted: u64 = frames.iter().map(Owned::least_length).sum::<u64>() + decoder.counts().noise_bytes;
        // Noise may be a jumbo frame that needn't be one: its size takes two bytes more.
        let found = counted..=counted + 2 * frames.len() as u64;
        prop_assert!(found.contains(&(bytes.len() as u64)), "{} in {found:?}", bytes.len());
    }

    #[test]
    fn any_split_of_a_stream_decodes_alike(
        pieces in prop::collection::vec((any_noise(), any_frame()), 1..6),
        splits in prop::collection::vec(1_usize..200, 1..40),
    ) {
        let stream: Vec<u8> = pieces.iter().flat_map(|(noise, frame)| [noise.clone(), frame.bytes()].concat()).collect();
        let mut at_once = Vec::new();
        let mut first = Decoder::default();
        first.read(&stream, |frame| at_once.push(Owned::from(frame)));
        let mut in_pieces = Vec::new();
        let mut second = Decoder::default();
        let mut rest = &stream[..];
        for length in splits.iter().cycle() {
            let (piece, after) = rest.split_at((*length).min(rest.len()));
            second.read(piece, |frame| in_pieces.push(Owned::from(frame)));
            rest = after;
            if rest.is_empty() {
                break;
            }
        }
        prop_assert_eq!(at_once, in_pieces);
        prop_assert_eq!(first.counts(), second.counts());
    }

    /// A false header can hide a frame only if its own checksum happens to be right: then a frame more than was sent is read.
    #[test]
    fn noise_between_frames_costs_no_frame_that_is_whole(
        pieces in prop::collection::vec((any_noise(), any_frame()), 1..8),
    ) {
        let sent: Vec<Owned> = pieces.iter().map(|(_, frame)| frame.clone()).collect();
        let stream: Vec<u8> = pieces.iter().flat_map(|(noise, frame)| [noise.clone(), frame.bytes()].concat()).collect();
        let mut decoder = Decoder::default();
        let mut read = read(&mut decoder, &stream);
        read.extend(wait(&mut decoder));
        let invented = read.iter().filter(|it| !sent.contains(it)).count();
        prop_assert!(is_subsequence(&sent, &read) || invented > 0, "sent {sent:?}, read {read:?}");
    }

    /// A wrong byte is found by either checksum: no altered frame is ever taken for the one that was sent.
    #[test]
    fn one_altered_byte_never_yields_an_altered_frame(
        frame in any_frame(),
        place in any::<prop::sample::Index>(),
        change in 1_u8..,
    ) {
        let mut bytes = frame.bytes();
        let place = 3 + place.index(bytes.len() - 3);
        bytes[place] ^= change;
        let mut decoder = Decoder::default();
        let mut all = read(&mut decoder, &bytes);
        all.extend(wait(&mut decoder));
        // What lies inside the payload may be a frame of its own; the frame as a whole is refused.
        let whole = all.iter().any(|it| it.payload.len() == frame.payload.len() && it.version == frame.version);
        prop_assert!(!whole, "{all:?}");
    }
}

/// A `$M<` that is noise claims the frames after it; they come once its checksum turns out wrong.
#[test]
fn a_false_header_costs_no_later_frame() {
    let frame = Owned {
        version: Version::V1,
        direction: Direction::Reply,
        command: 108,
        flag: 0,
        payload: vec![0; 6],
    };
    for size in 0..=255 {
        let mut stream = vec![b'$', b'M', b'<', size];
        for _ in 0..40 {
            stream.extend(frame.bytes());
        }
        let mut decoder = Decoder::default();
        let mut all = read(&mut decoder, &stream);
        all.extend(wait(&mut decoder));
        all.retain(|it| *it == frame);
        assert_eq!(all.len(), 40, "size {size}: {:?}", decoder.counts());
    }
}

#[test]
fn a_bad_checksum_costs_no_later_frame() {
    let mut stream = b"$M>\x06\x6c\0\0\0\0\0\0\x6b".to_vec();
    stream.extend(b"$M>\x06\x6c\0\0\0\0\0\0\x6a");
    let mut decoder = Decoder::default();
    assert_eq!(read(&mut decoder, &stream).len(), 1);
    let counts = decoder.counts();
    assert_eq!(
        (counts.frames, counts.bad_checksum, counts.noise_bytes),
        (1, 1, 12)
    );
}

/// On a line that is never silent.
#[test]
fn a_false_header_holds_frames_back_for_a_tenth_of_a_second_at_most() {
    let mut decoder = Decoder::default();
    assert_eq!(read(&mut decoder, b"$M<\xfe\x01"), []);
    let mut now = Duration::from_secs(7);
    let mut late = Vec::new();
    decoder.expire(now, |_| {});
    for _ in 0..10 {
        now += FRAME_TIME_MAX / 10;
        decoder.read(b"$M>\x00\xc8\xc8", |frame| late.push(frame.command));
        decoder.expire(now, |frame| late.push(frame.command));
    }
    assert_eq!(late, [200; 10]);
    assert_eq!((decoder.counts().late, decoder.counts().bad()), (1, 1));
}

/// A defect of the indoor thesis's code: one short read, and all later frames were read from the wrong byte.
#[test]
fn a_short_read_desynchronises_no_frame() {
    let stream = b"$M>\x00\xc8\xc8".repeat(3);
    for first in 0..=stream.len() {
        let mut decoder = Decoder::default();
        let (one, other) = stream.split_at(first);
        let frames = read(&mut decoder, one).len() + read(&mut decoder, other).len();
        assert_eq!((frames, decoder.counts().noise_bytes), (3, 0), "{first}");
    }
}

/// The thread that reads may be held up between the two halves of a frame.
#[test]
fn a_frame_that_was_read_late_is_whole() {
    let mut decoder = Decoder::default();
    decoder.read(b"$M>\x00", |_| {});
    decoder.expire(Duration::ZERO, |_| {});
    assert_eq!(read(&mut decoder, b"\xc8\xc8").len(), 1);
    decoder.expire(10 * FRAME_TIME_MAX, |_| {});
    assert_eq!(decoder.counts().bad(), 0);
}

#[test]
fn a_claimed_size_over_the_limit_is_refused_at_once() {
    let mut decoder = Decoder::default();
    assert_eq!(read(&mut decoder, b"$X>\0\x6c\0\xff\xff"), []);
    assert_eq!(read(&mut decoder, b"$M>\xff\x74\xff\xff"), []);
    assert_eq!((decoder.held(), decoder.counts().bad_size), (0, 2));
}

/// Betaflight writes a longer v2 frame beyond its buffer.
#[test]
fn a_payload_that_overflows_a_controller_is_never_written() {
    for version in [Version::V1, Version::V2, Version::V2OverV1] {
        let frame = |direction, payload| Frame {
            version,
            direction,
            command: 1,
            flag: 0,
            payload,
        };
        let (fits, overflows) = ([0; REQUEST_MAX], [0; REQUEST_MAX + 1]);
        let mut out = Vec::new();
        encode(&frame(Direction::Request, &overflows), &mut out).expect_err("too long");
        assert_eq!(out, []);
        encode(&frame(Direction::Request, &fits), &mut out).expect("it fits");
        encode(&frame(Direction::Reply, &overflows), &mut out).expect("replies may be longer");
    }
}
