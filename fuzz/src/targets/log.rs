//! Logs of scans: any text is a log within its limits, or refused with a place in the text.

use muster_indoor::log::{BEAMS_MAX, parse};

pub(super) fn run(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else {
        return;
    };
    match parse(text) {
        Ok(steps) => assert!(
            steps
                .iter()
                .all(|step| (2..=BEAMS_MAX).contains(&step.scan.ranges_m.len()))
        ),
        Err(refusal) => {
            assert!(text.get(refusal.span).is_some());
            assert!(!refusal.accepted.is_empty());
        }
    }
}
