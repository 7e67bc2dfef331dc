//! Recorded and hand-made frames decode to what they mean, and back.

use std::fmt::Debug;

use muster_msp::{
    AccCalibration, AdvancedConfig, Altitude, Analog, ApiVersion, ArmingConfig, Attitude,
    BatteryConfig, BatteryState, BoardInfo, BoxIds, BoxNames, CfSerialConfig, Channel, CompGps,
    Decode, Decoder, Direction, EepromWrite, Encode, FailsafeConfig, FcVariant, FcVersion,
    FeatureConfig, Frame, Message, ModeRanges, Motor, MotorOutput, Name, OpticalFlow, PidAdvanced,
    RangefinderSample, RawGps, RawImu, Rc, RcTuning, Reboot, ReceivedMotors, ReceivedRc, RxConfig,
    RxFailConfig, RxMap, SetMotor, SetRawRc, Sonar, Status, StatusEx, Sticks, Uid, Version, encode,
    order, reply, request,
};
use serde::Deserialize;

#[derive(Deserialize)]
struct Golden {
    frame: Vec<Row>,
}

#[derive(Deserialize)]
struct Row {
    name: String,
    source: String,
    hex: String,
    meaning: String,
}

impl Row {
    fn bytes(&self) -> Vec<u8> {
        let byte = |it| u8::from_str_radix(it, 16).expect("hex");
        self.hex.split(' ').map(byte).collect()
    }
}

fn golden() -> Vec<Row> {
    let golden: Golden = toml::from_str(include_str!("data/golden.toml")).expect("TOML");
    golden.frame
}

/// What a frame means, and the frame again from that meaning.
struct Read {
    meaning: String,
    again: Vec<u8>,
}

fn read<M: Decode + Encode + Debug>(frame: &Frame<'_>) -> Read {
    let message = M::decode(frame.payload).expect("a golden frame");
    let mut again = Vec::new();
    match frame.direction {
        Direction::Request => order(frame.version, &message, &mut again),
        Direction::Reply | Direction::Error => reply(frame.version, &message, &mut again),
    }
    .expect("it was encoded before");
    Read {
        meaning: format!("{message:?}"),
        again,
    }
}

/// For what is written as another type than it is read as.
fn read_only<M: Decode + Debug>(frame: &Frame<'_>) -> Read {
    let message = M::decode(frame.payload).expect("a golden frame");
    Read {
        meaning: format!("{message:?}"),
        ..read_raw(frame)
    }
}

fn read_raw(frame: &Frame<'_>) -> Read {
    let mut again = Vec::new();
    encode(frame, &mut again).expect("it was encoded before");
    Read {
        meaning: format!("{:?} {:02x?}", frame.direction, frame.payload),
        again,
    }
}

macro_rules! by_command {
    ($frame:ident, $($message:ident),*) => {
        match $frame.command {
            $( $message::COMMAND => read::<$message>(&$frame), )*
            ReceivedRc::COMMAND => read_only::<ReceivedRc>(&$frame),
            ReceivedMotors::COMMAND => read_only::<ReceivedMotors>(&$frame),
            _ => read_raw(&$frame),
        }
    };
}

fn interpret(frame: Frame<'_>) -> Read {
    let to_controller = [
        RangefinderSample::COMMAND,
        OpticalFlow::COMMAND,
        Reboot::COMMAND,
        EepromWrite::COMMAND,
        AccCalibration::COMMAND,
    ];
    let is_order = to_controller.contains(&frame.command);
    let is_message = match frame.direction {
        Direction::Request => is_order || !frame.payload.is_empty(),
        Direction::Reply => !frame.payload.is_empty() || frame.command == Name::COMMAND,
        Direction::Error => false,
    };
    if !is_message {
        return read_raw(&frame);
    }
    by_command!(
        frame,
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
        EepromWrite,
        AccCalibration
    )
}

#[test]
fn golden_frames_mean_what_the_table_says() {
    for row in golden() {
        let bytes = row.bytes();
        let mut all = Vec::new();
        let mut decoder = Decoder::default();
        decoder.read(&bytes, |frame| all.push(interpret(frame)));
        let label = format!("{} ({})", row.name, row.source);
        assert_eq!(all.len(), 1, "{label}: {:?}", decoder.counts());
        assert_eq!(all[0].meaning, row.meaning, "{label}");
        assert_eq!(all[0].again, bytes, "{label}");
    }
}

#[test]
fn golden_frames_survive_any_neighbour() {
    let stream: Vec<u8> = golden().iter().flat_map(Row::bytes).collect();
    let mut decoder = Decoder::default();
    let mut frames = 0;
    decoder.read(&stream, |_| frames += 1);
    assert_eq!(frames, golden().len());
    assert_eq!(decoder.counts().noise_bytes, 0);
}

