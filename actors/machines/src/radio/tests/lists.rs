use std::cell::Cell;

use super::*;

/// Whoever has a list has its number for the list; the fleet signs no odd ones.
struct Listed(Cell<u8>);

impl Authenticator for Listed {
    fn is_trusted(&self, sender: NodeId) -> bool {
        // List 6 has drone 2 on it.
        self.0.get() < 6 || sender != NodeId(2)
    }

    fn sign(&self, covered: &[u8]) -> [u8; AUTHENTICATOR_LEN] {
        IdealAuthenticator.sign(covered)
    }

    fn verify(&self, sender: NodeId, covered: &[u8], with: &[u8; AUTHENTICATOR_LEN]) -> bool {
        IdealAuthenticator.verify(sender, covered, with)
    }

    fn list_number(&self) -> u64 {
        self.0.get().into()
    }

    fn list(&self) -> Option<Bytes> {
        Some(Bytes::copy_from_slice(&[self.0.get()]))
    }

    fn take_list(&self, list: &[u8]) -> Offer {
        match list {
            [number] if number % 2 == 1 => Offer::Unsigned,
            [number] if *number < self.0.get() => Offer::Older,
            [number] if *number == self.0.get() => Offer::Same,
            [number] => {
                self.0.set(*number);
                Offer::Newer
            }
            _ => Offer::Unsigned,
        }
    }
}

fn with_list(id: u32, list: u8) -> Radio<Listed> {
    let listed = Listed(Cell::new(list));
    Radio::new(config(id), listed, 1, Checkpoint::default(), 0)
}

fn list(number: u8) -> Packet {
    Packet::List(Bytes::copy_from_slice(&[number]))
}

fn packets(frames: &[Bytes]) -> Vec<Packet> {
    frames.iter().map(packet).collect()
}

/// Tells a radio all of these; what it answers.
fn tell(radio: &mut Radio<Listed>, now_ms: u64, frames: &[Bytes]) -> Vec<Bytes> {
    let answered = frames.iter().map(|frame| answers(radio, now_ms, frame));
    answered.collect::<Vec<_>>().concat()
}

#[test]
fn without_lists_nothing_is_said_of_them_and_nothing_is_waited_for() {
    let mut radio = radio(0);
    assert_eq!(says(&mut radio, 0), Vec::<Bytes>::new());
    assert_eq!(radio.deadline(), None);
}

#[test]
fn whoever_starts_with_an_older_list_is_given_the_newer_one() {
    let (mut newer, mut older) = (with_list(0, 4), with_list(1, 2));
    let number = says(&mut older, 0);
    assert_eq!(packets(&number), [Packet::ListNumber(2)]);
    let given = tell(&mut newer, 0, &number);
    assert!(packets(&given).contains(&list(4)));
    let (_, events) = told(&mut older, 0, received(&given[0], None));
    assert_eq!(events, [Event::RevocationList { list: 4 }]);
}

#[test]
fn whoever_hears_of_a_newer_list_gets_it() {
    let (mut newer, mut older) = (with_list(0, 4), with_list(1, 2));
    // What the older one says at its start, nobody hears.
    says(&mut older, 0);
    let number = says(&mut newer, 2_000);
    assert_eq!(packets(&number), [Packet::ListNumber(4)]);
    let wants = tell(&mut older, 2_000, &number);
    assert_eq!(packets(&wants), [Packet::ListNumber(2)]);
    let given = tell(&mut newer, 2_000, &wants);
    assert_eq!(packets(&given), [list(4)]);
    tell(&mut older, 2_000, &given);
    assert_eq!(older.authenticator.list_number(), 4);
}

#[test]
fn a_list_that_is_new_to_a_radio_is_passed_on_at_once_and_once() {
    let mut radio = with_list(0, 2);
    says(&mut radio, 0);
    let news = says(&mut with_list(1, 4), 0);
    assert_eq!(packets(&news), [Packet::ListNumber(4)]);
    let frame = sent_by(&mut with_list(1, 4), &wire::encode_radio_packet(&list(4)));
    assert_eq!(packets(&tell(&mut radio, 5_000, &[frame])), [list(4)]);
    assert_eq!(says(&mut radio, 9_000), Vec::<Bytes>::new());
    // Likewise one that its operator has given it.
    radio.authenticator.0.set(8);
    assert_eq!(packets(&says(&mut radio, 9_000)), [list(8)]);
}

#[test]
fn a_list_that_the_fleet_has_not_signed_is_counted_and_not_taken() {
    let mut radio = with_list(0, 2);
    let frame = sent_by(&mut with_list(1, 9), &wire::encode_radio_packet(&list(9)));
    assert_eq!(
        dropped(&mut radio, 0, &frame),
        Some(DropReason::UnsignedList)
    );
    assert_eq!(radio.authenticator.list_number(), 2);
}

#[test]
fn whoever_is_expelled_and_speaks_is_told_so_now_and_then() {
    let mut radio = with_list(0, 6);
    says(&mut radio, 0);
    let mut revoked = with_list(2, 2);
    let mut told = Vec::new();
    for now in (0..20_000).step_by(100) {
        let frame = sent_by(&mut revoked, b"I am here");
        told.extend(packets(&answers(&mut radio, now, &frame)));
    }
    let lists = told.iter().filter(|it| **it == list(6)).count();
    assert_eq!(lists, 2, "{told:?}");
    // It believes the others still, and so hears of it.
    let frame = sent_by(&mut with_list(0, 6), &wire::encode_radio_packet(&list(6)));
    assert_eq!(dropped(&mut revoked, 0, &frame), None);
    assert_eq!(revoked.authenticator.list_number(), 6);
}

#[test]
fn numbers_are_said_rarely_whatever_others_say() {
    let mut radio = with_list(0, 2);
    let mut liar = with_list(1, 200);
    let mut said = 0;
    for now in (0..10_000).step_by(100) {
        let frame = sent_by(
            &mut liar,
            &wire::encode_radio_packet(&Packet::ListNumber(200)),
        );
        said += answers(&mut radio, now, &frame).len();
        said += says(&mut radio, now).len();
    }
    assert_eq!(said, 10);
}
