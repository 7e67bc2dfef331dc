//! Permission to fly an aircraft above the stage `bench`, signed by the fleet's key.

use std::collections::BTreeMap;
use std::fmt::{self, Write};
use std::path::Path;
use std::time::Duration;

use ed25519_dalek::SigningKey;
use muster_machines::identity::NodeId;
use muster_msp::{Configuration, Identity, Uid};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use thiserror::Error;
use time::OffsetDateTime;
use time::format_description::well_known::Rfc3339;

use super::key::{bytes, hex, read_public, sign};
use super::lists::{NEVER_FAILS, append_signature, verify};
use super::{Evidence, EvidenceKind, FleetKey};
use crate::diagnostic::{BadInput, FileFormat, TomlFile};
use crate::schema::{FieldList, Located};

/// Prefix of a signed grant, so that its signature fits no other message.
const GRANT: &[u8] = b"muster grant 2\0";

const FORMAT: FileFormat = FileFormat {
    fields: FieldList::EMPTY,
    description: "a grant has `drone`, `stage`, `chip`, `firmware`, `settings`, `issued`, `until`, `signature` and \
         `[evidence]`, as `muster deploy promote` writes it",
};

/// The stages that are granted, lowest first. `bench` asks for no grant; what was shown for it counts further up.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
pub enum GrantedStage {
    /// Telemetry; turns no motor.
    Bench,
    /// Flies with height, tilt, throttle and radius capped.
    Tethered,
    /// Flies.
    Flight,
}

impl fmt::Display for GrantedStage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Bench => "bench",
            Self::Tethered => "tethered",
            Self::Flight => "flight",
        })
    }
}

/// A time on the calendar, to the second.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct CalendarTime(OffsetDateTime);

impl CalendarTime {
    /// What this machine's clock shows, which may be wrong.
    #[must_use]
    pub fn of_this_clock() -> Self {
        let now = OffsetDateTime::now_utc();
        Self(now.replace_nanosecond(0).unwrap_or(now))
    }

    /// Reads a time such as `2026-12-24T18:00:00Z` (RFC 3339). `None` if it is none.
    #[must_use]
    pub fn read(text: &str) -> Option<Self> {
        let time = OffsetDateTime::parse(text.trim(), &Rfc3339).ok()?;
        (time.nanosecond() == 0).then_some(Self(time))
    }

    /// A time later. The latest one that can be written, if it would be after that.
    #[must_use]
    pub fn after(self, span: Duration) -> Self {
        let seconds = i64::try_from(span.as_secs()).unwrap_or(i64::MAX);
        let later = self.0.checked_add(time::Duration::seconds(seconds));
        Self(later.unwrap_or(time::PrimitiveDateTime::MAX.assume_utc()))
    }
}

impl fmt::Display for CalendarTime {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0.format(&Rfc3339).map_err(|_| fmt::Error)?)
    }
}

/// A flight controller, as far as a grant is bound to it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ControllerFacts {
    /// Number of its processor, in hexadecimal.
    pub chip: String,
    /// Its firmware's name and version.
    pub firmware: String,
    /// SHA-256 of the settings that make it fit to fly.
    pub settings: [u8; 32],
}

impl ControllerFacts {
    /// The facts that a controller tells.
    #[must_use]
    pub fn new(configuration: &Configuration, uid: &Uid) -> Self {
        let settings = Sha256::digest(configuration.to_bytes()).into();
        Self::of_armed(&configuration.identity, uid, settings)
    }

    /// The facts of a controller that is not asked for its settings, as it is armed.
    #[must_use]
    pub fn of_armed(identity: &Identity, uid: &Uid, settings: [u8; 32]) -> Self {
        let [first, second, third] = uid.uid;
        Self {
            chip: format!("{first:08x}{second:08x}{third:08x}"),
            firmware: format!("{} {}", identity.variant.variant, identity.version),
            settings,
        }
    }
}

/// A grant.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Grant {
    /// For this drone only.
    pub drone: NodeId,
    /// The highest stage that it allows.
    pub stage: GrantedStage,
    /// With this controller only.
    pub controller: ControllerFacts,
    /// When it was signed.
    pub issued: CalendarTime,
    /// When it ends.
    pub until: CalendarTime,
    /// What it was signed for.
    pub evidence: Evidence,
}

/// Why a grant does not allow a stage.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum GrantRefusal {
    /// Its drone is another one.
    #[error("the grant is for drone {0}")]
    OtherDrone(NodeId),
    /// Its stage is lower.
    #[error("the grant allows the stage \"{0}\" only")]
    LowerStage(GrantedStage),
    /// It was signed without what a stage needs.
    #[error("the grant skips what the stage \"{stage}\" needs: no evidence of `{missing}`")]
    SkipsEvidence {
        /// The stage.
        stage: GrantedStage,
        /// The first kind that is missing.
        missing: EvidenceKind,
    },
    /// Its controller is another one.
    #[error("the grant is for the flight controller with the chip {granted}; this one has {found}")]
    OtherController {
        /// Chip in the grant.
        granted: String,
        /// Chip of the controller.
        found: String,
    },
    /// The controller's firmware is another one.
    #[error("the grant is for the firmware {granted}; the flight controller has {found}")]
    OtherFirmware {
        /// Firmware in the grant.
        granted: String,
        /// Firmware of the controller.
        found: String,
    },
    /// The controller's settings changed.
    #[error("the flight controller's settings have changed since the grant was signed")]
    OtherSettings,
    /// It is over.
    #[error("the grant ended at {until}; it is {now} or later")]
    Ended {
        /// Its end.
        until: CalendarTime,
        /// The newest time that is known.
        now: CalendarTime,
    },
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Raw {
    drone: u32,
    stage: GrantedStage,
    chip: String,
    firmware: String,
    settings: Located<String>,
    issued: Located<String>,
    until: Located<String>,
    signature: Located<String>,
    evidence: BTreeMap<EvidenceKind, Located<String>>,
}

