//! What processes that were killed together have left in shared memory: nobody of theirs is there to tidy up.

use std::collections::BTreeSet;
use std::time::Duration;

use iceoryx2::service::ipc;
use rustix::process::{Pid, test_kill_process};

use super::{RUN, Space, files};

/// Removes the links of this user in which nobody is alive; returns their names. What is not certain stays.
pub fn sweep() -> Vec<String> {
    let entries = |directory: &std::path::Path| std::fs::read_dir(directory).into_iter().flatten().flatten();
    let roots = files::bases()
        .iter()
        .flat_map(|base| entries(base))
        .filter_map(|entry| Some(files::name_of_root(entry.file_name().to_str()?)?.to_owned()))
        .collect::<Vec<_>>();
    let in_memory = entries(files::SHARED_MEMORY.as_ref())
        .filter_map(|entry| Some(files::name_of_file(entry.file_name().to_str()?)?.to_owned()));
    let names: BTreeSet<String> = roots.into_iter().chain(in_memory).collect();
    names.into_iter().filter(|name| !may_have_owner(name) && is_left(name)).collect()
}

/// Whether the process that a link is named after may live; other links' names say nothing.
fn may_have_owner(name: &str) -> bool {
    let Some(owner) = name.strip_prefix(RUN).and_then(|rest| rest.split('-').next()) else { return false };
    let Some(owner) = owner.parse().ok().and_then(Pid::from_raw) else { return false };
    // Anything but "there is no such process" may be a living one.
    test_kill_process(owner) != Err(rustix::io::Errno::SRCH)
}

/// Removes what is left of a link, if it is certain that nobody has entered it. Whether there was anything.
fn is_left(name: &str) -> bool {
    let root = files::root(name);
    let key = files::known_key(&root);
    // Without files in shared memory, or a directory of a link's, there is nothing to sweep: only names that look alike. A
    // directory without a key is one's where it is named after a process that is gone, and has what links have.
    let is_half_removed = || name.starts_with(RUN) && files::is_half_removed(&root);
    if files::in_shared_memory(name).is_empty() && key.is_none() && !is_half_removed() {
        return false;
    }
    let Ok(locked) = files::lock_root_within(&root, Duration::ZERO) else { return false };
    // Of a link that is named after a process nobody comes any more: its owner is gone.
    if !name.starts_with(RUN) && files::is_awaited(&root, &locked) {
        return false;
    }
    // Who works with the transport alone has not entered, but has a node.
    let space = key.and_then(|key| Space::of(name, key).ok());
    let has_nodes =
        space.and_then(|space| space.clear_dead_nodes::<ipc::Service>(&locked)).is_some_and(|nodes| nodes.alive);
    let is_left = !has_nodes && files::is_empty(&root, &locked);
    if is_left {
        files::remove(name, &locked);
    }
    is_left
}