fn row(name: &str) -> Vec<u8> {
    let row = golden().into_iter().find(|it| it.name == name);
    row.expect("a golden frame").bytes()
}

fn written(write: impl FnOnce(&mut Vec<u8>) -> Result<(), muster_msp::EncodeError>) -> Vec<u8> {
    let mut out = Vec::new();
    write(&mut out).expect("short enough");
    out
}

#[test]
fn requests_and_orders_are_the_golden_bytes() {
    let channels = SetRawRc::new(Sticks::IDLE, &[Channel::LOW; 4]).expect("4 aux channels");
    let v1 = Version::V1;
    assert_eq!(
        written(|out| request::<ApiVersion>(v1, out)),
        row("request API_VERSION")
    );
    assert_eq!(
        written(|out| request::<Attitude>(Version::V2, out)),
        row("request ATTITUDE in v2")
    );
    assert_eq!(
        written(|out| request::<Attitude>(Version::V2OverV1, out)),
        row("request ATTITUDE in v2 over v1")
    );
    assert_eq!(
        written(|out| order(v1, &channels, out)),
        row("request SET_RAW_RC")
    );
    assert_eq!(
        written(|out| order(v1, &SetMotor::STOP, out)),
        row("request SET_MOTOR")
    );
    assert_eq!(
        written(|out| muster_msp::refuse(v1, 0x79, out)),
        row("unknown 0x79")
    );
    assert_eq!(
        written(|out| muster_msp::acknowledge(v1, SetRawRc::COMMAND, out)),
        row("SET_RAW_RC")
    );
}

#[test]
fn betaflight_takes_sent_channels_for_the_named_ones() {
    let sent = row("request SET_RAW_RC");
    let mut received = None;
    Decoder::default().read(&sent, |frame| {
        received = ReceivedRc::decode(frame.payload).ok();
    });
    let expected = Rc::from(&received.expect("channels"));
    let mut reported = None;
    Decoder::default().read(&row("RC after SET_RAW_RC"), |frame| {
        reported = Rc::decode(frame.payload).ok();
    });
    let reported = reported.expect("channels");
    assert_eq!(reported.throttle_us, Channel::LOW.us());
    assert_eq!(
        (
            reported.roll_us,
            reported.pitch_us,
            reported.yaw_us,
            reported.throttle_us
        ),
        (
            expected.roll_us,
            expected.pitch_us,
            expected.yaw_us,
            expected.throttle_us
        ),
    );
    assert_eq!(reported.aux_us[..4], expected.aux_us[..4]);
}

#[test]
fn values_outside_their_range_can_not_be_held() {
    assert!(Channel::new(884).is_err() && Channel::new(2116).is_err());
    assert!(Channel::new(885).is_ok() && Channel::new(2115).is_ok());
    assert!(MotorOutput::new(999).is_err() && MotorOutput::new(2001).is_err());
    assert!(SetRawRc::new(Sticks::IDLE, &[Channel::LOW; 15]).is_err());
    assert!(SetRawRc::new(Sticks::IDLE, &[Channel::LOW; 14]).is_ok());
}

#[test]
fn a_short_message_is_refused_with_what_it_lacks() {
    let error = Attitude::decode(&[0; 5]).expect_err("one byte is missing");
    assert_eq!(
        error.to_string(),
        "MSP_ATTITUDE of 5 bytes, at least 6 are needed"
    );
    let error = BoardInfo::decode(b"S405\0\0\0\0\x09ab").expect_err("7 bytes are missing");
    assert_eq!(
        error.to_string(),
        "MSP_BOARD_INFO of 11 bytes, at least 18 are needed"
    );
    let error = ReceivedRc::decode(&[0; 38]).expect_err("19 channels");
    assert_eq!(
        error.to_string(),
        "MSP_SET_RAW_RC of 38 bytes, at most 36 are allowed"
    );
}

#[test]
fn a_longer_message_of_newer_firmware_is_accepted() {
    let attitude = Attitude::decode(&[1, 0, 2, 0, 3, 0, 9, 9]).expect("longer is fine");
    assert_eq!(attitude.yaw_deg, 3);
    let rates = RcTuning::decode(&[7; 40]).expect("longer is fine");
    assert_eq!(rates.throttle_hover, Some(7));
}

#[test]
fn a_part_of_a_field_that_older_firmware_lacks_is_ignored() {
    let rates = RcTuning::decode(&[7; 17]).expect("without limits of rates");
    assert_eq!(
        (rates.throttle_limit_percent, rates.rate_limits_dps),
        (Some(7), None)
    );
    assert_eq!(rates.rates_type, None);
    assert!(RcTuning::decode(&[7; 11]).is_err());
    assert!(PidAdvanced::decode(&[0; 17]).is_err());
}
