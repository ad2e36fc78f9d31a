//! A place in shared memory for one run alone: its own directory, its own file prefix, removed as a whole.

mod files;
mod sweep;

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use iceoryx2::config::Config;
use iceoryx2::node::{Node, NodeState, NodeView as _};
use iceoryx2::prelude::CallbackProgression;
use iceoryx2::service::Service;

use super::error::LinkError;
pub(super) use files::Presence;
pub(super) use files::random_key;
use files::{Locked, OwnerOnly};
pub use sweep::sweep;

/// Longest name of a link: file names of iceoryx2 put a prefix and a hash around it.
const LONGEST_NAME: usize = 40;

/// Start of the names of links that one process has for itself, before its number.
const RUN: &str = "run-";

/// What both sides of a link need in shared memory: four times what was measured.
const NEEDED_BYTES: u64 = 4 << 20;

/// How long others are waited for that are about to go.
const CLEAN_UP_TIMEOUT: Duration = Duration::from_secs(2);

/// Whether a process that leaves a space waits for the others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Departure {
    /// Others are still at work; whoever leaves last tidies up.
    First,
    /// The others are about to go: wait for them, then tidy up.
    Last,
}

/// Shared memory of one link.
#[derive(Clone, Debug)]
pub struct Space {
    name: String,
    key: String,
    root: PathBuf,
    config: Config,
}

/// What a listing of a space's nodes shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Nodes {
    alive: bool,
    dead: bool,
}

impl Space {
    /// The space of this name, the same in every process of this user; makes its directory, owner-only.
    ///
    /// # Errors
    /// [`LinkError::Name`], [`LinkError::Directory`], [`LinkError::Foreign`], [`LinkError::Occupied`].
    pub fn new(name: &str) -> Result<Self, LinkError> {
        let invalid = || LinkError::Name { name: name.to_owned(), longest: LONGEST_NAME };
        let admitted = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
        if name.is_empty() || name.len() > LONGEST_NAME || !name.chars().all(admitted) {
            return Err(invalid());
        }
        let root = files::root(name);
        let key = files::key(&root, &files::lock_root(&root)?, None)?;
        Self::of(name, key)
    }

    /// The space with this name and key.
    fn of(name: &str, key: String) -> Result<Self, LinkError> {
        let invalid = || LinkError::Name { name: name.to_owned(), longest: LONGEST_NAME };
        let root = files::root(name);
        let mut config = Config::default();
        config.global.prefix = files::prefix(name, &key).as_str().try_into().map_err(|_| invalid())?;
        // The dead are cleared under the lock alone, and going needs none: see `files::remove_half_made`.
        config.global.node.cleanup_dead_nodes_on_destruction = false;
        let path = root.to_str().ok_or_else(invalid)?;
        config.global.set_root_path(&path.try_into().map_err(|_| invalid())?);
        Ok(Self { name: name.to_owned(), key, root, config })
    }

    /// The directory of the link of this name, whether it is there or not.
    pub fn directory_of(name: &str) -> PathBuf {
        files::root(name)
    }

    /// Its entries: names in shared memory, and its directory.
    pub fn traces(&self) -> Vec<PathBuf> {
        let root = self.root.exists().then(|| self.root.clone());
        files::in_shared_memory(&self.name).into_iter().chain(root).collect()
    }

    /// A space that no other process has, and whose name nobody can guess.
    ///
    /// # Errors
    /// As [`Space::new`].
    pub fn unique() -> Result<Self, LinkError> {
        let failed = |source| LinkError::Directory { path: std::env::temp_dir(), source };
        let random = files::random_key().map_err(failed)?;
        Self::new(&format!("{RUN}{}-{random}", std::process::id()))
    }

