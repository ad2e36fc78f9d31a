//! Processes that end with the one that has started them.

use std::os::unix::process::CommandExt;
use std::process::Command;

use rustix::process::{Signal, getpid, getppid, set_parent_process_death_signal};

/// Has the child killed by the kernel when the thread that starts it ends, however that ends: an emulator or a polling
/// peer that nobody waits for any more would burn a processor for ever. To be started from a thread that lives as long as
/// the child is wanted.
pub fn dies_with_parent(command: &mut Command) -> &mut Command {
    let parent = getpid();
    let before_exec = move || {
        set_parent_process_death_signal(Some(Signal::KILL))?;
        // It may have died before the line above.
        if getppid() == Some(parent) { Ok(()) } else { Err(std::io::ErrorKind::BrokenPipe.into()) }
    };
    // SAFETY: between fork and exec only two system calls are made; nothing is allocated, locked or shared.
    #[allow(unsafe_code)]
    unsafe {
        command.pre_exec(before_exec)
    }
}
