//! The tasks of a drone's process. They share one thread with the actors.

use std::io;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use muster_actors::{Message, Stall};
use muster_machines::mission::LandingReason;
use muster_machines::node::Address;
use muster_runtime::identity::FleetKey;
use muster_runtime::journal::WriteReport;
use tokio::signal::unix::{Signal, SignalKind, signal};
use tokio::sync::mpsc;

use super::network::Waiting;
use super::process::Process;
use super::service;
use super::state::ANSWER_MAX;
use super::vehicle::PortEvents;
use crate::config::reload;
use crate::control::{ActorFault, ControlMessage};
use crate::log::Volume;

/// Runs the process's timers.
pub(super) async fn keep_time(process: Arc<Process>) {
    loop {
        // Received frames are handled before timeouts: a process that stood still must not treat others as silent.
        if process.state().drain_some() {
            tokio::task::yield_now().await;
        }
        let now = process.clock.now();
        let next = process.state().wake(now);
        process.notify();
        match next {
            Some(at) => {
                let at = process.clock.instant(at);
                let _ = tokio::time::timeout_at(at, process.sooner.notified()).await;
            }
            None => process.sooner.notified().await,
        }
    }
}

/// How often actors are checked for hangs.
const HANG_CHECK_PERIOD: Duration = Duration::from_millis(50);
/// A check that is late by more than this means that the whole process stood still.
const STALL: Duration = Duration::from_millis(150);

/// Reports hung actors to their supervisor.
pub(super) async fn detect_hangs(process: Arc<Process>) {
    let mut last = process.clock.now();
    loop {
        tokio::time::sleep(HANG_CHECK_PERIOD).await;
        let now = process.clock.now();
        let has_stood_still = now.since(last) > HANG_CHECK_PERIOD + STALL;
        last = now;
        let mut state = process.state();
        if has_stood_still {
            state.actors().forgive_stall(now);
        }
        state.actors().report_hung(now);
    }
}

/// Handles the journal's reports, which release frames.
pub(super) async fn watch_journal(
    mut reports: mpsc::UnboundedReceiver<WriteReport>,
    process: Arc<Process>,
) {
    while let Some(report) = reports.recv().await {
        process.journal_reported(&report);
    }
}

/// Passes received datagrams to the radio.
pub(super) async fn listen(process: Arc<Process>, waiting: Waiting) {
    while let Ok(is_drained) = waiting.datagrams(|| process.state().drain()).await {
        process.notify();
        if !is_drained {
            // Lets the actors run.
            tokio::task::yield_now().await;
        }
    }
    tracing::error!("the sockets can't be watched: the drone lands");
    process.order_landing(LandingReason::NetworkLost);
}

/// The signals that recall the drone.
pub(super) fn recall_signals() -> io::Result<[Signal; 2]> {
    Ok([
        signal(SignalKind::terminate())?,
        signal(SignalKind::interrupt())?,
    ])
}

/// Orders the drone to land at each signal.
pub(super) async fn recall_on(mut signal: Signal, process: Arc<Process>) {
    while signal.recv().await.is_some() {
        tracing::info!("recalled by a signal");
        process.order_landing(LandingReason::Recalled);
    }
}

/// Control messages from standard input.
pub(super) type ControlMessages = mpsc::UnboundedReceiver<ControlMessage>;

/// Starts to read control messages from standard input.
pub(super) fn control_messages() -> ControlMessages {
    let (sender, receiver) = mpsc::unbounded_channel();
    // The thread blocks in reads until the process ends.
    std::thread::spawn(move || {
        for line in io::stdin().lines().map_while(Result::ok) {
            match ControlMessage::read(&line) {
                Some(message) => drop(sender.send(message)),
                None => {
                    tracing::warn!("ignored a line on standard input that is no control message");
                }
            }
        }
    });
    receiver
}

/// Passes what the flight controller tells to its link.
pub(super) async fn listen_to_port(mut events: PortEvents, process: Arc<Process>) {
    while let Some(event) = events.recv().await {
        process
            .state()
            .handle_port_event(process.clock.now(), event);
        process.notify();
    }
}

