use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, ValueEnum};
use muster_deploy::promotion::{CHAOS_PLANS_MIN, PromotionRequest, SearchFacts, promote};
use muster_experiments::chaos::{Request, Search};
use muster_machines::identity::NodeId;
use muster_msp::check::{ReceiverMode, check};
use muster_port::Address;
use muster_runtime::diagnostic::BadInput;
use muster_runtime::identity::{
    CalendarTime, ControllerFacts, EvidenceKind, Fleet, Grant, GrantedStage, hex,
};

use crate::command::{Failure, Outcome, fc, keys, numbers, terminal};

const DAY: Duration = Duration::from_secs(86_400);
/// The longest time that a grant is signed for.
const DAYS_MAX: u32 = 366;

/// Sign a grant: a drone may do more, for what was shown of it, with the flight controller on a device.
///
/// Each stage needs a grant for the one before, and files that show what was done there. Their hashes (SHA-256) go into the
/// grant, and count again for the next one. The grant is bound to the drone and to the controller's chip, firmware and
/// settings, and it has an end. With another controller, or other settings, the drone begins at `bench` again.
///
/// The controller must be disarmed and fit to be flown with a pilot's receiver (`muster fc check --receiver override --cli`);
/// its command line is read, after which it may restart. The exit code is 5 if it is not fit; then nothing is signed.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Fleet folder.
    folder: PathBuf,
    /// Number of the drone.
    #[arg(value_name = "ID", value_parser = keys::id)]
    id: u32,
    /// The highest stage that is granted.
    #[arg(long = "to", value_enum)]
    stage: Stage,
    /// Serial port or TCP address of the drone's flight controller.
    #[arg(long, value_name = "DEVICE", value_parser = fc::address)]
    controller: Address,
    #[command(flatten)]
    end: End,
    #[command(flatten)]
    files: Files,
}

/// What was shown. `bench` needs the first three, `tethered` also the check, `flight` also the log.
#[derive(Debug, Args)]
struct Files {
    /// Search of 1,000 plans or more in which no rule was broken: chaos.json of `muster chaos chaos-controllers`, by this version
    #[arg(long, value_name = "FILE")]
    chaos: Option<PathBuf>,
    /// Flight with simulated flight controllers: report.json of `muster sim` or `muster swarm`
    #[arg(long, value_name = "FILE")]
    simulated: Option<PathBuf>,
    /// Flight with Betaflight's software build: report.json of `muster swarm --firmware`
    #[arg(long, value_name = "FILE")]
    betaflight: Option<PathBuf>,
    /// Check of this flight controller: what `muster fc check DEVICE --receiver override --cli --json` prints
    #[arg(long, value_name = "FILE")]
    bench: Option<PathBuf>,
    /// Log of the drone's process, in JSON, with a flight in the stage `tethered`
    #[arg(long, value_name = "FILE")]
    tether: Option<PathBuf>,
}

impl Files {
    fn by_kind(&self) -> BTreeMap<EvidenceKind, PathBuf> {
        let files = [
            (EvidenceKind::Chaos, &self.chaos),
            (EvidenceKind::Simulated, &self.simulated),
            (EvidenceKind::Betaflight, &self.betaflight),
            (EvidenceKind::Bench, &self.bench),
            (EvidenceKind::Tether, &self.tether),
        ];
        let named = files
            .into_iter()
            .filter_map(|(kind, path)| Some((kind, path.clone()?)));
        named.collect()
    }
}

#[derive(Debug, Args)]
#[group(required = true, multiple = false)]
struct End {
    /// When it ends, within 366 days, as 2026-12-24T18:00:00Z.
    #[arg(long, value_name = "TIME", value_parser = time)]
    until: Option<CalendarTime>,
    /// Days until it ends.
    #[arg(long, value_name = "N", value_parser = numbers::whole::<u32>(1..=DAYS_MAX.into()), allow_negative_numbers = true)]
    days: Option<u32>,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Stage {
    /// Telemetry; no motor turns.
    Bench,
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
    let latest = issued.after(DAYS_MAX * DAY);
    if until > latest {
        let message = format!("a grant until {until} lasts for more than {DAYS_MAX} days");
        let help = format!("choose an end up to {latest}");
        return Err(BadInput::without_excerpt(folder, message, help).into());
    }
    let (configuration, uid) = fc::read_for_grant(address)?;
    let findings = check(&configuration, ReceiverMode::Override);
    if !findings.is_empty() {
        let lines = fc::findings(address, &configuration, ReceiverMode::Override, &findings);
        terminal::print(&format!(
            "{lines}no grant was signed: each stage needs a pilot's receiver and settings fit for it\n"
        ))?;
        return Ok(Outcome::Unfit);
    }
    let request = PromotionRequest {
        drone: NodeId(arguments.id),
        stage: match arguments.stage {
            Stage::Bench => GrantedStage::Bench,
            Stage::Tethered => GrantedStage::Tethered,
            Stage::Flight => GrantedStage::Flight,
        },
        controller: ControllerFacts::new(&configuration, &uid),
        search: search()?,
        issued,
        until,
        files: arguments.files.by_kind(),
    };
    let (grant, path) = promote(&fleet, &request)?;
    terminal::print(&in_lines(&grant, &path.display().to_string()))?;
    Ok(Outcome::Success)
}

/// The search that counts, as this version runs it.
fn search() -> Result<SearchFacts, BadInput> {
    let seeds = format!("0..{CHAOS_PLANS_MIN}").parse();
    let search = Search::load(&Request {
        scenario: PathBuf::from("chaos-controllers"),
        set: Vec::new(),
        seeds: seeds.expect("a range of seeds"),
        keeps_going: false,
    })?;
    let (program, content) = search.identity();
    Ok(SearchFacts {
        program: program.to_owned(),
        content: content.to_owned(),
    })
}

fn in_lines(grant: &Grant, path: &str) -> String {
    let Grant {
        drone,
        stage,
        controller,
        until,
        evidence,
        ..
    } = grant;
    let ControllerFacts {
        chip,
        firmware,
        settings,
    } = controller;
    let evidence = evidence.hashes();
    let evidence = evidence.map(|(kind, sha256)| format!("  {kind}: {}…\n", hex(&sha256[..8])));
    let (settings, evidence) = (hex(&settings[..8]), evidence.collect::<String>());
    format!(
        "signed {path}\n  drone:    {drone}\n  stage:    {stage}\n  until:    {until}\n  chip:     {chip}\n  firmware: \
         {firmware}\n  settings: {settings}… (SHA-256)\n{evidence}copy it to drone {drone}, and name it in the drone's file as \
         `keys.grant`\n"
    )
}
