//! Whether a controller is fit to fly, looked at as soon as its port is open.

use muster_msp::check::{Finding, ReceiverMode, check, check_firmware};
use muster_msp::{Configuration, Identity, Mode, Status, ask};

use crate::session::{AskError, Session};

/// What makes a controller unfit to be flown in `mode`, except what only its command line tells. Of one that is armed only the
/// firmware is looked at: it flies already, and waits for RC.
///
/// # Errors
/// If the controller is silent, or the port fails.
pub(crate) fn findings(
    session: &mut Session,
    mode: ReceiverMode,
) -> Result<Vec<Finding>, AskError> {
    match read(session, mode) {
        Err(error @ (AskError::Silent { .. } | AskError::Port(_))) => Err(error),
        Err(error) => Ok(vec![Finding {
            rule: "unread",
            what: "its settings can't be read",
            found: error.to_string(),
            set: "flash a newer Betaflight".to_owned(),
        }]),
        Ok(mut findings) => {
            findings.retain(|it| !it.is_unread_override());
            Ok(findings)
        }
    }
}

fn read(session: &mut Session, mode: ReceiverMode) -> Result<Vec<Finding>, AskError> {
    let identity = Identity::read(session)?;
    let status: Status = ask(session)?;
    if identity.boxes.is_active(Mode::Arm, status.modes()) == Some(true) {
        return Ok(check_firmware(&identity, mode));
    }
    Ok(check(&Configuration::read(session)?, mode))
}
