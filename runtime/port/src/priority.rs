//! Real-time priority, for threads that write RC, and for those of simulated controllers, which must read it in time.

use thread_priority::{
    RealtimeThreadSchedulePolicy, ThreadPriority, ThreadPriorityValue, ThreadSchedulePolicy,
    set_thread_priority_and_policy, thread_native_id,
};

/// Priority under SCHED_FIFO, on the scale of 0 to 99 of the thread-priority crate: below the kernel's interrupt threads (50).
const PRIORITY: u8 = 40;

/// Asks the system for real time (SCHED_FIFO) for this thread; it takes `CAP_SYS_NICE` or an `rtprio` limit. Returns whether it
/// was granted.
#[must_use]
pub fn raise_priority() -> bool {
    let Ok(priority) = ThreadPriorityValue::try_from(PRIORITY) else {
        return false;
    };
    let policy = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
    let priority = ThreadPriority::Crossplatform(priority);
    set_thread_priority_and_policy(thread_native_id(), priority, policy).is_ok()
}
