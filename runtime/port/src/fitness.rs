//! Whether a controller is fit to fly, looked at as soon as its port is open.

use muster_msp::check::{Finding, ReceiverMode, check, check_firmware};
use muster_msp::{Configuration, Identity, Mode, Status, Uid, ask};

use crate::session::{AskError, Session};

/// What a port found when it was opened.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// Who the controller is.
    pub identity: Identity,
    /// Number of its processor; `None` if it doesn't tell.
    pub uid: Option<Uid>,
    /// Its settings, but what only its command line tells; `None` if it is armed.
    pub configuration: Option<Configuration>,
}

/// A look at a controller.
pub(crate) struct Look {
    /// What makes it unfit to be flown.
    pub(crate) unfit: Vec<Finding>,
    /// `None` if it can't be read.
    pub(crate) found: Option<Found>,
}

impl Look {
    /// Whether the controller was armed, so that its settings were not looked at.
    pub(crate) fn is_of_armed(&self) -> bool {
        (self.found.as_ref()).is_some_and(|it| it.configuration.is_none())
    }
}

/// Looks whether a controller is fit to be flown in `mode`, except what only its command line tells. Of one that is armed only
/// the firmware is looked at: it flies already, and waits for RC.
///
/// # Errors
/// If the controller is silent, or the port fails.
pub(crate) fn look(session: &mut Session, mode: ReceiverMode) -> Result<Look, AskError> {
    match read(session) {
        Err(error @ (AskError::Silent { .. } | AskError::Port(_))) => Err(error),
        Err(error) => Ok(Look {
            unfit: vec![Finding {
                rule: "unread",
                what: "its settings can't be read",
                found: error.to_string(),
                set: "flash a newer Betaflight".to_owned(),
            }],
            found: None,
        }),
        Ok(found) => {
            let mut unfit = match &found.configuration {
                Some(configuration) => check(configuration, mode),
                None => check_firmware(&found.identity, mode),
            };
            unfit.retain(|it| !it.is_unread_command_line());
            let found = Some(found);
            Ok(Look { unfit, found })
        }
    }
}

fn read(session: &mut Session) -> Result<Found, AskError> {
    let identity = Identity::read(session)?;
    let status: Status = ask(session)?;
    let uid = match ask(session) {
        Err(AskError::Refused { .. }) => None,
        uid => Some(uid?),
    };
    let is_armed = identity.boxes.is_active(Mode::Arm, status.modes()) == Some(true);
    let configuration = (!is_armed).then(|| Configuration::read(session));
    Ok(Found {
        identity,
        uid,
        configuration: configuration.transpose()?,
    })
}
