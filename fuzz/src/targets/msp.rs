//! A flight controller's bytes: any are frames or noise, in any pieces alike, within the decoder's limit. Any payload is a
//! message or refused, and what is written again is read alike.

use std::fmt::Debug;

use muster_msp::{
    AdvancedConfig, Altitude, Analog, ApiVersion, ArmingConfig, Attitude, BatteryConfig,
    BatteryState, BoardInfo, BoxIds, BoxNames, CfSerialConfig, CompGps, Decode, Decoder, Encode,
    FRAME_MAX, FRAME_TIME_MAX, FailsafeConfig, FcVariant, FcVersion, FeatureConfig, ModeRanges,
    ModeRangesExtra, Motor, Name, OpticalFlow, PidAdvanced, REQUEST_MAX, RangefinderSample, RawGps,
    RawImu, Rc, RcTuning, Reboot, ReceivedMotors, ReceivedRc, RxConfig, RxFailConfig, RxMap, Sonar,
    Status, StatusEx, Uid, Version, encode, reply,
};

/// The pieces in which the stream is read once more, in bytes.
const PIECE: usize = 7;

pub(super) fn run(bytes: &[u8]) {
    let at_once = read(bytes, bytes.len().max(1));
    assert_eq!(at_once, read(bytes, PIECE));
    // Either what is in frames or what is a payload, for time.
    if at_once.is_empty() {
        read_payload(bytes);
    }
}

/// Payloads of all frames.
fn read(bytes: &[u8], piece: usize) -> Vec<Vec<u8>> {
    let mut decoder = Decoder::default();
    let (mut payloads, mut in_frames) = (Vec::new(), 0);
    let mut take = |frame: muster_msp::Frame<'_>| {
        let mut written = Vec::new();
        let is_written = encode(&frame, &mut written).is_ok();
        assert!(is_written || frame.payload.len() > REQUEST_MAX, "{frame:?}");
        in_frames += written.len() as u64;
        payloads.push(frame.payload.to_vec());
    };
    for piece in bytes.chunks(piece) {
        decoder.read(piece, &mut take);
        assert!(decoder.held() <= FRAME_MAX);
    }
    for tenth in 0.. {
        if decoder.held() == 0 {
            break;
        }
        decoder.expire(tenth * FRAME_TIME_MAX, &mut take);
    }
    // A frame may be written shorter than it was: a jumbo frame that needs to be none.
    assert!(in_frames + decoder.counts().noise_bytes <= bytes.len() as u64);
    payloads
}

fn read_payload(payload: &[u8]) {
    let _ = (ReceivedRc::decode(payload), ReceivedMotors::decode(payload));
    macro_rules! all {
        ($($message:ident),* $(,)?) => { $( again::<$message>(payload); )* };
    }
    all!(
        ApiVersion,
        FcVariant,
        FcVersion,
        BoardInfo,
        Uid,
        Name,
        Status,
        StatusEx,
        RawImu,
        Motor,
        Rc,
        RawGps,
        CompGps,
        Attitude,
        Altitude,
        Analog,
        BatteryState,
        BatteryConfig,
        BoxIds,
        BoxNames,
        ModeRanges,
        ModeRangesExtra,
        RxMap,
        RxConfig,
        FailsafeConfig,
        RxFailConfig,
        FeatureConfig,
        CfSerialConfig,
        AdvancedConfig,
        RcTuning,
        PidAdvanced,
        Sonar,
        ArmingConfig,
        RangefinderSample,
        OpticalFlow,
        Reboot,
    );
}

/// What is read, written and read again is the same.
fn again<M: Decode + Encode + Debug + PartialEq>(payload: &[u8]) {
    let Ok(message) = M::decode(payload) else {
        return;
    };
    let mut written = Vec::new();
    if reply(Version::V2, &message, &mut written).is_err() {
        // Longer than a frame may be.
        return;
    }
    let mut read = None;
    Decoder::default().read(&written, |frame| read = M::decode(frame.payload).ok());
    assert_eq!(read.as_ref(), Some(&message));
}
