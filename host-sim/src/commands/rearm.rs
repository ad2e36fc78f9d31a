//! `host-sim rearm`: somebody has looked, and lets a controller out of SAFE.

use model_offline::say;
use std::os::unix::ffi::OsStrExt;
use std::path::Path;

use host_sim::SimError;
use host_sim::bench::usage::UsageError;
use host_sim::runtime::error::RuntimeError;
use rustix::process::{Pid, Signal, getuid, kill_process};

/// Options of `rearm`.
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct RearmArgs {
    /// Process id of the controller [default: the only controller of this user]
    pub(crate) process: Option<i32>,
}

/// Asks a controller to re-arm. One that is not in SAFE, or that cannot be re-armed yet, stays as it is.
///
/// # Errors
/// [`SimError::Usage`] if there is no such controller, or more than one to choose from; [`SimError::Runtime`] if it is
/// gone by now.
pub(crate) fn rearm(args: &RearmArgs) -> Result<(), SimError> {
    let controllers = controllers();
    let process = match (args.process.as_ref(), controllers.as_slice()) {
        // Another program would die of the signal.
        (Some(process), found) if !found.contains(process) => {
            return Err(UsageError::NotAController { process: *process }.into());
        }
        (Some(process), _) | (None, [process]) => *process,
        (None, []) => return Err(UsageError::NoController.into()),
        (None, several) => return Err(UsageError::SeveralControllers { processes: several.to_vec() }.into()),
    };
    let pid = Pid::from_raw(process).ok_or(UsageError::NotAController { process })?;
    kill_process(pid, Signal::USR1).map_err(|error| RuntimeError::Spawn(error.into()))?;
    say!("asked controller {process} to re-arm");
    Ok(())
}

/// Process ids of this user's controllers, of this program under whatever name.
fn controllers() -> Vec<i32> {
    let Ok(processes) = std::fs::read_dir("/proc") else { return Vec::new() };
    let numbers = processes.flatten().filter_map(|entry| entry.file_name().to_str()?.parse().ok());
    let mut found: Vec<i32> = numbers.filter(|process| is_controller(*process)).collect();
    found.sort_unstable();
    found
}

fn is_controller(process: i32) -> bool {
    use std::os::unix::fs::MetadataExt;
    let folder = Path::new("/proc").join(process.to_string());
    let own = folder.metadata().is_ok_and(|metadata| metadata.uid() == getuid().as_raw());
    let this_program = std::env::current_exe().ok().and_then(|path| path.file_name().map(|name| name.to_owned()));
    let arguments = std::fs::read(folder.join("cmdline")).unwrap_or_default();
    let mut words = arguments.split(|byte| *byte == 0).map(std::ffi::OsStr::from_bytes);
    let program = words.next().and_then(|word| Path::new(word).file_name().map(|name| name.to_owned()));
    own && program == this_program && words.next() == Some("controller".as_ref())
}
