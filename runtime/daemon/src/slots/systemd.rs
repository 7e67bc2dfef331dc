//! systemd, by its command.

use std::collections::BTreeMap;
use std::io;
use std::process::{Command, Stdio};

/// Name of a drone's service.
pub(super) fn service(drone: u32) -> String {
    format!("musterd@{drone}.service")
}

/// Name of the service of a trial.
pub(super) const TRIAL: &str = "muster-trial.service";

/// Name of the service that settles the slots at boot.
pub(super) const BOOT: &str = "muster-slots.service";

/// Name of the unit of drones.
pub(super) const DRONES: &str = "musterd@.service";

/// Runs `systemctl`, and says whether it succeeded.
pub(super) fn systemctl(arguments: &[&str]) -> io::Result<bool> {
    let mut command = Command::new("systemctl");
    command.arg("--quiet").args(arguments);
    command.stdin(Stdio::null()).stdout(Stdio::null());
    let status = command.stderr(Stdio::null()).status()?;
    Ok(status.success())
}

/// Properties of a unit.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct Unit(BTreeMap<String, String>);

impl Unit {
    /// Asks for them.
    pub(super) fn look(name: &str) -> io::Result<Self> {
        let mut command = Command::new("systemctl");
        command.args([
            "show",
            "--property=ActiveState,Result,ExecMainStatus,NRestarts",
        ]);
        let output = command.arg(name).stderr(Stdio::null()).output()?;
        Ok(Self::read(&String::from_utf8_lossy(&output.stdout)))
    }

    pub(super) fn read(text: &str) -> Self {
        let lines = text.lines().filter_map(|line| line.split_once('='));
        let properties = lines.map(|(key, value)| (key.to_owned(), value.to_owned()));
        Self(properties.collect())
    }

    fn get(&self, property: &str) -> &str {
        self.0.get(property).map_or("", String::as_str)
    }

    /// `active`, `activating`, `inactive`, `failed` and others.
    pub(super) fn state(&self) -> &str {
        self.get("ActiveState")
    }

    /// Why it ended: `success`, `exit-code`, `signal`, `watchdog` and others.
    pub(super) fn result(&self) -> &str {
        self.get("Result")
    }

    /// Exit code of its process.
    pub(super) fn exit_code(&self) -> Option<i32> {
        self.get("ExecMainStatus").parse().ok()
    }

    /// How often systemd has started it again.
    pub(super) fn restarts(&self) -> u32 {
        self.get("NRestarts").parse().unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn properties_are_read_as_systemctl_prints_them() {
        let unit =
            Unit::read("ActiveState=failed\nResult=exit-code\nExecMainStatus=2\nNRestarts=3\n");
        assert_eq!(unit.state(), "failed");
        assert_eq!(unit.result(), "exit-code");
        assert_eq!((unit.exit_code(), unit.restarts()), (Some(2), 3));
        assert_eq!(Unit::default().restarts(), 0);
    }
}
