//! A recorded session of Betaflight decodes to what an independent client reads from it; see `data/README.md`.

use muster_msp::{
    Altitude, Analog, Attitude, BatteryConfig, Decode, Decoder, Direction, FailsafeConfig,
    FcVersion, Frame, Message, ModeRange, ModeRanges, Motor, PidAdvanced, RawImu, Rc, RcTuning,
    ReceivedRc, Status, StatusEx, StatusHead,
};
use serde::Deserialize;
use serde_json::{Value, json};

const SENT: &[u8] = include_bytes!("data/session-sent.bin");
const RECEIVED: &[u8] = include_bytes!("data/session-received.bin");

/// Values of a reply, as the independent client gives them; `None` for messages without one to compare.
fn values(frame: &Frame<'_>) -> Option<Value> {
    fn read<M: Decode>(frame: &Frame<'_>) -> M {
        M::decode(frame.payload).expect("Betaflight sent it")
    }
    let rounded = |value: f64, digits: f64| (value * digits).round() / digits;
    Some(match frame.command {
        Status::COMMAND => {
            let status: Status = read(frame);
            json!(head(&status.head))
        }
        StatusEx::COMMAND => {
            let StatusEx {
                head: start,
                pid_profiles,
                rate_profile,
                flags,
            } = read(frame);
            let mut all = head(&start);
            let profiles = [pid_profiles, rate_profile, flags.arming.count].map(u32::from);
            all.push(start.load_percent.into());
            all.extend(profiles);
            all.push(flags.arming.bits);
            json!(all)
        }
        RawImu::COMMAND => {
            let imu: RawImu = read(frame);
            json!([imu.acceleration, imu.rate_dps, imu.magnetic].concat())
        }
        Motor::COMMAND => json!(read::<Motor>(frame).outputs_us),
        Rc::COMMAND => {
            let rc: Rc = read(frame);
            let sticks = [rc.roll_us, rc.pitch_us, rc.yaw_us, rc.throttle_us];
            json!([&sticks[..], &rc.aux_us].concat())
        }
        Attitude::COMMAND => {
            let attitude: Attitude = read(frame);
            let degrees = |tenths: i16| f64::from(tenths) / 10.0;
            json!([
                degrees(attitude.roll_ddeg),
                degrees(attitude.pitch_ddeg),
                attitude.yaw_deg
            ])
        }
        Altitude::COMMAND => {
            let altitude: Altitude = read(frame);
            json!([rounded(f64::from(altitude.altitude_cm) / 100.0, 100.0)])
        }
        Analog::COMMAND => {
            let analog: Analog = read(frame);
            let volts = f64::from(analog.voltage_dv) / 10.0;
            json!([
                volts,
                analog.drawn_mah,
                analog.rssi,
                f64::from(analog.current_ca) / 100.0
            ])
        }
        _ => return None,
    })
}

fn head(head: &StatusHead) -> Vec<u32> {
    vec![
        head.cycle_us.into(),
        head.i2c_errors.into(),
        head.sensors.0.into(),
        head.modes,
        head.pid_profile.into(),
    ]
}

#[test]
fn ten_thousand_frames_mean_what_an_independent_client_reads() {
    let decoded: Vec<Value> = include_str!("data/session-decoded.jsonl")
        .lines()
        .map(|line| serde_json::from_str(line).expect("JSON"))
        .collect();
    let lengths = include_str!("data/session-reads.txt").lines();
    let mut decoder = Decoder::default();
    let (mut frames, mut compared) = (0, 0);
    let mut rest = RECEIVED;
    for length in lengths {
        let (piece, after) = rest.split_at(length.parse().expect("a length"));
        rest = after;
        decoder.read(piece, |frame| {
            let expected = decoded[frames].as_array().expect("an array");
            frames += 1;
            if frame.direction == Direction::Error {
                assert_eq!(expected[..], [json!("error")]);
                return;
            }
            assert_eq!(expected[0], frame.command);
            if let (Some(found), true) = (values(&frame), expected.len() > 1) {
                let (found, expected) = (found.to_string(), json!(expected[1..]).to_string());
                assert_eq!(found, expected, "reply {frames}, command {}", frame.command);
                compared += 1;
            }
        });
    }
    assert_eq!((rest.len(), frames), (0, decoded.len()));
    assert!(compared > 2_000, "{compared} compared");
    assert_eq!(
        (decoder.counts().bad(), decoder.counts().noise_bytes),
        (0, 0)
    );
}

#[test]
fn betaflight_answers_every_frame_that_was_sent() {
    let mut decoder = Decoder::default();
    let (mut frames, mut channels) = (0, 0);
    decoder.read(SENT, |frame| {
        frames += 1;
        assert_eq!(frame.direction, Direction::Request);
        if frame.command == ReceivedRc::COMMAND {
            channels += 1;
            assert!(ReceivedRc::decode(frame.payload).is_ok());
        }
    });
    assert_eq!((frames, decoder.counts().bad()), (5_000, 0));
    assert!(channels > 1_000, "{channels} frames of channels");
}

