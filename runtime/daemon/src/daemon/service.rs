//! What the service manager is told, where there is one.

use sd_notify::NotifyState;

/// The drone's five actors run.
pub(super) fn ready() {
    notify(&[NotifyState::Ready]);
}

/// What the drone is doing, in a few words.
pub(super) fn status(words: &str) {
    notify(&[NotifyState::Status(words)]);
}

/// The process ends by itself.
pub(super) fn stopping() {
    notify(&[NotifyState::Stopping]);
}

/// The drone's actors answer.
pub(super) fn alive() {
    notify(&[NotifyState::Watchdog]);
}

fn notify(state: &[NotifyState<'_>]) {
    if let Err(error) = sd_notify::notify(state) {
        tracing::warn!(%error, "the service manager can't be told");
    }
}
