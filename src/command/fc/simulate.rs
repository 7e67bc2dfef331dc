use std::fs::File;
use std::io::{self, ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpListener};
use std::os::fd::AsFd;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::Args;
use muster_controller::{Config, Controller, Settings};
use muster_machines::geodetic::Geodetic;
use muster_machines::time::Timestamp;
use muster_runtime::diagnostic::BadInput;
use muster_scenarios::scenario;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

use super::{ControllerError, Failure, Outcome};
use crate::command::terminal;

/// Where the simulated aircraft stands without a scenario: degrees north and east, metres above sea level.
const PLACE: [f64; 3] = [39.48, -0.34, 20.0];

/// Longest time without a look at the line.
const PAUSE: Duration = Duration::from_millis(100);

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
    #[arg(long, value_name = "ID", requires = "scenario")]
    drone: Option<u32>,
    /// Seed of the errors of its sensors.
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

#[derive(Debug, Args)]
#[group(required = true, multiple = false)]
struct Line {
    /// Wait for one TCP connection at a time.
    #[arg(long, value_name = "HOST:PORT")]
    listen: Option<SocketAddr>,
    /// Open a pseudo-terminal and make a symbolic link to it; an existing link is replaced.
    #[arg(long, value_name = "LINK")]
    pty: Option<PathBuf>,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let mut bench = Bench {
        start: Instant::now(),
        controller: Controller::new(configure(arguments)?, arguments.seed, Timestamp::ZERO),
    };
    if let Some(address) = arguments.line.listen {
        let source = listen(&mut bench, address);
        source.map_err(|source| ControllerError::Listen { address, source })?;
    }
    if let Some(link) = &arguments.line.pty {
        open_pty(&mut bench, link).map_err(|source| ControllerError::Pty {
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
    let plan = scenario::load(path, &[])?.plan;
    let drones = plan.layout.formation().drones();
    let mut places = (0..drones).zip(plan.start_positions());
    let Some((_, place)) = places.find(|(id, _)| *id == drone) else {
        let message = format!("has no drone {drone}");
        let help = format!("its drones have the numbers 0 to {}", drones - 1);
        return Err(BadInput::without_excerpt(path, message, help));
    };
    let mut config = Config::new(plan.home, Settings::fit());
    config.place = place;
    Ok(config)
}

/// A controller on the clock of this machine.
struct Bench {
    start: Instant,
    controller: Controller,
}

impl Bench {
    fn now(&self) -> Timestamp {
        Timestamp::ZERO + self.start.elapsed()
    }

    /// Carries bytes until the line is closed. Bytes that the reader doesn't take are lost, as on a serial line.
    fn serve(&mut self, mut line: impl Read + Write + AsFd) -> io::Result<()> {
        rustix::io::ioctl_fionbio(&line, true)?;
        let mut bytes = [0; 1_024];
        loop {
            let now = self.now();
            let due = self.controller.next_event();
            let pause = due.map_or(PAUSE, |due| due.since(now).min(PAUSE));
            let pause = Timespec::try_from(pause).expect("a short pause");
            let mut polled = [PollFd::new(&line, PollFlags::IN)];
            poll(&mut polled, Some(&pause))?;
            match line.read(&mut bytes) {
                Ok(0) => return Ok(()),
                Ok(count) => self.controller.receive(self.now(), &bytes[..count]),
                Err(error) if error.kind() == ErrorKind::WouldBlock => {}
                Err(error) => return Err(error),
            }
            let replies = self.controller.transmit(self.now());
            match line.write(&replies) {
                Err(error) if error.kind() != ErrorKind::WouldBlock => return Err(error),
                Ok(_) | Err(_) => {}
            }
        }
    }
}

fn listen(bench: &mut Bench, address: SocketAddr) -> io::Result<()> {
    let listener = TcpListener::bind(address)?;
    let address = listener.local_addr()?;
    terminal::print(&format!("simulated controller on tcp:{address}\n"))?;
    listener.set_nonblocking(true)?;
    loop {
        // Meanwhile its aircraft moves on: it may be in the air.
        bench.controller.advance(bench.now());
        let mut polled = [PollFd::new(&listener, PollFlags::IN)];
        let pause = Timespec::try_from(PAUSE).expect("a short pause");
        if poll(&mut polled, Some(&pause))? == 0 {
            continue;
        }
        let (stream, _) = listener.accept()?;
        // A connection that breaks is closed: the next one may come.
        if let Err(error) = stream.set_nodelay(true).and_then(|()| bench.serve(&stream)) {
            terminal::print(&format!("connection lost: {error}\n"))?;
        }
    }
}

fn open_pty(bench: &mut Bench, link: &Path) -> io::Result<()> {
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
    bench.serve(File::from(master))
}
