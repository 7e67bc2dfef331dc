//! Betaflight itself in the loop: its software build as a process in a network of its own, since its ports are fixed, with
//! our aircraft for a body.

mod body;
mod configure;
mod line;
mod network;

use std::fs::{self, File};
use std::io;
use std::net::{Ipv4Addr, TcpListener, UdpSocket};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use muster_controller::{CHANNELS, Config, InLoop, Sticks, Truth};
use muster_machines::msp::controller::Receiver;
use muster_machines::time::Timestamp;
use muster_port::raise_priority;
use muster_scenarios::report::FirmwareStalls;
use tempfile::TempDir;

use self::body::Seen;
use self::line::Line;
use self::network::Network;
use crate::controller::{lock, wait};
use crate::pilot::LivePilot;
use crate::{FlowSource, PoseSource};

/// Where the firmware listens for MSP, in its network.
const MSP: (Ipv4Addr, u16) = (Ipv4Addr::LOCALHOST, 5761);
/// Where it listens for the pilot's radio, in its network.
const RADIO: (Ipv4Addr, u16) = (Ipv4Addr::LOCALHOST, 9004);
/// Channels of a frame of that radio.
const RADIO_CHANNELS: usize = 16;
/// How long the firmware may take until it listens.
const LISTENS_WITHIN: Duration = Duration::from_secs(5);
/// How long it may take to end.
const ENDS_WITHIN: Duration = Duration::from_secs(5);
/// Now and then it starts without some of its tasks, and is started again.
const STARTS_MAX: u32 = 4;
/// Longest time until the end of a [`Firmware`] is seen.
const PAUSE: Duration = Duration::from_millis(100);

/// How a firmware is to run.
#[derive(Debug, Clone)]
pub struct Setup {
    /// The program: Betaflight's software build.
    pub program: PathBuf,
    /// Whether MSP is its only receiver, or a pilot has another.
    pub receiver: Receiver,
    /// Where its aircraft stands, and the errors of its sensors.
    pub config: Config,
    /// Draws these errors.
    pub seed: u64,
    /// What measures its pose, and who is told.
    pub pose: Option<PoseSource>,
}

/// A firmware that runs, and its aircraft. Both end with it.
#[derive(Debug)]
pub struct Firmware {
    /// What was seen of the aircraft a moment ago.
    seen: Arc<Mutex<Seen>>,
    network: Arc<Network>,
    line: Arc<Line>,
    process: Child,
    /// `None` without a pilot's receiver.
    pilot: Option<LivePilot>,
    is_over: Arc<AtomicBool>,
    _folder: TempDir,
}

impl Firmware {
    /// Starts the program in an empty folder, sets it up and starts it again. Takes some seconds. Needs root, for its network.
    ///
    /// # Errors
    /// If the program doesn't start, refuses its settings or doesn't take RC.
    pub fn start(setup: Setup) -> io::Result<Self> {
        let mut error = io::Error::other("it was not started");
        for _ in 0..STARTS_MAX {
            // A new one each time: what a start that failed has saved may be half a file.
            let folder = tempfile::tempdir()?;
            match Self::try_start(&setup, folder.path()) {
                Ok((process, network)) => return Self::fly(setup, folder, process, network),
                Err(again) => error = again,
            }
        }
        Err(error)
    }

    fn try_start(setup: &Setup, folder: &Path) -> io::Result<(Child, Network)> {
        let (mut process, network) = launch(&setup.program, folder)?;
        let configured = network.inside(|| configure::set_up(setup.receiver));
        // Saved settings end the program; now and then it hangs instead, with its settings saved.
        if configured.is_err() || !ends(&mut process)? {
            stop(&mut process);
        }
        configured?;
        let (mut process, network) = launch(&setup.program, folder)?;
        if let Err(error) = network.inside(configure::takes_rc) {
            stop(&mut process);
            return Err(error);
        }
        Ok((process, network))
    }

    fn fly(setup: Setup, folder: TempDir, process: Child, network: Network) -> io::Result<Self> {
        let started = Instant::now();
        let mut aircraft = InLoop::new(setup.config, setup.seed, Timestamp::ZERO);
        let mut firmware = Self {
            seen: Arc::new(Mutex::new(Seen {
                truth: aircraft.aircraft(Timestamp::ZERO),
                stalls: FirmwareStalls::default(),
            })),
            network: Arc::new(network),
            line: Arc::new(Line::new()),
            process,
            pilot: None,
            is_over: Arc::new(AtomicBool::new(false)),
            _folder: folder,
        };
        let socket = firmware.network.inside(body::open)?;
        let seen = Arc::downgrade(&firmware.seen);
        let thread = thread::Builder::new().name("aircraft".to_owned());
        thread.spawn(move || body::run(aircraft, &seen, started, &socket))?;
        if setup.receiver == Receiver::Override {
            firmware.pilot = Some(firmware.start_pilot(started)?);
        }
        if let Some(source) = setup.pose {
            let truth = firmware.watched();
            source.start(move || Some(truth()?.position))?;
        }
        Ok(firmware)
    }

