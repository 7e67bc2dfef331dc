//! systemd, by its command.

use std::collections::BTreeMap;
use std::io;
use std::path::PathBuf;
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

/// systemd of a host.
#[derive(Debug, Clone)]
pub(super) struct Systemd {
    /// The program `systemctl`, or another for tests.
    pub(super) program: PathBuf,
}

impl Systemd {
    /// Runs `systemctl`, and says whether it succeeded.
    pub(super) fn run(&self, arguments: &[&str]) -> io::Result<bool> {
        let mut command = Command::new(&self.program);
        command.arg("--quiet").args(arguments);
        command.stdin(Stdio::null()).stdout(Stdio::null());
        let status = command.stderr(Stdio::null()).status()?;
        Ok(status.success())
    }

    /// Runs `systemctl`.
    ///
    /// # Errors
    /// If it fails.
    pub(super) fn order(&self, arguments: &[&str]) -> io::Result<()> {
        if self.run(arguments)? {
            return Ok(());
        }
        let arguments = arguments.join(" ");
        Err(io::Error::other(format!("systemctl {arguments} failed")))
    }

    /// Asks for the properties of a unit.
    pub(super) fn look(&self, name: &str) -> io::Result<Unit> {
        let mut command = Command::new(&self.program);
        command.args([
            "show",
            "--property=ActiveState,Result,ExecMainStatus,ExecMainStartTimestampMonotonic,ActiveEnterTimestampMonotonic,NRestarts,MainPID",
        ]);
        let output = command.arg(name).stderr(Stdio::null()).output()?;
        Ok(Unit::read(&String::from_utf8_lossy(&output.stdout)))
    }
}

/// Properties of a unit.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct Unit(BTreeMap<String, String>);

impl Unit {
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

    /// Whether it has a process, or gets one again.
    pub(super) fn is_running(&self) -> bool {
        !matches!(self.state(), "inactive" | "failed" | "")
    }

    /// Why it ended: `success`, `exit-code`, `signal`, `watchdog` and others.
    pub(super) fn result(&self) -> &str {
        self.get("Result")
    }

    /// Whether its process ended by itself, with an exit code.
    pub(super) fn has_exited(&self) -> bool {
        matches!(self.result(), "success" | "exit-code")
    }

    /// Exit code of its process.
    pub(super) fn exit_code(&self) -> Option<i32> {
        self.get("ExecMainStatus").parse().ok()
    }

    /// When its process started last, in microseconds since the host did. 0 if it never has.
    pub(super) fn started_us(&self) -> u64 {
        let started = self.get("ExecMainStartTimestampMonotonic");
        started.parse().unwrap_or(0)
    }

    /// Whether its last process has said that it was ready.
    pub(super) fn was_ready(&self) -> bool {
        let ready = self.get("ActiveEnterTimestampMonotonic");
        let ready = ready.parse().unwrap_or(0_u64);
        ready != 0 && ready >= self.started_us()
    }

    /// How often systemd has started it again.
    pub(super) fn restarts(&self) -> u32 {
        self.get("NRestarts").parse().unwrap_or(0)
    }

    /// Number of its process. `None` if it has none.
    pub(super) fn process(&self) -> Option<u32> {
        self.get("MainPID").parse().ok().filter(|pid| *pid != 0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn properties_are_read_as_systemctl_prints_them() {
        let unit = Unit::read(
            "ActiveState=failed\nResult=exit-code\nExecMainStatus=2\nNRestarts=3\nMainPID=0\n",
        );
        assert_eq!(unit.state(), "failed");
        assert_eq!(unit.result(), "exit-code");
        assert_eq!((unit.exit_code(), unit.restarts()), (Some(2), 3));
        assert_eq!((unit.process(), unit.is_running()), (None, false));
        assert_eq!(Unit::default().restarts(), 0);
    }
}
