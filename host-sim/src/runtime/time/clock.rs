//! The steady clock, and what the operating system grants to a periodic thread.

use rustix::mm::{MlockAllFlags, mlockall};
use rustix::thread::clock_nanosleep_absolute;
use rustix::time::{ClockId, Timespec, clock_gettime};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thread_priority::{
    NormalThreadSchedulePolicy, RealtimeThreadSchedulePolicy, ThreadPriority, ThreadSchedulePolicy,
    set_thread_priority_and_policy, thread_native_id, thread_schedule_policy,
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

/// How the kernel chooses when a thread runs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub enum SchedulingPolicy {
    /// Real-time, until it waits.
    Fifo {
        /// 1 to 99; the larger one runs.
        priority: i32,
    },
    /// Real-time, in turns with others of the same priority.
    RoundRobin,
    /// Real-time, by deadlines.
    Deadline,
    /// The ordinary one.
    Other,
    /// The ordinary one for what nobody waits for.
    Batch,
    /// When nobody else wants to run.
    Idle,
    /// The kernel does not say.
    #[default]
    Unknown,
}

/// Policies without a number in their names.
const PLAIN_POLICIES: [(SchedulingPolicy, &str); 6] = [
    (SchedulingPolicy::RoundRobin, "Realtime(RoundRobin)"),
    (SchedulingPolicy::Deadline, "Realtime(Deadline)"),
    (SchedulingPolicy::Other, "SCHED_OTHER"),
    (SchedulingPolicy::Batch, "Normal(Batch)"),
    (SchedulingPolicy::Idle, "Normal(Idle)"),
    (SchedulingPolicy::Unknown, "unknown"),
];
const FIFO: &str = "SCHED_FIFO priority ";

impl std::fmt::Display for SchedulingPolicy {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Fifo { priority } => write!(f, "{FIFO}{priority}"),
            plain => {
                f.write_str(PLAIN_POLICIES.iter().find(|(policy, _)| policy == plain).map_or("", |(_, name)| name))
            }
        }
    }
}

impl From<SchedulingPolicy> for String {
    fn from(policy: SchedulingPolicy) -> Self {
        policy.to_string()
    }
}

impl TryFrom<String> for SchedulingPolicy {
    type Error = NoPolicy;

    fn try_from(name: String) -> Result<Self, NoPolicy> {
        if let Some(priority) = name.strip_prefix(FIFO).and_then(|priority| priority.parse().ok()) {
            return Ok(Self::Fifo { priority });
        }
        let plain = PLAIN_POLICIES.iter().find(|(_, known)| *known == name);
        plain.map(|(policy, _)| *policy).ok_or(NoPolicy { name })
    }
}

/// A name that no scheduling policy has.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{name}` is no scheduling policy")]
pub struct NoPolicy {
    /// The name.
    pub name: String,
}

/// What the operating system granted.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Scheduling {
    /// Scheduling policy actually obtained, e.g. `SCHED_FIFO priority 80`.
    #[schemars(with = "String")]
    pub policy: SchedulingPolicy,
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
    Scheduling { policy: policy(), memory_locked }
}

/// Back to the ordinary policy: only the loop itself may be real-time.
pub fn release_real_time() {
    let _ = set_thread_priority_and_policy(
        thread_native_id(),
        ThreadPriority::Min,
        ThreadSchedulePolicy::Normal(NormalThreadSchedulePolicy::Other),
    );
    let _ = rustix::mm::munlockall();
}

fn policy() -> SchedulingPolicy {
    match thread_schedule_policy() {
        Ok(ThreadSchedulePolicy::Realtime(policy)) => match policy {
            RealtimeThreadSchedulePolicy::Fifo => SchedulingPolicy::Fifo { priority: current_priority() },
            RealtimeThreadSchedulePolicy::RoundRobin => SchedulingPolicy::RoundRobin,
            RealtimeThreadSchedulePolicy::Deadline => SchedulingPolicy::Deadline,
        },
        Ok(ThreadSchedulePolicy::Normal(policy)) => match policy {
            NormalThreadSchedulePolicy::Other => SchedulingPolicy::Other,
            NormalThreadSchedulePolicy::Batch => SchedulingPolicy::Batch,
            NormalThreadSchedulePolicy::Idle => SchedulingPolicy::Idle,
        },
        Err(_) => SchedulingPolicy::Unknown,
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
    #[test]
    fn policies_are_read_back_by_the_names_in_results() {
        let mut names = Vec::new();
        for policy in
            [SchedulingPolicy::Fifo { priority: 80 }].into_iter().chain(PLAIN_POLICIES.map(|(policy, _)| policy))
        {
            let text = serde_json::to_string(&policy).unwrap();
            assert_eq!(serde_json::from_str::<SchedulingPolicy>(&text).unwrap(), policy, "{text}");
            names.push(text);
        }
        assert_eq!(names[0], r#""SCHED_FIFO priority 80""#);
        assert_eq!(names[3], r#""SCHED_OTHER""#);
        for wrong in ["SCHED_FIFO priority", "SCHED_FIFO priority high", "SCHED", ""] {
            assert!(SchedulingPolicy::try_from(wrong.to_owned()).is_err(), "{wrong}");
        }
    }
}
