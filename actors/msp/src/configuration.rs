//! What of a controller's configuration decides whether it is fit to fly.

use crate::field::Payload;
use crate::message::{
    AdvancedConfig, ApiVersion, ArmingConfig, BatteryConfig, BoardInfo, BoxIds, CfSerialConfig,
    Decode, Encode, FailsafeConfig, FcVariant, FcVersion, FeatureConfig, Message, ModeRanges,
    ModeRangesExtra, PidAdvanced, RcTuning, RxConfig, RxFailConfig, RxMap,
};

/// Something that a controller can be asked through.
pub trait Ask {
    /// Why there is no answer.
    type Error;

    /// Sends a request, and waits for the message that answers it.
    ///
    /// # Errors
    /// If there is no answer, or none that is the message.
    fn ask<Q: Encode, M: Decode>(&mut self, request: &Q) -> Result<M, Self::Error>;
}

/// A request for a message: no payload.
struct For<M>(std::marker::PhantomData<M>);

impl<M: Message> Message for For<M> {
    const COMMAND: u16 = M::COMMAND;
    const NAME: &'static str = M::NAME;
}

impl<M: Message> Encode for For<M> {
    fn encode(&self, _: &mut Payload) {}
}

/// Asks for a message that needs no parameter.
///
/// # Errors
/// Those of [`Ask::ask`].
pub fn ask<M: Decode, A: Ask>(controller: &mut A) -> Result<M, A::Error> {
    controller.ask(&For::<M>(std::marker::PhantomData))
}

/// A request for the modes from the 32nd on.
struct FurtherBoxIds;

impl Message for FurtherBoxIds {
    const COMMAND: u16 = BoxIds::COMMAND;
    const NAME: &'static str = BoxIds::NAME;
}

impl Encode for FurtherBoxIds {
    fn encode(&self, to: &mut Payload) {
        to.write(&[1]);
    }
}

/// Modes on a page of [`BoxIds`].
pub(crate) const BOXES_A_PAGE: usize = 32;

/// Who the controller is.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Identity {
    /// Version of the protocol.
    pub api: ApiVersion,
    /// Name of the firmware.
    pub variant: FcVariant,
    /// Version of the firmware.
    pub version: FcVersion,
    /// The board.
    pub board: BoardInfo,
    /// Its modes.
    pub boxes: BoxIds,
}

/// Board of Betaflight's software in the loop and of ours, which no motor hangs on.
const SIMULATION: [u8; 4] = *b"SITL";

impl Identity {
    /// Whether its board says that it is a simulation, with no motor.
    #[must_use]
    pub fn is_simulation(&self) -> bool {
        self.board.board.0 == SIMULATION
    }

    /// Asks who it is: five or six requests.
    ///
    /// # Errors
    /// Those of [`Ask::ask`].
    pub fn read<A: Ask>(controller: &mut A) -> Result<Self, A::Error> {
        Ok(Self {
            api: ask(controller)?,
            variant: ask(controller)?,
            version: ask(controller)?,
            board: ask(controller)?,
            boxes: read_boxes(controller)?,
        })
    }

    /// Whether overridden channels fall back to the pilot's receiver 300 ms after the last `MSP_SET_RAW_RC`: Betaflight 2026.6
    /// and newer. Older firmware holds them for ever.
    #[must_use]
    pub fn override_falls_back(&self) -> bool {
        self.is_betaflight() && self.version.release() >= (26, 6)
    }

    /// Whether the firmware has the setting `angle_feedforward`: Betaflight 4.5 and newer.
    #[must_use]
    pub fn has_angle_feedforward(&self) -> bool {
        self.is_betaflight() && self.version.release() >= (4, 5)
    }

    /// Whether the firmware is Betaflight.
    #[must_use]
    pub fn is_betaflight(&self) -> bool {
        self.variant.variant.0 == *b"BTFL"
    }

    /// Whether the mode ANGLE leans by the rates in force, as [`StickResponse`](crate::StickResponse) says: Betaflight 4.5.2 and
    /// newer. 4.4 leans in proportion to the stick; 4.5.0 and 4.5.1 divide by the largest rate of an earlier rate profile
    /// (Betaflight's change 13862).
    #[must_use]
    pub fn leans_by_rates(&self) -> bool {
        let FcVersion {
            major,
            minor,
            patch,
            ..
        } = self.version;
        self.is_betaflight() && (major, minor, patch) >= (4, 5, 2)
    }
}

fn read_boxes<A: Ask>(controller: &mut A) -> Result<BoxIds, A::Error> {
    let mut boxes: BoxIds = ask(controller)?;
    if boxes.modes.len() == BOXES_A_PAGE {
        let further: BoxIds = controller.ask(&FurtherBoxIds)?;
        boxes.modes.extend(further.modes);
    }
    Ok(boxes)
}

