use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, ValueEnum};
use muster_machines::identity::NodeId;
use muster_msp::check::{ReceiverMode, check};
use muster_port::Address;
use muster_runtime::diagnostic::BadInput;
use muster_runtime::identity::{CalendarTime, ControllerFacts, Fleet, Grant, GrantedStage};

use crate::command::{Failure, Outcome, fc, terminal};

const DAY: Duration = Duration::from_secs(86_400);

/// Sign a grant: what a drone may do above the stage `bench`, with the flight controller on a device.
///
/// The grant is bound to the drone and to the controller's chip, firmware and settings, and it has an end. The controller must
/// be disarmed and fit to be flown with a pilot's receiver (`muster fc check --receiver override --cli`); its command line is
/// read, after which it may restart. The exit code is 5 if it is not fit; then nothing is signed. A new grant replaces the
/// drone's last one.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Fleet folder.
    folder: PathBuf,
    /// Number of the drone.
    #[arg(value_name = "ID", value_parser = super::id)]
    id: u32,
    /// The highest stage that is granted.
    #[arg(long, value_enum)]
    stage: Stage,
    /// Serial port or TCP address of the drone's flight controller.
    #[arg(long, value_name = "DEVICE", value_parser = fc::address)]
    controller: Address,
    #[command(flatten)]
    end: End,
}

#[derive(Debug, Args)]
#[group(required = true, multiple = false)]
struct End {
    /// When it ends, as 2026-12-24T18:00:00Z.
    #[arg(long, value_name = "TIME", value_parser = time)]
    until: Option<CalendarTime>,
    /// Days until it ends.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=366))]
    days: Option<u32>,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Stage {
    /// Height, radius, tilt and throttle are capped.
    Tethered,
    /// Nothing is capped.
    Flight,
}

fn time(text: &str) -> Result<CalendarTime, String> {
    CalendarTime::read(text).ok_or_else(|| "a time has the form 2026-12-24T18:00:00Z".to_owned())
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let Arguments {
        folder,
        controller: address,
        ..
    } = arguments;
    let fleet = Fleet::open(folder)?;
    let issued = CalendarTime::of_this_clock();
    let until = match (arguments.end.until, arguments.end.days) {
        (Some(until), _) => until,
        (None, days) => issued.after(days.unwrap_or_default() * DAY),
    };
    if until <= issued {
        let message = format!("a grant until {until} has ended: it is {issued}");
        return Err(BadInput::without_excerpt(folder, message, "choose a later end").into());
    }
    let (configuration, uid) = fc::read_for_grant(address)?;
    let findings = check(&configuration, ReceiverMode::Override);
    if !findings.is_empty() {
        let lines = fc::findings(address, &configuration, ReceiverMode::Override, &findings);
        terminal::print(&format!(
            "{lines}no grant was signed: a stage above bench needs a pilot's receiver and settings fit for it\n"
        ))?;
        return Ok(Outcome::Unfit);
    }
    let grant = Grant {
        drone: NodeId(arguments.id),
        stage: match arguments.stage {
            Stage::Tethered => GrantedStage::Tethered,
            Stage::Flight => GrantedStage::Flight,
        },
        controller: ControllerFacts::new(&configuration, &uid),
        issued,
        until,
    };
    let path = fleet.grant(&grant)?;
    terminal::print(&in_lines(&grant, &path.display().to_string()))?;
    Ok(Outcome::Success)
}

fn in_lines(grant: &Grant, path: &str) -> String {
    let Grant {
        drone,
        stage,
        controller,
        until,
        ..
    } = grant;
    let ControllerFacts {
        chip,
        firmware,
        settings,
    } = controller;
    let settings: String = settings[..8].iter().map(|it| format!("{it:02x}")).collect();
    format!(
        "signed {path}\n  drone:    {drone}\n  stage:    {stage}\n  until:    {until}\n  chip:     {chip}\n  firmware: \
         {firmware}\n  settings: {settings}… (SHA-256)\ncopy it to drone {drone}, and name it in the drone's file as \
         `keys.grant`\n"
    )
}