/// Executes control messages. Ends the process when the control channel closes.
pub(super) async fn control(mut control_messages: ControlMessages, process: Arc<Process>) {
    while let Some(message) = control_messages.recv().await {
        let now = process.clock.now();
        match message {
            ControlMessage::Losses(losses) => process.state().set_losses(losses),
            ControlMessage::Vehicle { epoch, state } => {
                process.state().set_vehicle(now, *state, epoch);
            }
            ControlMessage::Inject { actor, fault } => inject(&process, actor, fault),
        }
        process.notify();
    }
    tracing::warn!("the control channel closed: the process and its simulated vehicle end");
    process.state().abandon();
    process.notify();
}

/// Injects a fault into an actor.
fn inject(process: &Process, actor: Address, fault: ActorFault) {
    let message = match fault {
        ActorFault::Crashes => Message::Crash,
        ActorFault::Hangs(Some(seconds)) => {
            let duration = Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX);
            Message::Stall(Stall(Box::pin(tokio::time::sleep(duration))))
        }
        ActorFault::Hangs(None) => Message::Stall(Stall(Box::pin(std::future::pending()))),
    };
    let at_ns = process.clock.now().as_nanos();
    tracing::warn!(%actor, at_ns, ?fault, "a fault is injected");
    process.state().actors().inject(actor, message);
}

/// What HUP reloads.
pub(super) struct Reload {
    pub(super) signal: Signal,
    pub(super) path: PathBuf,
    pub(super) volume: Volume,
    pub(super) fleet: FleetKey,
}

/// The signal that reloads files.
pub(super) fn reload_signal() -> io::Result<Signal> {
    signal(SignalKind::hangup())
}

/// Reloads the log level and the revocation list at each signal.
pub(super) async fn reload_on(mut reload: Reload, process: Arc<Process>) {
    while reload.signal.recv().await.is_some() {
        reload.run(&process);
        process.state().report();
    }
}

impl Reload {
    fn run(&self, process: &Process) {
        let reloaded = match reload(&self.path, &self.fleet) {
            Ok(reloaded) => reloaded,
            Err(error) => {
                let path = self.path.display();
                tracing::error!(%path, %error, "reloaded nothing: a file can't be used");
                return;
            }
        };
        self.volume.set(reloaded.level);
        let number = reloaded.revoked.number();
        let replaced = process.state().replace_list(reloaded.revoked);
        match replaced {
            Ok(()) => {
                tracing::info!(
                    number,
                    "reloaded log_level and the revocation list; other fields need a restart"
                );
                process.notify();
            }
            Err(error) => {
                tracing::error!(%error, "reloaded log_level, but not the revocation list");
            }
        }
    }
}

/// How often the numbers of frames sent and admitted are logged for programs, besides each change of the mission's state. A
/// process that is killed loses those since the last time.
const TRAFFIC_PERIOD: Duration = Duration::from_secs(1);

/// Logs periodically how many frames were sent and admitted.
pub(super) async fn report_traffic(process: Arc<Process>) {
    loop {
        tokio::time::sleep(TRAFFIC_PERIOD).await;
        process.state().report_traffic(process.clock.now());
    }
}

/// How often the actors' liveness is checked, unless the service manager's watchdog needs it sooner.
const LIVENESS_PERIOD: Duration = Duration::from_secs(1);

/// Notifies the service manager's watchdog while all actors handle messages, four times in each watchdog period.
pub(super) async fn feed_watchdog(process: Arc<Process>, watchdog: Option<Duration>) {
    let period = watchdog.map_or(LIVENESS_PERIOD, |it| (it / 4).min(LIVENESS_PERIOD));
    loop {
        let now = process.clock.now();
        if process.state().actors().check_liveness(now, ANSWER_MAX) {
            service::alive();
        }
        tokio::time::sleep(period).await;
    }
}
