use clap::{Args, ValueEnum};
use muster_msp::check::{Finding, ReceiverMode, check};
use muster_msp::{Configuration, Uid};
use muster_port::Address;
use muster_runtime::identity::ControllerFacts;
use muster_runtime::text::plural;
use serde_json::json;

use super::{
    ControllerError, Device, Failure, Outcome, add_command_line, ask_if_known, open, reading,
};
use crate::command::terminal;

/// Check whether a flight controller's settings are fit to fly.
///
/// Each finding says what is wrong, the setting, and what to enter in Betaflight's command line to mend it; `save` keeps it.
/// The exit code is 5 if there is one. Settings can't tell whether the aircraft itself is fit: motors, propellers, weight.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    device: Device,
    /// How it is to be flown; as it is configured if absent
    #[arg(long, value_enum)]
    receiver: Option<Receiver>,
    /// Read settings that no message has from Betaflight's command line. Disarmed only; the flight
    /// controller may restart.
    #[arg(long)]
    cli: bool,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Receiver {
    /// MSP alone: for bench and simulation, since no pilot can take over.
    Sole,
    /// MSP replaces a pilot's sticks while the pilot's switch allows it.
    Override,
}

impl From<Receiver> for ReceiverMode {
    fn from(receiver: Receiver) -> Self {
        match receiver {
            Receiver::Sole => Self::Sole,
            Receiver::Override => Self::Override,
        }
    }
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let Device { address, json } = &arguments.device;
    let (configuration, uid) = read(address, arguments.cli)?;
    let mode = arguments
        .receiver
        .map_or_else(|| ReceiverMode::of(&configuration), Into::into);
    let findings = check(&configuration, mode);
    let text = if *json {
        in_json(address, (&configuration, uid.as_ref()), mode, &findings)
    } else {
        self::findings(address, &configuration, mode, &findings)
    };
    terminal::print(&text)?;
    Ok(if findings.is_empty() {
        Outcome::Success
    } else {
        Outcome::Unfit
    })
}

/// The settings, and the number of the chip if the controller tells it.
fn read(address: &Address, cli: bool) -> Result<(Configuration, Option<Uid>), ControllerError> {
    let mut session = open(address)?;
    let mut configuration = reading(address, Configuration::read(&mut session))?;
    let uid = reading(address, ask_if_known(&mut session))?;
    if cli {
        add_command_line(address, session, &mut configuration)?;
    }
    Ok((configuration, uid))
}

/// The verdict, and a paragraph for each finding.
pub(in crate::command) fn findings(
    address: &Address,
    configuration: &Configuration,
    mode: ReceiverMode,
    findings: &[Finding],
) -> String {
    let verdict = match findings.len() {
        0 => "fit to fly".to_owned(),
        count => format!("not fit to fly, {}", plural(count, "finding")),
    };
    let version = &configuration.identity.version;
    let mut text = format!("{address}: Betaflight {version}, {mode}: {verdict}\n");
    for finding in findings {
        let Finding {
            rule,
            what,
            found,
            set,
        } = finding;
        let set = set.replace('\n', "\n         ");
        text.push_str(&format!(
            "  {rule}: {what}\n    found: {found}\n    set:   {set}\n"
        ));
    }
    if mode == ReceiverMode::Sole {
        text.push_str("  note: no pilot can take over: for bench and simulation\n");
    }
    text
}

fn in_json(
    address: &Address,
    (configuration, uid): (&Configuration, Option<&Uid>),
    mode: ReceiverMode,
    findings: &[Finding],
) -> String {
    let findings: Vec<_> = findings
        .iter()
        .map(|it| json!({"rule": it.rule, "what": it.what, "found": it.found, "set": it.set}))
        .collect();
    let report = json!({
        "device": address.to_string(),
        "version": configuration.identity.version.to_string(),
        "chip": uid.map(|uid| ControllerFacts::new(configuration, uid).chip),
        "receiver": mode.to_string(),
        "fit": findings.is_empty(),
        "findings": findings,
    });
    format!("{report}\n")
}