    /// The pilot's radio, which the firmware hears beside MSP. `started`: the time zero of its frames.
    fn start_pilot(&self, started: Instant) -> io::Result<LivePilot> {
        let radio = self
            .network
            .inside(|| UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)))?;
        // A frame that the firmware misses is followed by the next.
        LivePilot::start(self.watched(), move |channels| {
            drop(radio.send_to(&frame(started.elapsed(), channels), RADIO));
        })
    }

    /// Its pilot. `None` without a pilot's receiver.
    pub(crate) const fn pilot(&self) -> Option<&LivePilot> {
        self.pilot.as_ref()
    }

    /// The truth about its aircraft, some milliseconds old.
    #[must_use]
    pub fn truth(&self) -> Truth {
        lock(&self.seen).truth
    }

    /// What RC over MSP said since the last call. `None` before the first frame.
    #[must_use]
    pub fn take_sticks(&self) -> Option<Sticks> {
        self.line.take_sticks()
    }

    /// How often it stood still while it was armed, as on a busy host. Its aircraft waited meanwhile.
    #[must_use]
    pub fn stalls(&self) -> FirmwareStalls {
        lock(&self.seen).stalls
    }

    /// The truth about its aircraft, until it is dropped.
    fn watched(&self) -> impl Fn() -> Option<Truth> + Send + 'static {
        let seen = Arc::downgrade(&self.seen);
        move || Some(lock(&*seen.upgrade()?).truth)
    }

    /// Tells a drone how the ground moves beneath its aircraft, until it is dropped.
    ///
    /// # Errors
    /// If the system starts no thread.
    pub(crate) fn measure_flow(&self, source: FlowSource) -> io::Result<()> {
        source.start(self.watched())
    }

    /// Carries bytes between the firmware and who connects to `listener`, one connection after the other, until it is
    /// dropped. It does so on a thread of its own.
    ///
    /// # Errors
    /// If the system starts no thread.
    pub fn listen(&self, listener: TcpListener) -> io::Result<()> {
        listener.set_nonblocking(true)?;
        let (network, is_over) = (Arc::clone(&self.network), Arc::clone(&self.is_over));
        let line = Arc::clone(&self.line);
        let thread = thread::Builder::new().name("firmware-port".to_owned());
        thread.spawn(move || {
            // Without it a busy machine looks like a lost receiver. Threads that it starts inherit it.
            let _ = raise_priority();
            while !is_over.load(Ordering::Relaxed) {
                if let Ok(true) = wait(&listener, PAUSE)
                    && let Ok((stream, _)) = listener.accept()
                {
                    // A connection that fails is closed, and the link connects again.
                    drop(line.carry(&network, &stream));
                }
            }
        })?;
        Ok(())
    }
}

impl Drop for Firmware {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Relaxed);
        stop(&mut self.process);
    }
}

/// A frame of the pilot's radio: the time in seconds as `f64`, then the channels in µs as `u16`; little-endian. The throttle
/// comes before yaw, as the setting `map AETR1234` says.
fn frame(at: Duration, channels: &[u16; CHANNELS]) -> Vec<u8> {
    let mut channels = *channels;
    channels.swap(2, 3);
    let time = at.as_secs_f64().to_le_bytes();
    let channels = channels[..RADIO_CHANNELS].iter();
    time.into_iter()
        .chain(channels.flat_map(|it| it.to_le_bytes()))
        .collect()
}

/// Starts the program in a network of its own, and waits until it listens.
fn launch(program: &Path, folder: &Path) -> io::Result<(Child, Network)> {
    // It doesn't outlive this process.
    let mut process = Command::new("setpriv")
        .args(["--pdeathsig", "KILL", "unshare", "--net", "sh", "-c"])
        // On time, if the system grants it: a stalled control loop tips the aircraft over.
        .arg(
            "ip link set lo up && { chrt --rr 10 true && exec chrt --rr 10 \"$0\" 127.0.0.1; exec \"$0\" 127.0.0.1; }",
        )
        .arg(program)
        .current_dir(folder)
        .stdin(Stdio::null())
        .stdout(File::create(folder.join("output"))?)
        .stderr(Stdio::null())
        .spawn()?;
    let network = listening(&mut process);
    if network.is_err() {
        stop(&mut process);
    }
    network.map(|network| (process, network))
}

fn listening(process: &mut Child) -> io::Result<Network> {
    let started = Instant::now();
    loop {
        if let Some(status) = process.try_wait()? {
            return Err(io::Error::other(format!("the firmware ended: {status}")));
        }
        let network = Network::of(process.id());
        let listens = network.and_then(|network| {
            network.inside(is_listened_to)?;
            Ok(network)
        });
        match listens {
            Ok(network) => return Ok(network),
            Err(error) if started.elapsed() > LISTENS_WITHIN => return Err(error),
            Err(_) => thread::sleep(Duration::from_millis(20)),
        }
    }
}

/// Fails unless somebody listens for MSP in this thread's network. Not tried by a connection: the firmware takes one at a time,
/// and on a busy machine closes the next before it has seen the end of the first.
fn is_listened_to() -> io::Result<()> {
    let sockets = fs::read_to_string("/proc/thread-self/net/tcp")?;
    // Local port, no peer, and the state of a socket that listens.
    if sockets.contains(&format!(":{:04X} 00000000:0000 0A", MSP.1)) {
        return Ok(());
    }
    let message = format!("the firmware doesn't listen on port {}", MSP.1);
    Err(io::Error::new(io::ErrorKind::TimedOut, message))
}

/// Whether a process ends by itself.
fn ends(process: &mut Child) -> io::Result<bool> {
    let started = Instant::now();
    while started.elapsed() < ENDS_WITHIN {
        if process.try_wait()?.is_some() {
            return Ok(true);
        }
        thread::sleep(Duration::from_millis(20));
    }
    Ok(false)
}

/// Ends a process that may have ended already.
fn stop(process: &mut Child) {
    // Neither fails for a child of ours.
    drop((process.kill(), process.wait()));
}
