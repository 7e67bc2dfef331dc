//! Frames and all that they carry: whatever the bytes, they are read or refused, and what is read is written as it was
//! meant.

use muster_machines::wire;

pub(crate) fn run(bytes: &[u8]) {
    let sender = wire::sender(bytes);
    if let Ok(frame) = wire::decode_frame(bytes) {
        assert_eq!(sender, Some(frame.header.sender));
        read_payload(frame.payload);
        let mut again = wire::encode_covered(&frame.header, frame.payload, Vec::new());
        again.extend_from_slice(frame.authenticator);
        let read = wire::decode_frame(&again).expect("what was written is read");
        assert_eq!((read.header, read.payload), (frame.header, frame.payload));
    }
    read_payload(bytes);
}

fn read_payload(payload: &[u8]) {
    if let Ok((_, words)) = wire::split_tree(payload) {
        assert!(words.len() < payload.len());
    }
    if let Ok(packet) = wire::decode_packet(payload) {
        let again = wire::encode_packet(&packet);
        assert_eq!(wire::decode_packet(&again).as_ref(), Ok(&packet));
    }
    if let Some(packet) = wire::decode_radio_packet(payload) {
        let again = wire::encode_radio_packet(&packet);
        assert_eq!(wire::decode_radio_packet(&again), Some(packet));
    }
    if let Ok(order) = wire::decode_order(payload) {
        let again = wire::encode_order(&order);
        assert_eq!(wire::decode_order(&again).as_ref(), Ok(&order));
    }
}