/// A controller's configuration.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Configuration {
    /// Who it is.
    pub identity: Identity,
    /// Features.
    pub features: FeatureConfig,
    /// Order of channels.
    pub map: RxMap,
    /// Receiver.
    pub receiver: RxConfig,
    /// Channels without a receiver.
    pub lost: RxFailConfig,
    /// What a lost receiver leads to.
    pub failsafe: FailsafeConfig,
    /// What activates the modes.
    pub ranges: ModeRanges,
    /// How these are combined.
    pub extras: ModeRangesExtra,
    /// Arming.
    pub arming: ArmingConfig,
    /// Battery.
    pub battery: BatteryConfig,
    /// Serial ports.
    pub serial: CfSerialConfig,
    /// Motors.
    pub motors: AdvancedConfig,
    /// Rates.
    pub rates: RcTuning,
    /// Largest tilt.
    pub angle: PidAdvanced,
    /// What only the command line tells; `None` if it wasn't asked.
    pub command_line: Option<CommandLineSettings>,
}

impl Configuration {
    /// Asks for all of it but what only the command line tells: 18 or 19 requests.
    ///
    /// # Errors
    /// Those of [`Ask::ask`].
    pub fn read<A: Ask>(controller: &mut A) -> Result<Self, A::Error> {
        Ok(Self {
            identity: Identity::read(controller)?,
            features: ask(controller)?,
            map: ask(controller)?,
            receiver: ask(controller)?,
            lost: ask(controller)?,
            failsafe: ask(controller)?,
            ranges: ask(controller)?,
            extras: ask(controller)?,
            arming: ask(controller)?,
            battery: ask(controller)?,
            serial: ask(controller)?,
            motors: ask(controller)?,
            rates: ask(controller)?,
            angle: ask(controller)?,
            command_line: None,
        })
    }

    /// All that it is set to, in one piece, to tell whether it has changed: each message's number, length and payload. Who it
    /// is, and what only the command line tells, are left out.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        append(&self.features, &mut bytes);
        append(&self.map, &mut bytes);
        append(&self.receiver, &mut bytes);
        append(&self.lost, &mut bytes);
        append(&self.failsafe, &mut bytes);
        append(&self.ranges, &mut bytes);
        append(&self.extras, &mut bytes);
        append(&self.arming, &mut bytes);
        append(&self.battery, &mut bytes);
        append(&self.serial, &mut bytes);
        append(&self.motors, &mut bytes);
        append(&self.rates, &mut bytes);
        append(&self.angle, &mut bytes);
        bytes
    }
}

fn append<M: Encode>(message: &M, out: &mut Vec<u8>) {
    let payload = Payload::of(message);
    let payload = payload.bytes();
    out.extend(M::COMMAND.to_le_bytes());
    out.extend((payload.len() as u64).to_le_bytes());
    out.extend(payload);
}

/// Settings that no message has up to Betaflight 4.6, only the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CommandLineSettings {
    /// Those of the mode MSP OVERRIDE. `None`: the firmware has no override.
    pub over_ride: Option<OverrideSettings>,
    /// `angle_feedforward`, in percent. `None`: the firmware has none, as before 4.5, or it could not be read.
    pub angle_feedforward: Option<u8>,
}

impl CommandLineSettings {
    /// The settings, by their names on the command line.
    pub const NAMES: [&'static str; 3] = [
        "msp_override_channels_mask",
        "msp_override_failsafe",
        "angle_feedforward",
    ];

    /// From the answers of the command line's `get`, which have lines such as `msp_override_channels_mask = 15`.
    #[must_use]
    pub fn from_answers(answers: &str) -> Self {
        let [mask, failsafe, feedforward] = Self::NAMES.map(|name| value(answers, name));
        let mask = mask.and_then(|it| it.parse().ok());
        Self {
            over_ride: mask.map(|mask| OverrideSettings {
                mask,
                failsafe: failsafe.and_then(|it| match it {
                    "ON" => Some(true),
                    "OFF" => Some(false),
                    _ => None,
                }),
            }),
            angle_feedforward: feedforward.and_then(|it| it.parse().ok()),
        }
    }
}

/// Settings of the mode MSP OVERRIDE.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OverrideSettings {
    /// `msp_override_channels_mask`: which of the receiver's channels MSP replaces; bit 0 is the first.
    pub mask: u32,
    /// `msp_override_failsafe`: whether MSP alone counts as a receiver, so that a lost pilot's receiver goes unnoticed. `None`: it
    /// could not be read.
    pub failsafe: Option<bool>,
}

fn value<'a>(answers: &'a str, name: &str) -> Option<&'a str> {
    answers.lines().find_map(|line| {
        let (left, right) = line.split_once('=')?;
        (left.trim() == name).then(|| right.trim())
    })
}
