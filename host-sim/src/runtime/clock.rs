//! The steady clock, and what the operating system grants to a periodic thread.

use rustix::mm::{MlockAllFlags, mlockall};
use rustix::thread::clock_nanosleep_absolute;
use rustix::time::{ClockId, Timespec, clock_gettime};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thread_priority::{
    RealtimeThreadSchedulePolicy, ThreadPriority, ThreadSchedulePolicy, set_thread_priority_and_policy,
    thread_native_id, thread_schedule_policy,
};

const NS_PER_S: u64 = 1_000_000_000;

/// Priority asked for: above ordinary real-time work, below the kernel's own threads.
pub const FIFO_PRIORITY: u8 = 80;

/// Time on `CLOCK_MONOTONIC`, ns: the same in every process, never set back.
pub fn now_ns() -> u64 {
    let now = clock_gettime(ClockId::Monotonic);
    let (seconds, nanoseconds) = (now.tv_sec as u64, now.tv_nsec as u64);
    seconds * NS_PER_S + nanoseconds
}

/// Sleeps until an absolute time; interrupted sleeps go on.
pub fn sleep_until(time_ns: u64) {
    let until = Timespec { tv_sec: (time_ns / NS_PER_S) as i64, tv_nsec: (time_ns % NS_PER_S) as _ };
    while clock_nanosleep_absolute(ClockId::Monotonic, &until) == Err(rustix::io::Errno::INTR) {}
}

/// What the operating system granted.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Scheduling {
    /// Scheduling policy actually obtained, e.g. `SCHED_FIFO priority 80`.
    pub policy: String,
    /// Whether the process's pages are locked in memory.
    pub memory_locked: bool,
}

/// Asks for a real-time policy and locked memory for the calling thread; goes on without.
///
/// Pages of the future are not locked: under a limit on locked memory that turns later allocations into failures.
pub fn request_real_time() -> Scheduling {
    request_real_time_at(FIFO_PRIORITY)
}

/// As [`request_real_time`], at this priority; 0: the ordinary policy.
pub fn request_real_time_at(priority: u8) -> Scheduling {
    let memory_locked = mlockall(MlockAllFlags::CURRENT).is_ok();
    // Refused without the right to it; what was obtained is asked for below.
    if let (1.., Ok(priority)) = (priority, priority.try_into()) {
        let _ = set_thread_priority_and_policy(
            thread_native_id(),
            ThreadPriority::Crossplatform(priority),
            ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo),
        );
    }
    Scheduling { policy: policy_name(), memory_locked }
}

/// Back to the ordinary policy: only the loop itself may be real-time.
pub fn release_real_time() {
    let _ = set_thread_priority_and_policy(
        thread_native_id(),
        ThreadPriority::Min,
        ThreadSchedulePolicy::Normal(thread_priority::NormalThreadSchedulePolicy::Other),
    );
    let _ = rustix::mm::munlockall();
}

fn policy_name() -> String {
    match thread_schedule_policy() {
        Ok(ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo)) => {
            format!("SCHED_FIFO priority {}", current_priority())
        }
        Ok(ThreadSchedulePolicy::Normal(thread_priority::NormalThreadSchedulePolicy::Other)) => {
            "SCHED_OTHER".to_owned()
        }
        Ok(other) => format!("{other:?}"),
        Err(_) => "unknown".to_owned(),
    }
}

fn current_priority() -> i32 {
    thread_priority::unix::thread_schedule_policy_param(thread_native_id())
        .map_or(0, |(_, parameters)| parameters.sched_priority)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sleeping_until_a_time_ends_after_it() {
        let until = now_ns() + 2_000_000;
        sleep_until(until);
        assert!(now_ns() >= until);
        sleep_until(until); // Past: returns at once.
    }
}