    /// The name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Directory of the link's files; removed with the space.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Configuration for iceoryx2.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// Removes the space if nobody is alive in it: what dead peers left, then every file of ours. The caller has
    /// dropped its ports and waited for its children (an unreaped child counts as alive). The one who is to leave
    /// last waits for the others with [`Departure::Last`]. Who may be alive, is; what stays then, a later start sweeps.
    pub fn leave<S: Service>(&self, departure: Departure) {
        let waits_for_living = match departure {
            Departure::First => Duration::ZERO,
            Departure::Last => CLEAN_UP_TIMEOUT,
        };
        let started = Instant::now();
        loop {
            let Ok(locked) = files::lock_root(&self.root) else { return };
            let nodes = self.clear_dead_nodes::<S>(&locked);
            let is_empty = files::is_empty(&self.root, &locked);
            // A listing that failed says nothing of this process's own nodes; no other process is in here then.
            if is_empty && !nodes.is_some_and(|nodes| nodes.alive) {
                files::remove(&self.name, &locked);
                return;
            }
            drop(locked);
            let still_dead = nodes.is_some_and(|nodes| nodes.dead);
            if started.elapsed() >= if still_dead { CLEAN_UP_TIMEOUT } else { waits_for_living } {
                return;
            }
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    /// Clears what the dead hold, and says who is in here; none when that cannot be found out.
    fn clear_dead_nodes<S: Service>(&self, locked: &Locked) -> Option<Nodes> {
        files::remove_half_made(&self.name, locked);
        let mut nodes = Nodes::default();
        let listed = Node::<S>::list(&self.config, |node| {
            match node {
                NodeState::Alive(_) => nodes.alive = true,
                NodeState::Dead(view) => {
                    nodes.dead = true;
                    // Somebody else may be at it right now.
                    let _ = view.try_remove_stale_resources();
                }
                NodeState::Inaccessible(_) | NodeState::Undefined(_) => {}
            }
            CallbackProgression::Continue
        });
        listed.is_ok().then_some(nodes)
    }

    /// Removes what processes that have died left behind, so that others can take their places. Whether there was any.
    /// Waits for nobody: whoever opens this space at the moment clears it as well.
    pub fn clear_dead<S: Service>(&self) -> bool {
        let Ok(locked) = files::lock_root_within(&self.root, Duration::ZERO) else { return false };
        self.clear_dead_nodes::<S>(&locked).is_some_and(|nodes| nodes.dead)
    }

    /// Waits until nobody else opens this space, and keeps others from it until dropped. A process that dies lets go.
    ///
    /// # Errors
    /// [`LinkError::Directory`], [`LinkError::Foreign`]; [`LinkError::Replaced`] when others have made it anew.
    pub(super) fn lock(&self) -> Result<Locked, LinkError> {
        let locked = files::lock_root(&self.root)?;
        match files::key(&self.root, &locked, Some(&self.key))? {
            key if key == self.key => Ok(locked),
            _ => Err(LinkError::Replaced { name: self.name.clone() }),
        }
    }

    /// Notes that this process is in the space, for as long as the value lives; what others left half made goes first.
    ///
    /// # Errors
    /// [`LinkError::Directory`].
    pub(super) fn enter(&self, locked: &Locked) -> Result<Presence, LinkError> {
        files::remove_half_made(&self.name, locked);
        files::enter(&self.root)
    }

    /// Has files that are made from now on belong to this user alone, until the value is dropped.
    pub(super) fn owner_only() -> impl Drop {
        OwnerOnly::begin()
    }

    /// Clears what the dead hold. Where nobody is alive either, what is left half made goes as well. Whether that was
    /// worth another trial.
    ///
    /// # Errors
    /// [`LinkError::Directory`].
    pub(super) fn clear_if_dead<S: Service>(&self, locked: &Locked) -> Result<bool, LinkError> {
        let nodes = self.clear_dead_nodes::<S>(locked);
        let may_be_alive = nodes.is_some_and(|nodes| nodes.alive) || !files::is_empty(&self.root, locked);
        if may_be_alive {
            return Ok(nodes.is_some_and(|nodes| nodes.dead));
        }
        files::remove(&self.name, locked);
        Ok(true)
    }

    /// Refuses to start without room in shared memory: a page that cannot be had later is a SIGBUS in the loop.
    ///
    /// # Errors
    /// [`LinkError::Memory`].
    pub fn check_room(&self) -> Result<(), LinkError> {
        let Ok(room) = rustix::fs::statvfs(files::SHARED_MEMORY) else { return Ok(()) };
        let available = room.f_bavail.saturating_mul(room.f_frsize);
        // 0 blocks in all: a file system without a limit.
        if room.f_blocks > 0 && available < NEEDED_BYTES {
            return Err(LinkError::Memory { available, needed: NEEDED_BYTES });
        }
        Ok(())
    }

    /// Has every page of this space's memory allocated now, so that a lack of memory fails here and never in the loop,
    /// and takes everybody else's rights to it. Files of others that look like ours are left alone.
    ///
    /// # Errors
    /// [`LinkError::Memory`], [`LinkError::Directory`].
    pub fn secure(&self) -> Result<(), LinkError> {
        files::in_shared_memory(&self.name).iter().try_for_each(|path| files::secure(path))
    }

    /// Whether the peer has died: the dead have left a node, and nobody but this process is alive. The node of somebody
    /// who was refused looks dead for a moment while he goes, and the peer lives.
    pub fn has_dead_peer<S: Service>(&self) -> bool {
        let own = std::process::id();
        let (mut dead, mut others) = (false, false);
        let _ = Node::<S>::list(&self.config, |node| {
            match node {
                NodeState::Dead(_) => dead = true,
                NodeState::Alive(view) => {
                    others |= view.id().pid::<S>().map_or(true, |pid| pid.value().cast_unsigned() != own)
                }
                NodeState::Inaccessible(_) | NodeState::Undefined(_) => {}
            }
            CallbackProgression::Continue
        });
        dead && !others
    }
}

#[cfg(test)]
mod tests;