/// One byte in two hundred altered: every frame that lost none is read, and nothing else is taken for one.
#[test]
fn at_half_a_percent_of_wrong_bytes_whole_frames_are_read() {
    let mut whole = Vec::new();
    Decoder::default().read(RECEIVED, |frame| {
        whole.push((frame.command, frame.payload.to_vec()));
    });
    let mut altered = RECEIVED.to_vec();
    // A generator of its own (MINSTD), so that the places are the same everywhere.
    let mut random = 42_u64;
    let mut wrong = 0;
    for byte in &mut altered {
        random = random * 48_271 % 2_147_483_647;
        if random.is_multiple_of(200) {
            *byte ^= 1 + u8::try_from(random / 200 % 255).expect("below 255");
            wrong += 1;
        }
    }
    let mut decoder = Decoder::default();
    let mut read = Vec::new();
    decoder.read(&altered, |frame| {
        read.push((frame.command, frame.payload.to_vec()));
    });
    let mut rest = whole.iter();
    let invented = read
        .iter()
        .filter(|frame| !rest.any(|it| it == *frame))
        .count();
    assert_eq!(invented, 0);
    let lost = whole.len() - read.len();
    assert!(
        wrong > 350 && lost <= wrong,
        "{wrong} wrong bytes cost {lost} frames"
    );
}

#[derive(Deserialize)]
struct Replies {
    reply: Vec<Reply>,
}

#[derive(Deserialize)]
struct Reply {
    name: String,
    reply: String,
    /// What the independent client reads, as JSON.
    yamspy: Option<String>,
}

/// A recorded reply, and what the independent client reads from it.
fn reply<M: Decode>(name: &str) -> (M, Value) {
    let replies: Replies = toml::from_str(include_str!("data/replies.toml")).expect("TOML");
    let reply = replies
        .reply
        .into_iter()
        .find(|it| it.name == name)
        .expect("it was recorded");
    let byte = |at: usize| u8::from_str_radix(&reply.reply[at..at + 2], 16).expect("hex");
    let bytes: Vec<u8> = (0..reply.reply.len()).step_by(2).map(byte).collect();
    let mut found = None;
    Decoder::default().read(&bytes, |frame| found = M::decode(frame.payload).ok());
    let read = reply.yamspy.expect("the client reads it");
    let read = serde_json::from_str(&read).expect("JSON");
    (found.expect("a reply"), read)
}

#[test]
fn settings_are_what_an_independent_client_reads() {
    let (version, read) = reply::<FcVersion>("FC_VERSION");
    assert_eq!(json!([version.to_string()]), read);
    let (it, read) = reply::<FailsafeConfig>("FAILSAFE_CONFIG");
    let codes = (u8::from(it.switch), u8::from(it.procedure));
    let values = json!([
        it.delay_ds,
        it.landing_s,
        it.throttle_us,
        codes.0,
        it.throttle_low_delay_ds,
        codes.1
    ]);
    assert_eq!(values, read);
    let (battery, read) = reply::<BatteryConfig>("BATTERY_CONFIG");
    let cell = battery.cell();
    let volts = |it: u16| f64::from(it) / 100.0;
    let limits = [
        volts(cell.min_cv),
        volts(cell.max_cv),
        volts(cell.warning_cv),
    ];
    assert_eq!(
        json!(limits),
        json!(read.as_array().expect("an array")[..3])
    );
    let (ranges, read) = reply::<ModeRanges>("MODE_RANGES");
    let row = |it: &ModeRange| json!([u8::from(it.mode), it.aux, it.first_us(), it.end_us()]);
    assert_eq!(ranges.ranges.iter().map(row).collect::<Value>(), read);
}

#[test]
fn rates_are_what_an_independent_client_reads_and_the_command_line_says() {
    let (it, read) = reply::<RcTuning>("RC_TUNING");
    let share = |percent: u8| f64::from(percent) / 100.0;
    let [roll, pitch, yaw] = it.srates;
    let shares = [it.roll_rc_rate, it.roll_expo, roll, pitch, yaw];
    let mut values: Vec<Value> = shares.map(|it| json!(share(it))).into();
    let further = [
        it.throttle_mid,
        it.throttle_expo,
        it.yaw_expo,
        it.yaw_rc_rate,
    ];
    values.extend(further.map(|it| json!(share(it))));
    let of_pitch = [it.pitch_rc_rate, it.pitch_expo];
    values.extend(of_pitch.map(|it| json!(it.map(share))));
    values.push(json!(it.throttle_limit.map(u8::from)));
    values.push(json!(it.throttle_limit_percent));
    values.extend(it.rate_limits_dps.expect("API 1.47").map(|it| json!(it)));
    assert_eq!(json!(values), read);
    // The client knows neither.
    let words = (it.rates_type.map(|it| it.to_string()), it.throttle_hover);
    assert_eq!(words, (Some("QUICK".to_owned()), Some(52)));
    let (it, read) = reply::<PidAdvanced>("PID_ADVANCED");
    assert_eq!(json!([it.angle_limit_deg]), read);
}
