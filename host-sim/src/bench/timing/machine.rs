//! What the machine did meanwhile: time that the host took away, context switches, processors.

use rustix::thread::{CpuSet, sched_setaffinity};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Counters of the machine and of the calling thread.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Disturbance {
    /// Time that the host took away, all processors, ms; none where the kernel does not say.
    pub steal_ms: Option<u64>,
    /// Context switches of the thread because it waited.
    pub voluntary_switches: u64,
    /// Context switches of the thread because somebody else was to run.
    pub involuntary_switches: u64,
}

impl Disturbance {
    /// Counters since boot and since the start of the thread.
    pub fn now() -> Self {
        let status = std::fs::read_to_string("/proc/thread-self/status").unwrap_or_default();
        let switches = |name: &str| {
            let line = status.lines().find(|line| line.starts_with(name));
            line.and_then(|line| line.split_whitespace().nth(1)?.parse().ok()).unwrap_or(0)
        };
        Self {
            steal_ms: steal_ms(),
            voluntary_switches: switches("voluntary_ctxt_switches"),
            involuntary_switches: switches("nonvoluntary_ctxt_switches"),
        }
    }

    /// What happened since `earlier`.
    pub fn since(&self, earlier: &Self) -> Self {
        Self {
            steal_ms: self.steal_ms.zip(earlier.steal_ms).map(|(now, before)| now.saturating_sub(before)),
            voluntary_switches: self.voluntary_switches.saturating_sub(earlier.voluntary_switches),
            involuntary_switches: self.involuntary_switches.saturating_sub(earlier.involuntary_switches),
        }
    }

    /// Both together.
    pub fn plus(&self, other: &Self) -> Self {
        Self {
            steal_ms: self.steal_ms.or(Some(0)).zip(other.steal_ms).map(|(a, b)| a + b),
            voluntary_switches: self.voluntary_switches + other.voluntary_switches,
            involuntary_switches: self.involuntary_switches + other.involuntary_switches,
        }
    }
}

/// Steal time of all processors since boot, ms, from `/proc/stat`.
fn steal_ms() -> Option<u64> {
    /// Linux counts in hundredths of a second on every machine that users see.
    const MS_PER_TICK: u64 = 10;
    let text = std::fs::read_to_string("/proc/stat").ok()?;
    let steal: u64 = text.lines().next()?.split_whitespace().nth(8)?.parse().ok()?;
    Some(steal * MS_PER_TICK)
}

/// Keeps the calling thread on one processor; whether that was granted.
pub fn pin(processor: usize) -> bool {
    let mut set = CpuSet::new();
    if processor >= CpuSet::MAX_CPU {
        return false;
    }
    set.set(processor);
    sched_setaffinity(None, &set).is_ok()
}

/// Lets the calling thread run on every processor again.
pub fn unpin() {
    let mut set = CpuSet::new();
    (0..CpuSet::MAX_CPU).for_each(|processor| set.set(processor));
    let _ = sched_setaffinity(None, &set);
}
