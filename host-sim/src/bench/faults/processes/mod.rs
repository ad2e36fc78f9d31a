//! Rows 33 to 45: real processes, real signals, a second user, a small file system.

mod deaths;
mod peers;
mod resources;
mod stage;

pub(crate) use deaths::{controller_restarted, cycles, killed_at_start, plant_killed};
pub(crate) use peers::{garbage, never_reads, other_layout, other_user, panic_in_step, two_controllers};
pub(crate) use resources::{disk_full, file_deleted, memory_full};
pub(crate) use stage::Stage;
