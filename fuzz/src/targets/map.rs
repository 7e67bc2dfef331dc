//! Maps: any text and any image are a map within its limits, or refused with a place in the text.

use muster_indoor::map::{CELLS_MAX, Header, Map};

/// Fields of a map whose image the bytes are.
const HEADER: &str = "image: floor.pgm\nresolution: 0.05\norigin: [0, 0, 0.1]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.2\n";

pub(super) fn run(bytes: &[u8]) {
    if let Ok(text) = std::str::from_utf8(bytes) {
        match Header::parse(text) {
            Ok(header) => check(&header, &[]),
            Err(refusal) => {
                assert!(refusal.span.start <= refusal.span.end && refusal.span.end <= text.len());
            }
        }
    }
    check(&Header::parse(HEADER).expect("a constant"), bytes);
}

fn check(header: &Header, image: &[u8]) {
    if let Ok(map) = Map::parse(header, image) {
        assert!((1..=CELLS_MAX).contains(&(map.columns() * map.rows())));
        for cell in map.cells().take(64) {
            assert_eq!(map.cell(map.centre(cell)), Some(cell));
        }
    }
}
