//! Frames and their payloads: any bytes are decoded or refused, and re-encoding keeps the decoded value.

use muster_machines::wire;

pub(super) fn run(bytes: &[u8]) {
    let sender = wire::sender(bytes);
    if let Ok(frame) = wire::decode_frame(bytes) {
        assert_eq!(sender, Some(frame.header.sender));
        read_payload(frame.payload);
        let mut encoded = wire::encode_covered(&frame.header, frame.payload);
        encoded.extend_from_slice(frame.authenticator);
        let decoded = wire::decode_frame(&encoded).expect("an encoded frame is decoded");
        assert_eq!(
            (decoded.header, decoded.payload),
            (frame.header, frame.payload)
        );
    }
    read_payload(bytes);
}

fn read_payload(payload: &[u8]) {
    if let Ok((_, words)) = wire::split_tree(payload) {
        assert!(words.len() < payload.len());
    }
    assert!(wire::decode_message(payload).is_err() || wire::is_message(payload));
    if let Ok(packet) = wire::decode_packet(&payload.to_vec().into()) {
        let encoded = wire::encode_packet(&packet);
        assert_eq!(wire::decode_packet(&encoded.into()).as_ref(), Ok(&packet));
    }
    if let Some(packet) = wire::decode_radio_packet(payload) {
        let encoded = wire::encode_radio_packet(&packet);
        assert_eq!(wire::decode_radio_packet(&encoded), Some(packet));
    }
    if let Ok(order) = wire::decode_order(payload) {
        let encoded = wire::encode_order(&order);
        assert_eq!(wire::decode_order(&encoded).as_ref(), Ok(&order));
    }
}
