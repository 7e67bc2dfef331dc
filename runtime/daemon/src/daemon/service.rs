//! Notifications to the service manager, if there is one.

use sd_notify::NotifyState;

/// The five actors run.
pub(super) fn ready() {
    notify(&[NotifyState::Ready]);
}

/// The drone's state in a few words.
pub(super) fn status(text: &str) {
    notify(&[NotifyState::Status(text)]);
}

/// The process ends.
pub(super) fn stopping() {
    notify(&[NotifyState::Stopping]);
}

/// All actors handle messages: feeds the watchdog.
pub(super) fn alive() {
    notify(&[NotifyState::Watchdog]);
}

fn notify(state: &[NotifyState<'_>]) {
    if let Err(error) = sd_notify::notify(state) {
        tracing::warn!(%error, "can't notify the service manager");
    }
}
