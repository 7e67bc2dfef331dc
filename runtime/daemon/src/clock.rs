use std::time::{Duration, Instant, SystemTime};

use muster_machines::time::Timestamp;

/// The drone's time, since the Unix epoch: the system's clock at the start of the process plus a monotonic clock. So times in
/// a journal mean the same to later incarnations, and logs of several drones can be merged.
#[derive(Debug, Clone, Copy)]
pub struct Clock {
    started: Instant,
    then: Timestamp,
}

impl Clock {
    /// A clock that starts now.
    pub fn start() -> Self {
        let since_epoch = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
        Self {
            started: Instant::now(),
            then: Timestamp::ZERO + since_epoch.unwrap_or(Duration::ZERO),
        }
    }

    /// When the process started.
    pub const fn started(&self) -> Timestamp {
        self.then
    }

    /// The current time.
    pub fn now(&self) -> Timestamp {
        self.then + self.started.elapsed()
    }

    /// The same instant for timers of tokio.
    pub fn instant(&self, at: Timestamp) -> tokio::time::Instant {
        (self.started + at.since(self.then)).into()
    }
}
