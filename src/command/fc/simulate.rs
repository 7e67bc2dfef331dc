use std::fs::File;
use std::io;
use std::net::{SocketAddr, TcpListener};
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};

use clap::Args;
use muster_controller::{Config, Settings};
use muster_deploy::controller::{LiveController, Server};
use muster_machines::geodetic::Geodetic;
use muster_machines::msp::controller::Receiver;
use muster_runtime::diagnostic::BadInput;
use muster_scenarios::{controllers, scenario};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

use super::{ControllerError, Failure, Outcome};
use crate::command::{numbers, terminal};

/// Where the simulated aircraft stands without a scenario: degrees north and east, metres above sea level.
const PLACE: [f64; 3] = [39.48, -0.34, 20.0];

/// Simulate a flight controller with its aircraft, in real time.
///
/// It speaks MSP as Betaflight does, and its aircraft obeys physics. The companion is its only receiver; ARM is on AUX1
/// from 1,700 µs, ANGLE on AUX2 from 1,300 µs. When RC stops, it lands. It runs until it is interrupted.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  muster fc simulate --listen 127.0.0.1:5761
  muster fc simulate --listen 127.0.0.1:5762 --scenario swarm-controllers --drone 1
  muster fc simulate --pty /tmp/controller")]
pub(super) struct Arguments {
    #[command(flatten)]
    line: Line,
    /// Scenario file or shipped scenario; the aircraft stands where the drone starts in it.
    #[arg(long, value_name = "SCENARIO", requires = "drone")]
    scenario: Option<PathBuf>,
    /// Number of the drone in the scenario.
    #[arg(long, value_name = "ID", requires = "scenario", value_parser = numbers::whole::<u32>(0..=99_999), allow_negative_numbers = true)]
    drone: Option<u32>,
    /// Seed of the errors of its sensors.
    #[arg(long, default_value_t = 1, value_parser = numbers::whole::<u64>(0..=u64::MAX), allow_negative_numbers = true)]
    seed: u64,
}

#[derive(Debug, Args)]
#[group(required = true, multiple = false)]
struct Line {
    /// Wait for one TCP connection at a time.
    #[arg(long, value_name = "ADDRESS:PORT")]
    listen: Option<SocketAddr>,
    /// Open a pseudo-terminal and make a symbolic link to it; an existing link is replaced.
    #[arg(long, value_name = "LINK")]
    pty: Option<PathBuf>,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let controller = LiveController::start(configure(arguments)?, arguments.seed);
    let server = controller.server();
    if let Some(address) = arguments.line.listen {
        let source = listen(&server, address);
        source.map_err(|source| ControllerError::Listen { address, source })?;
    }
    if let Some(link) = &arguments.line.pty {
        open_pty(&server, link).map_err(|source| ControllerError::Pty {
            link: link.clone(),
            source,
        })?;
    }
    Ok(Outcome::Success)
}

fn configure(arguments: &Arguments) -> Result<Config, BadInput> {
    let (Some(path), Some(drone)) = (&arguments.scenario, arguments.drone) else {
        let [latitude, longitude, altitude_m] = PLACE;
        let place = Geodetic::new(latitude, longitude, altitude_m).expect("a place on the Earth");
        return Ok(Config::new(place, Settings::fit()));
    };
    let scenario = scenario::load(path, &[])?;
    let plan = &scenario.plan;
    if plan.receiver == Receiver::Override {
        let message = "its pilots are not simulated here";
        let help = "use `vehicle.receiver = \"sole\"`, or `muster swarm`, which simulates pilots";
        return Err(BadInput::without_excerpt(path, message, help));
    }
    let drones = plan.layout.formation().drones();
    let mut places = (0..drones).zip(plan.start_positions());
    let Some((_, place)) = places.find(|(id, _)| *id == drone) else {
        let message = format!("has no drone {drone}");
        let help = format!("its drones have the numbers 0 to {}", drones - 1);
        return Err(BadInput::without_excerpt(path, message, help));
    };
    Ok(controllers::config(&scenario, place))
}

fn listen(server: &Server, address: SocketAddr) -> io::Result<()> {
    let listener = TcpListener::bind(address)?;
    let address = listener.local_addr()?;
    terminal::print(&format!("simulated controller on tcp:{address}\n"))?;
    server.listen(&listener, |error| {
        // Without standard output nobody reads it.
        let _ = terminal::print(&format!("connection lost: {error}\n"));
    })
}

fn open_pty(server: &Server, link: &Path) -> io::Result<()> {
    let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY)?;
    grantpt(&master)?;
    unlockpt(&master)?;
    let name = ptsname(&master, Vec::new())?;
    let device = Path::new(std::ffi::OsStr::from_bytes(name.to_bytes()));
    // Kept open, so that the line lives on when a program closes it.
    let device_end = File::options().read(true).write(true).open(device)?;
    let mut modes = tcgetattr(&device_end)?;
    modes.make_raw();
    tcsetattr(&device_end, OptionalActions::Now, &modes)?;
    if link.is_symlink() {
        std::fs::remove_file(link)?;
    }
    std::os::unix::fs::symlink(device, link)?;
    let (link, device) = (link.display(), device.display());
    terminal::print(&format!("simulated controller on {link} ({device})\n"))?;
    server.serve(File::from(master))
}
