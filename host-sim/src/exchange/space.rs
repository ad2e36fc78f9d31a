//! A place in shared memory for one run alone: its own directory, its own file prefix, removed as a whole.

use std::fs::DirBuilder;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use iceoryx2::config::Config;
use iceoryx2::node::{Node, NodeState};
use iceoryx2::prelude::CallbackProgression;
use iceoryx2::service::Service;

use super::error::LinkError;

/// Longest name of a link: file names of iceoryx2 put a prefix and a hash around it.
const LONGEST_NAME: usize = 40;

/// Where POSIX shared memory appears as files.
const SHARED_MEMORY: &str = "/dev/shm";

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
    prefix: String,
    root: PathBuf,
    config: Config,
}

/// Makes the directory, owner-only.
fn make_root(root: &Path) -> Result<(), LinkError> {
    let made = DirBuilder::new().recursive(true).mode(0o700).create(root);
    made.map_err(|source| LinkError::Directory { path: root.to_owned(), source })?;
    check_owner(root)
}

/// The directory for temporary files is everybody's: a directory of this name that somebody else has made, or may
/// write to, is not used.
fn check_owner(root: &Path) -> Result<(), LinkError> {
    let metadata = root.symlink_metadata().map_err(|source| LinkError::Directory { path: root.to_owned(), source })?;
    let own = metadata.uid() == rustix::process::geteuid().as_raw();
    if metadata.is_dir() && own && metadata.mode() & 0o077 == 0 {
        Ok(())
    } else {
        Err(LinkError::Foreign { path: root.to_owned() })
    }
}

impl Space {
    /// The space of this name, the same in every process of this user; makes its directory, owner-only.
    ///
    /// # Errors
    /// [`LinkError::Name`], [`LinkError::Directory`], [`LinkError::Foreign`].
    pub fn new(name: &str) -> Result<Self, LinkError> {
        let invalid = || LinkError::Name { name: name.to_owned(), longest: LONGEST_NAME };
        let admitted = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
        if name.is_empty() || name.len() > LONGEST_NAME || !name.chars().all(admitted) {
            return Err(invalid());
        }
        let prefix = format!("stillpoint_{name}_");
        let root = std::env::temp_dir().join(format!("stillpoint-{name}"));
        let mut config = Config::default();
        config.global.prefix = prefix.as_str().try_into().map_err(|_| invalid())?;
        let path = root.to_str().ok_or_else(invalid)?;
        config.global.set_root_path(&path.try_into().map_err(|_| invalid())?);
        make_root(&root)?;
        Ok(Self { name: name.to_owned(), prefix, root, config })
    }

    /// Its entries: names in shared memory, and its directory.
    pub fn traces(&self) -> Vec<PathBuf> {
        let entries = std::fs::read_dir(SHARED_MEMORY).into_iter().flatten().flatten();
        let ours = entries.filter(|entry| entry.file_name().to_string_lossy().starts_with(&self.prefix));
        let root = self.root.exists().then(|| self.root.clone());
        ours.map(|entry| entry.path()).chain(root).collect()
    }

