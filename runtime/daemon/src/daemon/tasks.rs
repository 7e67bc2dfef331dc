//! What runs beside a drone's actors, on the same thread.

use std::io;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use muster_actors::{Message, Stall};
use muster_machines::mission::LandingReason;
use muster_machines::node::Address;
use muster_runtime::identity::{Ed25519Authenticator, FleetKey};
use muster_runtime::journal::Written;
use tokio::signal::unix::{Signal, SignalKind, signal};
use tokio::sync::mpsc;

use super::network::Waiting;
use super::process::Process;
use super::service;
use crate::config::reread;
use crate::control::{ActorFault, ControlMessage};
use crate::log::Volume;

/// Wakes whoever waits for a time.
pub(super) async fn keep_time(process: Arc<Process>) {
    loop {
        // What has come in counts before anybody finds that nothing came: a process that was kept from running is no
        // sign that others are silent. Whatever it wakes has run by then.
        if process.state().drain_some() {
            tokio::task::yield_now().await;
        }
        let now = process.clock.now();
        let next = process.state().wake(now);
        process.look_round();
        match next {
            Some(at) => {
                let at = process.clock.instant(at);
                // Either it is time, or somebody is to be woken sooner.
                let _ = tokio::time::timeout_at(at, process.sooner.notified()).await;
            }
            None => process.sooner.notified().await,
        }
    }
}

/// How often it is looked whether an actor hangs.
const LOOKS_EVERY: Duration = Duration::from_millis(50);
/// How late such a look is at the most in a process that has not stood still.
const STALL: Duration = Duration::from_millis(150);

/// Has actors mended that hang.
pub(super) async fn look_after(process: Arc<Process>) {
    let mut last = process.clock.now();
    loop {
        tokio::time::sleep(LOOKS_EVERY).await;
        let now = process.clock.now();
        let has_stood_still = now.since(last) > LOOKS_EVERY + STALL;
        last = now;
        let mut state = process.state();
        if has_stood_still {
            state.stood_still(now);
        }
        state.mend_what_hangs(now);
    }
}

/// Lets go what rests on the journal.
pub(super) async fn heed_journal(
    mut written: mpsc::UnboundedReceiver<Written>,
    process: Arc<Process>,
) {
    while let Some(written) = written.recv().await {
        process.written(&written);
    }
}

/// Hands the radio what comes in.
pub(super) async fn listen(process: Arc<Process>, waiting: Waiting) {
    while let Ok(is_drained) = waiting.datagrams(|| process.state().drain()).await {
        process.look_round();
        if !is_drained {
            // The actors get their turn.
            tokio::task::yield_now().await;
        }
    }
    tracing::error!("the sockets are not watched any more: the drone comes down");
    process.come_down(LandingReason::NetworkLost);
}

/// The signals that call the drone down.
pub(super) fn signals_to_end() -> io::Result<[Signal; 2]> {
    Ok([
        signal(SignalKind::terminate())?,
        signal(SignalKind::interrupt())?,
    ])
}

/// Calls the drone down at the first signal; it is on its way already at the second.
pub(super) async fn end_on(mut signal: Signal, process: Arc<Process>) {
    while signal.recv().await.is_some() {
        tracing::info!("called down");
        process.come_down(LandingReason::Recalled);
    }
}

/// What comes of standard input, by which the process is tied to whoever started it.
pub(super) fn control_messages() -> mpsc::UnboundedReceiver<ControlMessage> {
    let (sender, receiver) = mpsc::unbounded_channel();
    // Nothing can end a thread that reads, but the end of the process.
    std::thread::spawn(move || {
        for line in io::stdin().lines().map_while(Result::ok) {
            match ControlMessage::read(&line) {
                Some(word) => drop(sender.send(word)),
                None => tracing::warn!("standard input has a line that is none of a starter's"),
            }
        }
    });
    receiver
}

/// Does as whoever started the process says; once that is gone, so is the process.
pub(super) async fn heed(
    mut control_messages: mpsc::UnboundedReceiver<ControlMessage>,
    process: Arc<Process>,
) {
    while let Some(word) = control_messages.recv().await {
        let now = process.clock.now();
        match word {
            ControlMessage::Losses(losses) => process.state().lose(losses),
            ControlMessage::Vehicle { epoch, state } => {
                process.state().overrule(now, *state, epoch)
            }
            ControlMessage::Inject { actor, fault } => inject(&process, actor, fault),
        }
        process.look_round();
    }
    tracing::warn!(
        "whoever started this process is gone: it ends, and its simulated vehicle with it"
    );
    process.state().abandon();
    process.look_round();
}

/// Injects a fault into an actor.
fn inject(process: &Process, actor: Address, fault: ActorFault) {
    let message = match fault {
        ActorFault::Crashes => Message::Crash,
        ActorFault::Hangs(Some(seconds)) => {
            let lasts = Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX);
            Message::Stall(Stall(Box::pin(tokio::time::sleep(lasts))))
        }
        ActorFault::Hangs(None) => Message::Stall(Stall(Box::pin(std::future::pending()))),
    };
    process.state().inject(actor, message);
}

/// What is read again on HUP, and who is told.
pub(super) struct Rereading {
    pub(super) signal: Signal,
    pub(super) path: PathBuf,
    pub(super) volume: Volume,
    pub(super) authenticator: Arc<Ed25519Authenticator>,
    pub(super) fleet: FleetKey,
}

/// The signal at which files are read again.
pub(super) fn signal_to_reread() -> io::Result<Signal> {
    signal(SignalKind::hangup())
}

/// Reads again what may change while the drone flies.
pub(super) async fn reread_on(mut rereading: Rereading, process: Arc<Process>) {
    while rereading.signal.recv().await.is_some() {
        rereading.reread(&process);
        process.state().report();
    }
}

impl Rereading {
    fn reread(&self, process: &Process) {
        let read = match reread(&self.path, &self.fleet) {
            Ok(read) => read,
            Err(error) => {
                let path = self.path.display();
                tracing::error!(%path, %error, "nothing was read again: all stays as it was");
                return;
            }
        };
        self.volume.set(read.level);
        let number = read.revoked.number();
        match self.authenticator.revoke(read.revoked) {
            Ok(()) => {
                tracing::info!(
                    number,
                    "read again: log_level and the list of the revoked; all else is read at the start only"
                );
                process.state().has_new_list();
                process.look_round();
            }
            Err(error) => tracing::error!(%error, "log_level was read again; the list stays"),
        }
    }
}

/// How often the actors are asked whether they are there, unless a service manager wants to know it sooner.
const ASK_PERIOD: Duration = Duration::from_secs(1);

/// Asks the actors whether they are there, and tells the service manager as long as they answer: four times in each period
/// after which it would end the process.
pub(super) async fn watch(process: Arc<Process>, watchdog: Option<Duration>) {
    let period = watchdog.map_or(ASK_PERIOD, |it| (it / 4).min(ASK_PERIOD));
    loop {
        let now = process.clock.now();
        if process.state().ask_actors(now) {
            service::alive();
        }
        tokio::time::sleep(period).await;
    }
}
