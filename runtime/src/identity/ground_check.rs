//! What a drone keeps of its flight controller's last check on the ground.

use std::path::Path;

use serde::Deserialize;

use super::grant::{CalendarTime, ControllerFacts};
use super::key::{bytes, hex};
use crate::diagnostic::{BadInput, FileFormat, TomlFile, read_text};
use crate::schema::{FieldList, Located};

const FORMAT: FileFormat = FileFormat {
    fields: FieldList::EMPTY,
    description: "the last check of a flight controller has `time`, `chip`, `firmware` and `settings`, as `musterd` keeps it",
};

/// The last check of a flight controller on the ground.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct GroundCheck {
    /// The newest time that was known then. A clock that is set back, or has lost its battery, is behind it.
    pub time: CalendarTime,
    /// The controller as it was then. An armed one is not asked for its settings.
    pub controller: ControllerFacts,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Raw {
    time: Located<String>,
    chip: String,
    firmware: String,
    settings: Located<String>,
}

impl GroundCheck {
    /// Reads the check that is kept. `None` if none is.
    ///
    /// # Errors
    /// If the file can't be used.
    pub fn load(path: &Path) -> Result<Option<Self>, BadInput> {
        if let Ok(false) = path.try_exists() {
            return Ok(None);
        }
        let file = TomlFile::<Raw>::parse(path, read_text(path)?, FORMAT)?;
        let raw = &file.raw;
        let Some(time) = CalendarTime::read(raw.time.get_ref()) else {
            return Err(file.error(raw.time.span(), "this is not a time"));
        };
        let Some(settings) = bytes::<32>(raw.settings.get_ref()) else {
            return Err(file.error(raw.settings.span(), "this is not SHA-256"));
        };
        Ok(Some(Self {
            time,
            controller: ControllerFacts {
                chip: raw.chip.clone(),
                firmware: raw.firmware.clone(),
                settings,
            },
        }))
    }

    /// As a TOML file.
    #[must_use]
    pub fn to_toml(&self) -> String {
        let Self { time, controller } = self;
        let ControllerFacts { chip, firmware, .. } = controller;
        let settings = hex(&controller.settings);
        format!(
            "# The flight controller when it was checked last on the ground. Written by `musterd`.\n\
             time = \"{time}\"\nchip = \"{chip}\"\nfirmware = \"{firmware}\"\nsettings = \"{settings}\"\n"
        )
    }
}