    /// A space that no other process has: named after this process and a counter.
    ///
    /// # Errors
    /// As [`Space::new`].
    pub fn unique() -> Result<Self, LinkError> {
        use std::sync::atomic::{AtomicU32, Ordering};
        static COUNTER: AtomicU32 = AtomicU32::new(0);
        let count = COUNTER.fetch_add(1, Ordering::Relaxed);
        Self::new(&format!("run-{}-{count}", std::process::id()))
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
    /// last waits for the others with [`Departure::Last`].
    pub fn leave<S: Service>(&self, departure: Departure) {
        let started = Instant::now();
        let waits_for_living = match departure {
            Departure::First => Duration::ZERO,
            Departure::Last => CLEAN_UP_TIMEOUT,
        };
        loop {
            let (mut alive, mut dead) = (false, false);
            // A space whose files are partly gone cannot be listed; then nobody can be in it either.
            let _ = Node::<S>::list(&self.config, |node| {
                match node {
                    NodeState::Alive(_) => alive = true,
                    NodeState::Dead(view) => {
                        dead |= view.try_remove_stale_resources().is_err();
                    }
                    NodeState::Inaccessible(_) | NodeState::Undefined(_) => {}
                }
                CallbackProgression::Continue
            });
            if !alive && !dead {
                return self.remove_files();
            }
            let limit = if dead { CLEAN_UP_TIMEOUT } else { waits_for_living };
            if started.elapsed() >= limit {
                // A process killed while it made its own entry leaves one that nobody can tidy up; nobody needs it.
                if !alive {
                    self.remove_files();
                }
                return;
            }
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    /// Removes what processes that have died left behind, so that others can take their places. Whether there was any.
    pub fn clear_dead<S: Service>(&self) -> bool {
        let mut found = false;
        let _ = Node::<S>::list(&self.config, |node| {
            if let NodeState::Dead(view) = node {
                found = true;
                // Somebody else may be at it right now.
                let _ = view.try_remove_stale_resources();
            }
            CallbackProgression::Continue
        });
        found
    }

    /// Waits until nobody else opens this space, and keeps others from it until dropped. A process that dies lets go.
    ///
    /// # Errors
    /// [`LinkError::Directory`].
    pub(super) fn lock(&self) -> Result<std::fs::File, LinkError> {
        let failed = |source| LinkError::Directory { path: self.root.clone(), source };
        loop {
            make_root(&self.root)?;
            let Ok(directory) = std::fs::File::open(&self.root) else { continue };
            rustix::fs::flock(&directory, rustix::fs::FlockOperation::LockExclusive)
                .map_err(|error| failed(error.into()))?;
            // It may have been removed and made anew in the meantime.
            let locked = directory.metadata().map_err(failed)?.ino();
            if self.root.metadata().is_ok_and(|metadata| metadata.ino() == locked) {
                return Ok(directory);
            }
        }
    }

    /// Clears what the dead hold. Where nobody is alive either, what is left half made goes as well. Whether that was
    /// worth another trial.
    ///
    /// # Errors
    /// [`LinkError::Directory`].
    pub fn clear_if_dead<S: Service>(&self) -> Result<bool, LinkError> {
        let mut alive = false;
        let found = self.clear_dead::<S>();
        let _ = Node::<S>::list(&self.config, |node| {
            alive |= matches!(node, NodeState::Alive(_));
            CallbackProgression::Continue
        });
        if alive {
            return Ok(found);
        }
        self.remove_files();
        make_root(&self.root)?;
        Ok(true)
    }

    /// Refuses to start without room in shared memory: a page that cannot be had later is a SIGBUS in the loop.
    ///
    /// # Errors
    /// [`LinkError::Memory`].
    pub fn check_room(&self) -> Result<(), LinkError> {
        let Ok(room) = rustix::fs::statvfs(SHARED_MEMORY) else { return Ok(()) };
        let available = room.f_bavail.saturating_mul(room.f_frsize);
        // 0 blocks in all: a file system without a limit.
        if room.f_blocks > 0 && available < NEEDED_BYTES {
            return Err(LinkError::Memory { available, needed: NEEDED_BYTES });
        }
        Ok(())
    }

    /// Has every page of this space's memory allocated now, so that a lack of memory fails here and never in the loop,
    /// and takes everybody else's rights to it: one management file of iceoryx2 is made for everybody.
    ///
    /// # Errors
    /// [`LinkError::Memory`].
    pub fn secure(&self) -> Result<(), LinkError> {
        let Ok(entries) = std::fs::read_dir(SHARED_MEMORY) else { return Ok(()) };
        for entry in entries.flatten().filter(|entry| entry.file_name().to_string_lossy().starts_with(&self.prefix)) {
            // Gone by now, or only just being made: whoever makes it allocates it.
            let Ok(file) = std::fs::File::options().read(true).write(true).open(entry.path()) else { continue };
            let Ok(metadata) = file.metadata() else { continue };
            if metadata.mode() & 0o077 != 0 {
                let owner_only = std::fs::Permissions::from_mode(0o600);
                file.set_permissions(owner_only)
                    .map_err(|source| LinkError::Directory { path: entry.path(), source })?;
            }
            let length = metadata.len();
            if length == 0 {
                continue;
            }
            let flags = rustix::fs::FallocateFlags::KEEP_SIZE;
            if rustix::fs::fallocate(&file, flags, 0, length) == Err(rustix::io::Errno::NOSPC) {
                return Err(LinkError::Memory { available: 0, needed: length });
            }
        }
        Ok(())
    }

    /// Whether a node of this space belongs to a process that has died.
    pub fn has_dead_peer<S: Service>(&self) -> bool {
        let mut dead = false;
        let _ = Node::<S>::list(&self.config, |node| {
            dead |= matches!(node, NodeState::Dead(_));
            CallbackProgression::Continue
        });
        dead
    }

    /// The management files that iceoryx2 keeps for the next user of the same prefix; ours has none.
    fn remove_files(&self) {
        let _ = std::fs::remove_dir_all(&self.root);
        let Ok(entries) = std::fs::read_dir(SHARED_MEMORY) else {
            return;
        };
        for entry in entries.flatten() {
            if entry.file_name().to_string_lossy().starts_with(&self.prefix) {
                let _ = std::fs::remove_file(entry.path());
            }
        }
    }
}
