//! A place in shared memory for one run alone: its own directory, its own file prefix, removed as a whole.

use std::fs::DirBuilder;
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use iceoryx2::config::Config;
use iceoryx2::node::{Node, NodeState};
use iceoryx2::prelude::CallbackProgression;
use iceoryx2::service::Service;

use super::LinkError;

/// Longest name of a link: file names of iceoryx2 put a prefix and a hash around it.
pub(super) const LONGEST_NAME: usize = 40;

/// Where POSIX shared memory appears as files.
const SHARED_MEMORY: &str = "/dev/shm";

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

impl Space {
    /// The space of this name, the same in every process of this user; makes its directory, owner-only.
    ///
    /// # Errors
    /// [`LinkError::Name`], [`LinkError::Directory`].
    pub fn new(name: &str) -> Result<Self, LinkError> {
        let invalid = || LinkError::Name { name: name.to_owned() };
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
        DirBuilder::new()
            .recursive(true)
            .mode(0o700)
            .create(&root)
            .map_err(|source| LinkError::Directory { path: root.clone(), source })?;
        Ok(Self { name: name.to_owned(), prefix, root, config })
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
                break;
            }
            std::thread::sleep(Duration::from_millis(2));
        }
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
