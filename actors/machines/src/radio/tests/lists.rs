use super::*;

/// The content of a list is its number; the fleet signs no odd ones.
struct Listed;

/// Drone 2 is revoked by list 6.
fn revoked(number: u8) -> Revoked {
    Revoked {
        number: number.into(),
        drones: (number >= 6).then_some(NodeId(2)).into_iter().collect(),
        signed: Some(Bytes::copy_from_slice(&[number])),
    }
}

impl Authenticator for Listed {
    fn sign(&self, covered: &[u8]) -> [u8; AUTHENTICATOR_LEN] {
        IdealAuthenticator.sign(covered)
    }

    fn verify(&self, sender: NodeId, covered: &[u8], with: &[u8; AUTHENTICATOR_LEN]) -> bool {
        IdealAuthenticator.verify(sender, covered, with)
    }

    fn read_list(&self, list: &[u8]) -> Option<Revoked> {
        match list {
            [number] if number % 2 == 0 => Some(revoked(*number)),
            _ => None,
        }
    }
}

fn with_list(id: u32, list: u8) -> Radio<Listed> {
    Radio::new(config(id), Listed, 1, Checkpoint::default(), 0).with_list(revoked(list))
}

fn list(number: u8) -> RadioPacket {
    RadioPacket::List(Bytes::copy_from_slice(&[number]))
}

fn packets(frames: &[Bytes]) -> Vec<RadioPacket> {
    frames.iter().map(packet).collect()
}

/// Gives a radio these frames and returns its response.
fn give(radio: &mut Radio<Listed>, now_ms: u64, frames: &[Bytes]) -> Vec<Bytes> {
    let answered = frames
        .iter()
        .map(|frame| response_frames(radio, now_ms, frame));
    answered.collect::<Vec<_>>().concat()
}

#[test]
fn without_lists_there_are_no_list_packets_and_no_timers() {
    let mut radio = radio(0);
    assert_eq!(timeout_frames(&mut radio, 0), Vec::<Bytes>::new());
    assert_eq!(radio.deadline(), None);
}

#[test]
fn radio_that_starts_with_an_older_list_receives_the_newer_one() {
    let (mut newer, mut older) = (with_list(0, 4), with_list(1, 2));
    let number = timeout_frames(&mut older, 0);
    assert_eq!(packets(&number), [RadioPacket::ListNumber(2)]);
    let given = give(&mut newer, 0, &number);
    assert!(packets(&given).contains(&list(4)));
    let (transmits, events) = handle(&mut older, 0, received(&given[0], None));
    assert_eq!(events, [Event::RevocationList { list: 4 }]);
    assert!(transmits.contains(&Transmit::KeepList(Bytes::from_static(&[4]))));
}

#[test]
fn radio_that_hears_of_a_newer_list_receives_it() {
    let (mut newer, mut older) = (with_list(0, 4), with_list(1, 2));
    // The first number of the older one is lost.
    timeout_frames(&mut older, 0);
    let number = timeout_frames(&mut newer, 2_000);
    assert_eq!(packets(&number), [RadioPacket::ListNumber(4)]);
    let wants = give(&mut older, 2_000, &number);
    assert_eq!(packets(&wants), [RadioPacket::ListNumber(2)]);
    let given = give(&mut newer, 2_000, &wants);
    assert_eq!(packets(&given), [list(4)]);
    give(&mut older, 2_000, &given);
    assert_eq!(older.list_number(), 4);
}

#[test]
fn new_list_is_passed_on_immediately_and_once() {
    let mut radio = with_list(0, 2);
    timeout_frames(&mut radio, 0);
    let number = timeout_frames(&mut with_list(1, 4), 0);
    assert_eq!(packets(&number), [RadioPacket::ListNumber(4)]);
    let frame = sent_by(&mut with_list(1, 4), &wire::encode_radio_packet(&list(4)));
    assert_eq!(packets(&give(&mut radio, 5_000, &[frame])), [list(4)]);
    assert_eq!(timeout_frames(&mut radio, 9_000), Vec::<Bytes>::new());
    // The same holds for a list from the operator.
    let (transmits, _) = handle(&mut radio, 9_000, Input::Revoked(Box::new(revoked(8))));
    assert_eq!(packets(&frames(transmits)), [list(8)]);
    // An older one of the operator changes nothing.
    handle(&mut radio, 9_000, Input::Revoked(Box::new(revoked(4))));
    assert_eq!(radio.list_number(), 8);
}

#[test]
fn unsigned_list_is_counted_and_not_taken() {
    let mut radio = with_list(0, 2);
    let frame = sent_by(&mut with_list(1, 9), &wire::encode_radio_packet(&list(9)));
    assert_eq!(
        dropped(&mut radio, 0, &frame),
        Some(DropReason::UnsignedList)
    );
    assert_eq!(radio.list_number(), 2);
}

#[test]
fn revoked_sender_receives_the_list_at_intervals() {
    let mut radio = with_list(0, 6);
    timeout_frames(&mut radio, 0);
    let mut revoked = with_list(2, 2);
    let mut received_packets = Vec::new();
    for now in (0..20_000).step_by(100) {
        let frame = sent_by(&mut revoked, b"I am here");
        received_packets.extend(packets(&response_frames(&mut radio, now, &frame)));
    }
    let lists = received_packets.iter().filter(|it| **it == list(6)).count();
    assert_eq!(lists, 2, "{received_packets:?}");
    // It still accepts frames of the others, so it receives the list.
    let frame = sent_by(&mut with_list(0, 6), &wire::encode_radio_packet(&list(6)));
    assert_eq!(dropped(&mut revoked, 0, &frame), None);
    assert_eq!(revoked.list_number(), 6);
}

#[test]
fn list_numbers_are_rate_limited() {
    let mut radio = with_list(0, 2);
    let mut peer = with_list(1, 200);
    let mut sent = 0;
    for now in (0..10_000).step_by(100) {
        let frame = sent_by(
            &mut peer,
            &wire::encode_radio_packet(&RadioPacket::ListNumber(200)),
        );
        sent += response_frames(&mut radio, now, &frame).len();
        sent += timeout_frames(&mut radio, now).len();
    }
    assert_eq!(sent, 10);
}
