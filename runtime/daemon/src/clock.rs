use std::time::{Duration, Instant, SystemTime};

use muster_machines::time::Timestamp;

/// What time it is for a drone: since the Unix epoch by the system's clock when the process started, and on from there by
/// a clock that nobody sets. So times in a journal mean the same to a later life, and logs of drones can be merged as far
/// as the clocks of their machines agree.
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

    /// When it started.
    pub const fn started(&self) -> Timestamp {
        self.then
    }

    pub fn now(&self) -> Timestamp {
        self.then + self.started.elapsed()
    }

    /// The same instant for those who wait by the runtime's timers.
    pub fn instant(&self, at: Timestamp) -> tokio::time::Instant {
        (self.started + at.since(self.then)).into()
    }
}