impl Grant {
    /// Reads a grant and verifies its signature.
    ///
    /// # Errors
    /// If the file can't be used, or is not signed by the fleet's key.
    pub fn load(path: &Path, fleet: &FleetKey) -> Result<Self, BadInput> {
        let file = TomlFile::<Raw>::parse(path, read_public(path)?, FORMAT)?;
        let raw = &file.raw;
        let time = |field: &Located<String>| {
            CalendarTime::read(field.get_ref()).ok_or_else(|| {
                let help = "a time has the form 2026-12-24T18:00:00Z";
                file.error_with(field.span(), "this is not a time", help)
            })
        };
        let hash = |field: &Located<String>| {
            bytes::<32>(field.get_ref()).ok_or_else(|| {
                let help = "SHA-256 has 64 hexadecimal digits";
                file.error_with(field.span(), "this is not SHA-256", help)
            })
        };
        let evidence = raw.evidence.iter();
        let evidence = evidence.map(|(kind, field)| Ok((*kind, hash(field)?)));
        let grant = Self {
            drone: NodeId(raw.drone),
            stage: raw.stage,
            controller: ControllerFacts {
                chip: raw.chip.clone(),
                firmware: raw.firmware.clone(),
                settings: hash(&raw.settings)?,
            },
            evidence: evidence.collect::<Result<_, BadInput>>()?,
            issued: time(&raw.issued)?,
            until: time(&raw.until)?,
        };
        verify(&file, fleet, &grant.message(), &raw.signature)?;
        Ok(grant)
    }

    /// Checks whether it is for a drone and its stage; with which controller and when is not looked at.
    ///
    /// # Errors
    /// If it is for another drone or a lower stage, or was signed without what the stage needs.
    pub fn is_for(&self, drone: NodeId, stage: GrantedStage) -> Result<(), GrantRefusal> {
        if drone != self.drone {
            Err(GrantRefusal::OtherDrone(self.drone))
        } else if stage > self.stage {
            Err(GrantRefusal::LowerStage(self.stage))
        } else if let Some(missing) = self.evidence.missing_for(stage).first() {
            Err(GrantRefusal::SkipsEvidence {
                stage,
                missing: *missing,
            })
        } else {
            Ok(())
        }
    }

    /// Checks whether it allows a drone this stage with this controller. `newest`: the newest time that is known, of clock
    /// and journal; the time of the signature counts, too.
    ///
    /// # Errors
    /// The first reason why it does not.
    pub fn allows(
        &self,
        drone: NodeId,
        stage: GrantedStage,
        found: &ControllerFacts,
        newest: CalendarTime,
    ) -> Result<(), GrantRefusal> {
        self.is_for(drone, stage)?;
        let granted = &self.controller;
        let now = newest.max(self.issued);
        if now >= self.until {
            Err(GrantRefusal::Ended {
                until: self.until,
                now,
            })
        } else if found.chip != granted.chip {
            Err(GrantRefusal::OtherController {
                granted: granted.chip.clone(),
                found: found.chip.clone(),
            })
        } else if found.firmware != granted.firmware {
            Err(GrantRefusal::OtherFirmware {
                granted: granted.firmware.clone(),
                found: found.firmware.clone(),
            })
        } else if found.settings != granted.settings {
            Err(GrantRefusal::OtherSettings)
        } else {
            Ok(())
        }
    }

    /// The grant as a signed TOML file.
    pub(super) fn to_toml(&self, fleet: &SigningKey) -> String {
        let mut text = String::from(
            "# A grant to fly, signed with the fleet's key. Written by `muster deploy promote`.\n",
        );
        let controller = &self.controller;
        write!(
            text,
            "drone = {}\nstage = \"{}\"\nchip = \"{}\"\nfirmware = \"{}\"\nsettings = \"{}\"\nissued = \"{}\"\nuntil = \"{}\"\n",
            self.drone,
            self.stage,
            controller.chip,
            controller.firmware,
            hex(&controller.settings),
            self.issued,
            self.until,
        )
        .expect(NEVER_FAILS);
        append_signature(&mut text, &sign(fleet, &self.message()));
        text.push_str("\n[evidence]\n");
        for (kind, sha256) in self.evidence.hashes() {
            writeln!(text, "{kind} = \"{}\"", hex(sha256)).expect(NEVER_FAILS);
        }
        text
    }

    /// Each text is preceded by its length, so that no two grants have one message.
    fn message(&self) -> Vec<u8> {
        let controller = &self.controller;
        let texts = [
            self.stage.to_string(),
            controller.chip.clone(),
            controller.firmware.clone(),
            self.issued.to_string(),
            self.until.to_string(),
        ];
        let mut message = [GRANT, &self.drone.0.to_le_bytes(), &controller.settings].concat();
        for text in texts {
            message.extend_from_slice(&(text.len() as u64).to_le_bytes());
            message.extend_from_slice(text.as_bytes());
        }
        for (kind, sha256) in self.evidence.hashes() {
            let name = kind.name();
            message.extend_from_slice(&(name.len() as u64).to_le_bytes());
            message.extend_from_slice(name.as_bytes());
            message.extend_from_slice(sha256);
        }
        message
    }
}
