//! What a flight controller on the desk is, says and is fit for.

mod check;
mod flow;
mod probe;
mod simulate;
mod tune;
mod watch;

use std::net::SocketAddr;
use std::path::PathBuf;

use clap::{Args, Subcommand};
use muster_msp::check::{Finding, ReceiverMode};
use muster_msp::{Configuration, Decode, Uid, ask};
use muster_port::{Address, AskError, BadAddress, CommandLineError, Session, read_command_line};

pub(super) use self::check::findings;
use super::{Failure, Outcome};

/// Look at a flight controller that speaks MSP, such as Betaflight.
///
/// The device is a serial port or, for simulations, a TCP address: serial:/dev/ttyACM0, serial:/dev/ttyAMA0@115200,
/// tcp:127.0.0.1:5761. Nothing here arms, turns a motor or changes a setting. One program at a time can use a device.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  muster fc probe /dev/ttyACM0
  muster fc watch tcp:127.0.0.1:5761
  muster fc flow /dev/ttyUSB0
  muster fc check /dev/ttyACM0 --receiver override --cli")]
pub(crate) struct Arguments {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    Probe(probe::Arguments),
    Watch(watch::Arguments),
    Flow(flow::Arguments),
    Check(check::Arguments),
    Simulate(simulate::Arguments),
    Tune(tune::Arguments),
}

#[derive(Debug, Args)]
struct Device {
    /// Serial port or TCP address of the flight controller.
    #[arg(value_name = "DEVICE", value_parser = address)]
    address: Address,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Reads the name of a port.
pub(super) fn address(text: &str) -> Result<Address, BadAddress> {
    text.parse()
}

/// Why a flight controller could not be looked at.
#[derive(Debug, thiserror::Error)]
pub(crate) enum ControllerError {
    #[error("can't open {address}")]
    Open {
        address: Address,
        #[source]
        source: std::io::Error,
    },
    #[error("the port {address} failed")]
    Read {
        address: Address,
        #[source]
        source: std::io::Error,
    },
    #[error("can't read the flight controller on {address}")]
    Ask {
        address: Address,
        #[source]
        source: AskError,
    },
    #[error("can't simulate a flight controller on tcp:{address}")]
    Listen {
        address: SocketAddr,
        #[source]
        source: std::io::Error,
    },
    #[error("can't simulate a flight controller on {}", link.display())]
    Pty {
        link: PathBuf,
        #[source]
        source: std::io::Error,
    },
    #[error("can't read the settings of the override on {address}")]
    CommandLine {
        address: Address,
        #[source]
        source: CommandLineError,
    },
}

pub(crate) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    match &arguments.action {
        Action::Probe(arguments) => probe::run(arguments),
        Action::Watch(arguments) => watch::run(arguments),
        Action::Flow(arguments) => flow::run(arguments),
        Action::Check(arguments) => check::run(arguments),
        Action::Simulate(arguments) => simulate::run(arguments),
        Action::Tune(arguments) => tune::run(arguments),
    }
}

fn open(address: &Address) -> Result<Session, ControllerError> {
    Session::open(address).map_err(|source| ControllerError::Open {
        address: address.clone(),
        source,
    })
}

/// Reads from an open controller; says which one failed.
fn reading<T>(address: &Address, read: Result<T, AskError>) -> Result<T, ControllerError> {
    read.map_err(|source| ControllerError::Ask {
        address: address.clone(),
        source,
    })
}

/// Adds what only the command line tells.
fn add_command_line(
    address: &Address,
    session: Session,
    configuration: &mut Configuration,
) -> Result<(), ControllerError> {
    let settings = read_command_line(session, &configuration.identity);
    configuration.command_line = Some(settings.map_err(|source| ControllerError::CommandLine {
        address: address.clone(),
        source,
    })?);
    Ok(())
}

/// The settings of a disarmed controller and the number of its chip. The command line is asked only if all else is fit for a
/// pilot's receiver.
pub(super) fn read_for_grant(address: &Address) -> Result<(Configuration, Uid), ControllerError> {
    let mut session = open(address)?;
    let mut configuration = reading(address, Configuration::read(&mut session))?;
    let uid = reading(address, ask(&mut session))?;
    let findings = muster_msp::check::check(&configuration, ReceiverMode::Override);
    if findings.iter().all(Finding::is_unread_command_line) {
        add_command_line(address, session, &mut configuration)?;
    }
    Ok((configuration, uid))
}

/// A message that not every controller has.
fn ask_if_known<M: Decode>(session: &mut Session) -> Result<Option<M>, AskError> {
    match ask(session) {
        Ok(message) => Ok(Some(message)),
        Err(AskError::Refused { .. }) => Ok(None),
        Err(error) => Err(error),
    }
}
